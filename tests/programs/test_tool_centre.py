"""Programs for the tool's tip: G43.4 on machines whose links have rotary axes, and correction of assembly errors."""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.cli.nc_operate import live_line
from rds.cli.nc_options import ProgramOptions
from rds.core.errors import InputError
from rds.interpolators.motion.segments import AXES, JOINTS
from rds.machines import Machine, load_machine
from rds.machines.kinematics.tip import Tip
from rds.nc.active import Modes
from rds.nc.check import check_program, motion
from rds.nc.cycle_time import cycle_time
from rds.nc.language.dialect import Dialect
from rds.nc.run.contour import contour_error
from rds.nc.run.prepare import Prepared, prepare
from rds.nc.run.run import PartProgram, ProgramRun, Status
from rds.nc.setup import Setup
from rds.nc.tool_centre import ToolCentre, without_errors
from rds.panels.program.status import status_html

FIVE, OTHER = load_machine("xyzac"), load_machine("xyzbc")
HEAD = "G21 G90 G17 G94 G64 P0.02\nG0 A30 C45\nG43.4 H0\nG0 X10 Y0 Z20\n"
TOUR = (
    HEAD
    + """G1 X20 Y0 Z0 F300
G1 X20 Y20 Z0 A10 C90
G2 X0 Y20 I-10 J0 A-20
G1 A20 C0 F600
G93
G1 X0 Y0 F6
G94
G49
G0 X0 Y0 Z50
G0 A0 C0
M2
"""
)


def trt(kind: str, tip: np.ndarray, tilt: np.ndarray, turn: np.ndarray, dt: float) -> np.ndarray:
    """Joints X Y Z of trtfuncs.c of LinuxCNC (conventional directions), with the rotary centres of our machine files.

    Its pose contains the length dt of the tool: z of the tip and dt.
    """
    a, c = np.radians(tilt), np.radians(turn)
    x, y, z = tip[:, 0], tip[:, 1], tip[:, 2] + dt + 80.0  # from the rotary point 0, 0, -80
    along, across = np.cos(c) * x + np.sin(c) * y, -np.sin(c) * x + np.cos(c) * y
    offset, height = 20.0, 10.0 + dt
    if kind == "xyzac":
        p = across - offset, z - height
        return np.column_stack(
            (along, np.cos(a) * p[0] + np.sin(a) * p[1] + offset, -np.sin(a) * p[0] + np.cos(a) * p[1] + height - 80.0)
        )
    p = along - offset, z - height
    return np.column_stack(
        (np.cos(a) * p[0] - np.sin(a) * p[1] + offset, across, np.sin(a) * p[0] + np.cos(a) * p[1] + height - 80.0)
    )


def positions_of(prepared: Prepared) -> np.ndarray:
    """The planned positions (n, 6) of a program."""
    found = np.zeros((prepared.program.samples, 6))
    for i, name in enumerate(prepared.program.axes):
        found[:, AXES.index(name)] = prepared.program.position[:, i]
    return found


def made(tmp_path: Path, text: str, machine: Machine = FIVE, setup: Setup | None = None) -> Prepared:
    (tmp_path / "part.ngc").write_text(text)
    return prepare(tmp_path / "part.ngc", machine, setup)


def faults(tmp_path: Path, text: str, machine: Machine = FIVE, setup: Setup | None = None) -> str:
    (tmp_path / "part.ngc").write_text(text)
    result, _ = check_program(tmp_path / "part.ngc", machine, setup or Setup())
    assert not result.ok
    return str(result)


