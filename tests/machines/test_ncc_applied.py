"""A configuration script at a program's head is applied: its limits narrow the travel, its chain is the machine's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import RdsError
from rds.machines import load_machine
from rds.machines.ncc import machine_of_script, read_script, script_of
from rds.modes.loop.program import Program
from rds.nc.check import check_program, motion
from rds.nc.language.dialect import Dialect
from rds.nc.run.prepare import prepare
from rds.nc.setup import Setup

NCC = Setup(options=Dialect(ncc=True))
MILL = load_machine("mrm-mill")
SCRIPT = script_of(MILL.kinematics)
PROGRAM = "G21 G90\nG1 X{x} F100\nM2\n"


def program(tmp_path: Path, script: str = SCRIPT, x: float = 5.0) -> Path:
    path = tmp_path / "own.ngc"
    path.write_text(script + PROGRAM.format(x=x), encoding="ascii")
    return path


def test_a_script_of_the_machine_itself_changes_nothing(tmp_path: Path) -> None:
    found, compiled = check_program(program(tmp_path), MILL, NCC)
    assert found.ok and compiled is not None
    assert len(found.warnings) == 1, "that there is one"


@pytest.mark.parametrize("x, ok", [(4.9, True), (5.1, False)])
def test_its_limits_narrow_the_travel_of_check_and_run(tmp_path: Path, x: float, ok: bool) -> None:
    path = program(tmp_path, SCRIPT.replace("RF02 LN6 UP100 LW-100", "RF02 LN6 UP5 LW-100"), x)
    found, _ = check_program(path, MILL, NCC)
    assert found.ok == ok
    if ok:
        notes = prepare(path, MILL, NCC).notes
        assert any("RF02 narrows the travel of X (LN6) to -100 to 5 mm" in note for note in notes)
        return
    assert "5.1" in str(found.faults[0]) and found.faults[0].line == 14
    with pytest.raises(RdsError, match=r"5\.1"):
        prepare(path, MILL, NCC)
    with pytest.raises(RdsError, match=r"5\.1"):
        list(motion(path, MILL, NCC))


def test_limits_beyond_the_travel_leave_it(tmp_path: Path) -> None:
    found, _ = check_program(program(tmp_path, SCRIPT.replace("LN6 UP100", "LN6 UP500"), 101.0), MILL, NCC)
    assert not found.ok


def test_the_motion_is_corrected_for_its_assembly_errors(tmp_path: Path) -> None:
    """mrm-control, section 5: RF03 alters programs so that the tool goes where they say on the misaligned machine."""
    wrong = SCRIPT.replace("BUILD", "RF03 LN1 XA0 YA0 ZA0 X0.2 Y0 Z-5\nRF03 LN4 XA0 YA0 ZA0.5 X0 Y0 Z0\nBUILD")
    prepared = prepare(program(tmp_path, wrong, 50.0), MILL, NCC)
    assert any("corrected for the assembly error that RF03 says of LN1, X0.2 Z-5" in note for note in prepared.notes)
    assert isinstance(prepared.program, Program) and prepared.tip is not None
    end = dict(zip(prepared.program.axes, prepared.program.position[-1], strict=True))
    meant = MILL.kinematics.forward({"X": 50.0})
    crooked = machine_of_script(read_script(wrong)).kinematics
    np.testing.assert_allclose(crooked.forward(end)[:3, 3], meant[:3, 3], atol=1e-6)
    assert abs(end["Z"]) > 4.0 and abs(end["X"] - 50.0) > 0.1, "without the correction 0 and 50"


ALONE = "RF02 LN6 UP5 LW-100\n"


@pytest.mark.parametrize("x, ok", [(4.9, True), (5.1, False)])
def test_limits_alone_are_about_the_machine_that_runs(tmp_path: Path, x: float, ok: bool) -> None:
    """mrm-control, section 6: the workspace is fitted to the operation, and the chain is not constructed anew."""
    found, _ = check_program(program(tmp_path, ALONE, x), MILL, NCC)
    assert found.ok == ok
    notes = [str(each) for each in (*found.warnings, *found.faults)]
    assert any(("RF02 narrows the travel of X (LN6) to -100 to 5 mm" if ok else "5.1") in note for note in notes)


def test_errors_alone_correct_the_motion_on_the_machine_that_runs(tmp_path: Path) -> None:
    errors = "RF03 LN1 XA0 YA0 ZA0 X0.2 Y0 Z-5\nRF03 LN4 XA0 YA0 ZA0.5 X0 Y0 Z0\nBUILD\n"
    whole = prepare(program(tmp_path, SCRIPT.replace("BUILD\n", errors), 50.0), MILL, NCC).program
    alone = prepare(program(tmp_path, errors, 50.0), MILL, NCC).program
    assert isinstance(whole, Program) and isinstance(alone, Program)
    np.testing.assert_allclose(alone.position[-1], whole.position[-1], atol=1e-9)
    with pytest.raises(RdsError, match="G21 G90 before BUILD"):
        prepare(program(tmp_path, errors.replace("BUILD\n", ""), 50.0), MILL, NCC)


@pytest.mark.parametrize(
    ("script", "says"),
    [
        ("\nRF02 LN9 UP5 LW-5\n", r"2: there is no link LN9 \(LN1 to LN7\); `rds machine script mrm-mill` lists them"),
        ("RF02 LN1 UP5 LW-5\n", r"1: LN1 is fixed \(in mrm-mill\): limits belong to a joint"),
        ("RF02 LN6 UP300 LW200\n", "outside the travel of X, -100 to 100"),
    ],
)
def test_a_change_that_does_not_fit_the_machine_is_refused_by_its_line(tmp_path: Path, script: str, says: str) -> None:
    with pytest.raises(RdsError, match=says):
        check_program(program(tmp_path, script), MILL, NCC)


def test_limits_of_links_are_those_of_programs(tmp_path: Path) -> None:
    links = tuple(replace(link, limits=(-5.0, 5.0)) if link.axis == "X" else link for link in MILL.links)
    narrow = replace(MILL, links=links)
    assert check_program(program(tmp_path, "", 4.9), narrow, Setup())[0].ok
    found, _ = check_program(program(tmp_path, "", 5.1), narrow, Setup())
    assert "0.1 mm beyond its limits of -5 to 5" in str(found.faults[0])


@pytest.mark.parametrize(
    ("script", "machine", "says"),
    [
        (SCRIPT, "mini-cnc", "mini-cnc has no links to compare"),
        (SCRIPT, "xyzac", r"the script has 3 joints, and xyzac has 5 \(C, A, X, Y, Z from the work\)"),
        (SCRIPT.replace("Z-160", "Z-161"), "mrm-mill", "tip is 1 mm away with all joints at zero"),
        (SCRIPT.replace("X0 Y0 Z# (Z)", "X0 Y# Z0"), "mrm-mill", "not that of mrm-mill: the tool's tip is 0 mm away"),
        (SCRIPT.replace("LN2 XA0 YA0 ZA0 X0 Y0 Z#", "LN2 XA0 YA0 ZA# X0 Y0 Z0"), "mrm-mill", "not the joint Z"),
        (SCRIPT.replace("LN1 XA0", "LN1 XA90"), "mrm-mill", "the tool's frame is turned against it"),
        (SCRIPT.replace("LN6 UP100 LW-100", "LN6 UP300 LW200"), "mrm-mill", "outside the travel of X, -100 to 100"),
    ],
)
def test_another_chain_is_refused_with_what_differs(tmp_path: Path, script: str, machine: str, says: str) -> None:
    path = program(tmp_path, script)
    with pytest.raises(RdsError, match=says):
        check_program(path, load_machine(machine), NCC)
    with pytest.raises(RdsError, match=says):
        prepare(path, load_machine(machine), NCC)


def test_a_machine_without_links_is_squared(tmp_path: Path) -> None:
    """Half a degree between X and Y of the mini CNC: X makes good what Y leans."""
    path = tmp_path / "own.ngc"
    path.write_text("RF03 LN3 XA0 YA0 ZA0.5 X0 Y0 Z0\nBUILD\nG21 G90\nG1 X5 Y20 F100\nM2\n")
    prepared = prepare(path, load_machine("mini-cnc"), NCC)
    assert isinstance(prepared.program, Program)
    end = dict(zip(prepared.program.axes, prepared.program.position[-1], strict=True))
    lean = np.radians(0.5)
    assert end["X"] - end["Y"] * np.sin(lean) == pytest.approx(5.0, abs=1e-6)
    assert end["Y"] * np.cos(lean) == pytest.approx(20.0, abs=1e-6)
