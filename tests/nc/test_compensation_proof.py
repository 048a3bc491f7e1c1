"""The proof of compensation: zero on sound contours, gouges found at their depth, distances checked by other means."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rds.nc.compensation.compensation import LEFT, RIGHT
from rds.nc.compensation.moves import Stretch
from rds.nc.compensation.proof import Proof, StretchProof, measure
from rds.nc.compensation.proof_geometry import Contour, Curve
from rds.nc.compensation.proof_pieces import CONTOUR, ENTRY, EXIT, LEAD_IN, LEAD_OUT, RAPID
from rds.nc.language.errors import ProgramError

from .compensation_cases import OFF, Case, Op, Round, Straight, cases, made


def proved(case: Case, units: str = "MM") -> StretchProof:
    record: list[Stretch] = []
    made(case, record)
    record[0].units = units
    return measure(record[0])


def straight(*points: tuple[float, float]) -> tuple[Op, ...]:
    return tuple(Straight(False, (*point, 0.0)) for point in points)


def arc(end: tuple[float, float], centre: tuple[float, float], turn: int) -> Round:
    return Round((*end, 0.0), centre, turn)


PART: tuple[Op, ...] = (
    *straight((-10, 10)),
    arc((0, 20), (-10, 20), 1),
    *straight((0, 50)),
    arc((10, 60), (10, 50), -1),
    *straight((30, 60), (40, 45), (50, 60), (70, 60)),
    arc((70, 20), (70, 40), -1),
    *straight((55, 20)),
    arc((35, 20), (45, 20), 1),
    *straight((30, 0), (0, 0), (0, 20)),
    arc((-10, 30), (-10, 20), 1),
    OFF,
    *straight((-30, 30)),
)


@pytest.mark.parametrize("plane", ["XY", "XZ"])
def test_a_part_with_corners_and_arcs_of_all_kinds_is_touched_everywhere(plane: str) -> None:
    found = proved(Case(plane, LEFT, 3.0, (-30.0, 10.0, 0.0), PART))
    assert found.max_deviation < 1e-9
    assert found.gouges() == []
    assert found.range(ENTRY) == pytest.approx((7.0, 27.0))  # 10 and 30 mm from the contour, less the radius
    for role in (LEAD_IN, LEAD_OUT):  # arcs of 90°
        assert found.range(role) == pytest.approx((0.0, 7.0), abs=1e-9)
    assert found.range(EXIT) == pytest.approx((7.0, 27.0))
    # of 2·atan(10/15) the V keeps r/sin(half) - r
    assert found.uncut == pytest.approx(3.0 / math.sin(math.atan2(10, 15)) - 3.0)


@given(
    st.lists(st.floats(0.1, 1.0), min_size=3, max_size=12),
    st.floats(10, 100),
    st.floats(0.1, 9.0),
    st.sampled_from((LEFT, RIGHT)),
)
def test_around_any_convex_polygon_the_edge_never_leaves_the_contour(
    steps: list[float], size: float, radius: float, side: int
) -> None:
    """Corners on a circle, from outside: clockwise with the cutter left, counter-clockwise with it right."""
    angles = np.cumsum(steps) / sum(steps) * 2 * np.pi
    assume(np.diff(np.append(angles, angles[0] + 2 * np.pi)).min() > 0.06)
    corners = [(size * math.cos(-side * a), size * math.sin(-side * a)) for a in angles]
    way = (np.array(corners[1]) - corners[0]) / math.dist(corners[1], corners[0])
    before = np.array(corners[0]) - way * size  # a lead-in along the first side
    start = before - 2 * size * way + (radius + 1) * side * np.array([-way[1], way[0]])
    away = np.array(corners[-1]) + (np.array(corners[0]) - corners[-1]) * 2.0
    ops = (*straight(tuple(before), *corners, corners[0]), OFF, *straight(tuple(away + 50)))
    assume(math.dist(away + 50, corners[0]) > radius)
    found = proved(Case("XY", side, radius, (*start, 0.0), ops))
    assert found.max_deviation < 1e-6
    assert not [part for part in found.gouges() if part.role in (ENTRY, LEAD_IN, CONTOUR)]
    assert len(found.of(CONTOUR)) >= 2 * len(corners) - 1


KEYHOLE = (
    *straight((0, 0), (0, 30), (20, 30), (20, 18), (12, 18), (12, 4), (32, 4), (32, 18), (24, 18), (24, 30)),
    *straight((40, 30), (40, 0), (0, 0)),
    OFF,
    *straight((-10, -10)),
)


def test_a_neck_narrower_than_the_cutter_is_gouged_by_the_difference() -> None:
    """The neck is 4 mm wide: a cutter of 4.8 mm follows each wall and cuts 0.8 mm into the other."""
    found = proved(Case("XY", LEFT, 2.4, (-10.0, -20.0, 0.0), KEYHOLE))
    assert found.max_deviation == pytest.approx(0.8)
    assert found.range(CONTOUR) == pytest.approx((-0.8, 0.0), abs=1e-9)
    assert {part.line for part in found.gouges() if part.least == pytest.approx(-0.8)} >= {7, 13}
    fits = proved(Case("XY", LEFT, 1.9, (-10.0, -20.0, 0.0), KEYHOLE))
    assert fits.max_deviation < 1e-9
    assert fits.gouges() == []


def test_the_last_digit_of_a_program_is_no_gouge() -> None:
    ops = (*straight((0, 10), (0, 50)), arc((7.071, 67.071), (24.142, 50), -1), *straight((40.0, 70.333)))
    found = proved(Case("XY", LEFT, 3.0, (-20.0, 10.0, 0.0), ops))
    assert -1e-4 < found.parts[1].least < -1e-5 and found.gouges() == []
    assert [part.role for part in found.gouges(1e-5)] == ["contour", "contour"]


def test_an_entry_across_the_contour_is_found_and_told_apart() -> None:
    """From inside the square outwards: the edge is beyond the contour by the cutter's radius and the way in."""
    square = straight((0, 0), (0, 30), (30, 30), (30, 0), (0, 0))
    found = proved(Case("XY", LEFT, 2.0, (15.0, 15.0, 0.0), (*square, OFF, *straight((-20, -20)))))
    entry = found.range(ENTRY)
    assert entry is not None and entry[0] == pytest.approx(-17.0)
    assert found.range(CONTOUR) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert {part.role for part in found.gouges()} == {ENTRY}