@settings(max_examples=20, deadline=None)
@given(kind=st.sampled_from(["xyzac", "xyzbc"]), seed=st.integers(0, 10_000), longer=st.floats(-30.0, 60.0))
def test_joints_are_those_of_trtfuncs(kind: str, seed: int, longer: float) -> None:
    centre = ToolCentre(FIVE if kind == "xyzac" else OTHER)
    centre.length = longer
    random = np.random.default_rng(seed)
    tilt, turn = random.uniform(-110.0, 110.0, 50), random.uniform(-360.0, 360.0, 50)
    wanted = np.zeros((50, 6))
    wanted[:, :3] = random.uniform(-100.0, 100.0, (50, 3))
    wanted[:, 3 if kind == "xyzac" else 4], wanted[:, 5] = tilt, turn
    found = centre.bring(wanted, np.zeros(6), joints=False)
    dt = 50.0 + longer  # 50 mm are those of the machine's own tool
    np.testing.assert_allclose(found[:, :3], trt(kind, wanted[:, :3], tilt, turn, dt), rtol=0, atol=1e-9)
    assert (found[:, 3:] == wanted[:, 3:]).all()
    np.testing.assert_allclose(centre.meant.places(found, longer)[0], wanted[:, :3], rtol=0, atol=1e-9)


def test_the_planned_tip_keeps_to_path_feed_and_limits(tmp_path: Path) -> None:
    prepared = made(tmp_path, TOUR)
    assert prepared.certificate is not None and prepared.certificate.ok
    assert prepared.tip is not None
    at = positions_of(prepared)
    tip, _ = prepared.tip.tip.places(at, 0.0)
    line = prepared.path["line"][prepared.segment]
    mine = prepared.path["tip"][prepared.segment] != JOINTS
    off, _ = contour_error(tip[mine], prepared.tip.path, prepared.segment[mine], np.full(mine.sum(), 0.1))
    assert off.max() < 0.02
    arc = line == 7  # about X10 Y20 with 10 mm
    assert np.abs(np.hypot(tip[arc, 0] - 10.0, tip[arc, 1] - 20.0) - 10.0).max() < 0.02
    assert np.abs(tip[line == 8] - [0.0, 20.0, 0.0]).max() < 0.02  # the tool tilts about its tip
    speed = np.linalg.norm(np.diff(tip, axis=0), axis=1) / prepared.T * 60.0
    for number in (5, 6, 7):
        here = speed[line[1:] == number]
        assert here.max() < 300.0 * 1.01 and np.median(here) > 290.0
    assert np.count_nonzero(line == 10) * prepared.T == pytest.approx(10.0, abs=0.1)  # G93 F6
    np.testing.assert_allclose(at[-1], [0.0, 0.0, 50.0, 0.0, 0.0, 0.0], atol=1e-9)


def test_a_longer_tool_pivots_about_its_own_tip(tmp_path: Path) -> None:
    (tmp_path / "tool.tbl").write_text("T1 P1 Z25 D6\n")
    text = "G21 G90 G64 P0.01\nT1 M6\nG43.4 H1\nG0 X5 Y6 Z7\nG1 A40 C70 F600\nM2\n"
    prepared = made(tmp_path, text, setup=Setup(tools=tmp_path / "tool.tbl"))
    assert prepared.tip is not None
    tilting = positions_of(prepared)[prepared.path["line"][prepared.segment] == 5]
    tip, direction = prepared.tip.tip.places(tilting, 25.0)
    assert np.abs(tip - [5.0, 6.0, 7.0]).max() < 0.01
    a, c = radians(40.0), radians(70.0)
    np.testing.assert_allclose(direction[-1], [sin(c) * sin(a), -cos(c) * sin(a), cos(a)], atol=1e-9)


