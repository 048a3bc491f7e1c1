"""Lines, quadrilaterals, arcs and cones: the objects of three-axis-mill."""

from __future__ import annotations

from math import ceil, cos, hypot, nextafter, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.core.geometry import length, sweep
from rds.core.types import ArcSegment, LineSegment
from rds.nc import arc, line, part_program, quadrilateral, quadrilateral_by_moves, spiral_cone
from rds.nc.paths.cone import chord_angle, chord_error
from rds.nc.paths.measure import extent, is_closed, pieces, sampled, total_length
from tests.paths.programs import agreed, assert_cuts

FEED = 5.0  # mm/s
coordinates = st.floats(-1000, 1000)


def test_a_line_moves_all_axes_together() -> None:
    (cut,) = line((0, 0), (3, 4, -12), FEED)
    assert cut == LineSegment((0, 0, 0), (3, 4, -12), FEED)
    assert length(cut) == 13


def test_a_quadrilateral_comes_back_to_its_first_corner() -> None:
    corners = [(0, 0), (20, 0, -1), (25, 10, -2), (-5, 8)]
    path = quadrilateral(corners, FEED)
    assert [segment.start[:2] for segment in path] == [corner[:2] for corner in corners]
    assert is_closed(path) and len(pieces(path)) == 1


@given(st.lists(st.tuples(coordinates, st.floats(1, 100), st.floats(-5, 5)), min_size=3, max_size=3))
def test_a_quadrilateral_by_moves_has_these_sides(moves: list[tuple[float, float, float]]) -> None:
    try:
        path = quadrilateral_by_moves((1, 2, 3), moves, FEED)
    except InputError as error:  # the third move may lead to the start
        assert "same point" in str(error)
        return
    for segment, (direction, across, rise) in zip(path, moves, strict=False):
        x, y, z = np.subtract(segment.end, segment.start)
        assert np.allclose((x, y, z), (across * cos(radians(direction)), across * sin(radians(direction)), rise))
    assert path[-1].end == path[0].start == (1, 2, 3)


def source_arc(xc: float, yc: float, depth: float, R: float, start: float, turned: int) -> np.ndarray:
    """The points of an arc as the calculation task of three-axis-mill makes them, without its first one, the origin."""
    i = np.arange(1, turned * 2 + 2)
    angles = radians(1) * (start + (i - 1) / 2.0)
    return np.column_stack([xc + R * np.cos(angles), yc + R * np.sin(angles), np.full(len(i), -depth)])


@pytest.mark.parametrize("turned", [1, 90, 360])
def test_an_arc_goes_through_the_points_of_the_source(turned: int) -> None:
    points = source_arc(3, -4, 2, 7, 30, turned)
    (cut,) = arc((3, -4), 7, 30, turned, FEED, depth=2)
    assert np.allclose(cut.start, points[0]) and np.allclose(cut.end, points[-1])
    assert np.allclose(np.hypot(points[:, 0] - 3, points[:, 1] + 4), 7)
    assert np.degrees(sweep(cut)) == pytest.approx(turned)  # type: ignore[arg-type]


@pytest.mark.parametrize("start", [0.0, 30.0, 267.7655405799703, 351.3])
@pytest.mark.parametrize("swept", [360.0, nextafter(360.0, 361.0), nextafter(360.0, 0.0), -nextafter(720.0, 721.0)])
def test_a_circle_whose_sweep_is_rounded_is_one_circle(start: float, swept: float) -> None:
    segments = arc((3.25, -7.5), 12.3, start, swept, 5.0)
    assert total_length(segments) == pytest.approx(abs(swept) * pi / 180 * 12.3, rel=1e-9)
    assert len(segments) == round(abs(swept) / 360) and segments[-1].end == segments[0].start
    assert total_length(arc((0, 0), 5.0, start, 1e-7, 5.0)) == pytest.approx(1e-7 * pi / 180 * 5, rel=1e-3)


@given(st.floats(0.01, 500), st.floats(-720, 720), st.floats(-1500, 1500), st.floats(-10, 10), st.floats(-10, 10))
def test_an_arc_is_as_long_as_its_sweep(r: float, start: float, swept: float, top: float, bottom: float) -> None:
    if abs(swept) < 1e-3:
        return
    path = arc((10, 20), r, start, swept, FEED, depth=top, end_depth=bottom)
    assert len(path) == ceil(abs(swept) / 360)
    around = radians(abs(swept)) * r
    assert total_length(path) == pytest.approx(hypot(around, top - bottom), rel=1e-6)
    assert path[0].start[2] == pytest.approx(-top) and path[-1].end[2] == pytest.approx(-bottom, abs=1e-12)
    end = (10 + r * cos(radians(start + swept)), 20 + r * sin(radians(start + swept)))
    assert path[-1].end[:2] == pytest.approx(end, abs=1e-6)
    assert len(pieces(path)) == 1


def source_cone(xc: float, yc: float, height: float, R: float, step_up: float, step_radius: float) -> np.ndarray:
    """The points of a spiral cone as three-axis-mill makes them, without its first one, the origin."""
    points, z = [], -height
    for i in range(1, int(180 * (height / step_up + 1)) + 2):
        if i >= 182:
            R, z = R - step_radius / 180, z + step_up / 180
        angle = (pi / 180) * 2.0 * (i - 1)
        points.append((xc + R * cos(angle), yc + R * sin(angle), z))
    return np.array(points)


def test_a_cone_goes_through_the_points_of_the_source() -> None:
    points = source_cone(1, 2, 10, 20, 2, 3)
    circle, *chords = spiral_cone((1, 2), 20, 10, 2, 3, FEED)
    assert isinstance(circle, ArcSegment) and sweep(circle) == 2 * pi
    assert np.allclose(np.hypot(*(points[:181, :2] - (1, 2)).T), 20) and np.allclose(points[:181, 2], -10)
    assert np.allclose([chord.end for chord in chords], points[181:], atol=1e-9)
    assert chords[-1].end == pytest.approx((1 + 20 - 5 * 3, 2, 0), abs=1e-12)