@given(st.floats(0.005, 0.049))
def test_flat_corners_left_as_they_are_show_their_little_gouge(turned: float) -> None:
    """LinuxCNC takes a corner below 0.05 rad for none: the edge goes r(1 - cos) too deep there."""
    end = (50 + 50 * math.cos(turned), 50 * math.sin(turned))
    found = proved(Case("XY", LEFT, 4.0, (-20.0, 0.0, 0.0), straight((0, 0), (50, 0), end)))
    assert found.range(CONTOUR) == pytest.approx((-4.0 * (1 - math.cos(turned)), 0.0), abs=1e-9)


def test_a_helix_with_full_circles_is_one_closed_contour() -> None:
    ops = (
        Round((20.0, 0.0, 0.0), (10.0, 0.0), 1),
        Round((20.0, 0.0, -6.0), (0.0, 0.0), 3),
        Round((0.0, 20.0, -6.0), (0.0, 0.0), 1),
        Round((0.0, 0.0, -6.0), (0.0, 10.0), 1),
        OFF,
        Straight(False, (10.0, 5.0, -6.0)),
    )
    found = proved(Case("XY", LEFT, 4.0, (0.0, 0.0, 1.0), ops))
    assert found.max_deviation < 1e-9
    assert found.gouges() == []
    contour = found.of(CONTOUR)
    length = sum(part.distance[-1] - part.distance[0] for part in contour)
    assert length == pytest.approx(2 * math.pi * 16 * 3.25)


def test_rapids_are_told_apart_and_begin_another_contour() -> None:
    square = ((0, -9), (0, 10), (10, 10), (10, 0), (-9, 0))
    rapids = (Straight(True, (-9.0, -30.0, 0.0)), Straight(True, (60.0, -30.0, 0.0)))
    again = straight(*((u + 60, v) for u, v in square))
    case = Case("XY", LEFT, 1.0, (-20.0, -15.0, 0.0), (*straight(*square), *rapids, *again, OFF, *straight((30, 0))))
    found = proved(case)
    assert len(found.chains) == 2
    assert found.of(RAPID)
    assert found.max_deviation < 1e-9


