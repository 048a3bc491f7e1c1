"""python-control systems as controllers and models."""

from __future__ import annotations

import pickle
from dataclasses import replace
from math import exp

import control
import numpy as np
import pytest

import rds
from rds.controllers.design import tracking_controller_system
from rds.core.adapt import as_controller, as_model, is_control_system
from rds.core.errors import ContractError, InputError
from rds.core.types import Controller, Model, Reference

T = 1e-3
TAU, K = 9.943e-3, 1.764
AXIS = control.ss([[0, 1], [0, -1 / TAU]], [[0], [K / TAU]], [[1, 0]], 0, name="axis")
LAG = control.ss([[-50.0]], [[50.0]], [[1.0]], [[0.5]], name="lag")


def play(controller, errors):
    """Voltages for a sequence of errors, the position being zero."""
    state, voltages = controller.initial_state, []
    for k, e in enumerate(errors):
        u, state = controller.control(k * T, Reference(e, 0.0, 0.0), 0.0, state, controller.params)
        voltages.append(u)
    return voltages


def respond(model, voltages, T=T):
    x, outputs = model.initial_state, []
    for u in voltages:
        outputs.append(model.output(x) if model.output else x[0])
        x = model.advance(x, u, T, model.params)
    return outputs


ERRORS = np.sin(np.arange(50)).tolist()


def test_continuous_linear_controller_is_discretized_by_tustins_rule():
    discrete = LAG.sample(T, method="bilinear")
    expected = control.forced_response(discrete, U=ERRORS).outputs
    np.testing.assert_allclose(play(as_controller(LAG, T), ERRORS), expected, atol=1e-12)


@pytest.mark.parametrize("dt", [T, True])
def test_discrete_linear_controller_runs_as_it_is(dt):
    discrete = control.ss([[0.9]], [[1.0]], [[0.1]], [[2.0]], dt)
    expected = control.forced_response(control.ss([[0.9]], [[1.0]], [[0.1]], [[2.0]], T), U=ERRORS).outputs
    np.testing.assert_allclose(play(as_controller(discrete, T), ERRORS), expected, atol=1e-12)


def test_transfer_function_and_constant_gain_are_controllers():
    expected = play(as_controller(LAG, T), ERRORS)
    np.testing.assert_allclose(play(as_controller(control.ss2tf(LAG), T), ERRORS), expected, atol=1e-9)
    assert play(as_controller(control.ss([], [], [], [[20.0]]), T), [0.5]) == [10.0]


def test_controller_with_two_inputs_gets_reference_and_position():
    gain = as_controller(control.ss([], [], [], [[3.0, -2.0]]), T)
    assert gain.control(0.0, Reference(5.0, 9.0, 9.0), 1.0, (), gain.params)[0] == 13.0


def test_the_designed_tracking_system_is_the_library_law():
    from rds.controllers import library_controller

    poles = [[-32, 24], [-32, -24]]
    system = as_controller(tracking_controller_system(TAU, K, poles, -320, T), T)
    law = library_controller("tracking", {"tau": TAU, "K": K}, T, float("inf"), poles=poles)
    states = [system.initial_state, law.initial_state]
    for k in range(100):
        r, y = Reference(0.01 * k, 10.0, 1.0), 0.0095 * k
        answers = [c.control(k * T, r, y, x, c.params) for c, x in zip((system, law), states, strict=True)]
        states = [state for _, state in answers]
        assert answers[0][0] == pytest.approx(answers[1][0], rel=1e-9)


def test_nonlinear_controllers_continuous_and_discrete():
    def cube(t, x, u, params):
        return params["gain"] * u**3

    static = control.nlsys(None, cube, inputs=1, outputs=1, params={"gain": 2.0})
    assert play(as_controller(static, T), [2.0]) == [16.0]

    counter = control.nlsys(
        lambda t, x, u, params: x + u, lambda t, x, u, params: x, inputs=1, outputs=1, states=1, dt=True
    )
    assert play(as_controller(counter, T), [1.0, 2.0, 4.0, 0.0]) == [0.0, 1.0, 3.0, 7.0]

    integrator = control.nlsys(lambda t, x, u, params: u, lambda t, x, u, params: x, inputs=1, outputs=1, states=1)
    np.testing.assert_allclose(play(as_controller(integrator, T), [1.0, 2.0, 0.0]), [0.0, T, 3 * T])


