"""The linear axis solved exactly: against 60 digits, against itself in parts, and at the places where solvers fail."""

from __future__ import annotations

from decimal import Decimal, localcontext
from math import expm1, inf, isfinite, nan
from typing import Any

import pytest
from hypothesis import assume, example, given, settings
from hypothesis.strategies import builds, floats, integers, just, one_of, sampled_from

from rds.core.errors import InputError
from rds.machines import load_machine
from rds.models import library_model
from rds.models.linear_axis import LinearAxisMotion, advance, make

X = load_machine("mini-cnc").axis("X").model
PARAMS = {key: X[key] for key in ("tau", "K", "friction_plus", "friction_minus")}


def parameters(tau: Any = None) -> Any:
    return builds(
        dict,
        tau=tau or floats(1e-3, 1.0),
        K=one_of(floats(0.1, 10.0), just(0.0), floats(-10.0, -0.1)),
        friction_plus=one_of(just(0.0), floats(1e-3, 5.0)),
        friction_minus=one_of(just(0.0), floats(-5.0, -1e-3)),
    )


SPEEDS = one_of(just(0.0), floats(-50.0, 50.0), sampled_from([5e-324, -5e-324, 1e-300, -1e-300, 1e-12, -1e-12]))
VOLTAGES = one_of(just(0.0), floats(-10.0, 10.0))
PERIODS = one_of(sampled_from([1e-4, 5e-4, 1e-3, 2e-3, 1e-2]), floats(1e-5, 0.5))


def exact(x: float, v: float, u: float, T: float, p: dict[str, float]) -> tuple[float, float]:
    """The same motion by phases, each with its own closed form, in 60 digits and with nothing precomputed."""
    with localcontext(prec=60):
        position, speed, left = Decimal(x), Decimal(v), Decimal(T)
        tau, drive = Decimal(p["tau"]), Decimal(p["K"] * u)
        plus, minus = Decimal(p["friction_plus"]), Decimal(p["friction_minus"])
        for _ in range(3):
            if left == 0 or (speed == 0 and minus <= drive <= plus):
                return float(position), float(speed)
            forward = speed > 0 or (speed == 0 and drive > plus)
            final = drive - (plus if forward else minus)
            stops = speed != 0 and (final < 0 if forward else final > 0)
            crossing = tau * (1 - speed / final).ln() if stops else left
            duration = min(crossing, left)
            decay = (-duration / tau).exp()
            position += final * duration + (speed - final) * tau * (1 - decay)
            speed = Decimal(0) if stops and crossing <= left else final + (speed - final) * decay
            left -= duration
        return float(position), float(speed)


def close(ours: tuple[float, float], theirs: tuple[float, float], scale: float) -> bool:
    return all(abs(a - b) <= 2e-14 * scale for a, b in zip(ours, theirs, strict=True))


def size(x: float, v: float, u: float, T: float, p: dict[str, float]) -> float:
    """Of the terms that the closed form adds up."""
    speed = abs(v) + abs(p["K"] * u) + p["friction_plus"] - p["friction_minus"]
    return max(abs(x), speed, speed * T, speed * p["tau"], 1e-3)


@settings(max_examples=400, deadline=None)
@given(p=parameters(), x=floats(-100, 100), v=SPEEDS, u=VOLTAGES, T=PERIODS)
@example(p=PARAMS, x=0.0, v=0.5, u=-5.0, T=1e-3)  # crosses zero and reverses
@example(p=PARAMS, x=0.0, v=0.02, u=0.0, T=1e-3)  # crosses zero and sticks
@example(p=PARAMS, x=0.0, v=0.02, u=0.0, T=0.5)
@example(p=PARAMS, x=0.0, v=-0.02, u=5.0, T=1e-3)
def test_one_sample_is_exact(p: dict[str, float], x: float, v: float, u: float, T: float) -> None:
    ours = advance((x, v), u, T, p)
    assert close(ours, exact(x, v, u, T, p), size(x, v, u, T, p))


