"""A program against a machine: each clause by the line and word that break it, arcs to their extremes."""

from __future__ import annotations

from math import hypot, inf, pi
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.interpolators.motion.segments import LINE, SEGMENT, arc, chain, point_at
from rds.machines import load_machine
from rds.nc.check import check_program
from rds.nc.extent import extents
from rds.nc.fault_columns import find_word
from rds.nc.run.report import _program_lines
from rds.nc.setup import Setup
from rds.nc.trace import MOST_POINTS, Trace, sample
from rds.nc.validate import MOST_FAULTS, MOST_WARNINGS, tool_limits
from rds.nc.validation import Validation, plain

TOOLS = "T1 P1 Z10 D3 ;end mill, max S8000 F400\nT2 P2 D6 ;face mill\n"


def check(folder: Path, text: str, machine: str = "mini-cnc") -> Validation:
    """The verdict on a program that is written to part.ngc."""
    program, tools = folder / "part.ngc", folder / "tools.tbl"
    program.write_text(text, encoding="utf-8")
    tools.write_text(TOOLS, encoding="utf-8")
    return check_program(program, load_machine(machine), Setup(tools=tools))[0]


def places(found: Validation) -> list[tuple[int, int, str]]:
    return [(fault.line, fault.column, fault.word) for fault in found.faults]


def test_a_line_of_nothing_but_brackets_is_told_at_once(tmp_path: Path) -> None:
    began = process_time()
    (fault,) = check(tmp_path, "(" * 60_000 + "\nM2\n").faults
    assert "longer than 252 characters" in fault.reason and process_time() - began < 2.0  # searched, it takes 5 s


centres = st.floats(-40, 40)


@given(
    plane=st.integers(0, 2),
    centre=st.tuples(centres, centres, centres),
    radius=st.floats(0.1, 60),
    begin=st.floats(-pi, pi),
    sweep=st.floats(0.01, 20).flatmap(lambda size: st.sampled_from([size, -size])),
    drift=st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)),
    rise=st.floats(-10, 10),
)
def test_the_extremes_of_an_arc_are_those_of_the_path(plane, centre, radius, begin, sweep, drift, rise) -> None:
    first, second, normal = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
    start, end = np.array(centre), np.array(centre)
    start[first] += radius * np.cos(begin)
    start[second] += radius * np.sin(begin)
    end[first] += radius * np.cos(begin + sweep) + drift[0]
    end[second] += radius * np.sin(begin + sweep) + drift[1]
    end[normal] += rise
    segment = arc(start, end, centre, 1.0, plane=plane)
    segment["sweep"], segment["length"] = sweep, hypot(radius * sweep, rise)
    low, high = extents(segment)
    points, _ = sample(segment, 1e-3)
    points = np.concatenate((segment["start"][:, :3], points))
    slack = radius * 1e-3**2 / 8 + 1e-5  # what may lie between two points, and more than what drift adds to that
    assert np.all(points >= low[0, :3] - 1e-9)
    assert np.all(points <= high[0, :3] + 1e-9)
    assert np.all(points.min(axis=0) <= low[0, :3] + slack)
    assert np.all(points.max(axis=0) >= high[0, :3] - slack)


def test_drawn_points_are_on_the_path_that_is_run() -> None:
    segments = chain(arc((5, 0, 0), (0, 5, 3), (0, 0, 0), 1.0), arc((0, 5, 3), (0, 5.01, 3), (0, 9, 3), 1.0, plane=2))
    points, owner = sample(segments, 0.3)
    for number in (0, 1):
        mine = points[owner == number]
        shares = np.arange(1, len(mine) + 1) / len(mine)
        exact = [point_at(segments[number], share * segments["length"][number])[:3] for share in shares]
        assert mine == pytest.approx(np.array(exact), abs=1e-12)


def test_a_valid_program_and_what_is_told_of_it(tmp_path: Path) -> None:
    found = check(tmp_path, "G21 G90\nT1 M6\nS5000 M3\nF120\nG0 X10\nG1 Y20\nG3 X10 Y20 I-5 J0\nG0 Z40\nM2\n")
    assert found.ok and not found.faults
    assert found.cutting == pytest.approx(20 + 10 * pi)
    assert found.rapid == pytest.approx(10 + 40)
    assert found.low == {"X": 0.0, "Y": 0.0, "Z": 0.0} and found.high == {"X": 10.0, "Y": 25.0, "Z": 40.0}
    assert found.tools == (1,) and found.spindle == 5000.0
    assert "can run it: 4 moves" in str(found)


