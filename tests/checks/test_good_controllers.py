"""Controllers that keep their interface: the check must not raise a false alarm over any of them."""

from __future__ import annotations

import functools
import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import pytest
from scipy import signal

from rds.checks import check_controller
from rds.core.types import Controller

GAIN = 20.0
TABLE = [math.sin(0.01 * k) for k in range(1000)]
A = np.array([[0.9, 0.05], [0.0, 0.8]])
B = np.array([0.1, 0.2])
NUMERATOR, DENOMINATOR = signal.butter(2, 0.1)


def proportional(t, r, y, state, params):
    return GAIN * (r.position - y), state


def without_state(t, r, y, state, params):
    return GAIN * (r.position - y), None


def integer_voltage(t, r, y, state, params):
    return 1 if r.position > y else -1, state


def numpy_voltage(t, r, y, state, params):
    return np.float64(GAIN) * (r.position - y), state


def array_without_dimensions(t, r, y, state, params):
    return np.array(GAIN * (r.position - y)), state


def array_of_one(t, r, y, state, params):
    return np.array([[GAIN * (r.position - y)]]), state


def list_answer(t, r, y, state, params):
    return [GAIN * (r.position - y), state]


def tuple_state(t, r, y, state, params):
    z, started = state
    z = -318.0 * y if not started else z
    velocity = 318.0 * y + z
    u = GAIN * (r.position - y) + 0.1 * (r.velocity - velocity)
    return u, (0.73 * z - 80.0 * y + 0.4 * u, 1.0)


def list_state_returned_as_tuple(t, r, y, state, params):
    return state[0], (state[0] + 0.001 * (r.position - y),)


def array_state(t, r, y, state, params):
    return float(B @ state), A @ state + B * (r.position - y)


def dict_state(t, r, y, state, params):
    return state["u"] + GAIN * (r.position - y), state | {"u": 0.9 * state["u"] + 0.1 * y}


@dataclass(frozen=True)
class Memory:
    integral: float = 0.0
    last: list[float] = field(default_factory=list)


def dataclass_state(t, r, y, state, params):
    error = r.position - y
    new = replace(state, integral=state.integral + 0.001 * error, last=[y])
    return GAIN * error + new.integral, new


class Pair(NamedTuple):
    integral: float
    last: float


def namedtuple_state(t, r, y, state, params):
    return GAIN * (r.position - y) + state.integral, Pair(0.99 * state.integral + y, y)


class Plain:
    def __init__(self, integral):
        self.integral = integral


def object_state(t, r, y, state, params):
    return state.integral, Plain(0.9 * state.integral + r.position - y)


def moving_average(t, r, y, state, params):
    window = [*state, y][-50:]
    return GAIN * (r.position - sum(window) / len(window)), window


def deque_state(t, r, y, state, params):
    window = state.copy()
    window.append(y)
    return r.position - sum(window) / len(window), window


def first_sample_state(t, r, y, state, params):
    last = y if not state else state[0]
    return GAIN * (r.position - y) - (y - last), (y,)


def nan_state(t, r, y, state, params):
    last = y if math.isnan(state[0]) else state[0]
    return GAIN * (r.position - y) - (y - last), [y]


def generator_in_state(t, r, y, state, params):
    """Dither from random numbers is deterministic if the generator is part of the state."""
    new = np.random.default_rng(state[0])
    return float(new.normal()), [state[0] + 1]


def table_lookup(t, r, y, state, params):
    return TABLE[min(int(abs(r.position - y) * 10), len(TABLE) - 1)], state


def helpers(t, r, y, state, params):
    return clip(GAIN * (r.position - y)), state


def clip(u):
    return max(-10.0, min(10.0, u))


@functools.cache
def gain_at(level):
    return GAIN / (1 + level)


def cached_helper(t, r, y, state, params):
    return gain_at(int(abs(y))) * (r.position - y), state


def scipy_filter(t, r, y, state, params):
    filtered, new = signal.lfilter(NUMERATOR, DENOMINATOR, [r.position - y], zi=state)
    return GAIN * float(filtered[0]), new


def with_params(t, r, y, state, params):
    return params["gain"] * (r.position - y), state


def extra_default(t, r, y, state, params, gain=20.0):
    return gain * (r.position - y), state


def any_arguments(*args, **kwargs):
    return 0.0, args[3]


def own_names(time, ref, measured, memory, settings):
    return GAIN * (ref.position - measured), memory


def _closure(gain):
    def control(t, r, y, state, params):
        return gain * (r.position - y), state

    return control


class Law:
    def __init__(self, gain):
        self.gain = gain

    def __call__(self, t, r, y, state, params):
        return self.gain * (r.position - y), state


def unstable(t, r, y, state, params):
    """A bad controller that keeps its interface."""
    return -1000.0 * (r.position - y), state


