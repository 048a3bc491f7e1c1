"""A student's derivatives under RK4, and a student's advance."""

from __future__ import annotations

from itertools import pairwise
from math import cos, exp, log2

import numpy as np
import pytest

from rds.core.errors import ContractError, InputError
from rds.core.integrate import rk4
from rds.models import library_model
from rds.models.ode import advance_model, ode_model

T = 1e-3
PARAMS = {"tau": 9.943e-3, "K": 1.764}


def axis(t, x, u, params):
    return np.array([x[1], (params["K"] * u[0] - x[1]) / params["tau"]])


def pendulum(t, x, u, params):
    return np.array([x[1], -np.sin(x[0]) + u[0]])


def test_rk4_is_of_fourth_order():
    exact, *found = (np.array(rk4(pendulum, 0.0, [1.0, 0.0], [0.3], 2.0, {}, n)) for n in (2000, 8, 16, 32, 64))
    errors = [np.abs(x - exact).max() for x in found]
    orders = [log2(coarse / fine) for coarse, fine in pairwise(errors)]
    assert orders == pytest.approx([4.0] * 3, abs=0.25)


def test_default_substeps_are_exact_enough_for_an_axis():
    student = ode_model(axis, params=PARAMS)
    exact = library_model("linear-axis", **PARAMS)
    x = y = (0.0, 0.0)
    for u in np.random.default_rng(3).uniform(-10, 10, 500):
        x, y = student.advance(x, u, T, student.params), exact.advance(y, u, T, exact.params)
        assert x == pytest.approx(y, abs=1e-8)


@pytest.mark.parametrize(
    "derivatives",
    [
        lambda t, x, u, p: [x[1], (p["K"] * u[0] - x[1]) / p["tau"]],
        lambda t, x, u, p: (x[1], (p["K"] * u - x[1]) / p["tau"]),  # u where u[0] was meant
        lambda t, x, u, p: np.array([[x[1]], [(p["K"] * u[0] - x[1]) / p["tau"]]]),
        lambda t, x, u, p: np.array([[0, 1], [0, -1 / p["tau"]]]) @ x + np.array([0, p["K"] / p["tau"]]) * u,
    ],
)
def test_derivatives_may_come_in_any_shape_that_has_the_right_size(derivatives):
    expected = ode_model(axis, params=PARAMS).advance((1.0, 2.0), 3.0, T, PARAMS)
    assert ode_model(derivatives, params=PARAMS).advance((1.0, 2.0), 3.0, T, PARAMS) == pytest.approx(expected)


@pytest.mark.parametrize("kept", [np.zeros(2), [0.0, 0.0]], ids=["array", "list"])
def test_derivatives_may_come_in_the_same_array_each_time(kept):
    def derivatives(t, x, u, params):
        kept[:] = axis(t, x, u, params)
        return kept

    expected = ode_model(axis, params=PARAMS).advance((1.0, 2.0), 3.0, T, PARAMS)
    assert ode_model(derivatives, params=PARAMS).advance((1.0, 2.0), 3.0, T, PARAMS) == expected


def test_many_states_move_as_few_do_to_the_bit():
    """From 17 states on they are computed as an array, and as numbers before."""

    def all_of_them(t, x, u, params):
        return np.concatenate([axis(t, x[n : n + 2], u, params) for n in range(0, len(x), 2)])

    one = ode_model(axis, params=PARAMS).advance((1.0, 2.0), 3.0, T, PARAMS)
    many = ode_model(all_of_them, initial_state=[0.0] * 20, params=PARAMS).advance((1.0, 2.0) * 10, 3.0, T, PARAMS)
    assert many == one * 10


def test_motion_knows_the_time_since_the_run_began():
    model = ode_model(lambda t, x, u, params: [cos(t)], initial_state=[0.0])
    motion = model.motion(model, 0.1)
    for _ in range(20):
        motion.write(0.0)
    assert motion.read() == pytest.approx(np.sin(2.0), abs=1e-9)


def test_output_says_what_the_encoder_sees():
    model = ode_model(axis, [1.0, 2.0], PARAMS, output=lambda t, x, u, params: [params["tau"] * x[1]])
    assert model.output(model.initial_state) == 2.0 * PARAMS["tau"]
    motion = model.motion(model, T)
    assert motion.read() == 2.0 * PARAMS["tau"]
    both = ode_model(axis, [1.0, 2.0], PARAMS, output=lambda t, x, u, params: x)
    with pytest.raises(ContractError, match=r"output\(\) returned .*one number, as in `return x\[0\]`"):
        both.output(both.initial_state)


@pytest.mark.parametrize("first", [lambda u: u, lambda u: u[0]])
def test_a_students_advance_takes_the_voltage_with_and_without_index(first):
    def advance(x, u, T, params):
        return [x[0] + T * x[1], exp(-T / params["tau"]) * x[1] + first(u)]

    model = advance_model(advance, params=PARAMS)
    assert model.advance((0.0, 1.0), 2.0, T, PARAMS) == pytest.approx((T, exp(-T / PARAMS["tau"]) + 2.0))


def test_a_student_cannot_change_the_state_that_was_handed_in():
    def advance(x, u, T, params):
        x += 1.0
        return x

    state = np.zeros(2)
    assert advance_model(advance).advance(state, 0.0, T, {}) == (1.0, 1.0)
    assert state.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("answer", [[1.0], [1.0, 2.0, 3.0], None, "fast", 3.0, np.array(3.0), [None, 1.0], {1.0, 2.0}])
def test_answers_of_the_wrong_size_break_the_contract(answer):
    student = ode_model(lambda t, x, u, params: answer)
    with pytest.raises(ContractError, match=r"derivatives\(\) returned .*2 numbers"):
        student.advance((0.0, 0.0), 0.0, T, {})
    with pytest.raises(ContractError, match=r"advance\(\) returned .*2 numbers"):
        advance_model(lambda x, u, T, params: answer).advance((0.0, 0.0), 0.0, T, {})


@pytest.mark.parametrize("state", [[], "rest", [float("nan"), 0.0], None, [[0.0, 1.0], [2.0, 3.0]]])
def test_bad_initial_states_are_refused(state):
    with pytest.raises(InputError, match="initial_state"):
        ode_model(axis, state)


@pytest.mark.parametrize("substeps", [0, -1, 2.5, True, "10"])
def test_bad_substeps_are_refused(substeps):
    with pytest.raises(InputError, match="substeps"):
        ode_model(axis, substeps=substeps)
