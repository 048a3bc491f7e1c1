"""The axis whose friction differs by direction: exact in each direction, over the crossing, and at rest."""

from __future__ import annotations

from math import log

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.models import linear_axis
from rds.models.directional_axis import advance, make

DRY = {"tau": 0.01, "K": 1.8, "friction_plus": 0.6, "friction_minus": -0.9}
WET = {**DRY, "viscous_plus": 0.25, "viscous_minus": 0.6}
state = st.tuples(st.floats(-5.0, 5.0), st.sampled_from([0.0, 3.0, -3.0]) | st.floats(-20.0, 20.0))
voltage = st.floats(-10.0, 10.0)
time = st.floats(1e-5, 0.05)


def params(**values: float) -> dict[str, float]:
    return dict(make(**values).params)


@given(x=state, u=voltage, T=time)
def test_without_viscous_friction_it_is_the_linear_axis(x: tuple[float, float], u: float, T: float) -> None:
    assert advance(x, u, T, params(**DRY)) == pytest.approx(linear_axis.advance(x, u, T, DRY), abs=1e-9)


@given(x=state, u=voltage, T=time)
def test_a_direction_is_the_linear_axis_over_one_plus_its_viscous_friction(
    x: tuple[float, float], u: float, T: float
) -> None:
    """Where the velocity has the command's sign it keeps it."""
    forward = u > 0.0
    b = WET["viscous_plus" if forward else "viscous_minus"]
    names = ("tau", "K", "friction_plus", "friction_minus")
    start = (x[0], abs(x[1]) if forward else -abs(x[1]))
    scaled = linear_axis.advance(start, u, T, {name: WET[name] / (1.0 + b) for name in names})
    assert advance(start, u, T, params(**WET)) == pytest.approx(scaled, abs=1e-9)


@given(x=state, u=voltage, T=time, part=st.floats(0.01, 0.99))
def test_two_samples_are_one_that_is_as_long(x: tuple[float, float], u: float, T: float, part: float) -> None:
    p = params(**WET)
    assert advance(advance(x, u, part * T, p), u, (1.0 - part) * T, p) == pytest.approx(advance(x, u, T, p), abs=1e-9)


def test_it_turns_back_at_the_instant_at_which_it_stands() -> None:
    """From 4 mm/s forward with −5 V: 1.25 v + 0.01 v' = −9.6 to v = 0, then 1.6 v + 0.01 v' = −8.1."""
    p = params(**WET)
    stands = 0.008 * log(1.0 + 4.0 / (9.6 / 1.25))
    position, velocity = advance((0.0, 4.0), -5.0, stands, p)
    assert velocity == pytest.approx(0.0, abs=1e-9) and position == pytest.approx(0.008 * 4.0 - 7.68 * stands)
    back, fast = advance((0.0, 4.0), -5.0, stands + 1.0, p)
    assert fast == pytest.approx(-8.1 / 1.6) and back == pytest.approx(position - 8.1 / 1.6 * (1.0 - 0.01 / 1.6))


@pytest.mark.parametrize("u, moves", [(0.33, 0), (0.34, 1), (-0.49, 0), (-0.51, -1)])
def test_at_rest_it_sticks_up_to_its_friction(u: float, moves: int) -> None:
    """0.6/1.8 V forward, 0.9/1.8 V backward; and whatever moves comes to rest within that."""
    assert make(**WET).initial_state == (0.0, 0.0) and make(**WET).has_velocity
    position, velocity = advance((1.0, 0.0), u, 0.01, params(**WET))
    assert (position > 1.0) - (position < 1.0) == (velocity > 0.0) - (velocity < 0.0) == moves
    if not moves:
        assert advance((0.0, 3.0), u, 1.0, params(**WET))[1] == advance((0.0, -3.0), u, 1.0, params(**WET))[1] == 0.0
