"""A machine put together by hand, by the panel's own view."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rds.machines import load_machine
from rds.panels.machine.library_view import LibraryView
from rds.panels.machine.state import MachineState
from rds.panels.page.shell import Shell
from rds.panels.session.session import Session
from rds.panels.session.task import Task
from rds.results import Result, open_result


def test_a_machine_by_hand_without_a_browser(tmp_path: Path) -> None:
    """The panel's own view: modules mounted, refused, taken out, moved, and written as a machine that loads."""
    shell = Shell(Session(tmp_path, "mrmt-oacs"))
    state = MachineState(shell.session)
    view = LibraryView(shell, state)
    assert view._write.disabled and "begin with a cutting head" in view.notice.value

    def mount(*names: str) -> None:
        for name in names:
            view.choices.set("module", name)
            view.mount()

    mount("oacs-drill", "oacs-x")
    assert view._write.disabled and "does not fit on" in view.notice.value
    view._remove(1)
    mount("oacs-range-arm", "oacs-x", "oacs-z")
    assert view._write.disabled
    view._move(3, -1)
    assert view.order == ["oacs-drill", "oacs-range-arm", "oacs-z", "oacs-x"] and not view._write.disabled
    view.write()
    assert load_machine(str(tmp_path / "by-hand.toml")).kinematics.joints == ("X", "Z")
    assert "--" not in view.notice.value and state.choices["machine"] == "mrmt-oacs"
    for later in (state, MachineState(Session(tmp_path, "mrmt-oacs"))):  # it can be chosen at once, and another day
        later.choices.set("machine", str(tmp_path / "by-hand.toml"))
        assert later.machine.name == "by-hand"


def test_a_recorded_step_is_kept_in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state = MachineState(Session(tmp_path, "mrmt-oacs"))
    state.data[4] = {"kind": "translational", "type_text": "LinrXa"}
    columns = {"time": [0.0, 0.01], "X_reference": [2.0, 2.0], "X_measured": [0.0, 1.5]}
    units = {"time": "s", "X_reference": "mm", "X_measured": "mm"}

    class Stepped:
        def step(self, by: float, period: float, **options: Any) -> Result:
            return Result(columns, units, {"axes": ["X"], "sample_period": 0.01})

    @contextlib.contextmanager
    def module(self: MachineState, number: int) -> Iterator[Stepped]:
        yield Stepped()

    monkeypatch.setattr(MachineState, "_module", module)
    (tmp_path / "step-1").mkdir()  # of somebody else, which stays as it is
    task: Task[Result] = state.step(4)
    task.wait(30.0)
    assert task.error is None and state.kept == tmp_path / "step-2"
    assert list(open_result(state.kept)["X_measured"]) == [0.0, 1.5]