def test_params_of_a_nonlinear_controller_can_be_changed():
    static = control.nlsys(None, lambda t, x, u, params: params["gain"] * u, inputs=1, outputs=1, params={"gain": 2.0})
    controller = as_controller(static, T)
    assert controller.params == {"gain": 2.0}
    assert controller.control(0.0, Reference(1.0, 0.0, 0.0), 0.0, (), {"gain": 5.0})[0] == 5.0


def test_linear_model_is_exact_for_a_held_voltage():
    model = as_model(AXIS, T)
    t = np.arange(200) * T
    expected = K * 3.0 * (t - TAU * (1 - np.exp(-t / TAU)))
    np.testing.assert_allclose(respond(model, [3.0] * 200), expected, atol=1e-12)


@pytest.mark.parametrize("answer", [[1.0], [1.0, 2.0, 3.0], 3.0])
@pytest.mark.parametrize("dt", [0, T])
def test_an_update_that_does_not_answer_for_each_state_is_refused(answer, dt):
    system = control.nlsys(
        lambda t, x, u, params: answer, lambda t, x, u, params: x[0], inputs=1, outputs=1, states=2, dt=dt, name="axle"
    )
    model = as_model(system, T)
    with pytest.raises(ContractError, match=r"of axle returned .*; it must return 2 numbers, one for each"):
        model.advance((0.0, 0.0), 1.0, T, model.params)


def test_nonlinear_and_interconnected_models_are_integrated():
    nonlinear = control.nlsys(
        lambda t, x, u, params: [x[1], (K * u[0] - x[1]) / params["tau"]],
        lambda t, x, u, params: x[0],
        inputs=["u"],
        outputs=["y"],
        states=2,
        params={"tau": TAU},
    )
    t = np.arange(200) * T
    expected = K * 3.0 * (t - TAU * (1 - np.exp(-t / TAU)))
    np.testing.assert_allclose(respond(as_model(nonlinear, T), [3.0] * 200), expected, atol=1e-9)
    slow_amplifier = control.ss([[-200.0]], [[200.0]], [[1.0]], 0, inputs=["command"], outputs=["u"])
    whole = control.interconnect([slow_amplifier, nonlinear], inputs=["command"], outputs=["y"])
    chain = respond(as_model(whole, T), [3.0] * 200)
    assert chain[-1] == pytest.approx(expected[-1] - 3.0 * K / 200.0, rel=1e-3)


def test_discrete_model_runs_as_it_is():
    model = as_model(AXIS.sample(T, method="zoh"), T)
    np.testing.assert_allclose(respond(model, [3.0] * 50), respond(as_model(AXIS, T), [3.0] * 50), atol=1e-12)


def test_adapted_parts_can_be_pickled():
    for part in (as_controller(LAG, T), as_model(AXIS, T)):
        assert pickle.loads(pickle.dumps(part)).initial_state == part.initial_state


def test_ready_parts_come_back_as_they_are():
    model, controller = as_model(AXIS, T), as_controller(LAG, T)
    assert as_model(model, T) is model
    assert as_controller(controller, T) is controller
    assert isinstance(model, Model)
    assert isinstance(controller, Controller)


def test_only_python_controls_objects_are_systems():
    assert is_control_system(AXIS)
    assert is_control_system(control.tf([1], [1, 1]))
    assert not is_control_system(3.0)
    assert not is_control_system(lambda t, x, u, params: x)
    assert not is_control_system(as_model(AXIS, T))


@pytest.mark.parametrize(
    "adapt, system, faults",
    [
        (as_controller, control.tf([0.1, 30.0], [1.0]), ["higher degree", "control.tf([Kd, Kp], [0.002, 1])"]),
        (as_model, control.tf([1.0, 0.0, 0.0], [0.0, 1.0, 0.5], T), ["higher degree"]),
        (as_controller, control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.01), ["dt = 0.01 s", "0.001 s"]),
        (as_model, AXIS.sample(0.002), ["dt = 0.002 s", "0.001 s"]),
        (as_controller, control.ss([], [], [], np.ones((1, 3))), ["3 inputs", "r - y"]),
        (as_controller, control.ss([], [], [], np.ones((2, 1))), ["2 outputs", "1 output (voltage)"]),
        (as_model, control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]]), ["2 inputs", "1 input (voltage)"]),
        (as_model, LAG, ["jumps with the voltage"]),
        (as_model, control.ss([], [], [], [[1.0]]), ["0 states"]),
        (as_model, control.nlsys(None, lambda t, x, u, p: u, inputs=1, outputs=1), ["0 states"]),
        (as_controller, "lag", ["no Controller", "control.StateSpace"]),
        (as_model, control.frd([1.0, 2.0], [1.0, 2.0]), ["cannot be run"]),
        (as_controller, control.ss([[0.5]], [[1.0]], [[1.0]], 0, None), ["dt = None", "dt = 0"]),
    ],
)
def test_what_cannot_be_run_is_refused_with_a_reason(adapt, system, faults):
    with pytest.raises(InputError) as error:
        adapt(system, T)
    for fault in faults:
        assert fault in str(error.value)


