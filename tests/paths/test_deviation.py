"""The Hausdorff distance that outlines are held to."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.nc.paths.deviation import ACCURACY, hausdorff

coordinates = st.floats(-10, 10).map(lambda value: round(value, 6))  # mm
points = st.lists(st.tuples(coordinates, coordinates), min_size=2, max_size=12, unique=True)


def test_it_is_exact_where_the_corners_alone_are_not() -> None:
    # the middle of the lower line is equally far from both ends of the gap: 5 mm, where its corners are at 0 mm
    a = [np.array([[0.0, 0.0], [20.0, 0.0]])]
    b = [np.array([[0.0, 0.0], [5.0, 0.0]]), np.array([[15.0, 0.0], [20.0, 0.0]])]
    assert hausdorff(a, b) == pytest.approx(5.0, abs=ACCURACY)
    corners = shapely.hausdorff_distance(shapely.MultiLineString(a), shapely.MultiLineString(b))
    assert corners == 0.0


def test_it_is_that_of_parallel_lines_and_of_a_circle_and_its_polygon() -> None:
    square = np.array([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]], dtype=float)
    assert hausdorff([square], [square]) == 0
    larger = (square - 5) * 1.2 + 5
    assert hausdorff([square], [larger]) == pytest.approx(2**0.5, abs=ACCURACY)
    angles = np.linspace(0, 2 * np.pi, 100_001)
    circle = np.column_stack([np.cos(angles), np.sin(angles)]) * 10
    assert hausdorff([circle], [circle[::12_500]]) == pytest.approx(10 * (1 - np.cos(np.pi / 8)), abs=1e-5)


@settings(max_examples=60)
@given(points, points)
def test_it_is_no_less_than_at_any_sample_and_no_more_than_between_them(first: list, second: list) -> None:
    a, b = np.array(first), np.array(second)
    found = hausdorff([a], [b])
    assert found == hausdorff([b], [a])
    spacing = 0.0
    sampled = 0.0
    for line, other in ((a, b), (b, a)):
        rows = np.vstack([np.linspace(p, q, 200) for p, q in pairwise(line)])
        distances = shapely.distance(shapely.points(rows), shapely.LineString(other))
        sampled = max(sampled, float(distances.max()))
        spacing = max(spacing, float(np.linalg.norm(np.diff(line, axis=0), axis=1).max()) / 199)
    assert sampled - ACCURACY <= found <= sampled + spacing / 2 + 1e-9