def test_feed_is_lowered_to_the_slowest_joint_and_told(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text(HEAD + "G1 X10.1 C0 F1000\nG1 X30 F300\nM2\n")
    result, _ = check_program(tmp_path / "part.ngc", FIVE, Setup())
    assert result.ok and len(result.warnings) == 1
    assert "C would have to do" in str(result) and result.warnings[0].line == 5
    time = cycle_time(motion(tmp_path / "part.ngc", FIVE, Setup()), FIVE)
    assert time.certificate.ok


def test_limits_of_joints_are_looked_at_along_the_whole_way(tmp_path: Path) -> None:
    """Both ends are within Y's travel; half-way round the table is not."""
    told = faults(tmp_path, HEAD + "G0 X110 Y110 Z0 A0 C0\nG1 C90 F600\nM2\n")
    assert "part.ngc:6:" in told and "beyond its travel" in told and "1 fault" in told


@pytest.mark.parametrize(
    ("lines", "at", "said"),
    [
        ("G43.4 H0\nG1 X1 Y2 F100\n", 2, "name all three"),
        ("G43.4 H0\nG91 G0 X1 Y2 Z3\n", 2, "in G90"),
        ("G43.4 H0\nG0 X0 Y0 Z0\nG41.1 D3\n", 3, "does not go with tool centre point control"),
        ("G43.4 H0\nG0 X0 Y0 Z0\nG55\n", 3, "does not go with tool centre point control"),
        ("G43.4 H0\nG0 X0 Y0 Z0\nG53 G0 Z0\n", 3, "does not go with tool centre point control"),
        ("G43.4 H0\nG0 X0 Y0 Z0\nG28\n", 3, "does not go with tool centre point control"),
        ("G43.4 H0\nG0 X0 Y0 Z0\nG43 H0\n", 3, "write G49"),
        ("T0\nG43.4 H0\nG0 X0 Y0 Z0\nM6\n", 4, "write G49 before"),
        ("G61\nG43.4 H0\nG0 X0 Y0 Z1\n", 3, "write G64"),
        ("G43.4 H0\nG0 X0 Y0 Z1\nG49\nG0 Z5\n", 4, "name all three"),
    ],
)
def test_what_does_not_go_together_is_refused_with_its_line(tmp_path: Path, lines: str, at: int, said: str) -> None:
    told = faults(tmp_path, lines + "M2\n")
    assert f"part.ngc:{at}:" in told and said in told


def test_machines_without_rotary_links_say_so(tmp_path: Path) -> None:
    text = "G43.4 H0\nG0 X1 Y1 Z1\nM2\n"
    assert "links have rotary axes" in faults(tmp_path, text, load_machine("mini-cnc"))
    told = faults(tmp_path, text, load_machine("mini-cnc"), Setup(options=Dialect(tcp=True)))
    assert "no [[link]] tables" in told


def test_four_axes_turn_the_work_under_the_tip(tmp_path: Path) -> None:
    mill = load_machine("mrm-mill-4")
    text = "G64 P0.01\nG43.4 H0\nG0 X0 Y0 Z10\nG1 Z1 F300\nG1 X20 A45\nG1 Y5 A0\nM2\n"
    prepared = made(tmp_path, text, mill)
    assert prepared.certificate is not None and prepared.certificate.ok and prepared.tip is not None
    line = prepared.path["line"][prepared.segment]
    tip, _ = prepared.tip.tip.places(positions_of(prepared)[line == 5], 0.0)
    assert np.abs(tip[:, 1]).max() < 0.01 and np.abs(tip[:, 2] - 1.0).max() < 0.01


def test_the_rotary_table_follows_where_there_is_no_y(tmp_path: Path) -> None:
    """The thesis's machine has X, Z and a table about z: X and Y of the tip are reached by turning it."""
    small = load_machine("mrmt-oacs")
    tip = Tip(small.kinematics)
    zero = tip.places(np.zeros((1, 6)))[0][0]
    x, _, z = zero
    text = f"G64 P0.05\nG43.4 H0\nG0 X{x:.3f} Y0 Z{z:.3f}\nG1 Y40 F60\nG1 X{x - 20:.3f}\nM2\n"
    prepared = made(tmp_path, text, small)
    assert prepared.certificate is not None and prepared.certificate.ok and prepared.tip is not None
    at = positions_of(prepared)[prepared.path["line"][prepared.segment] == 4]
    place, _ = prepared.tip.tip.places(at, 0.0)
    assert np.abs(place[:, 0] - x).max() < 0.05 and place[-1, 1] == pytest.approx(40.0, abs=0.05)
    assert np.ptp(at[:, 3]) > 3.0
    told = faults(tmp_path, f"G43.4 H0\nG0 X{x:.3f} Y0 Z{z:.3f}\nG1 A10 F60\nM2\n", small)
    assert "A follows from X and Y" in told


def test_a_singular_place_is_passed_within_the_tolerance(tmp_path: Path) -> None:
    """Over the table's axis the table turns by 180 degrees, while the tip stays where it is."""
    small = load_machine("mrmt-oacs")
    z = Tip(small.kinematics).places(np.zeros((1, 6)))[0][0, 2]
    prepared = made(tmp_path, f"G64 P0.05\nG43.4 H0\nG0 X4 Y0 Z{z:.3f}\nG1 X-4 F60\nM2\n", small)
    assert prepared.certificate is not None and prepared.certificate.ok and prepared.tip is not None
    at = positions_of(prepared)[prepared.path["line"][prepared.segment] == 4]
    place, _ = prepared.tip.tip.places(at, 0.0)
    assert np.abs(place[:, 1]).max() < 0.05 and np.ptp(at[:, 3]) == pytest.approx(180.0, abs=0.1)


def test_where_no_joints_reach_is_a_fault_with_its_line(tmp_path: Path) -> None:
    """A tool off the table's axis cannot reach what is nearer to it than the tool's own distance in y."""
    small = load_machine("mrmt-oacs")
    aside = tuple(replace(each, offset=(-370.0, 30.0, 0.0)) if each.name == "arm" else each for each in small.links)
    machine = replace(small, links=aside)
    x, y, z = Tip(machine.kinematics).places(np.zeros((1, 6)))[0][0]
    text = f"G43.4 H0\nG0 X{x:.4f} Y{y:.4f} Z{z:.4f}\nG1 X10 Y0 F60\nM2\n"
    told = faults(tmp_path, text, machine)
    assert "part.ngc:3:" in told and "no position of the joints brings the tip to" in told


def crooked(machine: Machine) -> Machine:
    """The machine with assembly errors of some links."""
    wrong = {"A": ((0.02, 0.03, -0.05), (0.1, -0.2, 0.05)), "X": ((0.0, 0.01, 0.04), (0.0, 0.03, 0.0))}
    links = tuple(
        replace(link, error_angles=wrong[link.name][0], error_offset=wrong[link.name][1])
        if link.name in wrong
        else link
        for link in machine.links
    )
    return replace(machine, links=links)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), joints=st.booleans())
