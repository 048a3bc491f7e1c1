"""Constant velocity: on the path, at the feed rate, to its end; velocity and acceleration are those of the path."""

from __future__ import annotations

from math import ceil

import numpy as np
import pytest
from hypothesis import given

from interpolators.strategies import arcs, lines
from rds.core.errors import InputError
from rds.core.geometry import length, radius, sweep
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.interpolators import circular, constant_velocity, interpolator_module, interpolator_names, linear
from rds.interpolators.deviation import distances

T = 0.01


def rows_of(segment: Segment, T: float = T, module=constant_velocity) -> np.ndarray:
    return np.array(list(module.interpolate(segment, T, {})))


@given(lines(axes=3))
def test_lines(segment: LineSegment) -> None:
    rows = rows_of(segment)
    N = len(rows)
    assert ceil(length(segment) / segment.feed_rate / T - 1e-9) == N
    assert tuple(rows[-1, 0]) == segment.end
    assert distances(segment, rows[:, 0]).max() < 1e-9
    speed = np.linalg.norm(rows[:, 1], axis=1)
    assert np.allclose(speed, length(segment) / (N * T)) and speed.max() <= segment.feed_rate * (1 + 1e-9)
    steps = np.diff(np.vstack([segment.start, rows[:, 0]]), axis=0)
    assert np.allclose(steps, rows[:, 1] * T, atol=1e-10)
    assert not rows[:, 2].any()


@given(arcs(helix=True))
def test_arcs_and_helices(segment: ArcSegment) -> None:
    rows = rows_of(segment)
    N, R = len(rows), radius(segment)
    assert ceil(length(segment) / segment.feed_rate / T - 1e-9) == N
    assert tuple(rows[-1, 0]) == segment.end
    centred = rows[:, 0, :2] - np.array(segment.centre[:2])
    assert np.abs(np.hypot(*centred.T) - R).max() < 1e-8
    assert np.allclose(np.linalg.norm(rows[:, 1], axis=1), length(segment) / (N * T))
    # the acceleration points to the centre and is v²/R of the motion in the plane
    in_plane = R * abs(sweep(segment)) / (N * T)
    assert np.allclose(rows[:, 2, :2], -centred * (in_plane / R) ** 2, atol=1e-6)
    rise = np.linspace(segment.start[2], segment.end[2], N + 1)[1:]
    assert np.allclose(rows[:, 0, 2], rise, atol=1e-9)
    assert distances(segment, rows[:, 0]).max() < 1e-7


def test_the_velocity_is_the_derivative() -> None:
    rows = rows_of(ArcSegment((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), 20.0, clockwise=True), T=1e-3)
    measured = (rows[2:, 0] - rows[:-2, 0]) / 2e-3
    assert np.abs(measured - rows[1:-1, 1]).max() < 1e-4  # mm/s of 20; the error of the difference is v³T²/(6R²)
    measured = (rows[2:, 1] - rows[:-2, 1]) / 2e-3
    assert np.abs(measured - rows[1:-1, 2]).max() < 2e-4


def test_blocks_of_rows_do_not_show() -> None:
    rows = rows_of(LineSegment((0.0,), (3000.0,), 1.0), T=1.0)
    assert np.allclose(np.diff(rows[:, 0, 0]), 1.0, atol=1e-9) and len(rows) == 3000


def test_an_end_off_the_circle_is_reached_evenly() -> None:
    segment = ArcSegment((10.0, 0.0), (0.0, 10.02), (0.0, 0.0), 10.0)
    rows = rows_of(segment)
    radii = np.hypot(*rows[:, 0].T)
    assert tuple(rows[-1, 0]) == segment.end
    assert np.diff(radii).min() > -1e-6 and np.abs(np.diff(radii)).max() < 2e-4


@pytest.mark.parametrize(
    ("segment", "said"),
    [
        (ArcSegment((10.0, 0.0), (0.0, 10.1), (0.0, 0.0), 1.0), "10.1000 mm from the centre"),
        (ArcSegment((0.0, 0.0), (0.0, 1.0), (0.0, 0.0), 1.0), "centre of the arc is its start"),
        (ArcSegment((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), 1.0, plane=(0, 2)), "two different axes by index, 0 to 1"),
        (LineSegment((0.0, 0.0), (1.0,), 1.0), "differ in the number of axes"),
        (LineSegment((0.0, float("nan")), (1.0, 1.0), 1.0), "must be finite"),
        (LineSegment((0.0,), (1.0,), 0.0), "feed_rate = 0.0 mm/s must be"),
    ],
)
def test_refused_by_every_method(segment: Segment, said: str) -> None:
    for name in interpolator_names():
        if name not in ("linear", "circular"):
            with pytest.raises(InputError, match=said):
                next(interpolator_module(name).interpolate(segment, T, {}))


def test_each_says_what_it_does_not_take() -> None:
    with pytest.raises(InputError, match="use constant-velocity or circular"):
        next(linear.interpolate(ArcSegment((1.0, 0.0), (0.0, 1.0), (0.0, 0.0), 1.0), T, {}))
    with pytest.raises(InputError, match="use constant-velocity or linear"):
        next(circular.interpolate(LineSegment((0.0,), (1.0,), 1.0), T, {}))
    with pytest.raises(InputError, match=r"T = -1.0 s"):
        next(linear.interpolate(LineSegment((0.0,), (1.0,), 1.0), -1.0, {}))


@pytest.mark.parametrize("name", interpolator_names())
def test_a_line_without_length_takes_no_time(name: str) -> None:
    if name != "circular":
        assert not list(interpolator_module(name).interpolate(LineSegment((1.0, 2.0), (1.0, 2.0), 5.0), T, {}))
