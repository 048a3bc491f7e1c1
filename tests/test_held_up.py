"""What is run again: a test that failed while processes waited for a processor; and that it is told."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SAMPLE = """
import threading
from pathlib import Path

import held_up

held_up.PRESSURE = Path("pressure")
TRIES = Path("tries")


def wait(seconds):
    held_up.PRESSURE.write_text(f"some avg10=0.00 total={int(seconds * 1e6)}\\nfull total=0\\n")


wait(0.0)


def test_sample():
    tries = len(TRIES.read_text()) if TRIES.exists() else 0
    TRIES.write_text("+" * (tries + 1))
    if STARTS:
        threading.Thread(target=int).start()
    wait(WAITED * (tries + 1))
    assert tries >= FAILURES, "too late"
"""


def run(
    place: Path, waited: float, failures: int, *options: str, starts: bool = True, sample: str = SAMPLE
) -> tuple[int, str, int]:
    """Exit code, output and tries of a test that fails so often, while processes wait so many seconds."""
    text = sample.replace("WAITED", str(waited)).replace("FAILURES", str(failures)).replace("STARTS", str(starts))
    (place / "test_sample.py").write_text(text)
    options = ("-p", "held_up", "-p", "no:cacheprovider", "-rR", "--rerun-show-tracebacks", *options)
    found = subprocess.run(
        [sys.executable, "-m", "pytest", *options, "test_sample.py"],
        cwd=place,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(HERE)},
    )
    return found.returncode, found.stdout, len((place / "tries").read_text())


def test_a_failure_while_processes_waited_for_a_processor_is_void_and_told(tmp_path: Path) -> None:
    code, out, tries = run(tmp_path, 0.25, 1)
    assert (code, tries) == (0, 2)
    assert "RERUN test_sample.py::test_sample" in out and "AssertionError: too late" in out
    assert "processes waited for a processor for 0.25 s while this test ran" in out


def test_one_that_repeats_is_a_failure(tmp_path: Path) -> None:
    code, out, tries = run(tmp_path, 0.25, 5)
    assert (code, tries) == (1, 3)
    assert "processes waited for a processor for 0.25 s while this test ran" in out


@pytest.mark.parametrize("waited", [0.0, 0.05])
def test_one_on_a_quiet_computer_is_a_failure_at_once(tmp_path: Path, waited: float) -> None:
    code, out, tries = run(tmp_path, waited, 1)
    assert (code, tries) == (1, 1)
    assert f"processes waited for a processor for {waited:.2f} s" in out


def test_one_that_waits_for_nobody_else_is_a_failure_at_once(tmp_path: Path) -> None:
    code, out, tries = run(tmp_path, 5.0, 1, starts=False)
    assert (code, tries) == (1, 1)
    assert "this test waits for no other process and no thread" in out


def test_one_served_by_a_fixture_of_an_earlier_file_is_void(tmp_path: Path) -> None:
    """A session's processes were started before the file's first test, and are waited for in it all the same."""
    (tmp_path / "conftest.py").write_text(
        "import threading, pytest\n"
        "@pytest.fixture(scope='session')\n"
        "def served():\n    threading.Thread(target=int).start()\n"
    )
    (tmp_path / "test_earlier.py").write_text("def test_earlier(served):\n    pass\n")
    sample = SAMPLE.replace("def test_sample()", "def test_sample(served)")
    code, out, tries = run(tmp_path, 0.25, 1, "test_earlier.py", starts=False, sample=sample)
    assert (code, tries) == (0, 2)
    assert "RERUN test_sample.py::test_sample" in out


def test_many_void_tries_in_one_run_are_a_failure(tmp_path: Path) -> None:
    assert run(tmp_path, 0.25, 2, "--max-suite-reruns=1", "-n1")[0] == 1


def test_a_worker_does_not_ask_at_each_test(
    request: pytest.FixtureRequest, worker_id: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each would take a millisecond more of two processors."""
    if worker_id == "master":
        pytest.skip("not a worker of pytest-xdist")
    crashes = request.config.failures_db  # type: ignore[attr-defined]
    asked: list[str] = []
    monkeypatch.setattr(crashes, "_sock_send", lambda line, words: asked.append(words))
    assert crashes.get_test_failures(request.node.nodeid) == 0
    crashes.set_test_reruns(request.node.nodeid, 2)
    assert crashes.get_suite_reruns() == 0
    assert not asked