def test_corrected_joints_bring_the_tip_where_it_is_programmed(seed: int, joints: bool) -> None:
    machine = crooked(FIVE)
    real, meant = Tip(machine.kinematics), Tip(without_errors(machine).kinematics)
    random = np.random.default_rng(seed)
    wanted = np.zeros((40, 6))
    wanted[:, :3] = random.uniform(-50.0, 50.0, (40, 3))
    wanted[:, 3], wanted[:, 5] = random.uniform(20.0, 90.0, 40), random.uniform(-180.0, 180.0, 40)
    plain = ToolCentre(machine).bring(wanted, np.zeros(6), joints)
    place, direction = meant.places(plain)
    found = ToolCentre(machine, correct=True).bring(wanted, np.zeros(6), joints)
    corrected, turned = real.places(found)
    np.testing.assert_allclose(corrected, place, rtol=0, atol=1e-9)
    np.testing.assert_allclose(turned, direction, rtol=0, atol=1e-9)
    off = np.linalg.norm(real.places(plain)[0] - place, axis=1)
    assert off.min() > 0.05  # the errors are as large as 0.2 mm


def test_a_corrected_program_cuts_where_the_other_misses(tmp_path: Path) -> None:
    machine = crooked(FIVE)
    contour = {}
    for correct in (False, True):
        prepared = made(tmp_path, TOUR, machine, Setup(correct=correct))
        assert prepared.certificate is not None and prepared.certificate.ok and prepared.tip is not None
        tip, _ = prepared.tip.tip.places(positions_of(prepared), 0.0)
        line = prepared.path["line"][prepared.segment]
        contour[correct] = np.abs(tip[line == 8] - [0.0, 20.0, 0.0]).max()
    assert contour[True] < 0.02 and contour[False] > 0.1


def test_correction_of_a_machine_without_links_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no \[\[link\]\] tables"):
        made(tmp_path, "G0 X1\nM2\n", load_machine("mini-cnc"), Setup(correct=True))


