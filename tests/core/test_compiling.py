"""Kernels that are kept on disk are those of the files as they are."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba", reason="numba is not installed: it is in the extra fast")

CALLED = "from rds.core.compiling import kernel\n\n\n@kernel\ndef called(x):\n    return x + {added}\n"
CALLING = """import sys

sys.path.insert(0, {folder!r})
from inner.called import called

from rds.core.compiling import kernel


@kernel
def calling(x):
    return called(x)


print(calling(1), sum(calling.stats.cache_hits.values()))
"""


def test_a_kernel_is_compiled_anew_when_one_that_it_calls_has_changed(tmp_path: Path) -> None:
    """Numba itself looks at a kernel's own file only."""
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "outer.py").write_text(CALLING.format(folder=str(tmp_path)))

    def run(added: int, changed: float) -> str:
        (inner / "called.py").write_text(CALLED.format(added=added))
        os.utime(inner / "called.py", (changed, changed))
        return subprocess.run(
            [sys.executable, str(tmp_path / "outer.py")], capture_output=True, text=True, check=True
        ).stdout.strip()

    os.utime(tmp_path / "outer.py", (1e9, 1e9))
    assert run(1, 1.1e9) == "2 0"
    assert run(1, 1.1e9) == "2 1", "it is kept"
    later = max(index.stat().st_mtime for index in tmp_path.glob("__pycache__/*.nbi")) + 1.0
    assert run(2, later) == "3 0", "not what was kept of the old one"
