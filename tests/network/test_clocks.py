"""Clocks of nodes: what regression finds of drift and offset, and the contour error of a circle with it and without."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats

import rds
from rds.network.clocks import circle_error, synchronized


@given(drift=floats(-500.0, 500.0), offset=floats(-10.0, 10.0))
def test_constant_delays_leave_the_clock_exact(drift: float, offset: float) -> None:
    estimate, errors = synchronized(drift, offset, np.full((40, 2), 2e-4), 0.1)
    assert estimate.drift == pytest.approx(drift, abs=1e-3)
    assert abs(errors[-1]) < 1e-8


def test_random_delays_leave_an_error_below_half_a_round_trip() -> None:
    delays = 2e-4 + np.random.default_rng(0).exponential(1e-4, (600, 2))
    estimate, errors = synchronized(80.0, 1.0, delays, 0.1)
    assert estimate.drift == pytest.approx(80.0, abs=15.0)
    assert np.abs(errors[100:]).max() < 1e-4
    assert 0 < estimate.left_out < 600
    assert estimate.error < 1e-4


def test_delay_in_one_direction_alone_shifts_the_offset_by_half_of_it() -> None:
    _, errors = synchronized(0.0, 0.0, np.tile([3e-4, 1e-4], (100, 1)), 0.1)
    assert errors[-1] == pytest.approx(0.5 * (3e-4 - 1e-4), rel=1e-3)


def test_the_contour_error_of_a_circle_with_and_without() -> None:
    """100 ppm apart for 60 s are 6 ms: at 20 mm/s, the circle becomes an ellipse, 60 µm off; else below 1 µm."""
    radius, feed, drift = 20.0, 20.0, 100.0
    without = circle_error(radius, feed, np.full(720, drift * 1e-6 * 60.0))
    assert np.abs(without).max() == pytest.approx(0.5 * feed * drift * 1e-6 * 60.0, rel=0.01)
    delays = 2e-4 + np.random.default_rng(1).exponential(2e-5, (720, 2))
    _, errors = synchronized(drift, 0.0, delays, 0.1)
    assert np.abs(circle_error(radius, feed, errors)[100:]).max() < 1e-3


def test_a_drift_that_no_clock_has_is_refused() -> None:
    with pytest.raises(rds.InputError, match=r"drift = 100000\.0 must be from -10000 to 10000 ppm"):
        synchronized(1e5, 0.0, np.ones((2, 2)), 0.1)
