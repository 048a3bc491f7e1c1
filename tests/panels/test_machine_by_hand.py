"""A machine put together by hand, by the panel's own view."""

from __future__ import annotations

from pathlib import Path

from rds.machines import load_machine
from rds.panels.machine.library_view import LibraryView
from rds.panels.machine.state import MachineState
from rds.panels.page.shell import Shell
from rds.panels.session.session import Session


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
