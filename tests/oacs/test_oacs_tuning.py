"""Table 11 from recorded steps: known first-order-plus-delay responses, and those that the method is not for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs.tuning import (
    Gains,
    ReactionCurve,
    gains_from_step,
    quality,
    reaction_curve,
    ziegler_nichols,
)
from rds.core.errors import InputError
from rds.results import Result


def response(L: float, T: float, K: float = 1.0, step: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(0.0, L + 8.0 * T, T / 200.0)
    return t, K * step * np.where(t > L, 1.0 - np.exp(-np.maximum(t - L, 0.0) / T), 0.0)


def test_table_11() -> None:
    curve = ReactionCurve(delay=0.5, time_constant=2.0)
    assert ziegler_nichols(curve, "P") == Gains(4.0, 0.0, 0.0)
    assert ziegler_nichols(curve, "PI") == pytest.approx((3.6, 2.16, 0.0))
    assert ziegler_nichols(curve, "PID") == pytest.approx((4.8, 4.8, 1.2))
    assert ziegler_nichols(ReactionCurve(0.5, 2.0, 2.0), "PID") == pytest.approx((2.4, 2.4, 0.6))


@given(st.floats(0.1, 1.0), st.floats(0.3, 10.0), st.floats(0.1, 50.0), st.floats(0.5, 20.0))
def test_a_known_response_gives_its_numbers(delay: float, T: float, K: float, step: float) -> None:
    L = delay * T
    t, y = response(L, T, K, step)
    curve = reaction_curve(t, y + 7.0, step)
    assert curve.gain == pytest.approx(K, rel=0.01)
    assert curve.time_constant == pytest.approx(T, rel=0.02)
    assert curve.delay == pytest.approx(L, abs=0.02 * T)


def test_an_encoders_steps_do_not_count_as_slope() -> None:
    t, y = response(0.4, 1.0, step=1.0)
    rough = np.round(y * 50) / 50
    curve = reaction_curve(t, rough)
    assert curve.time_constant == pytest.approx(1.0, rel=0.2) and curve.delay == pytest.approx(0.4, abs=0.1)


def test_from_a_recorded_step() -> None:
    t, y = response(0.5, 2.0)
    meta = {"axes": ["X"], "sample_period": 0.01}
    result = Result({"time": t, "X_reference": np.ones_like(t), "X_measured": y}, meta=meta)
    assert gains_from_step(result, "X", "PI") == pytest.approx((3.6, 2.16, 0.0), rel=0.03)


@pytest.mark.parametrize(
    "y, told",
    [
        (np.linspace(0, 1, 100), "has not settled"),
        (1 - np.cos(np.linspace(0, 20, 100)) * np.exp(-np.linspace(0, 4, 100)), "overshoots by"),
        (np.zeros(100), "ends where it began"),
        (np.full(100, np.nan), "finite"),
        (np.ones(3), "ten samples"),
    ],
)
def test_what_the_method_is_not_for(y: np.ndarray, told: str) -> None:
    with pytest.raises(InputError, match=told):
        reaction_curve(np.arange(len(y)) * 0.1, y)


def test_a_response_without_delay_has_no_gains() -> None:
    with pytest.raises(InputError, match="must be more than 0"):
        ziegler_nichols(ReactionCurve(0.0, 1.0))


META = {"axes": ["X"], "sample_period": 0.01}


def recorded(y: np.ndarray, t: np.ndarray, point: float) -> Result:
    return Result({"time": t, "X_reference": np.full_like(t, point), "X_measured": y}, meta=META)


@given(st.floats(0.1, 0.9), st.floats(-20.0, 20.0).filter(lambda step: abs(step) > 0.1), st.floats(-50.0, 50.0))
def test_the_quality_of_a_second_order_response_is_that_of_its_closed_forms(z: float, step: float, at: float) -> None:
    """ω = 1 rad/s: overshoot exp(-π ζ/√(1 - ζ²)); nothing stays; in its band of 2 % for good by the envelope's time."""
    t = np.arange(0.0, 12.0 / z + 20.0, 0.01)
    w = np.sqrt(1 - z**2)
    y = at + step * (1 - np.exp(-z * t) * (np.cos(w * t) + z / w * np.sin(w * t)))
    found = quality(recorded(y, t, at + step), "X")
    assert found.overshoot == pytest.approx(100 * np.exp(-np.pi * z / w), abs=0.1)
    assert found.steady_error == pytest.approx(0.0, abs=1e-4 * abs(step))
    assert found.settling_time is not None and found.rise_time is not None
    assert found.settling_time <= np.log(1 / (0.02 * w)) / z + 0.02
    assert 1.0 < found.rise_time < 3.1


def test_the_quality_of_a_response_that_falls_short() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    found = quality(recorded(3.0 + 1.9 * (1 - np.exp(-t / 0.5)), t, 5.0), "X")
    rise = 0.5 * np.log((1.9 - 0.2) / (1.9 - 1.8))  # of 1.9 (1 - exp(-t/0.5)) from 0.2 to 1.8
    assert found.rise_time == pytest.approx(rise, abs=0.005)
    assert (found.overshoot, found.settling_time) == (0.0, None)
    assert found.steady_error == pytest.approx(0.1, abs=1e-3)
    assert "settling time never, steady error 0.1 mm" in found.words("mm")
    never = quality(recorded(3.0 + 1.0 * (1 - np.exp(-t / 0.5)), t, 5.0), "X")
    assert never.rise_time is None and "rise time never" in never.words("mm")
    with pytest.raises(InputError, match="has no step"):
        quality(recorded(np.zeros(3), np.arange(3.0), 0.0), "X")
