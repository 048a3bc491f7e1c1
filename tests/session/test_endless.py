"""Code of a user that does not end: whatever is pressed to stop it does so, and says where it was."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from rds.core.interrupt import Endless, interruptible
from rds.panels.equipment.state import Equipment
from rds.panels.interpolator.state import Interpolating
from rds.panels.session import Session

PATIENCE = 10.0  # s, on a busy computer


def begun(waiting: Callable[[], object]) -> None:
    """Wait until something is true."""
    pause = threading.Event()
    for _ in range(200):
        if waiting():
            return
        pause.wait(0.05)
    raise AssertionError("it did not begin")


def user_controller(folder: Path, text: str) -> Equipment:
    (folder / "mine.py").write_text(text)
    equipment = Equipment(Session(folder), "control")
    equipment.choices.set("controller", "user")
    equipment.choices.set("controller_file", "mine.py")
    return equipment


def test_a_build_of_a_file_that_loops_as_it_is_loaded_is_stopped(tmp_path: Path) -> None:
    task = user_controller(tmp_path, "while True:\n    pass\n").build()
    begun(lambda: task.note)
    task.stop()
    assert task.wait(PATIENCE) and task.stopped


def test_a_run_is_stopped_while_its_files_are_checked(tmp_path: Path) -> None:
    run = user_controller(tmp_path, "while True:\n    pass\n").run().start()
    begun(lambda: "checking" in run.note)
    run.stop()
    assert run.wait(PATIENCE) and run.stopped_early


def test_a_simulation_whose_controller_never_returns_is_stopped_at_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    equipment = user_controller(
        tmp_path,
        "def control(t, r, y, state, params):\n    while t > 3.0:\n        try:\n            pass\n"
        "        except Exception:\n            pass\n    return r.position - y, state\n",
    )
    monkeypatch.setattr(equipment.builds, "require", lambda *_: None)  # as if the check had not found it
    run = equipment.run().start()
    begun(lambda: run.share and run.share > 0.3)
    run.stop()
    assert run.wait(PATIENCE)
    assert "mine.py, line" in str(run.error) and "at t = 3.001 s" in str(run.error)


def test_an_interpolator_that_never_yields_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.py").write_text(
        "def interpolate(segment, T, params):\n    while True:\n        pass\n    yield\n"
    )
    work = Interpolating(Session(tmp_path))
    work.choices.set("arc_method", "user")
    work.choices.set("arc_file", "mine.py")
    monkeypatch.setattr(work.builds, "require", lambda *_: [])
    task = work.run()
    begun(lambda: task.note == "interpolating")
    task.stop()
    assert task.wait(PATIENCE) and (task.stopped or "mine.py, line" in str(task.error))


def test_work_that_goes_on_by_steps_is_not_interrupted_and_its_own_errors_are_kept() -> None:
    steps = iter(range(1000))
    pause = threading.Event()

    def work() -> str:
        pause.wait(0.4)
        return "done"

    assert interruptible(work, lambda: True, lambda: next(steps), patience=0.1) == "done"
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 / 0, lambda: False)
    with pytest.raises(Endless):
        interruptible(lambda: [pause.wait(0.01) for _ in range(10_000)], lambda: True, patience=0.1)