@pytest.mark.parametrize(
    ("text", "expected", "said"),
    [
        ("G0 X75\nX-75.001\n", (2, 1, "X-75.001"), "X would reach -75.001 mm (machine coordinates), 0.001 mm beyond"),
        ("G54\nG10 L2 P1 Y70\nG0 X1 Y6\n", (3, 7, "Y6"), "Y would reach 76 mm"),
        ("F60\nG0 X70.0001\n(X1) G2 Y-10 J-5\n", (3, 6, "G2"), "on this arc X would reach 75.0001 mm"),
        ("G20\nG0 Z [1+1]\n", (2, 4, "Z [1+1]"), "Z would reach 50.8 mm"),
        ("G0 A0\nA1\n", (2, 1, "A1"), "has no axis A to move (it has X, Y, Z)"),
        (
            "F661\nG1 X1\nX2 Z1\n",
            (1, 1, "F661"),
            "661 mm/min is more than Z, the slowest axis that moves, can do (660)",
        ),
        (
            "F800\nG1 X1\nX2 Z1\n",
            (1, 1, "F800"),
            "800 mm/min is more than Z, the slowest axis that moves, can do (660)",
        ),
        ("F781\nG2 X1 Y1 I0.5 J0.5\n", (1, 1, "F781"), "781 mm/min is more than X, the slowest axis that moves"),
        ("G93\nG1 X10 F79\n", (2, 8, "F79"), "790 mm/min is more than X"),
        ("S1000 M3\nG95\nG1 Z1 F0.67\n", (3, 7, "F0.67"), "670 mm/min"),
        ("F60\nM3 S1000\nG33 Z-1 K1\n", (3, 1, "G33"), "speed of the spindle make a feed of 1000 mm/min, more than Z"),
        ("T1 M6\nF401\nG1 X1\n", (2, 1, "F401"), "401 mm/min is more than the tool table allows tool 1 (400)"),
        ("S10001\nM3\n", (2, 1, "M3"), "10001 rev/min is outside of what the spindle does (-10000 to 10000"),
        ("M4\nS10001\n", (2, 1, "S10001"), "10001 rev/min counter-clockwise is outside"),
        ("T1 M6\nM3 S8001\n", (2, 4, "S8001"), "8001 rev/min is more than the tool table allows tool 1 (8000)"),
        ("T3 M6\n", (1, 1, "T3"), "the tool table has no tool 3"),
        ("G0 X1\nG1 X2\n", (2, 0, ""), "feed rate"),
        ("M3\nG33 Z-1 K1\n", (2, 0, ""), "a thread at S0 moves nothing; give a spindle speed"),
        ("G10 L2 P1 R30\nF60\nG18 G2 X10 I5\n", (3, 5, "G2"), "lies in no plane"),
    ],
)
def test_each_clause_by_line_and_word(tmp_path: Path, text: str, expected: tuple[int, int, str], said: str) -> None:
    found = check(tmp_path, text + "M2\n")
    assert not found.ok
    assert [place[0] for place in places(found)] == [expected[0]]
    if expected[1]:
        assert places(found)[0] == expected
    assert said in str(found)
    assert f"part.ngc:{expected[0]}:" in str(found)


def test_all_faults_are_told_in_the_order_of_lines(tmp_path: Path) -> None:
    text = "F800\nG1 X80\nY10\nG1 X0 Y-80\nG1 Y0 A5\nG1 G2 X1\n(later)\nG12 X1\nX1 X2\n#1=[1/0]\nM2\nG999\n"
    found = check(tmp_path, text)
    assert [(fault.line, fault.word) for fault in found.faults] == [
        (1, "F800"),
        (2, "X80"),
        (4, "Y-80"),
        (5, "A5"),
        (6, "G2"),
        (8, "G12"),
        (9, "X2"),
    ]
    assert found.stopped is not None and found.stopped.line == 6
    assert "not run from line 6 on" in str(found) and "7 faults" in str(found)


