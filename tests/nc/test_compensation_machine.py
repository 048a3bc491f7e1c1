"""Cutter compensation against LinuxCNC's rs274 on random stretches, and by itself."""

from __future__ import annotations

import math

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from rds.nc.compensation.compensation import LEFT, RIGHT, Compensation
from rds.nc.compensation.geometry import arc_arc, arc_line, entry_centre, line_arc, line_line, sweep
from rds.nc.language.canon import FEED, Call
from rds.nc.language.errors import ProgramError

from .compensation_cases import (
    OFF,
    STOP,
    Case,
    Op,
    Round,
    Straight,
    cases,
    made,
    moves,
    moves_of,
    needs_rs274,
    program,
    rs274,
    same,
)

# Refused though rs274 takes them; see the module's docstring.
STRICTER = ("only backward", "stopped at this inside corner", "too short for the cutter", "exit move")


@needs_rs274
@settings(max_examples=35, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cases())
def test_every_stretch_is_made_or_refused_as_linuxcnc_does(case: Case) -> None:
    printed, complaint = rs274(program(case))
    try:
        ours = made(case)
    except ProgramError as error:
        assert complaint or any(words in str(error) for words in STRICTER), error
        return
    assert not complaint, complaint
    assert same(ours, moves_of(printed)), (ours, moves_of(printed))


def straight(*points: tuple[float, float]) -> tuple[Op, ...]:
    return tuple(Straight(False, (*point, 0.0)) for point in points)


def test_an_outside_corner_gets_an_arc_around_the_programmed_corner() -> None:
    case = Case("XY", LEFT, 3.0, (0.0, -20.0, 0.0), (*straight((0, 0), (0, 30), (40, 30)), OFF))
    assert made(case)[1:] == [
        ("STRAIGHT_FEED", (-3, 0, 0, 0, 0, 0)),
        ("STRAIGHT_FEED", (-3, 30, 0, 0, 0, 0)),
        ("ARC_FEED", (0, 33, 0, 30, -1, 0, 0, 0, 0)),
        ("STRAIGHT_FEED", (40, 33, 0, 0, 0, 0)),
    ]


def test_an_inside_corner_is_cut_off_where_the_offsets_cross() -> None:
    case = Case("XY", RIGHT, 3.0, (0.0, -20.0, 0.0), (*straight((0, 0), (0, 30), (40, 30)), OFF))
    ends = [values[:2] for _, values in made(case)[1:]]
    assert ends == [pytest.approx((3, 0)), pytest.approx((3, 27)), pytest.approx((40, 27))]


@given(st.floats(-3.0, 3.0), st.sampled_from((LEFT, RIGHT)))
def test_the_cutter_touches_both_lines_at_every_corner(turned: float, side: int) -> None:
    """Entry along X, a line, a line turned by an angle: their offsets are one radius away, and end on the bisector."""
    assume(abs(turned) > 0.06)
    end = (100 + 100 * math.cos(turned), 100 * math.sin(turned))
    case = Case("XY", side, 2.0, (-50.0, 0.0, 0.0), (*straight((0, 0), (100, 0), end), OFF))
    rows = made(case)[2:]
    assert rows[0][1][1] == pytest.approx(2.0 * side)
    inside = (turned > 0) == (side == LEFT)
    assert [name for name, _ in rows] == ["STRAIGHT_FEED"] + ["ARC_FEED"] * (not inside) + ["STRAIGHT_FEED"]
    corner = (100.0, 0.0)
    if inside:
        assert math.dist(rows[0][1][:2], corner) == pytest.approx(2.0 / math.cos(turned / 2))
    else:
        assert math.dist(rows[0][1][:2], corner) == pytest.approx(2.0)
        assert math.dist(rows[1][1][:2], corner) == pytest.approx(2.0)