def test_inches_are_measured_in_mm() -> None:
    case = Case("XY", RIGHT, 0.1, (0.0, -2.0, 0.0), (*straight((0, 0), (0, 3), (4, 3)), OFF, *straight((4, 1))))
    found = proved(case, "INCHES")
    assert found.radius == pytest.approx(2.54)
    assert found.uncut == pytest.approx(2.54 * (math.sqrt(2) - 1))


_SPIRAL = 1e-6  # programs are written to 1e-6, so are ends of arcs


@settings(max_examples=30, deadline=None)
@given(cases())
def test_distances_agree_with_those_of_many_points(case: Case) -> None:
    """Least and greatest of every piece, against points 1/400 apart on the piece and on the contour."""
    record: list[Stretch] = []
    try:
        made(case, record)
    except ProgramError:
        assume(False)
    assume(record[0].programmed)
    found = measure(record[0])
    steps = np.linspace(0, 1, 401)
    for number, chain in enumerate(found.chains):
        curves = chain.contour_curves
        points = np.concatenate([curve.at(steps) for curve in curves])
        slack = max(curve.length for curve in curves) / 400 + 2 * _SPIRAL
        contour = chain.contour(record[0].side)
        assert len(contour.boxes) == len(curves)
        for part in (part for part in found.parts if part.role == CONTOUR or len(found.chains) == 1):
            if part.role == RAPID or number:
                continue
            path = part.curve.at(steps[::8])
            near = np.hypot(*(path[:, None, :] - points[None, :, :]).transpose(2, 0, 1)).min(axis=1)
            size = np.abs(part.deviation + found.radius)
            if len(found.chains) == 1:
                assert size.min() <= near.min() + 1e-6
                assert near.min() <= size.min() + slack + part.curve.length / 50
                assert size.max() >= near.max() - slack
                exact = np.abs(contour.distance(path))
                assert np.all(exact <= near + 1e-6)
                assert np.all(near <= exact + slack)


def test_distances_have_the_side_of_the_contour_in_their_sign() -> None:
    square = [Curve((0, 0), (0, 10)), Curve((0, 10), (10, 10)), Curve((10, 10), (10, 0)), Curve((10, 0), (0, 0))]
    contour = Contour(square, LEFT, closed=True)
    points = np.array([(-3.0, 5.0), (3.0, 5.0), (-3.0, 14.0), (5.0, 4.0), (0.0, 0.0), (13.0, -4.0)])
    assert contour.distance(points) == pytest.approx([3, -3, 5, -4, 0, 5])
    ring = Contour([Curve((5, 0), (5, 0), (0, 0), 1)], LEFT, closed=True)
    assert ring.distance(np.array([(1.0, 0.0), (0.0, 7.0), (0.0, 0.0)])) == pytest.approx([4, -2, 5])


def test_the_picture_shows_plane_and_deviations_with_units(tmp_path: Path) -> None:
    proof = Proof("part.ngc", (proved(Case("XY", LEFT, 3.0, (-30.0, 10.0, 0.0), PART)),))
    figure = proof.plot()
    plane, whole, alone = figure.axes
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("X [mm]", "Y [mm]")
    assert whole.get_ylabel() == "edge to contour [mm]"
    assert alone.get_ylabel() == "edge to contour [nm]"
    assert "no gouge" in figure.get_suptitle()
    figure.savefig(tmp_path / "proof.png")
    assert (tmp_path / "proof.png").stat().st_size > 10_000


def test_the_numbers_name_gouges_by_line_and_depth() -> None:
    proof = Proof("", (proved(Case("XY", LEFT, 2.4, (-10.0, -20.0, 0.0), KEYHOLE)),))
    numbers = proof.numbers()
    assert numbers["max_deviation_mm"] == pytest.approx(0.8)
    assert {"line": 7, "role": "contour", "depth_mm": pytest.approx(0.8)} in numbers["gouges"]
    assert numbers["stretches"][0]["radius_mm"] == 2.4
    assert "gouges" in proof.plot().get_suptitle()