def test_all_faults_of_a_line_are_told(tmp_path: Path) -> None:
    found = check(tmp_path, "G1 G2 X1 X2 G12 F60\nU1 V2 $H\nG0 X1 X2 (not closed\nM2\n")
    assert [(fault.line, fault.word) for fault in found.faults] == [
        *((1, word) for word in ("G2", "X2", "G12")),
        *((2, word) for word in ("U1", "V2", "$")),
        (3, "("),
    ]


def test_what_stands_behind_a_wrong_number_of_an_o_word_is_no_fault_of_its_own(tmp_path: Path) -> None:
    found = check(tmp_path, "G12\no5.19 sub\nG0 X1\no5.19 endsub\nM2\n")
    assert [(fault.line, fault.word) for fault in found.faults] == [(1, "G12"), (2, "O5.19"), (4, "O5.19")]


def test_subroutines_that_nothing_calls_are_read(tmp_path: Path) -> None:
    text = (
        "o1 sub\nG12 X1\no1 endsub\n o2 SUB\nG0 X1 U2\no5.19 if [1]\no2 endsub\no3 sub\nG0 X1\no3 endsub\no3 call\nM2\n"
    )
    found = check(tmp_path, text)
    assert found.ok
    assert [(warning.line, warning.word) for warning in found.warnings] == [(2, "G12"), (5, "U2"), (6, "O5.19")]
    assert "in a subroutine that nothing calls" in str(found)
    assert not check(tmp_path, text.replace("o2 endsub", "o2 endsub\no2 call")).ok


def test_moves_back_from_outside_are_no_faults_of_their_own(tmp_path: Path) -> None:
    found = check(tmp_path, "F60\nG0 X80\nY10\nX85\nX76\nX0\nM2\n")
    assert [fault.line for fault in found.faults] == [2, 4]


def test_a_loop_tells_each_line_once_and_the_worst_of_it(tmp_path: Path) -> None:
    found = check(tmp_path, "#1 = 70\nO1 WHILE [#1 LT 79]\nG0 X#1\nG0 X0\n#1 = [#1 + 1]\nO1 ENDWHILE\nM2\n")
    assert [(fault.line, fault.word) for fault in found.faults] == [(3, "X#1")]
    assert "X would reach 78 mm" in str(found)
    found = check(tmp_path, "#1 = 78\nO1 WHILE [#1 GT 69]\nG0 X#1\nG0 X0\n#1 = [#1 - 1]\nO1 ENDWHILE\nM2\n")
    assert [fault.reason.partition(";")[0] for fault in found.faults] == [
        "X would reach 78 mm (machine coordinates), 3 mm beyond its travel of -75 to 75"
    ]


@pytest.mark.parametrize(("centre", "reached"), [("3", "83 mm"), ("-3", "-83 mm")])
def test_an_arc_beyond_both_ends_is_told_where_it_is_farther_out(tmp_path: Path, centre: str, reached: str) -> None:
    found = check(tmp_path, f"#1=[80 * SIN[60]]\nG0 X[{centre} + 40] Y#1\nF60 G3 X[{centre} + 40] I-40 J[-#1]\nM2\n")
    assert any(f"on this arc X would reach {reached}" in fault.reason for fault in found.faults)


@pytest.mark.parametrize(("axis", "number"), [("B", 90), ("C", 300)])
def test_each_rotary_axis_has_its_limit(tmp_path: Path, axis: str, number: int) -> None:
    (alone,) = check(tmp_path, f"G1 {axis}1 F2401\nM2\n", "xyzbc").faults
    assert f"2401 degrees/min is more than {axis}, the slowest rotary axis that moves" in alone.reason
    (beside,) = check(tmp_path, f"F60\nG1 X1 {axis}{number}\nM2\n", "xyzbc").faults
    assert f"{axis} would turn at {60 * number} degrees/min to keep up, and can do 2400" in beside.reason
    assert check(tmp_path, f"F60\nG1 X1 {axis}40\nM2\n", "xyzbc").ok  # just so


