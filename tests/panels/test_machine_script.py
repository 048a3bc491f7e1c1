"""A machine from a configuration script, by the panel's own view."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.machines import load_machine
from rds.panels.machine.script_view import ScriptView
from rds.panels.machine.state import MachineState
from rds.panels.page.shell import Shell
from rds.panels.session.session import Session

PAPER = """N001 RF01 LN1 XA0 YA90 ZA0 X-80 Y0 Z75
N002 RF01 LN2 XA0 YA0 ZA0 X0 Y0 Z-370
N003 RF01 LN3 XA0 YA0 ZA# X0 Y0 Z-140
N004 RF02 LN3 UP180 LW-180
N005 BUILD
"""


@pytest.fixture
def view(tmp_path: Path) -> ScriptView:
    shell = Shell(Session(tmp_path, "mrm-mill"))
    return ScriptView(shell, MachineState(shell.session))


def test_a_script_is_judged_and_written(view: ScriptView, tmp_path: Path) -> None:
    """mrm-control, section 5: the script is entered on the page."""
    assert view._write.disabled and "no script stands here yet" in view.notice.value
    view.text.value = PAPER.replace("LN2", "LN4")
    with pytest.raises(InputError, match="line 2: LN4 out of order"):
        view.check()
    assert view._write.disabled
    view.text.value = PAPER
    view.check()
    assert not view._write.disabled and "this script makes a machine" in view.notice.value
    view.write()
    tip = load_machine(str(tmp_path / "my-script.toml")).kinematics.forward({"C": 0.0})[:3, 3]
    assert tip.tolist() == pytest.approx([-80.0, 0.0, -435.0])


def test_limits_alone_change_the_machine_that_is_chosen(view: ScriptView, tmp_path: Path) -> None:
    view.take()
    assert "RF02 LN6 UP100 LW-100" in view.text.value and not view._write.disabled
    view.text.value = "RF02 LN6 UP50 LW-50"
    assert view._write.disabled, "what was judged is another machine"
    view.check()
    view.state.choices.set("machine", "xyzac")
    assert view._write.disabled
    view.state.choices.set("machine", "mrm-mill")
    view.check()
    view.write()
    machine = load_machine(str(tmp_path / "my-script.toml"))
    assert machine.kinematics.limits[machine.kinematics.joints.index("X")].tolist() == [-50.0, 50.0]
    assert machine.axis("X").model == load_machine("mrm-mill").axis("X").model


def test_what_is_typed_is_there_again(view: ScriptView, tmp_path: Path) -> None:
    view.text.value = PAPER
    again = ScriptView(Shell(view.session), view.state)
    assert again.text.value == PAPER
