"""Table 11 from recorded steps: known first-order-plus-delay responses, and those that the method is not for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs.tuning import Gains, ReactionCurve, gains_from_step, reaction_curve, ziegler_nichols
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
