"""A change of the rate: rate and slope are the derivatives of the way passed, and it lands on whole periods."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.modes.loop.ramp import EXTRA_SHARPEST, EXTRA_STEEPEST, FURTHEST, Ramp

rates = st.floats(0.0, 2.0)


@given(start=rates, end=rates, samples=st.integers(20, 600), extra=st.floats(-FURTHEST, FURTHEST))
def test_rate_and_slope_are_derivatives_of_the_way(start: float, end: float, samples: int, extra: float) -> None:
    ramp = Ramp(start, end, samples, extra)
    k, h = np.linspace(0.01, samples - 0.01, 50), 1e-3
    assert (ramp.passed(k + h) - ramp.passed(k - h)) / (2 * h) == pytest.approx(ramp.rate(k), abs=1e-7)
    assert (ramp.rate(k + h) - ramp.rate(k - h)) / (2 * h) == pytest.approx(ramp.slope(k), abs=1e-7)
    assert (ramp.rate(0), ramp.rate(samples)) == pytest.approx((start, end))
    assert (ramp.slope(0), ramp.slope(samples)) == (0.0, 0.0)
    assert ramp.passed(samples) == pytest.approx(samples * (start + end) / 2 + extra)


@given(start=rates, samples=st.integers(20, 600), place=st.floats(0.0, 1e6))
def test_it_lands_on_a_whole_number_of_periods(start: float, samples: int, place: float) -> None:
    ramp = Ramp(start, 1.0, samples).landing(place)
    end = place + ramp.passed(samples)
    assert abs(end - round(end)) < 1e-8
    assert abs(ramp.extra) <= FURTHEST
    assert ramp.rate(np.arange(samples + 1)).min() >= 0.0


def test_the_constants_are_those_of_the_curve() -> None:
    k = np.linspace(0.0, 1.0, 100_001)
    slope = Ramp(0.0, 0.0, 1, 1.0).slope(k)
    assert np.abs(slope).max() == pytest.approx(EXTRA_STEEPEST, rel=1e-3)
    assert np.abs(np.diff(slope) / 1e-5).max() == pytest.approx(EXTRA_SHARPEST, rel=1e-3)