@given(p=parameters(), x=floats(-100, 100), v=SPEEDS, u=VOLTAGES, T=PERIODS)
def test_a_part_of_a_sample_in_a_loop_is_exact_too(p: dict[str, float], x: float, v: float, u: float, T: float) -> None:
    motion = LinearAxisMotion(make(**p), 1e-3)
    motion.position, motion.velocity = x, v
    motion.move(u, T)
    assert close((motion.read(), motion.velocity), exact(x, v, u, T, p), 10 * size(x, v, u, T, p))


@settings(max_examples=300, deadline=None)
@given(p=parameters(), x=floats(-10, 10), v=SPEEDS, u=VOLTAGES, T=PERIODS, share=floats(0.01, 0.99))
def test_a_sample_is_the_sum_of_its_parts(
    p: dict[str, float], x: float, v: float, u: float, T: float, share: float
) -> None:
    middle = advance((x, v), u, share * T, p)
    parts = advance(middle, u, T - share * T, p)
    assert close(advance((x, v), u, T, p), parts, 10 * size(x, v, u, T, p))


@given(p=parameters(), x=floats(-10, 10), v=SPEEDS, u=VOLTAGES, T=PERIODS)
def test_the_mirrored_axis_moves_the_mirrored_way(p: dict[str, float], x: float, v: float, u: float, T: float) -> None:
    mirrored = p | {"friction_plus": -p["friction_minus"], "friction_minus": -p["friction_plus"]}
    position, velocity = advance((x, v), u, T, p)
    assert advance((-x, -v), -u, T, mirrored) == (-position, -velocity)


@given(p=parameters(), x=floats(-100, 100), T=PERIODS, where=floats(0, 1))
def test_it_stays_at_rest_exactly_while_friction_holds_it(
    p: dict[str, float], x: float, T: float, where: float
) -> None:
    assume(p["K"] != 0.0)
    drive = p["friction_minus"] + where * (p["friction_plus"] - p["friction_minus"])
    u = drive / p["K"]
    assume(p["friction_minus"] <= p["K"] * u <= p["friction_plus"])
    assert advance((x, 0.0), u, T, p) == (x, 0.0)


@pytest.mark.parametrize("K", [1.0, 2.0, 0.5])
@pytest.mark.parametrize("limit", ["friction_plus", "friction_minus"])
def test_it_breaks_away_just_beyond_the_limit(K: float, limit: str) -> None:
    p = {"tau": 0.01, "K": K, "friction_plus": 0.5, "friction_minus": -0.25}
    at = p[limit] / K
    assert advance((1.0, 0.0), at, 1e-3, p) == (1.0, 0.0)
    _, velocity = advance((1.0, 0.0), at * (1 + 1e-12), 1e-3, p)
    assert velocity * p[limit] > 0.0
    # in motion at the limit, drive and friction cancel: a pure decay that never stops
    moving = 1.0 if p[limit] > 0 else -1.0
    _, velocity = advance((0.0, moving), at, 0.01, p)
    assert velocity == pytest.approx(moving * (1 + expm1(-1.0)), rel=1e-15)


@given(p=parameters(), v=floats(-50, 50), T=PERIODS)
def test_without_a_voltage_it_only_loses_speed_and_never_turns(p: dict[str, float], v: float, T: float) -> None:
    position, velocity = advance((0.0, v), 0.0, T, p)
    assert abs(velocity) <= abs(v)
    assert velocity * v >= 0.0
    assert position * v >= 0.0 or abs(position) < 1e-15 * abs(v) * p["tau"]
    assert abs(position) <= abs(v) * min(T, p["tau"]) * (1 + 1e-12)


@given(p=parameters(), v=SPEEDS, u=VOLTAGES, T=PERIODS)
def test_speed_stays_between_its_start_and_its_end_value(p: dict[str, float], v: float, u: float, T: float) -> None:
    drive = p["K"] * u
    ends = [v, 0.0, drive - p["friction_plus"], drive - p["friction_minus"]]
    _, velocity = advance((0.0, v), u, T, p)
    slack = 1e-14 * max(map(abs, ends))
    assert min(ends) - slack <= velocity <= max(ends) + slack


