"""What a whole run compiles before its workers begin, none of them compiles again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.compiled_first import rewrite_assertions

HERE = Path(__file__).parent
SAMPLE = "def test_sample():\n    assert [1, 2] == [1, 2]\n"
NO_WORKER = """
import pytest
from _pytest.assertion import rewrite

def refuse(*arguments):
    raise AssertionError("rewritten again")

@pytest.hookimpl(tryfirst=True)
def pytest_configure(config):
    if hasattr(config, "workerinput"):
        rewrite._rewrite_test = refuse
"""


def run(place: Path, *options: str) -> tuple[int, str]:
    found = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no_worker", *options, "-n", "1"],
        cwd=place,
        capture_output=True,
        text=True,
        env={name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
        | {"PYTHONPATH": f"{HERE}{os.pathsep}{place}"},
    )
    return found.returncode, found.stdout


def test_a_worker_finds_the_assertions_of_all_tests_rewritten(tmp_path: Path) -> None:
    """And without that it would rewrite them, which this worker refuses."""
    (tmp_path / "no_worker.py").write_text(NO_WORKER)
    (tmp_path / "test_sample.py").write_text(SAMPLE)
    (tmp_path / "first.py").write_text(
        "from pathlib import Path\nfrom compiled_first import rewrite_assertions\n\n\n"
        "def pytest_configure(config):\n    rewrite_assertions(config, Path(__file__).parent.rglob('*.py'))\n"
    )
    code, said = run(tmp_path)
    assert code != 0 and "rewritten again" in said
    code, said = run(tmp_path, "-p", "first")
    assert (code, "1 passed" in said) == (0, True), said


def test_what_is_rewritten_already_is_left_as_it_is(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    config = request.config
    (tmp_path / "helper.py").write_text("")  # rewritten by nobody
    file = tmp_path / "test_sample.py"
    file.write_text(SAMPLE)
    assert [rewrite_assertions(config, tmp_path.rglob("*.py")) for _ in range(2)] == [1, 0]
    file.write_text(SAMPLE + "\n")
    assert rewrite_assertions(config, tmp_path.rglob("*.py")) == 1
