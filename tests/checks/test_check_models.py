"""Models known to be bad, each with the clause that it breaks, and good ones without a false alarm."""

from __future__ import annotations

import math
import random
import time
from dataclasses import replace
from itertools import count

import control
import numpy as np
import pytest

from rds.checks import check, check_controller, check_model, clauses
from rds.core.errors import InputError
from rds.core.thread_time import ThreadTime
from rds.models import library_model

TAU, K = 9.943e-3, 1.764
A = np.array([[0.0, 1.0], [0.0, -1 / TAU]])
B = np.array([0.0, K / TAU])
calls = 0


def axis(t, x, u, params):
    return [x[1], (K * u[0] - x[1]) / TAU]


def hidden(t, x, u, params):
    global calls
    calls += 1
    return [x[1], (K * u[0] - x[1]) / TAU + calls]


def chance(t, x, u, params):
    return [x[1], random.random()]


def too_short(t, x, u, params):
    return [x[1]]


def too_long(t, x, u, params):
    return [x[0], x[1], u[0]]


def nothing(t, x, u, params):
    x[1] - u[0]  # forgot to return it


def one_number(t, x, u, params):
    return x[1]


def text(t, x, u, params):
    return ["0", "1"]


def complex_number(t, x, u, params):
    return [x[1], 1j * u[0]]


def not_a_number(t, x, u, params):
    return np.array([x[1], math.nan if x[0] > 0.05 else u[0]])


def changes_x(t, x, u, params):
    x *= 1.1
    return [x[1], (K * u[0] - x[1]) / TAU]


def changes_u(t, x, u, params):
    u[0] = min(max(u[0], -4.0), 4.0)
    return [x[1], (K * u[0] - x[1]) / TAU]


def changes_params(t, x, u, params):
    params["last"] = x[0]
    return [x[1], (K * u[0] - x[1]) / TAU]


def fails_backwards(t, x, u, params):
    return [x[1], math.sqrt(u[0]) - x[1]]


def odeint_order(x, t, u, params):
    return [x[1], (K * u[0] - x[1]) / TAU]


def three_arguments(t, x, u):
    return [x[1], (K * u[0] - x[1]) / TAU]


def advance_hidden(x, u, T, params, last=[0.0]):  # noqa: B006
    last[0] += u[0]
    return [x[0] + T * x[1], last[0]]


def advance_wrong_size(x, u, T, params):
    return [x[0] + T * x[1]]


BAD = [
    (hidden, clauses.NO_MEMORY, "global `calls`"),
    (chance, clauses.DETERMINISTIC, "`random`"),
    (too_short, clauses.SHAPE, "1 value"),
    (too_long, clauses.SHAPE, "3 values"),
    (nothing, clauses.SHAPE, "returned nothing"),
    (one_number, clauses.SHAPE, "return a list of 2 numbers"),
    (text, clauses.SHAPE, "'0'"),
    (complex_number, clauses.SHAPE, "j"),
    (not_a_number, clauses.FINITE, "nan"),
    (changes_x, clauses.UNCHANGED, "x.copy()"),
    (changes_u, clauses.UNCHANGED, "array([5.])"),
    (changes_params, clauses.UNCHANGED, "params"),
    (fails_backwards, clauses.RUNS, "-5 V: test_check_models.py, line"),
    (odeint_order, clauses.ARGUMENTS, "`x` in place 1"),
    (three_arguments, clauses.ARGUMENTS, "params missing"),
    (advance_hidden, clauses.NO_MEMORY, "default argument `last`"),
    (advance_wrong_size, clauses.SHAPE, "1 value"),
]


@pytest.mark.parametrize(("bad", "clause", "detail"), BAD, ids=[b[0].__name__ for b in BAD])
def test_the_broken_clause_is_named(bad, clause, detail):
    report = check_model(bad, initial_state=[0.0, 0.0])
    assert clause in [fault.clause for fault in report.faults], str(report)
    assert detail in str(report)


@pytest.mark.parametrize("state", ["rest", [], [math.nan, 0.0], 3.0, {"x": 0.0}, [[0.0], [0.0, 1.0]], np.eye(2)])
def test_initial_state_must_hold_numbers(state):
    assert [fault.clause for fault in check_model(axis, initial_state=state).faults] == [clauses.INITIAL_STATE]


def test_a_missing_initial_state_is_written_out():
    def derivatives(t, x, u, params):
        return [x[1], x[2], u[0] - x[2]]

    report = check_model(derivatives)
    assert [fault.clause for fault in report.faults] == [clauses.INITIAL_STATE]
    assert "define initial_state = [0.0, 0.0, 0.0]" in str(report)


OUTPUTS = [
    (lambda t, x, u, params: x, clauses.OUTPUT),
    (lambda t, x, u, params: None, clauses.OUTPUT),
    (lambda t, x, u, params: math.nan, clauses.OUTPUT),
    (lambda t, x, u, params: x[7], clauses.RUNS),
    (lambda t, x, u, params: random.random(), clauses.DETERMINISTIC),
    (lambda t, x: x[0], clauses.ARGUMENTS),
]