def test_calls_keep_their_place_behind_held_moves_and_bear_the_number_of_the_block_that_frees_them() -> None:
    machine = Compensation(LEFT, 1.0, "XY", (0.0, 0.0, 0.0))
    assert machine.other(Call("FLOOD_ON")) == [Call("FLOOD_ON")]  # nothing is held yet
    assert machine.straight(False, (10.0, 0.0, 0.0), (0, 0, 0), 1, (2, 10)) == []
    assert machine.other(Call("MIST_ON", line=2, n="20")) == []
    assert machine.other(Call("MESSAGE", ("hello",))) == [Call("MESSAGE", ("hello",))]  # not kept in order
    items = machine.straight(False, (20.0, 0.0, 0.0), (0, 0, 0), 3, (3, 30))
    assert [item if isinstance(item, Call) else item[:4] for item in items] == [
        (FEED, 3, 30, 1),
        Call("MIST_ON", line=2, n="030"),
    ]


def test_up_and_down_in_an_inside_corner_happens_at_the_cut_off_corner() -> None:
    ops: tuple[Op, ...] = (
        *straight((0, 0), (0, 30)),
        Straight(False, (0, 30, -5)),
        Straight(True, (0, 30, 0)),
        *straight((40, 30)),
        OFF,
    )
    rows = made(Case("XY", RIGHT, 3.0, (0.0, -20.0, 0.0), ops))[2:5]
    assert [values[:3] for _, values in rows] == [
        pytest.approx((3, 27, 0)),
        pytest.approx((3, 27, -5)),
        pytest.approx((3, 27, 0)),
    ]


def test_other_length_units_while_it_is_on() -> None:
    machine = Compensation(LEFT, 2.54, "XY", (0.0, 0.0, 0.0))
    machine.straight(False, (25.4, 0.0, 25.4), (0, 0, 0))
    machine.scale(1 / 25.4, "INCHES")
    machine.straight(False, (1.0, -1.0, 1.0), (0, 0, 0))
    rows = moves(machine.off())
    assert machine.radius == pytest.approx(0.1)
    assert rows == [("STRAIGHT_FEED", pytest.approx((1.1, -1.0, 1.0, 0, 0, 0)))]


POCKET = (*straight((0, 0), (10, 0), (10, 4), (0, 4), (0, 0)), OFF)
FAULTS: list[tuple[str, Case]] = [
    ("entry move is 3.0000 long", Case("XY", LEFT, 3.0, (-3.0, 0.0, 0.0), straight((0, 0)))),
    ("entry move is 0.0000 long", Case("XY", LEFT, 3.0, (0, 0, 5.0), straight((0, 0)))),
    ("entry arc's ends are 2.8284", Case("XY", LEFT, 3.0, (-2.0, 0, 0), (Round((0, 2, 0), (0, 0), -1),))),
    ("only backward", Case("XY", LEFT, 6.0, (10.0, 0, 0), (Round((5, 8.6602540378, 0), (0, 0), 1),))),
    ("not less than the arc's radius 10", Case("XY", LEFT, 10.0, (10.0, 0, 0), (Round((-10, 0, 0), (0, 0), 1),))),
    (
        "not less than the arc's radius 2",
        Case("XY", RIGHT, 2.0, (-9.0, 0, 0), (*straight((0, 0)), Round((4, 0, 0), (2, 0), -1))),
    ),
    ("straight move of line 6 is too short", Case("XY", LEFT, 3.0, (-20.0, 0.0, 0.0), POCKET)),
    (
        "arc of line 5 is too short",
        Case("XY", LEFT, 3, (-20, 0, 0), (*straight((0, 0)), Round((0, 4, 0), (-30, 2), 1), *straight((-20, 4)))),
    ),
    (
        "does not fit into the inside corner after line 5",
        Case("XY", LEFT, 3.0, (-20.0, 0, 0), (*straight((0, 0), (10, 0)), Round((4, -3, 0), (7, -1.5), 1))),
    ),
    ("rounding swallows it", Case("XY", LEFT, 1.0, (-1e20, 0, 0), straight((0, 1e20), (1e20, 1e20), (1e20, 0)))),
    (
        "stopped at this inside corner",
        Case("XY", LEFT, 1.0, (-20.0, 0, 0), (*straight((0, 0)), STOP, *straight((0, 9)))),
    ),
    ("exit move is 1.0000 long", Case("XY", LEFT, 3.0, (-20.0, 0, 0), (*straight((0, 0)), OFF, *straight((1, 0))))),
]


@pytest.mark.parametrize(("words", "case"), FAULTS, ids=[words for words, _ in FAULTS])
def test_what_the_cutter_cannot_do_is_refused_with_a_remedy(words: str, case: Case) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        made(case)
    assert ";" in str(caught.value)


