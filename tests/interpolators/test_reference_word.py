"""Reference word: the polygon stays within one BLU of the arc, with no step more than that takes."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from interpolators.strategies import arcs, lines
from rds.core.errors import InputError
from rds.core.geometry import length, radius
from rds.core.types import ArcSegment, LineSegment
from rds.interpolators import interpolator_module
from rds.interpolators.deviation import distances
from rds.interpolators.division import Turn
from rds.interpolators.interpolator import library_interpolator
from rds.interpolators.reference_word import steps

METHODS = ("euler", "improved-euler", "taylor", "tustin", "improved-tustin")
T = 0.01
some = settings(max_examples=20)


def blu_for(name: str, R: float, share: float) -> float:
    """A BLU that asks for tens to thousands of steps."""
    return R * share * (1e-2 if "euler" in name else 1e-4)


@pytest.mark.parametrize("name", METHODS)
@some
@given(segment=arcs(), share=st.floats(0.1, 10.0))
def test_the_bound_of_one_blu_holds(name: str, segment: ArcSegment, share: float) -> None:
    blu = blu_for(name, radius(segment), share)
    taken = steps(segment, {"blu": blu}, interpolator_module(name).METHOD)
    assert taken.within and taken.radial_error <= blu * (1 + 1e-6) and taken.chord_error <= blu * (1 + 1e-6)


@pytest.mark.parametrize("name", METHODS)
@some
@given(segment=arcs(), share=st.floats(0.1, 10.0))
def test_one_step_less_would_break_it(name: str, segment: ArcSegment, share: float) -> None:
    blu = blu_for(name, radius(segment), share)
    method = interpolator_module(name).METHOD
    taken = steps(segment, {"blu": blu}, method)
    assume(taken.count > 1 + 2 * taken.sweep / pi)  # else it is 90° that a step may turn at most
    fewer = steps(segment, {"blu": blu, "steps": taken.count - 1}, method)
    # of improved Euler the bound is that of the whole ellipse: of few corners, none need be at its widest point
    slack = 10.0 / taken.count if name == "improved-euler" else 0.0
    assert max(fewer.radial_error, fewer.chord_error) > blu * (1 - slack) * (1 - 1e-6)


@pytest.mark.parametrize("name", METHODS)
@some
@given(segment=arcs(), share=st.floats(0.1, 10.0))
def test_samples_and_the_straight_way_between_them_hold_it_too(name: str, segment: ArcSegment, share: float) -> None:
    blu = blu_for(name, radius(segment), share)
    feed = min(segment.feed_rate, 0.8 * np.sqrt(8 * radius(segment) * blu) / T, length(segment) / T)
    slow = ArcSegment(segment.start, segment.end, segment.centre, float(feed), segment.clockwise)
    rows = library_interpolator(name, blu=blu).rows(slow, T)
    positions = np.vstack([slow.start, rows[:, 0]])
    assert tuple(rows[-1, 0]) == slow.end
    assert distances(slow, positions).max() <= blu * (1 + 1e-6)
    assert distances(slow, (positions[1:] + positions[:-1]) / 2).max() <= blu * (1 + 1e-6)


@given(lines(axes=2))
def test_lines_are_walked_in_words_and_a_residual(segment: LineSegment) -> None:
    word = segment.feed_rate * T
    rows = library_interpolator("improved-tustin").rows(segment, T)
    steps = np.linalg.norm(np.diff(np.vstack([segment.start, rows[:, 0]]), axis=0), axis=1)
    assert np.allclose(steps[:-1], word, rtol=1e-7)  # eq. 7.27
    residual = length(segment) - word * (len(rows) - 1)  # eq. 7.29, 7.30
    assert steps[-1] == pytest.approx(residual, abs=1e-7) and 0 < residual <= word * (1 + 1e-6)
    assert tuple(rows[-1, 0]) == segment.end
    assert np.linalg.norm(rows[-1, 1]) == pytest.approx(residual / T, abs=1e-4)  # eq. 7.31


@pytest.mark.parametrize("name", METHODS)
@settings(max_examples=12)
@given(segment=arcs(helix=True), way=st.floats(0.03, 0.3))
def test_chords_are_walked_at_the_feed_rate_and_little_slower(name: str, segment: ArcSegment, way: float) -> None:
    R, method = radius(segment), interpolator_module(name).METHOD
    blu = R * 1e-3
    slow = ArcSegment(segment.start, segment.end, segment.centre, way * np.sqrt(8 * R * blu) / T, segment.clockwise)
    rows = library_interpolator(name, blu=blu).rows(slow, T)
    speed = np.linalg.norm(np.diff(np.vstack([slow.start, rows[:, 0]]), axis=0), axis=1) / T
    assert speed.max() <= slow.feed_rate * (1 + 3e-3 + (blu / (slow.feed_rate * T)) ** 2)  # corners are outside
    taken, wanted = len(rows) * T, length(slow) / slow.feed_rate
    assert wanted * (1 - 3e-3) <= taken
    assert taken <= wanted + max(0.013 * wanted, 2 * wanted / steps(slow, {"blu": blu}, method).count) + 2 * T


@pytest.mark.parametrize("name", METHODS)
def test_velocity_and_acceleration_add_up_to_the_motion(name: str) -> None:
    segment = ArcSegment((5.0, 0.0), (0.0, 5.0), (0.0, 0.0), 3.0)
    rows = library_interpolator(name, blu=0.05).rows(segment, T)
    positions = np.vstack([segment.start, rows[:, 0]])
    assert np.allclose(np.diff(positions, axis=0), rows[:, 1] * T)
    assert np.allclose(np.diff(rows[:, 1], axis=0), rows[1:, 2] * T, atol=1e-9)


def test_what_each_recursion_does_to_the_radius() -> None:
    n = 50
    angle = pi / 2 / n
    turn = Turn(complex(100.0, 0.0), pi / 2)

    def radii(name: str) -> np.ndarray:
        return np.abs(np.array(list(interpolator_module(name).METHOD.corners(turn, n)))) / 100.0

    assert np.allclose(radii("euler"), (1 / np.cos(angle)) ** np.arange(1, n))  # √(1 + α²) each, tan = α
    assert np.allclose(radii("tustin"), 1.0, atol=1e-14)
    taylor = radii("taylor")
    assert np.allclose(taylor, taylor[0] ** np.arange(1, n)) and taylor[0] == pytest.approx(1 + angle**4 / 8, rel=1e-9)
    points = np.array(list(interpolator_module("improved-euler").METHOD.corners(turn, n))) / 100.0
    alpha = points[0].imag
    assert alpha == pytest.approx(angle, rel=2e-2)
    assert np.allclose(points.real**2 + points.imag**2 - alpha * points.real * points.imag, 1.0)
    outside = radii("improved-tustin")
    assert np.allclose(outside, outside[0], atol=1e-14) and outside[0] > 1


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"steps": 2.5}, "must be a whole number"),
        ({"steps": 3.0}, "less than a step each 90°; the arc needs 4"),
        ({"blu": 1e-9}, "needs more than"),
    ],
)
def test_refusals(params: dict[str, float], said: str) -> None:
    circle = ArcSegment((10.0, 0.0), (10.0, 0.0), (0.0, 0.0), 0.01)
    with pytest.raises(InputError, match=said):
        steps(circle, params, interpolator_module("euler").METHOD)


def test_a_feed_rate_that_cannot_hold_the_bound_is_refused_with_what_can() -> None:
    def quadrant(feed: float) -> ArcSegment:
        return ArcSegment((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), feed)

    with pytest.raises(InputError, match=r"0.95 mm in one sample .* 0.8727 mm is possible: lower .* to 91.9 % of it"):
        library_interpolator("tustin").rows(quadrant(95.0), 0.01)
    assert len(library_interpolator("tustin").rows(quadrant(10 * pi / 2 / 18 / 0.01), 0.01)) == 18


def test_euler_walks_many_steps_in_a_sample() -> None:
    quadrant = ArcSegment((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), 10.0)
    method = library_interpolator("euler")
    taken = method.steps(quadrant, 0.01)
    rows = method.rows(quadrant, 0.01)
    assert taken is not None and taken.within and len(rows) == 158
    assert taken.count == taken.least == 1234  # π² R / 8, R = 1000 BLU


@pytest.mark.parametrize(("name", "count"), [("euler", 1234), ("improved-euler", 394)])
@pytest.mark.parametrize("feed", [0.5, 10.0, 16.7, 80.0])
def test_the_steps_of_euler_do_not_depend_on_the_feed(name: str, count: int, feed: float) -> None:
    quadrant = ArcSegment((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), feed)
    method = library_interpolator(name)
    taken, rows = method.steps(quadrant, 0.01), method.rows(quadrant, 0.01)
    assert taken is not None and (taken.count, taken.least, taken.within) == (count, count, True)
    ways = np.linalg.norm(np.diff(np.vstack([quadrant.start, rows[:, 0]]), axis=0), axis=1)
    assert ways.max() <= feed * 0.01 * (1 + 1e-6)
    assert np.median(ways) == pytest.approx(feed * 0.01, rel=1e-3)
