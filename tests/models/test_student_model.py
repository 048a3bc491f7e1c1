"""A student's file as a model."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from rds.core.errors import ContractError, InputError
from rds.core.load import from_namespace, load_student
from rds.models.student import student_model

TAU, K = 9.943e-3, 1.764


def derivatives(t, x, u, params):
    return [x[1], (params["K"] * u[0] - x[1]) / TAU]


def advance(x, u, T, params):
    decay = math.exp(-T / TAU)
    final = params["K"] * u[0]
    return [x[0] + final * T + (x[1] - final) * TAU * (1 - decay), final + (x[1] - final) * decay]


def test_both_ways_of_writing_it_give_the_same_answer():
    params = {"K": K}
    by_rk4 = student_model(from_namespace({"derivatives": derivatives, "params": params}))
    exact = student_model(from_namespace({"advance": advance, "params": params}))
    x = y = (0.0, 0.0)
    for _ in range(100):
        x, y = by_rk4.advance(x, 5.0, 1e-3, by_rk4.params), exact.advance(y, 5.0, 1e-3, exact.params)
    assert x == pytest.approx(y, rel=1e-8)
    assert x[1] == pytest.approx(5.0 * K, rel=1e-4)


def test_parameters_go_before_its_own_and_must_be_known():
    student = from_namespace({"derivatives": derivatives, "params": {"K": K}})
    assert student_model(student, params={"K": 2.0}).params == {"K": 2.0}
    with pytest.raises(InputError, match="unknown parameter 'k'; known parameters: K"):
        student_model(student, params={"k": 2.0})


def test_output_and_initial_state_are_taken_over():
    model = student_model(
        from_namespace(
            {
                "derivatives": derivatives,
                "output": lambda t, x, u, params: 2 * x[0],
                "initial_state": [1.0, 0.0],
                "params": {"K": K},
            }
        )
    )
    assert model.output is not None and model.output(model.initial_state) == 2.0


@pytest.mark.parametrize("function", [lambda t, x, u, params: [x[1], x[2], u[0]], lambda t, x, u, params: [-x[0]]])
def test_a_missing_initial_state_is_noticed_before_the_run(function):
    with pytest.raises(ContractError, match="there is no initial_state"):
        student_model(from_namespace({"derivatives": function}))


def test_a_controller_is_no_model():
    with pytest.raises(ContractError, match="no model"):
        student_model(from_namespace({"control": lambda t, r, y, state, params: (0.0, state)}))


def test_derivatives_that_work_in_their_x_leave_the_state_as_it_is(tmp_path: Path) -> None:
    head, acceleration = "def derivatives(t, x, u, params):\n", "(1.7 * u[0] - x[1] + 2.0) / 0.01"
    pure, inside = tmp_path / "pure.py", tmp_path / "inside.py"
    pure.write_text(f"{head}    return [x[1], {acceleration.replace('2.0', '1.0')}]\n")
    inside.write_text(f"{head}    speed = x[1]\n    x[1] += 1.0\n    return [speed, {acceleration}]\n")
    there = [student_model(load_student(file)) for file in (pure, inside)]
    ends = [model.advance((0.0, 0.0), 5.0, 1e-3, model.params) for model in there]
    assert ends[1] == pytest.approx(ends[0], rel=1e-12)


def test_an_answer_of_a_wrong_size_names_its_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("initial_state = [0.0, 0.0]\ndef derivatives(t, x, u, params):\n    pass\n")
    model = student_model(load_student(tmp_path / "mine.py"))
    with pytest.raises(ContractError, match=r"mine.py: derivatives\(\) returned None; it must return dx/dt, 2 numbers"):
        model.advance((0.0, 0.0), 5.0, 1e-3, model.params)
