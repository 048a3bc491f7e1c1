"""Canonical calls become machine motion: offsets, units, planes, feed modes, events."""

from __future__ import annotations

from math import cos, hypot, inf, pi, radians, sin, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.interpolators.motion.segments import BLEND, EXACT_PATH, EXACT_STOP, LINE, XY, YZ, ZX, point_at
from rds.nc.language.canon import ARC, FEED, MOTION, RATE, SPEED, TRAVERSE, Call, MotionBlock
from rds.nc.language.errors import ProgramError
from rds.nc.language.interpreter import interpret
from rds.nc.path_block import PathBlock
from rds.nc.toolpath import toolpath


def rows(*moves: tuple[Any, ...], file: str = "") -> MotionBlock:
    """Rows of (kind, line, value, ...)."""
    block = np.zeros(len(moves), MOTION)
    for row, (kind, line, *values) in zip(block, moves, strict=True):
        row["kind"], row["line"] = kind, line
        row["values"][: len(values)] = values
    return MotionBlock(block, file)


def path(*items: MotionBlock | Call) -> PathBlock:
    """All of it as one block: programs here change neither file nor tool."""
    blocks = list(toolpath(items))
    assert len(blocks) == 1
    return blocks[0]


def test_lines_rates_and_lines_of_the_program() -> None:
    block = path(
        rows((RATE, 1, 120.0), (TRAVERSE, 2, 10.0), (FEED, 3, 10.0, 4.0), (RATE, 5, 60.0), (FEED, 5, 7.0, 0.0))
    )
    segments = block.segments
    assert segments["line"].tolist() == [2, 3, 5]
    assert segments["rapid"].tolist() == [True, False, False]
    assert segments["plane"].tolist() == [LINE] * 3
    assert segments["start"][:, :2].tolist() == [[0, 0], [10, 0], [10, 4]]
    assert segments["end"][:, :2].tolist() == [[10, 0], [10, 4], [7, 0]]
    assert segments["length"].tolist() == [10, 4, 5]
    assert segments["rate"][1:].tolist() == [2.0, 1.0]  # mm/s
    assert block.feed_lines.tolist() == [1, 1, 5]
    assert [event[:3] for event in block.events] == [(2, "end", 0.0)]


def test_inches_scale_lengths_and_rates_but_not_angles() -> None:
    block = path(
        Call("USE_LENGTH_UNITS", ("INCHES",)),
        rows((RATE, 1, 6.0), (FEED, 1, 1.0, 0, 0, 90.0), (FEED, 2, 1.0, 0, 0, 180.0)),
        Call("USE_LENGTH_UNITS", ("MM",)),
        rows((FEED, 4, 25.4, 0, 0, 180.0), (FEED, 5, 26.4, 0, 0, 180.0)),
    )
    assert block.segments["end"][:, 0] == pytest.approx([25.4, 25.4, 26.4])
    assert block.segments["end"][:, 3].tolist() == [90, 180, 180]
    assert block.segments["length"] == pytest.approx([25.4, 90.0, 1.0])
    assert block.segments["rate"] == pytest.approx([2.54, 0.1, 2.54])  # mm/s, degrees/s where only A moves, mm/s