GOOD = [
    (proportional, None),
    (without_state, None),
    (integer_voltage, None),
    (numpy_voltage, None),
    (array_without_dimensions, None),
    (array_of_one, None),
    (list_answer, None),
    (tuple_state, (0.0, 0.0)),
    (list_state_returned_as_tuple, [0.0]),
    (array_state, np.zeros(2)),
    (dict_state, {"u": 0.0}),
    (dataclass_state, Memory()),
    (namedtuple_state, Pair(0.0, 0.0)),
    (object_state, Plain(0.0)),
    (moving_average, None),
    (deque_state, deque([0.0], maxlen=20)),
    (first_sample_state, None),
    (nan_state, [math.nan]),
    (generator_in_state, [1]),
    (table_lookup, None),
    (helpers, None),
    (cached_helper, None),
    (scipy_filter, np.zeros(2)),
    (extra_default, None),
    (any_arguments, None),
    (own_names, None),
    (_closure(20.0), None),
    (Law(20.0), None),
    (functools.partial(lambda gain, t, r, y, state, params: (gain * (r.position - y), state), 20.0), None),
    (lambda t, r, y, state, params: (GAIN * (r.position - y), state), None),
    (unstable, None),
]


@pytest.mark.parametrize(("good", "state"), GOOD, ids=[getattr(g[0], "__name__", type(g[0]).__name__) for g in GOOD])
def test_no_false_alarm(good, state):
    report = check_controller(good, initial_state=state)
    assert not report.faults, str(report)
    assert not [warning for warning in report.warnings if warning.clause != "time per call"], str(report)
    assert report.timing is not None and report.timing.calls > 100


def test_params_are_handed_in():
    assert check_controller(with_params, params={"gain": 3.0}).ok
    assert check_controller(Controller(with_params, params={"gain": 3.0})).ok


def test_signals_that_are_declared_and_told_are_no_fault(tmp_path):
    path = tmp_path / "with_signals.py"
    path.write_text(
        "signals = {'velocity': 'mm/s'}\ninitial_state = [0.0]\n"
        "def control(t, r, y, state, params):\n"
        "    return 20.0 * (r.position - y), [y], {'velocity': (y - state[0]) / 1e-3}\n"
    )
    assert check_controller(path).ok
    both = Controller(
        lambda t, r, y, state, params: (r.position - y, state, {"place": y}), coupled=True, signals={"place": "mm"}
    )
    assert check_controller(both).ok


def test_a_controller_object_knows_whether_it_is_coupled():
    law = Controller(lambda t, r, y, state, params: (r.position[::-1] - y, state), coupled=True)
    assert check_controller(law, axes=3).ok


@pytest.mark.parametrize("name", ["p", "pid", "modified-pid", "tracking", "cascade"])
def test_the_library_keeps_its_own_interface(name):
    from rds.controllers import library_controller

    law = library_controller(name, {"tau": 9.943e-3, "K": 1.764}, 1e-3, 10.0)
    report = check_controller(law)
    assert report.ok and not report.warnings, str(report)


def test_a_counter_that_decides_nothing_is_only_worth_a_warning():
    calls = []

    def control(t, r, y, state, params):
        calls.append(t)
        return GAIN * (r.position - y), state

    report = check_controller(control)
    assert report.ok
    assert "variable `calls` around control()" in str(report.warnings[0])


def test_a_state_that_becomes_nan_behind_a_limit_is_worth_a_warning():
    """min() and max() turn it into -10 V; a state that begins with NaN, as what is not known yet, is no accident."""

    def control(t, r, y, state, params):
        total = state[0] + r.position - y if t < 0.2 else math.nan
        return min(10.0, max(-10.0, GAIN * (r.position - y) + total)), [total]

    report = check_controller(control, initial_state=[0.0])
    assert report.ok and "next_state is [nan] at t = 0.200 s: a number has become NaN" in str(report.warnings[0])
    assert not check_controller(lambda t, r, y, state, params: (0.0, [math.nan]), initial_state=[math.nan]).warnings


@pytest.mark.parametrize("kind", [list, dict])
def test_a_state_that_holds_itself_twice_is_gone_through_once(kind):
    def control(t, r, y, state, params):
        error = r.position - y
        held = {0: error} if kind is dict else [error, None, None]
        held[1] = held[2] = held
        return GAIN * error, held

    assert check_controller(control, initial_state=[0.0, 0.0, 0.0]).ok


def test_a_state_that_changes_its_shape_is_worth_a_warning():
    """A column plus a row is a square, which an observer's matrices make of it without a word."""

    def control(t, r, y, state, params):
        return GAIN * (r.position - y), state + np.array([1e-3, 1e-3])

    report = check_controller(control, initial_state=np.zeros((2, 1)))
    assert report.ok and "next_state has the shape (2, 2) and initial_state (2, 1)" in str(report.warnings[0])


def test_a_user_may_check_with_an_exact_period_of_another_size():
    report = check_controller(proportional, 0.01)
    assert report.ok