def test_the_bounds_themselves_are_allowed(tmp_path: Path) -> None:
    text = "T1 M6\nG4 P3600\nS8000 M3\nF400 G1 X1\nT2 M6\nM3 S10000\nM4\nF660 G1 Z1\nF780 X75\nX-75\nM3 S0\nT0 M6\nM2\n"
    found = check(tmp_path, text)
    assert found.ok and (found.tools, found.spindle) == ((1, 2), 10000.0)
    assert [(told.line, told.word) for told in found.warnings] == [(2, "P3600"), (11, "M3")]
    assert not check(tmp_path, "G4 P60\nM2\n").warnings
    (fault,) = check(tmp_path, "G4 P3601\nM2\n").faults
    assert fault.word == "P3601" and "longer than 3600" in fault.reason
    assert len(check(tmp_path, "G4 P61\n" * (MOST_WARNINGS + 1) + "M2\n").warnings) == MOST_WARNINGS
    (fault,) = check(tmp_path, "S100 M3\nM2\n", "xyzbc").faults
    assert "xyzbc has no spindle to turn" in fault.reason


def test_faults_without_end_are_counted(tmp_path: Path) -> None:
    lines = [f"X{80 + number * 0.01:.2f}" for number in range(MOST_FAULTS + 5)]
    found = check(tmp_path, "G0 X0\n" + "\n".join(lines) + "\nM2\n")
    assert (len(found.faults), found.more) == (MOST_FAULTS, 5)
    assert "and 5 faults more" in str(found)


def test_a_rotary_machine_has_its_own_limits(tmp_path: Path) -> None:
    assert check(tmp_path, "G93 G1 X0 A90 F1\nG94 F60 X10\nM2\n", "mrmt-oacs").ok
    found = check(tmp_path, "F181\nG1 A10\nF60\nX1 A100\nM3 S600\nY1\nM2\n", "mrmt-oacs")
    assert [(fault.line, fault.word) for fault in found.faults] == [(1, "F181"), (4, "A100"), (5, "S600"), (6, "Y1")]
    assert "181 degrees/min is more than A, the slowest rotary axis that moves, can do (180)" in str(found)
    assert "A would turn at 5400 degrees/min to keep up" in str(found)


def test_an_axis_that_stands_still_does_not_limit_the_feed(tmp_path: Path) -> None:
    assert check(tmp_path, "G1 X10 F780\nM2\n").ok
    assert check(tmp_path, "G1 X10 A5 F100\nM2\n", "mrmt-oacs").ok  # Z does 66 mm/min
    assert not check(tmp_path, "G1 X10 Z1 F100\nM2\n", "mrmt-oacs").ok


def test_a_machine_without_limits_is_refused(tmp_path: Path) -> None:
    machine = tmp_path / "m.toml"
    machine.write_text(
        "sample_period = 0.001\n[axis.X]\nnode = 1\ntravel = [0, 1]\nresolution = 0.1\n", encoding="utf-8"
    )
    with pytest.raises(InputError, match="has no limits"):
        check(tmp_path, "M2\n", str(machine))


@pytest.mark.parametrize(
    ("comment", "speed", "feed"),
    [
        ("end mill, max S8000 F400", 8000, 400),
        ("MAX F12.5", inf, 12.5),
        ("max speed", inf, inf),
        ("", inf, inf),
    ],
)
def test_limits_of_a_tool_stand_in_its_comment(comment: str, speed: float, feed: float) -> None:
    assert tool_limits(comment) == (speed, feed)


@pytest.mark.parametrize(
    ("text", "letters", "found"),
    [
        ("G1 X10 Y-5", "Y", (8, "Y-5")),
        ("g1x 10y-5", "X", (3, "x 10")),
        ("(X1) G1 X2 ; X3", "X", (9, "X2")),
        ("X#<a b> Y[#1 + 2]", "Y", (9, "Y[#1 + 2]")),
        ("G02 I5", "X G2", (1, "G02")),
        ("G20 G28", "G2", (0, "")),
        ("", "X", (0, "")),
    ],
)
def test_words_are_found_on_their_lines(text: str, letters: str, found: tuple[int, str]) -> None:
    assert find_word(text, letters) == found


def test_lines_are_counted_as_the_interpreter_counts_them(tmp_path: Path) -> None:
    part = tmp_path / "part.ngc"
    part.write_bytes(b"\xef\xbb\xbfG21 G90\r\r\nG1 X1 F100\r\r\n(\x0c)  X500\r\r\nM2\r\r\n")
    result, _ = check_program(part, load_machine("mini-cnc"), Setup())
    assert [(fault.line, fault.column, fault.word) for fault in result.faults] == [(3, 6, "X500")]
    assert [line.strip() for line in _program_lines(part)] == ["G21 G90", "G1 X1 F100", "(\x0c)  X500", "M2", ""]