@settings(max_examples=500)
@given(
    tau=sampled_from([1e-300, 1e-12, 1e-3, 1.0, 1e12, 1e300]),
    T=sampled_from([1e-300, 1e-15, 1e-3, 1.0, 1e9]),
    v=sampled_from([0.0, 5e-324, -5e-324, 1e-200, 1.0, -1.0, 1e6, -1e150, 1e300]),
    u=sampled_from([0.0, 5e-324, 1e-300, -1e-300, 0.5, -0.5, 10.0, -10.0, 1e100]),
    friction=sampled_from([0.0, 5e-324, 1e-300, 0.5, 10.0]),
)
def test_extremes_stay_finite(tau: float, T: float, v: float, u: float, friction: float) -> None:
    p = {"tau": tau, "K": 1.0, "friction_plus": friction, "friction_minus": -friction}
    position, velocity = advance((0.0, v), u, T, p)
    assert isfinite(velocity)
    bound = (abs(v) + abs(u) + friction) * T
    assert isfinite(position) or not isfinite(bound * 4 + (abs(v) + abs(u)) * tau)
    if velocity * v < 0.0:  # turned: only a voltage beyond friction does that
        assert u > friction if velocity > 0.0 else u < -friction


@given(p=parameters(), v=floats(0.01, 50), share=floats(0.05, 0.95))
def test_the_instant_of_a_stop_is_exact(p: dict[str, float], v: float, share: float) -> None:
    """Just before the computed instant it moves, just after it rests, and friction work is the lost motion."""
    assume(p["friction_plus"] > 0)
    with localcontext(prec=40):
        stop = float(Decimal(p["tau"]) * (1 + Decimal(v) / Decimal(p["friction_plus"])).ln())
    assert advance((0.0, v), 0.0, stop * (1 - 1e-9), p)[1] > 0.0
    position, velocity = advance((0.0, v), 0.0, stop * (1 + 1e-9), p)
    assert velocity == 0.0
    assert position == pytest.approx(v * p["tau"] - p["friction_plus"] * stop, abs=1e-12 * (v * p["tau"] + 1))
    assert advance((0.0, v), 0.0, stop * (1 + 1e-9) + share, p) == (position, velocity)


@given(p=parameters(), voltages=builds(list, just([])) | just([1.0, -2.0, 0.3, 0.0, -0.1, 9.0]), n=integers(1, 50))
def test_in_motion_it_is_the_same_to_the_bit(p: dict[str, float], voltages: list[float], n: int) -> None:
    motion, state = LinearAxisMotion(make(**p), 1e-3), (0.0, 0.0)
    for k in range(n):
        u = voltages[k % len(voltages)] if voltages else 0.5
        motion.write(u)
        state = advance(state, u, 1e-3, p)
        assert (motion.read(), motion.velocity) == state


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"tau": 0.01}, "needs K"),
        ({"K": 1.0}, "needs tau"),
        ({"tau": 0.0, "K": 1.0}, "tau = 0.0 must be more than 0"),
        ({"tau": nan, "K": 1.0}, "finite"),
        ({"tau": inf, "K": 1.0}, "finite"),
        ({"tau": 10**400, "K": 1.0}, "finite"),
        ({"tau": True, "K": 1.0}, "must be a number"),
        ({"tau": "0.01", "K": 1.0}, "must be a number"),
        ({"tau": 0.01, "K": 1.0, "friction_plus": -0.1}, "at least 0"),
        ({"tau": 0.01, "K": 1.0, "friction_minus": 0.1}, "friction_minus = 0.1 must be at most 0"),
        ({"tau": 0.01, "K": 1.0, "frction": 0.1}, "did you mean"),
    ],
)
def test_impossible_parameters_are_refused(params: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        library_model("linear-axis", **params)
