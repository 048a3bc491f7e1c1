"""The contour error against dense sampling of the path, for lines, arcs and helices in all planes."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.interpolators.motion.segments import XY, YZ, ZX, arc, chain, in_plane, line, point_at, points_at
from rds.nc.run.contour import contour_error

DENSE = 1500

number = st.floats(-20.0, 20.0)
point = st.tuples(number, number, number)


@st.composite
def arcs(draw: st.DrawFn) -> np.ndarray:
    """An arc, a full circle or a helix of up to two and a half turns."""
    plane = draw(st.sampled_from([XY, ZX, YZ]))
    first, second, normal = in_plane(plane)
    centre, radius = np.array(draw(point)), draw(st.floats(0.5, 15.0))
    from_, sweep = draw(st.floats(-pi, pi)), draw(st.floats(0.05, 2.0 * pi))
    rise, turns = draw(st.sampled_from([0.0, 3.0, -8.0])), draw(st.sampled_from([0, 0, 1]))
    start, end = centre.copy(), centre.copy()
    for place, angle in ((start, from_), (end, from_ + sweep)):
        place[[first, second]] += radius * np.array([np.cos(angle), np.sin(angle)])
    end[normal] += rise
    return arc(start, end, centre, 10.0, clockwise=draw(st.booleans()), turns=turns if rise else 0, plane=plane)


def brute(points: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, float]:
    """Distance to the nearest of many points of the path, and how far it may be too large."""
    share = np.tile(np.linspace(0.0, 1.0, DENSE), len(path))
    dense = points_at(np.repeat(path, DENSE), share)[:, :3]
    distance = np.array([np.linalg.norm(dense - p, axis=1).min() for p in points])
    return distance, float(path["length"].max()) / DENSE


@settings(max_examples=40)
@given(segment=arcs(), offs=st.lists(st.tuples(st.floats(0.0, 1.0), point), min_size=1, max_size=4))
def test_the_distance_to_an_arc_is_the_least(
    segment: np.ndarray, offs: list[tuple[float, tuple[float, float, float]]]
) -> None:
    """Of points that are off by up to half of its radius: an axis does not lag by more."""
    arm = segment["start"][0, :3] - segment["centre"][0]
    radius = np.linalg.norm(arm[list(in_plane(int(segment["plane"][0]))[:2])])
    p = np.array(
        [point_at(segment[0], share * segment["length"][0])[:3] + np.array(off) / 40.0 * radius for share, off in offs]
    )
    found, nearest = contour_error(p, segment, np.zeros(len(p), int), np.full(len(p), 100.0))
    dense, step = brute(p, segment)
    assert (nearest == 0).all()
    assert (found <= dense + 1e-9).all()
    assert (found >= dense - step).all()


@settings(max_examples=25)
@given(corners=st.lists(point, min_size=3, max_size=6, unique=True), points=st.lists(point, min_size=1, max_size=4))
def test_the_distance_to_lines_is_the_least(
    corners: list[tuple[float, float, float]], points: list[tuple[float, float, float]]
) -> None:
    path = chain(*(line(a, b, 10.0) for a, b in pairwise(corners)))
    p = np.array(points)
    found, nearest = contour_error(p, path, np.zeros(len(p), int), np.full(len(p), 1000.0))
    dense, step = brute(p, path)
    assert (found <= dense + 1e-9).all()
    assert (found >= dense - step).all()
    for k, segment in enumerate(nearest):
        alone, _ = contour_error(p[k : k + 1], path[segment : segment + 1], np.zeros(1, int), np.full(1, 1.0))
        assert alone[0] == found[k]


@settings(max_examples=40)
@given(segment=arcs(), share=st.floats(0.0, 1.0))
def test_a_point_of_the_path_is_not_off_it(segment: np.ndarray, share: float) -> None:
    p = point_at(segment[0], share * segment["length"][0])[None, :3]
    found, _ = contour_error(p, segment, np.zeros(1, int), np.full(1, 1.0))
    assert found[0] < 1e-9


def test_a_point_opposite_to_an_arc_is_as_far_as_its_nearer_end() -> None:
    quarter = chain(arc((10, 0, 0), (0, 10, 0), (0, 0), 10.0))
    points = np.array([[-10.0, 0.0, 0.0], [0.0, -10.0, 0.0], [0.0, -10.0, 3.0]])
    found, _ = contour_error(points, quarter, np.zeros(3, int), np.full(3, 100.0))
    assert np.abs(found - np.sqrt([200.0, 200.0, 209.0])).max() < 1e-12


def test_only_the_path_near_the_motion_counts() -> None:
    """A second pass beside the first, 0.1 mm away: each measured point belongs to its own pass."""
    there, back = line((0, 0, 0), (50, 0, 0), 10.0), line((50, 0.1, 0), (0, 0.1, 0), 10.0)
    corners = [(50, 0, 0), (60, 0, 0), (60, 0.1, 0), (50, 0.1, 0)]
    path = chain(there, *(line(a, b, 10.0) for a, b in pairwise(corners)), back)
    p = np.array([[20.0, 0.09, 0.0]])
    for segment, expected in ((0, 0.09), (4, 0.01)):
        found, nearest = contour_error(p, path, np.array([segment]), np.array([0.1]))
        assert nearest[0] == segment
        assert abs(found[0] - expected) < 1e-12


def test_a_point_far_behind_or_ahead_of_its_reference_belongs_to_the_segment_where_it_is() -> None:
    path = chain(*(line((k, 0, 0), (k + 1, 0, 0), 10.0) for k in range(10)))
    p = np.array([[2.4, 0.3, 0.0], [7.4, -0.3, 0.0]])
    found, nearest = contour_error(p, path, np.array([7, 2]), np.full(2, 5.0))
    assert nearest.tolist() == [2, 7] and np.abs(found - 0.3).max() < 1e-12


def test_a_circle_is_as_long_as_its_arc_and_earlier_turns_do_not_count() -> None:
    """From start to end of a full circle there is no way at all: four turns would all be near each other."""
    turns = chain(*(arc((10, 0, 0), (10, 0, 0), (0, 0), 10.0) for _ in range(4)))
    found, nearest = contour_error(np.array([[-10.1, 0.0, 0.0]]), turns, np.array([3]), np.array([0.1]))
    assert nearest[0] in (2, 3) and abs(found[0] - 0.1) < 1e-12


def test_an_arc_that_ends_off_its_circle_goes_there_evenly() -> None:
    uneven = arc((10, 0, 0), (0, 10.01, 0), (0, 0), 10.0)
    middle = points_at(uneven, np.array([0.5]))[:, :3]
    found, _ = contour_error(middle, uneven, np.zeros(1, int), np.full(1, 1.0))
    assert found[0] < 1e-12 and abs(middle[0, 1] - middle[0, 0] - 0.005) < 1e-12


def test_near_the_axis_of_a_helix_the_turn_that_is_nearest_is_found() -> None:
    """There all directions are nearly as far, and the turn and angle that the axis suggests are not the nearest."""
    helix = arc((1, 0, 0), (np.cos(2.1), np.sin(2.1), 2.6557), (0, 0), 10.0, turns=3)
    p = np.array([[0.000164, 0.000064, height] for height in np.linspace(0.2, 2.4, 12)])
    found, _ = contour_error(p, helix, np.zeros(12, int), np.full(12, 100.0))
    assert (found <= 1.001 * brute(p, helix)[0]).all(), "of all turns, and not 2 % farther off"