def test_offsets_are_applied_as_linuxcnc_does() -> None:
    """G92, then the rotation, then the coordinate system's origin, then the tool."""
    block = path(
        Call("SET_G5X_OFFSET", (2, 10.0, 20.0, 5.0, 1.0, 2.0, 3.0)),
        Call("SET_XY_ROTATION", (30.0,)),
        Call("SET_G92_OFFSET", (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)),
        Call("USE_TOOL_LENGTH_OFFSET", (0.5, 0.25, 12.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        rows((TRAVERSE, 1, 4.0, 7.0, -1.0, 10.0, 20.0, 30.0)),
    )
    c, s = cos(radians(30)), sin(radians(30))
    expected = [5 * c - 9 * s + 10.5, 5 * s + 9 * c + 20.25, -1 + 3 + 5 + 12, 11, 22, 33]
    assert block.segments["end"][0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "plane", "axes"), [("XY", XY, (0, 1, 2)), ("XZ", ZX, (2, 0, 1)), ("YZ", YZ, (1, 2, 0))]
)
@pytest.mark.parametrize("turns", [1, -1, 3, -2])
def test_arcs_and_helices_in_all_planes(name: str, plane: int, axes: tuple[int, int, int], turns: int) -> None:
    """From (5, 0) about the origin to (0, 5), rising by 8: a quarter counter-clockwise or three clockwise, or more."""
    first, second, normal = axes
    start = [0.0] * 6
    start[first] = 5.0
    block = path(
        Call("SELECT_PLANE", (name,)),
        rows((RATE, 1, 60.0), (TRAVERSE, 1, *start), (ARC, 2, 0.0, 5.0, 0.0, 0.0, turns, 8.0, 45.0)),
    )
    arc = block.segments[1]
    sweep = pi / 2 + 2 * pi * (turns - 1) if turns > 0 else -3 * pi / 2 - 2 * pi * (-turns - 1)
    assert arc["plane"] == plane
    assert arc["sweep"] == pytest.approx(sweep)
    assert arc["length"] == pytest.approx(hypot(5 * sweep, 8))
    assert arc["end"][[first, second, normal]].tolist() == [0, 5, 8]
    assert arc["end"][3] == 45.0
    assert point_at(arc, arc["length"]) == pytest.approx(arc["end"])


def test_a_full_circle_stays_one_under_every_offset() -> None:
    block = path(
        Call("SET_XY_ROTATION", (33.3,)),
        Call("SET_G5X_OFFSET", (1, 0.1, 0.7, 0.0, 0.0, 0.0, 0.0)),
        rows((RATE, 1, 60.0), (TRAVERSE, 1, 0.3, 0.9), (ARC, 2, 0.3, 0.9, 5.3, 0.9, -1, 0.0)),
    )
    assert block.segments["sweep"][1] == pytest.approx(-2 * pi)


def test_an_axis_that_stands_still_in_other_units_turns_no_rotary_move_into_a_linear_one() -> None:
    x = 0.1 + 0.2  # one bit beside 0.3
    block = path(rows((RATE, 1, 60.0), (FEED, 1, 0.3), (FEED, 2, x, 0, 0, 30.0)))
    assert block.segments["length"][1] == 30.0
    assert block.segments["rate"][1] == 1.0


def test_feed_per_revolution_follows_the_spindle() -> None:
    block = path(
        rows((SPEED, 1, 600.0)),
        Call("START_SPINDLE_COUNTERCLOCKWISE", (0,), 1),
        Call("SET_FEED_MODE", (0, 1)),
        rows((RATE, 2, 0.1), (FEED, 3, 1.0), (SPEED, 4, 1200.0), (FEED, 5, 2.0)),
        Call("SET_FEED_MODE", (0, 0)),
        rows((RATE, 6, 30.0), (FEED, 6, 3.0)),
    )
    assert block.segments["rate"] == pytest.approx([1.0, 2.0, 0.5])
    assert [event for event in block.events if event.kind == "spindle"] == [
        (-1, "spindle", -600.0, 1),
        (0, "spindle", -1200.0, 4),
    ]


@pytest.mark.parametrize(
    ("items", "said"),
    [
        ((Call("SET_FEED_MODE", (0, 1)), rows((RATE, 2, 0.1), (FEED, 3, 1.0), file="p.ngc")), "stands still"),
        ((rows((FEED, 3, 1.0), file="p.ngc"),), "no feed rate"),
        ((Call("CLAMP_AXIS", (), 3, file="p.ngc"),), "CLAMP_AXIS"),
        (
            (
                Call("SET_XY_ROTATION", (10.0,)),
                Call("SELECT_PLANE", ("XZ",)),
                rows((RATE, 1, 60.0), (ARC, 3, 2.0, 0.0, 1.0, 0.0, 1, 0.0), file="p.ngc"),
            ),
            "G18",
        ),
    ],
    ids=("per revolution", "no feed", "call", "tilted"),
)
def test_what_no_machine_can_do_is_told_with_its_line(items: tuple[Any, ...], said: str) -> None:
    with pytest.raises(ProgramError, match=said) as told:
        list(toolpath(items))
    assert (told.value.file, told.value.line) == ("p.ngc", 3)
    found: list[ProgramError] = []
    blocks = list(toolpath(items, report=found.append))
    assert len(found) == 1
    assert blocks[-1].events[-1].kind == "end"


def test_path_modes() -> None:
    block = path(
        rows((TRAVERSE, 1, 1.0)),
        Call("SET_MOTION_CONTROL_MODE", ("EXACT_PATH",)),
        rows((TRAVERSE, 2, 2.0)),
        Call("SET_MOTION_CONTROL_MODE", ("EXACT_STOP",)),
        rows((TRAVERSE, 3, 3.0)),
        Call("SET_MOTION_CONTROL_MODE", ("CONTINUOUS", 0.05)),
        Call("SET_NAIVECAM_TOLERANCE", (0.02,)),
        rows((TRAVERSE, 4, 4.0)),
        Call("SET_MOTION_CONTROL_MODE", ("CONTINUOUS", 0.0)),
        Call("SET_NAIVECAM_TOLERANCE", (0.0,)),
        rows((TRAVERSE, 5, 5.0)),
    )
    assert block.segments["mode"].tolist() == [BLEND, EXACT_PATH, EXACT_STOP, BLEND, BLEND]
    assert block.segments["tolerance"].tolist() == [inf, inf, inf, 0.05, inf]
    assert block.segments["collinear"].tolist() == [0, 0, 0, 0.02, 0]


def test_events_stand_where_they_happen_and_blocks_are_of_one_tool() -> None:
    blocks = list(
        toolpath(
            [
                rows((TRAVERSE, 1, 1.0)),
                Call("SELECT_TOOL", (7,), 2),
                Call("CHANGE_TOOL", (3,), 2),  # the row of the table
                Call("FLOOD_ON", (), 3),
                rows((TRAVERSE, 4, 2.0), (TRAVERSE, 5, 2.0), (TRAVERSE, 6, 3.0)),  # line 5 moves nothing
                Call("DWELL", (1.5,), 7),
                Call("OPTIONAL_PROGRAM_STOP", (), 8),
                Call("COMMENT", ("x",), 9),
                Call("PROGRAM_END", (), 10),
            ]
        )
    )
    assert [block.tool for block in blocks] == [0, 7]
    assert [len(block) for block in blocks] == [1, 2]
    assert [event for block in blocks for event in block.events] == [
        (-1, "tool", 7.0, 2),
        (-1, "coolant", "flood on", 3),
        (1, "dwell", 1.5, 7),
        (1, "stop", 1.0, 8),
        (1, "end", 0.0, 10),
    ]


def test_blocks_are_of_one_file() -> None:
    first, second = rows((RATE, 1, 60.0), (FEED, 2, 1.0), file="a"), rows((FEED, 2, 2.0), file="b")
    blocks = list(toolpath([first, second]))
    assert [(block.file, block.feed_lines.tolist()) for block in blocks] == [("a", [1]), ("b", [0])]


numbers = st.floats(-50, 50).map(lambda value: round(value, 4))
moves = st.lists(
    st.one_of(
        st.tuples(st.sampled_from([TRAVERSE, FEED]), st.lists(numbers, min_size=6, max_size=6)),
        st.tuples(st.sampled_from([RATE, SPEED]), st.lists(st.floats(0.1, 5000.0), min_size=1, max_size=1)),
    ),
    min_size=1,
    max_size=40,
)


@given(moves, st.integers(1, 12), st.integers(0, 1))
def test_how_the_stream_is_cut_into_blocks_changes_nothing(
    made: list[tuple[int, list[float]]], size: int, per_revolution: int
) -> None:
    table = [(RATE, 1, 60.0), *((kind, line, *values) for line, (kind, values) in enumerate(made, start=2))]
    turning = [rows((SPEED, 1, 90.0)), Call("START_SPINDLE_CLOCKWISE", (0,), 1)]
    turning.append(Call("SET_FEED_MODE", (0, per_revolution)))
    whole = path(*turning, rows(*table))
    pieces = [rows(*table[at : at + size]) for at in range(0, len(table), size)]
    items = [item for piece in pieces for item in (piece, Call("COMMENT", ("x",)), Call("SELECT_PLANE", ("XY",)))]
    parts = path(*turning, *items)
    assert whole.events == parts.events
    speeds = [(line, values[0]) for line, (kind, values) in enumerate(made, start=2) if kind == SPEED]
    assert [(event.line, event.value) for event in whole.events if event.kind == "spindle"] == [(1, 90.0), *speeds]
    for event in whole.events[:-1]:
        lines = whole.segments["line"]
        assert np.all(lines[: event.after + 1] <= event.line) and np.all(lines[event.after + 1 :] > event.line)
    assert np.array_equal(whole.segments, parts.segments)
    assert np.array_equal(whole.feed_lines, parts.feed_lines)
    assert whole.segments["start"][1:].tolist() == whole.segments["end"][:-1].tolist()
    lengths = whole.segments["length"]
    assert np.all(lengths > 0)
    for segment in whole.segments:
        way = segment["end"] - segment["start"]
        assert segment["length"] == pytest.approx(sqrt(sum(way[:3] ** 2)) or sqrt(sum(way[3:] ** 2)))


@pytest.mark.parametrize(
    ("program", "says"),
    [
        ("M48\nG1 X1", []),
        ("G1 X1\nM49\nG1 X2\nM48\nG1 X3", [(0, 1, 3), (1, 0, 5)]),
        ("M50 P0\nM50 P1\nG1 X1", []),
        ("M49 G1 X1\nX2", [(-1, 1, 2), (1, 0, 4)]),  # a move in the line of M49 is none of a tap
        ("M49 G1 X1", [(-1, 1, 2), (0, 0, 3)]),
        ("M50 P0 G1 X1\nG4 P1\nX2", [(-1, 1, 2), (1, 0, 5)]),
        ("M49 G84 X1 Z-2 R1\nG80", [(-1, 1, 2), (1, 2, 2), (3, 0, 4)]),
        ("G33 X1 K1\nG33 X3 Z-1 K1\nG1 X4", [(-1, 2, 2), (1, 0, 3)]),  # threads go on into each other
        ("G84 X1 Z-2 R1\nX2\nG80", [(1, 2, 2), (3, 0, 2), (4, 2, 3), (6, 0, 3)]),
        ("M49\nG84 X1 Z-2 R1\nG80\nG1 X3", [(-1, 1, 2), (1, 2, 3), (3, 1, 3), (4, 0, 6)]),
        (
            "G18 G0 X5\nG76 P1 Z-9 I-1 J1 K2",
            [(2, 2, 3), (4, 0, 3), (6, 2, 3), (8, 0, 3)],
        ),  # the way out of the thread, too
    ],
)
def test_who_has_a_say_in_the_feed(program: str, says: list[tuple[int, int, int]]) -> None:
    """After which segment it becomes the operator's (0), the program's alone (1), the spindle's (2), by which line."""
    text = f"G21 G90 F100 S300 M3\n{program}\nM2\n"
    told = [each for block in toolpath(interpret(text)) for each in block.events if each.kind == "override"]
    assert [(each.after, each.value, each.line) for each in told] == says


@pytest.mark.parametrize(("program", "lines"), [("G33 X1 K1\nG33 X3 Z-1 K1", []), ("G33 X1 K1\nG0 X0\nG33 X1 K1", [4])])
def test_a_thread_in_several_cuts_is_warned_of(program: str, lines: list[int]) -> None:
    """The spindle's angle is not known: the cuts would lie beside each other."""
    told: list[ProgramError] = []
    list(toolpath(interpret(f"G21 G90 S300 M3\n{program}\nM2\n"), warn=told.append))
    assert [fault.line for fault in told] == lines