@given(st.floats(1, 50), st.floats(0.5, 20), st.floats(0.3, 5), st.floats(0, 1), st.floats(0.001, 0.5))
def test_chords_of_a_cone_keep_within_the_tolerance(r: float, h: float, rise: float, part: float, tol: float) -> None:
    width = part * r * rise / h
    path = spiral_cone((0, 0), r, h, rise, width, FEED, tolerance=tol)
    step = chord_angle(r, width, tolerance=tol)
    assert chord_error(r, width, step) <= tol * (1 + 1e-9)
    assert path[-1].end[2] == 0 and len(pieces(path)) == 1
    # the true spiral half-way along each of the first chords is that near to the chord
    for k, chord in enumerate(path[1:20]):
        turn = min((k + 0.5) * step / 360, (k * step / 360 + h / rise) / 2)
        now = r - width * turn
        a = np.array([now * cos(2 * pi * turn), now * sin(2 * pi * turn), -h + rise * turn])
        start, along = np.array(chord.start), np.subtract(chord.end, chord.start)
        nearest = start + np.clip((a - start) @ along / (along @ along), 0, 1) * along
        assert np.linalg.norm(a - nearest) <= tol + 1e-9


@given(st.floats(0.1, 100), st.floats(-400, 400), st.floats(-359, 359).filter(lambda s: abs(s) > 0.1))
def test_the_extent_of_an_arc_has_its_extremes(r: float, start: float, swept: float) -> None:
    (cut,) = arc((5, -5), r, start, swept, FEED)
    angles = np.radians(start + np.linspace(0, 1, 4001) * swept)
    x, y = 5 + r * np.cos(angles), -5 + r * np.sin(angles)
    found = extent([cut])
    assert np.allclose(found[:2], [(x.min(), x.max()), (y.min(), y.max())], atol=r * 4e-6 + 1e-9)
    error = np.abs(np.hypot(*(sampled(cut, 1e-3)[:, :2] - (5, -5)).T) - r)
    assert error.max() < 1e-9 * max(r, 1)


@pytest.mark.parametrize(
    "path",
    [
        line((0, 0), (3, 4, -12), FEED),
        quadrilateral([(0, 0), (20, 0), (25, 10), (-5, 8)], FEED),
        arc((10, 10), 5, 30, -800, FEED, end_depth=3),
        arc((0, 0), 2e-3, 0, 360, FEED),
        spiral_cone((0, 0), 20, 10, 2, 3, FEED),
    ],
    ids=["line", "quad", "helix", "circle of 2 µm", "cone"],
)
@pytest.mark.parametrize("safe", [None, 5.0])
def test_their_programs_cut_them(path: list, safe: float | None) -> None:
    program = part_program(path, "an object", safe_height=safe, spindle=8000, blend=0.01)
    assert_cuts(program, path)
    agreed(program)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: line((1, 2), (1, 2, 0), FEED), ["start and end are the same point (1, 2, 0)"]),
        (lambda: line((1, 2), (1, float("nan")), FEED), ["y of end = nan", "finite"]),
        (lambda: line((1,), (1, 2), FEED), ["start = (1,) must be x, y or x, y, z in mm"]),
        (lambda: line("12", (1, 2), FEED), ["start = '12'"]),
        (lambda: line((0, 0), (1e9, 2), FEED), ["x of end = 1000000000.0", "at most 1e+06"]),
        (lambda: line((0, 0), (1, 2), 0.0), ["feed rate = 0.0 must be more than 0"]),
        (lambda: quadrilateral([(0, 0), (1, 0), (1, 1)], FEED), ["3 corners; a quadrilateral has 4"]),
        (lambda: quadrilateral([(0, 0), (1, 0), (1, 0), (0, 1)], FEED), ["corner 2 and corner 3 are the same point"]),
        (lambda: quadrilateral_by_moves((0, 0), [(0, 1, 0), (90, 1, 0)], FEED), ["2 moves; give 3"]),
        (lambda: quadrilateral_by_moves((0, 0), [(0, -1, 0)] * 3, FEED), ["length of move 1 = -1", "more than 0"]),
        (lambda: arc((0, 0), 0, 0, 90, FEED), ["radius = 0 must be more than 0"]),
        (lambda: arc((0, 0), 1, 0, 0, FEED), ["sweep = 0 is no arc", "360"]),
        (lambda: arc((0, 0), 1, 0, 1e10, FEED), ["sweep"]),
        (lambda: arc((0, 0, 0), 1, 0, 10, FEED), ["centre = (0, 0, 0) must be x, y in mm"]),
        (lambda: spiral_cone((0, 0), 5, 10, 1, 1, FEED), ["go past the centre", "at most 0.5 mm"]),
        (lambda: spiral_cone((0, 0), 5, 10, 0, 1, FEED), ["step height = 0 must be more than 0"]),
        (lambda: spiral_cone((0, 0), 5, 10, 1e-6, 0, FEED), ["chords; take a larger step height"]),
        (lambda: spiral_cone((0, 0), 5, 10, 1, 0, FEED, step_angle=2, tolerance=1), ["give one of them"]),
        (lambda: spiral_cone((0, 0), 5, 10, 1, 0, FEED, step_angle=90), ["at most 45"]),
    ],
)
def test_what_is_no_object_is_refused(make, words: list[str]) -> None:
    with pytest.raises(InputError) as refusal:
        make()
    assert all(word in str(refusal.value) for word in words), str(refusal.value)