def test_numbers_read_well() -> None:
    assert [plain(value) for value in (12.0, -0.5, 0.00001234, 0.0, 1e6)] == ["12", "-0.5", "1.2e-05", "0", "1000000"]


def test_a_long_path_is_thinned_out_to_be_drawn() -> None:
    trace = Trace()
    angle = np.linspace(0, 2 * pi, MOST_POINTS // 5)
    circle = np.zeros(len(angle) - 1, SEGMENT)
    circle["plane"] = LINE
    circle["start"][:, 0], circle["start"][:, 1] = 5 * np.cos(angle[:-1]), 5 * np.sin(angle[:-1])
    circle["end"][:, 0], circle["end"][:, 1] = 5 * np.cos(angle[1:]), 5 * np.sin(angle[1:])
    for _ in range(20):
        trace.add(circle)
    points = trace.points[1]
    assert len(points) <= MOST_POINTS
    assert 0.0 < trace.resolution <= 10 / 400
    good = points[~np.isnan(points[:, 0])]
    assert np.hypot(good[:, 0], good[:, 1]) == pytest.approx(5.0)
    assert np.hypot(*np.diff(good[:, :2], axis=0).T).max() < 3 * trace.resolution
    assert trace.low[:2] == pytest.approx([-5, -5]) and trace.high[:2] == pytest.approx([5, 5])


def _loop(rounds: int, *lines: str) -> str:
    body = "\n".join(lines)
    return f"G21 G90 F500\n#1=0\nG0 X70\no1 while [#1 lt {rounds}]\n#1=[#1+1]\n{body}\no1 endwhile\nG1 X1 X2\nM2\n"


def test_a_loop_that_runs_out_of_the_travel_is_told_when_it_does(tmp_path: Path) -> None:
    found = check(tmp_path, _loop(10**9, "G91 G1 X.01"))
    assert [fault.line for fault in found.faults] == [6, 6, 8]  # what comes after it is read, too
    assert found.stopped is not None
    assert "left the travel of X 1000 times" in found.stopped.reason
    assert "X would reach 85 mm" in found.faults[1].reason


@pytest.mark.parametrize("lines", [["G91 G1 X.01"], ["G90 G1 X80", "G1 X70"]])
def test_a_loop_that_ends_or_comes_back_is_followed(tmp_path: Path, lines: list[str]) -> None:
    found = check(tmp_path, _loop(1400, *lines))
    assert found.stopped is not None
    assert found.stopped.line == 7 + len(lines)  # the wrong line behind it


def test_what_a_student_hardly_means_is_worth_a_warning(tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text("G21 F200 G0 X0 Y0 Z5\nG4 P2000\nG41 G1 X10\nY10\nG40 G0 X0\nM2\n")
    found, _ = check_program(file, load_machine("mini-cnc"), Setup())
    assert found.ok
    said = [(warning.line, warning.reason) for warning in found.warnings]
    assert (2, "a dwell of 2000 s, 33.3 minutes: P is in seconds here") in said
    assert any(line == 3 and "with a diameter of 0 moves nothing aside" in reason for line, reason in said)


def test_cycles_of_other_lathes_are_told_where_they_would_be_something_else(tmp_path: Path) -> None:
    """Fanuc's G90, G92 and G94 with X, Z and F turn; here one is a rapid through the work."""
    file = tmp_path / "part.ngc"
    text = "G21 G18 G8 G99\nG0 X15 Z2\nG90 X14 (a cut) Z-15 F0.2\nG92 X14.4 Z-15 F1.5\nG90 G1 X9 F20\nG90 X2\nM2\n"
    file.write_text(text)
    found, _ = check_program(file, load_machine("lathe"), Setup())
    assert [(told.line, told.word) for told in found.warnings] == [(3, "G90"), (4, "G92"), (1, "G99")]
    assert "at rapid after G0" in found.warnings[0].reason
    assert "write G95" in found.warnings[2].reason
    file.write_text(text.replace("G90 G1", "G81 Z1 R3 F9\nG90 G1"))
    assert "G99" not in [told.word for told in check_program(file, load_machine("lathe"), Setup())[0].warnings]
    assert not check_program(file, load_machine("mini-cnc"), Setup())[0].warnings
