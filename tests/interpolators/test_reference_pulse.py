"""Reference pulse: whole BLU, and never more than one off, however long the path (dcs-thesis, section 6.6)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from interpolators.strategies import arcs, lines
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.interpolators.acceleration import make_acceleration
from rds.interpolators.interpolator import library_interpolator
from rds.interpolators.path import interpolate
from rds.interpolators.reference_pulse import generation_error, pulses, pulses_without_carry

T = 0.01
BLUS = st.sampled_from((0.001, 0.01, 0.05, 0.3))


@given(segment=lines() | arcs(), blu=BLUS)
def test_commanded_minus_theoretical_is_at_most_half_a_blu(segment: Segment, blu: float) -> None:
    done = interpolate([segment], T, library_interpolator("reference-pulse", blu=blu))
    error = done.generation_error
    assert error is not None and done.pulses is not None
    assert np.abs(error).max() <= 0.5 * blu + 1e-9  # half a BLU; the promise is one
    assert done.within
    whole = done.position / blu
    assert np.abs(whole - np.rint(whole)).max() < 1e-6
    assert done.pulses.dtype == np.int64
    moved = np.rint(done.theory[-1] / blu) - np.rint(done.theory[0] / blu)
    assert np.array_equal(done.pulses.sum(axis=0), moved.astype(np.int64))


@given(
    points=st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=3, max_size=12, unique=True), blu=BLUS
)
def test_it_does_not_accumulate_over_segments(points: list[tuple[float, float]], blu: float) -> None:
    path = [LineSegment(a, b, 40.0) for a, b in pairwise(points)]
    for filter_ in (None, make_acceleration("s-shape", time=0.1)):
        done = interpolate(path, T, library_interpolator("reference-pulse", blu=blu), acceleration=filter_)
        assert done.generation_error is not None
        assert np.abs(done.generation_error).max() <= 0.5 * blu + 1e-9


def test_without_the_carry_the_remainders_are_lost() -> None:
    # 0.6 and 0.8 BLU a sample: int{} of each is 0, and the axes never move
    done = interpolate([LineSegment((0.0, 0.0), (30.0, 40.0), 10.0)], 1e-3, library_interpolator("reference-pulse"))
    lost = generation_error(done.theory, pulses_without_carry(done.theory, 0.01), 0.01)
    assert np.allclose(lost[-1], [-30.0, -40.0])
    kept = generation_error(done.theory, pulses(done.theory, 0.01), 0.01)
    assert np.abs(kept).max() <= 0.005 + 1e-12


def test_velocity_and_acceleration_are_the_theoretical_ones() -> None:
    circle = ArcSegment((5.0, 0.0), (5.0, 0.0), (0.0, 0.0), 4.0)
    whole = library_interpolator("reference-pulse").interpolate(circle, T)
    exact = library_interpolator("constant-velocity").interpolate(circle, T)
    for commanded, theoretical in zip(whole, exact, strict=True):
        assert np.abs(commanded[0] - theoretical[0]).max() <= 0.005 + 1e-12
        assert np.array_equal(commanded[1], theoretical[1]) and np.array_equal(commanded[2], theoretical[2])