@pytest.mark.parametrize(("output", "clause"), OUTPUTS)
def test_output_is_one_finite_number(output, clause):
    report = check_model({"derivatives": axis, "output": output, "initial_state": [0.0, 0.0]})
    assert [fault.clause for fault in report.faults] == [clause], str(report)


def matrix(t, x, u, params):
    return A @ x + B * u[0]


def column(t, x, u, params):
    return A @ x.reshape(-1, 1) + (B * u[0]).reshape(-1, 1)


def friction(t, x, u, params):
    return np.array([x[1], (params["K"] * u[0] - 1.0 * np.sign(x[1]) - x[1]) / TAU])


def advance(x, u, T, params):
    decay = math.exp(-T / TAU)
    final = K * u[0]
    return (x[0] + final * T + (x[1] - final) * TAU * (1 - decay), final + (x[1] - final) * decay)


def euler(x, u, T, params):
    return x + T * (A @ x + B * u)


GOOD = [
    (axis, None, None),
    (matrix, [0, 0], None),
    (column, np.zeros(2), None),
    (friction, None, {"K": K}),
    (advance, None, None),
    (euler, (0.0, 0.0), None),
    (lambda t, x, u, params: [(u[0] - x[0]) / 0.1], [0.0], None),
    (lambda t, x, u, params: (u[0] - x[0]) / 0.1, 0, None),
    (axis, [[0.0], [0.0]], None),
]


@pytest.mark.parametrize(("good", "state", "params"), GOOD)
def test_no_false_alarm(good, state, params):
    report = check_model(good, initial_state=state, params=params)
    assert report.ok and not report.warnings, str(report)
    assert report.timing is not None and report.timing.calls > 100


@pytest.mark.parametrize("output", [lambda t, x, u, params: x[0], lambda t, x, u, params: np.array([2.0 * x[0]])])
def test_no_false_alarm_over_an_output(output):
    report = check_model({"derivatives": axis, "output": output})
    assert report.ok and not report.warnings, str(report)


@pytest.mark.parametrize("waited", [0, 10**9], ids=["by itself", "for the processor"])
def test_what_the_first_call_waits_for_the_processor_is_not_its_own(waited, monkeypatch):
    looks = count(0, waited)  # ns
    monkeypatch.setattr(ThreadTime, "waited", lambda account: next(looks))

    def slow_at_first(t, x, u, params):
        if t == 0.0:
            time.sleep(0.005)
        return axis(t, x, u, params)

    report = check_model(slow_at_first, initial_state=[0.0, 0.0])
    late = [warning.message for warning in report.warnings if warning.clause == clauses.TIME]
    assert [message.startswith("the first call of derivatives()") for message in late] == [True] * (waited == 0)


def test_a_library_model_is_taken_as_it_is():
    model = library_model("linear-axis", tau=TAU, K=K, friction_plus=5.45, friction_minus=-5.6)
    assert check_model(model).ok
    assert not check_model(replace(model, advance=lambda x, u, T, params: (x[0],))).ok


def test_what_python_control_would_refuse_is_a_warning():
    def derivatives(t, x, u, params):
        return [x[1], K * u - x[1]]

    report = check_model(derivatives)
    assert report.ok and "u[0]" in str(report.warnings[0])
    with pytest.raises(ValueError):
        control.nlsys(derivatives, inputs=1, states=2).dynamics(0.0, np.zeros(2), np.zeros(1))


WARNED = [
    (lambda t, x, u, params: [x[1], (K * (u[0] + 0.1) - x[1]) / TAU], clauses.AT_REST, "without voltage"),
    (lambda t, x, u, params: [0.0 * x[1], 0.0], clauses.AT_REST, "do not move it"),
    (lambda t, x, u, params: [x[1], 100.0 * x[1] + u[0]], clauses.FINITE, "unstable"),
    (lambda x, u, T, params: [x[0] + 1e-3 * x[1], 0.9 * x[1] + 0.1 * u[0]], clauses.SAMPLE_TIME, "use T"),
]


@pytest.mark.parametrize(("model", "clause", "detail"), WARNED)
def test_what_is_odd_but_allowed_is_a_warning(model, clause, detail):
    report = check_model(model)
    assert report.ok, str(report)
    assert [warning.clause for warning in report.warnings] == [clause]
    assert detail in str(report)


def test_a_system_of_python_control_is_a_model_or_a_controller():
    plant = control.ss([[0, 1], [0, -1 / TAU]], [[0], [K / TAU]], [[1, 0]], 0)
    report = check_model(plant)
    assert report.ok and not report.warnings, str(report)
    assert check_controller(control.tf([20.0], [1.0])).ok
    with pytest.raises(InputError, match="check_controller or check_model"):
        check(plant)
