"""The stepper: the closed form of its pull-in speed, and steps lost above its curve."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.models.stepper_axis import StepperAxis, StepperParameters

X = StepperParameters(K=2.0, torque=2400.0, corner=8.0, no_torque=40.0, friction=200.0)


def run(speed: float, seconds: float = 0.5) -> StepperAxis:
    axis = StepperAxis(X, 0.01)
    axis.rate(speed, 0.0)
    axis.advance(seconds)
    return axis


def test_a_sudden_speed_is_followed_up_to_the_pull_in_speed() -> None:
    limit = X.pull_in(0.01)
    assert limit == pytest.approx((4 * 0.01 * 2200.0) ** 0.5)
    assert run(0.97 * limit).lost == 0
    assert run(1.03 * limit).lost != 0


def test_above_the_pull_out_speed_it_stalls_however_gently_it_got_there() -> None:
    assert X.pull_out() == pytest.approx(40.0 - 200.0 / 2400.0 * 32.0)
    for speed, loses in ((0.95 * X.pull_out(), False), (1.02 * X.pull_out(), True)):
        axis = StepperAxis(X, 0.01)
        for k in range(4000):
            axis.rate(speed * min(k / 3000.0, 1.0), k * 1e-3)
        axis.advance(4.0)
        assert (axis.lost != 0) == loses


@given(st.lists(st.integers(-6, 6), max_size=60))
def test_gentle_steps_are_all_made(steps: list[int]) -> None:
    axis = StepperAxis(X, 0.01)
    for k, count in enumerate(steps):
        axis.move(count, 0.01 * k, 0.01)
    axis.advance(0.01 * len(steps) + 0.2)
    assert axis.counts == sum(steps)
    assert abs(axis.lost) % 4 == 0
    assert axis.position == pytest.approx((sum(steps) - axis.lost) * 0.01, abs=1e-6)


def test_steps_that_come_while_others_are_made_are_not_lost() -> None:
    axis = StepperAxis(X, 0.01)
    for k in range(10):
        axis.move(3, 0.008 * k, 0.01)  # a clock that is too fast
    axis.advance(1.0)
    assert axis.counts == 30 and axis.lost == 0


def test_a_motor_that_never_moves_is_refused() -> None:
    with pytest.raises(InputError, match="must be above friction and weight together"):
        StepperParameters(K=1.0, torque=100.0, corner=1.0, no_torque=2.0, friction=90.0, weight=20.0)
