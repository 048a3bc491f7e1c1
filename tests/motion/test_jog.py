"""A jogged axis keeps its speed and acceleration, reaches its goal without passing it, and comes to rest."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from rds.interpolators.motion.jog import advance

T = 0.002  # s


@given(goal=st.floats(-20, 20), speed=st.floats(0.5, 15), acceleration=st.floats(5, 500))
def test_it_reaches_its_goal_within_its_limits(goal: float, speed: float, acceleration: float) -> None:
    x, v, way = 0.0, 0.0, 0.0
    for _ in range(round((abs(goal) / speed + 2 * speed / acceleration + 0.1) / T) + 2000):
        before, last, here = v, way, x
        x, v = advance(x, v, goal, speed, acceleration, T)
        way = x - here
        assert abs(v) <= speed * (1 + 1e-9)
        assert abs(v - before) <= 2 * acceleration * T * (1 + 1e-9)  # the last sample may end two at once
        assert abs(way - last) <= acceleration * T * T * (1 + 1e-6) + 1e-14
        assert min(0.0, goal) - 1e-9 <= x <= max(0.0, goal) + 1e-9
    assert (x, v) == (goal, 0.0)


def test_a_slow_axis_that_gains_its_speed_at_once_does_not_leap_at_its_goal() -> None:
    x, v, places = 0.0, 0.0, [0.0]
    while x != 0.005:
        x, v = advance(x, v, 0.005, 0.5, 5000.0, T)
        places.append(x)
    assert max(b - a for a, b in pairwise(places)) <= 0.5 * T * (1 + 1e-9)
    assert len(places) == 6


@given(v=st.floats(-15, 15), acceleration=st.floats(5, 500))
def test_let_go_it_rests_after_the_time_that_its_deceleration_takes(v: float, acceleration: float) -> None:
    x, samples = 0.0, 0
    start = v
    while v:
        x, v = advance(x, v, None, 1.0, acceleration, T)
        samples += 1
        assert samples <= abs(start) / (acceleration * T) + 2  # one for what is left, one for rounding
    assert abs(x) <= start * start / (2 * acceleration) + 1e-9