def test_a_contour_of_tiny_moves_rounded_to_three_decimals_is_followed() -> None:
    """Inside a circle of 20 mm, in moves of 0.03 mm whose directions rounding changes by more than a degree."""
    angles = [0.0015 * k for k in range(2000)]
    points = [(round(20 * math.cos(a), 3), round(20 * math.sin(a), 3)) for a in angles]
    rows = made(Case("XY", LEFT, 3.0, (10.0, -5.0, 0.0), (*straight((20, -3), *points), OFF)))
    radii = [math.hypot(*values[:2]) for _, values in rows[10:]]
    assert max(radii) < 17.01
    assert min(radii) > 16.99


def test_a_short_move_before_one_straight_on_is_refused_though_linuxcnc_gouges_with_it() -> None:
    case = Case("XY", LEFT, 5.0, (-40.0, 0.0, 0.0), straight((0, 0), (30, 0), (30, 4), (30, 30), (0, 30)))
    with pytest.raises(ProgramError, match="straight move of line 6 is too short"):
        made(case)


@needs_rs274
def test_linuxcnc_gouges_with_a_short_move_before_one_straight_on() -> None:
    case = Case("XY", LEFT, 5.0, (-40.0, 0.0, 0.0), straight((0, 0), (30, 0), (30, 4), (30, 30), (0, 30)))
    printed, complaint = rs274(program(case))
    assert not complaint
    ends = [values[:2] for _, values in moves_of(printed)]
    assert (25.0, 4.0) in ends  # 4 mm above the first line, where 5 is the radius


@given(st.floats(1, 50), st.floats(-49, 49), st.floats(0, 6))
def test_crossings_lie_on_both(radius: float, offset: float, angle: float) -> None:
    way = (math.cos(angle), math.sin(angle))
    point = (-way[1] * offset, way[0] * offset)
    for crossing in (line_arc(point, way, (0, 0), radius, True), arc_line((0, 0), radius, point, way, True)):
        assert (crossing is None) == (abs(offset) > radius) or abs(abs(offset) - radius) < 1e-6
        if crossing is not None:
            assert math.hypot(*crossing) == pytest.approx(radius)
            assert crossing[1] * way[0] - crossing[0] * way[1] == pytest.approx(offset, abs=1e-9)
    met = line_line(point, way, (3.0, 4.0), (-way[1], way[0]))
    assert met is not None
    assert met[1] * way[0] - met[0] * way[1] == pytest.approx(offset, abs=1e-9)
    assert line_line(point, (1.0, 0.0), point, (1.0, 0.0)) is None


@given(st.floats(1, 50), st.floats(1, 50), st.floats(0.1, 90), st.booleans())
def test_arcs_cross_at_both_radii(radius: float, other: float, apart: float, left: bool) -> None:
    crossing = arc_arc((0, 0), radius, (apart, 0), other, left)
    reached = abs(radius - other) < apart < radius + other
    if crossing is None:
        assert not reached
    else:
        assert math.hypot(*crossing) == pytest.approx(radius)
        assert math.dist(crossing, (apart, 0)) == pytest.approx(other, abs=1e-5)
        assert (crossing[1] >= 0) == left or abs(crossing[1]) < 1e-6


def test_sweeps_count_full_circles() -> None:
    assert sweep((1, 0), (0, 0), 1, (0, 1)) == pytest.approx(math.pi / 2)
    assert sweep((1, 0), (0, 0), -1, (0, 1)) == pytest.approx(-1.5 * math.pi)
    assert sweep((1, 0), (0, 0), 1, (1, 0)) == pytest.approx(2 * math.pi)
    assert sweep((1, 0), (0, 0), -3, (1, 0)) == pytest.approx(-6 * math.pi)


def test_an_entry_arc_is_as_far_from_its_start_as_from_its_end() -> None:
    centre, cosine = entry_centre((10.0, 0.0), (0.0, 4.0), (1.0, 0.0))
    assert centre is not None
    assert math.dist(centre, (10, 0)) == pytest.approx(math.dist(centre, (0, 4)))
    assert centre[1] == pytest.approx(4.0)
    assert cosine == pytest.approx(10 / math.hypot(10, 4))
