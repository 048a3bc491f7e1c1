"""What `make` hands to the programs that it starts."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_libraries_are_compiled_once_whatever_the_environment_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    (show := tmp_path / "show.mk").write_text("show:; @env\n")
    command = ["make", "-f", "Makefile", "-f", str(show), "show"]
    seen = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "PATH=" in seen
    assert "PYTHONDONTWRITEBYTECODE" not in seen