def test_a_run_measures_the_tip(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text(HEAD + "G1 X12 A28 F300\nM2\n")
    result = PartProgram(tmp_path / "part.ngc", "xyzac").run()
    error = result.meta["program"]["contour_error"]
    assert 0.0 < error["max"] < 0.5
    assert result.meta["ending"] == "done"


def test_other_profiles_are_refused_with_the_line(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text(HEAD + "M2\n")
    with pytest.raises(InputError, match=r"line 4.*does not move the tool's tip"):
        prepare(tmp_path / "part.ngc", FIVE, profile="trapezoid")


class Told(ProgramRun):
    """A run of which one row is known."""

    columns: list[str] = []  # noqa: RUF012 - in place of the base's property
    row = np.zeros(0)
    progress = (1, 1)

    def read(self, first: int = 0) -> tuple[int, np.ndarray]:
        return 0, self.row[None]


@pytest.mark.parametrize("words", [{}, {"interpolator": "linear"}])
def test_an_operator_sees_that_the_program_has_locked_the_override(tmp_path: Path, words: dict[str, Any]) -> None:
    """His override was shown as if it acted."""
    text = "G21 G90 G94 G61\nF600\nG1 X2\nM49\nG1 X4\nM48\nG1 X6\nM2\n"
    (tmp_path / "part.ngc").write_text(text)
    part = PartProgram(tmp_path / "part.ngc", "mini-cnc", **words)
    result = part.run()
    run = Told(part.plan(), None, lambda live, progress: result)
    said = {}
    for line in (3, 5, 7):
        at = np.flatnonzero(result["program_line"] == line)
        sample = at[len(at) // 2]
        run.columns = ["sample", *result.columns]
        run.row = np.array([sample, *(column[sample] for column in result.columns.values())])
        status = run.status()
        assert status is not None
        page, terminal = status_html(status, {}, part.plan().machine, 150.0), live_line(status, run)
        said[line] = "locked at 100 % by the program's M49" in page
        assert said[line] == ("locked at 100 % by the program's M49" in terminal)
    assert said == {3: False, 5: True, 7: False}


def test_an_operator_sees_the_tip_and_its_feed(tmp_path: Path) -> None:
    """On a table that turns, the axes are elsewhere and go faster; work coordinates and feed are the tip's."""
    (tmp_path / "part.ngc").write_text(
        "G21 G90 G94 G64 P0.02\nG10 L2 P1 X1 Y0 Z0\nG43.4 H1\nG0 X10 Y0 Z20\n"
        "G1 X10 Y0 Z20 A10 C60 F60\nG49\nG0 X0 Y0 Z0\nM2\n"
    )
    (tmp_path / "tool.tbl").write_text("T1 P1 Z5 D2\n")
    tools = ProgramOptions(tmp_path / "tool.tbl").setup()
    part = PartProgram(tmp_path / "part.ngc", "xyzac", setup=tools)
    result = part.run()
    line = result["program_line"].astype(int)
    turning, at_end = np.flatnonzero(line == 5), np.flatnonzero(line == 7)
    run = Told(part.plan(), None, lambda live, progress: result)
    run.prepared = part.prepared

    def status(sample: int) -> Status:
        run.columns = ["sample", *result.columns]
        run.row = np.array([sample, *(column[sample] for column in result.columns.values())])
        found = run.status()
        assert found is not None
        return found

    middle = status(int(turning[len(turning) // 2]))
    assert [middle.tip[name] for name in "XYZ"] == pytest.approx([11.0, 0.0, 20.0], abs=0.06)
    assert abs(middle.measured["Z"] - 20.0) > 10.0
    assert middle.feed < 5.0, "the tip stands while the table turns below it"
    modes = Modes(("G1",), 1, 60.0, 0.0, origin=(1.0, 0.0, 0.0), tool_offset=(0.0, 0.0, 5.0))
    shown = status_html(middle, {5: modes}, part.plan().machine, 100.0)
    assert f"{middle.tip['X'] - 1.0:.3f}" in shown and f"{middle.tip['Z']:.3f}" in shown
    assert not status(int(at_end[-1])).tip, "after G49 the axes are what is programmed"