def test_a_nonlinear_model_whose_output_jumps_is_refused():
    leaky = control.nlsys(
        lambda t, x, u, params: -x + u, lambda t, x, u, params: x + u, inputs=1, outputs=1, states=1, name="leaky"
    )
    with pytest.raises(InputError, match="leaky"):
        as_model(leaky, T)


def test_a_continuous_model_advances_by_any_time_and_a_discrete_one_by_its_period():
    model = as_model(AXIS, T)
    assert model.params["A"][1][1] == pytest.approx(exp(-T / TAU))
    for time in (0.3 * T, 2 * T):
        _, velocity = model.advance(model.initial_state, 1.0, time, model.params)
        assert velocity == pytest.approx(K * (1.0 - exp(-time / TAU)), rel=1e-12)
    sampled = as_model(control.sample_system(AXIS, T), T)
    with pytest.raises(InputError, match="made for a sample period"):
        sampled.advance(sampled.initial_state, 1.0, 2 * T, sampled.params)


@pytest.mark.parametrize("sampled", [T, None])
def test_an_observer_counts_positions_from_where_the_axis_stands(sampled: float | None) -> None:
    """From the zero state the axis would be taken for one that has leapt 64 mm in a sample."""
    system = tracking_controller_system(TAU, K, [-32 + 24j, -32 - 24j], -320.0, sampled)
    runs = []
    for place in (0.0, 64.0):
        axis = rds.library_model("linear-axis", tau=TAU, K=K, friction_plus=0.5, friction_minus=-0.5)
        experiment = rds.Experiment(
            duration=0.5,
            sample_period=T,
            controller=system,
            model=replace(axis, initial_state=(place, 0.0)),
            reference=rds.square(amplitude=0.01, frequency=4.0, offset=place),
            interface={"quantization": False, "saturation": False},
        )
        run = experiment.run()
        runs.append((run["X_voltage"], run["X_measured"] - place))
    np.testing.assert_allclose(runs[1][0], runs[0][0], atol=1e-8)
    np.testing.assert_allclose(runs[1][1], runs[0][1], atol=1e-11)
    assert np.abs(runs[1][0]).max() < 1.0


def test_a_law_with_a_force_of_its_place_takes_positions_as_they_are() -> None:
    """It holds against a spring, 0.1 V/mm, with a filtered position."""
    spring = control.ss([[0.9]], [[0.0, 0.1]], [[0.1]], [[20.0, -20.0]], T)
    law = as_controller(spring, T)
    u, state = law.control(0.0, Reference(30.0, 0.0, 0.0), 30.0, law.initial_state, law.params)
    assert u == 0.0 and state == (3.0,)


@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0, 1e6, 1e12])
def test_whether_a_law_has_a_place_of_its_own_does_not_depend_on_the_sizes_of_its_states(scale: float) -> None:
    """Beside states of 1e12, the spring's force counted as rounding, and was taken from where the axis stood."""
    spring = control.ss([[0.9]], [[0.0, 0.1 * scale]], [[0.1 / scale]], [[20.0, -21.0]], T)
    law = as_controller(spring, T)
    assert law.control(0.0, Reference(30.0, 0.0, 0.0), 30.0, law.initial_state, law.params)[0] == -30.0
    system = tracking_controller_system(TAU, K, [-32 + 24j, -32 - 24j], -320.0, T)
    sizes = np.diag([scale ** (-1) ** n for n in range(system.nstates)])
    A, B, C = sizes @ system.A @ np.linalg.inv(sizes), sizes @ system.B, system.C @ np.linalg.inv(sizes)
    observer = as_controller(control.ss(A, B, C, system.D, T), T)
    start = observer.initial_state
    assert observer.control(0.0, Reference(64.0, 0.0, 0.0), 64.0, start, observer.params)[0] == 0.0


def test_an_output_function_that_fails_is_told_with_its_system_and_line():
    blind = control.nlsys(lambda t, x, u, p: u, lambda t, x, u, p: x[5], inputs=1, outputs=1, states=1, name="blind")
    with pytest.raises(ContractError, match=r"model blind: its output function fails: test_adapt.py, line \d+"):
        as_model(blind, 1e-3)
