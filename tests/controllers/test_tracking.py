"""The general tracking controller in the loop: the error that friction leaves, saturation, the start."""

from __future__ import annotations

import pickle
import subprocess
import sys
from math import exp, pi

import numpy as np
import pytest
from control_loops import POLES, RANGE, T, axis_model, plant, ramp, run, step

from rds.controllers import library_controller, observer
from rds.controllers.design import observer_parameters, tracking_gains
from rds.controllers.tracking import control, observe
from rds.core.errors import InputError
from rds.core.types import Controller, Reference


def tracking(axis, **options):
    return library_controller("tracking", axis_model(axis), T, RANGE, **options)


def analytic_error(axis, direction):
    """(F_C/τ)(1 + g₂/320)/g₁: what is left of Coulomb friction in steady motion, mm."""
    model = axis_model(axis)
    g1, g2 = tracking_gains(model["tau"], POLES)
    return model[f"friction_{direction}"] / model["tau"] * (1 + g2 / 320) / g1


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("direction, sign", [("plus", 1), ("minus", -1)])
@pytest.mark.parametrize("speed", [1.0, 4.0, 2 * pi])
def test_steady_error_is_the_analytic_one(axis, direction, sign, speed):
    reference = ramp(sign * speed, 2000)
    measured, _ = run(tracking(axis), plant(axis), reference)
    error = reference.position[-1] - measured[-1]
    assert error == pytest.approx(analytic_error(axis, direction), rel=0.01)
    assert error == pytest.approx(analytic_error(axis, direction), rel=0.001)  # as it comes out


def test_analytic_error_of_x_is_the_published_one():
    assert analytic_error("X", "plus") == pytest.approx(0.0300, abs=5e-5)


def test_a_continuous_observer_with_held_position_would_halve_the_error_of_x():
    """Pins down why the observer is made for the sampled loop: the naive one is biased in proportion to speed."""
    tau, K = (axis_model("X")[name] for name in ("tau", "K"))
    g1, g2 = tracking_gains(tau, POLES)
    L, F, G, H = observer_parameters(tau, K, -320)
    decay = exp(F * T)

    def naive(t, r, y, state, params):
        (z,) = state
        u = tau / K * (r.velocity / tau + g1 * (r.position - y) + g2 * (r.velocity - L * y - z))
        return u, (decay * z + (decay - 1) / F * (G * y + H * u),)

    errors = {}
    for speed in (pi, 2 * pi):  # 2π mm/s is the top speed of 5 mm at 0.2 Hz
        reference = ramp(speed, 2000)
        measured, _ = run(Controller(naive, (0.0,)), plant("X"), reference)
        errors[speed] = reference.position[-1] - measured[-1]
    assert errors[2 * pi] == pytest.approx(0.0135, abs=2e-4)
    lost = [analytic_error("X", "plus") - error for error in errors.values()]
    assert lost[1] == pytest.approx(2 * lost[0], rel=0.01)


def test_frictionless_axis_is_followed_without_error_or_bias():
    controller = tracking("X")
    reference = ramp(5.0, 2000)
    measured, _ = run(controller, plant("X", friction=False), reference)
    assert abs(reference.position[-1] - measured[-1]) < 1e-9


def test_the_law_is_the_observer_and_equation_8():
    controller, model = tracking("X"), axis_model("X")
    p = controller.params
    c = (p["L"], p["F"], p["G"], p["H"])
    y, r, z = 0.3, Reference(0.4, 2.0, 30.0), -53.0
    estimate, _ = observer.step(z, y, 0.0, c)
    expected = (
        model["tau"]
        / model["K"]
        * (r.acceleration + r.velocity / model["tau"] + p["g1"] * (r.position - y) + p["g2"] * (r.velocity - estimate))
    )
    u, state = control(0.0, r, y, (z, 1.0), p)
    assert u == pytest.approx(expected, rel=1e-12)
    assert state == pytest.approx((observer.step(z, y, u, c)[1], 1.0))
    assert observe(y, (z, 1.0), (), p)[0] == pytest.approx(estimate)


def test_the_observer_is_told_the_voltage_that_saturation_leaves():
    """Through 20 mm at full voltage the estimate stays the true velocity of the frictionless axis."""
    controller, model = tracking("X"), plant("X", friction=False)
    motion, state = model.motion(model, T), controller.initial_state
    worst = highest = 0.0
    for k in range(1500):
        y = motion.read()
        worst = max(worst, abs(observe(y, state, (), controller.params)[0] - motion.velocity))
        u, state = controller.control(k * T, Reference(20.0, 0.0, 0.0), y, state, controller.params)
        highest = max(highest, abs(u))
        motion.write(u)
    assert highest == RANGE
    assert worst < 1e-9


@pytest.mark.parametrize("start", [-40.0, 12.345])
def test_an_axis_at_rest_anywhere_gives_no_jerk_at_the_start(start):
    controller = tracking("X")
    u, state = controller.control(0.0, Reference(start, 0.0, 0.0), start, controller.initial_state, controller.params)
    assert abs(u) < 1e-9
    assert abs(observe(start, state, (), controller.params)[0]) < 1e-9


def test_without_saturation_nothing_is_limited():
    controller = library_controller("tracking", axis_model("X"), T, float("inf"))
    _, voltages = run(controller, plant("X"), step(20.0, 10))
    assert voltages.max() > 2 * RANGE


def test_explicit_gains_go_without_python_control():
    code = (
        "import sys\nfrom rds.controllers import library_controller as make\n"
        "for name in ('p', 'pid', 'modified-pid'): make(name, {'tau': 0.01, 'K': 1.7}, 1e-3, 10.0)\n"
        "c = make('tracking', {'tau': 0.01, 'K': 1.7}, 1e-3, 10.0, gains=[1600, -36.0])\n"
        "c.control(0.0, (1.0, 0.0, 0.0), 0.0, c.initial_state, c.params)\n"
        "assert not {'control', 'scipy'} & set(sys.modules), 'imported'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_finished_controllers_travel_to_another_process_without_python_control():
    data = pickle.dumps(tracking("X"))
    code = (
        f"import sys, pickle\nc = pickle.loads({data!r})\n"
        "c.control(0.0, (1.0, 0.0, 0.0), 0.0, c.initial_state, c.params)\n"
        "assert 'control' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_explicit_gains_equal_those_of_the_poles():
    gains = list(tracking_gains(axis_model("X")["tau"], POLES))
    assert tracking("X", gains=gains).params == tracking("X", poles=POLES, observer_pole=-320).params


@pytest.mark.parametrize(
    "options, fault",
    [
        ({"poles": POLES, "gains": [1, 2]}, "give one of them"),
        ({"gains": [1600]}, "[g1, g2]"),
        ({"gains": [1600, float("nan")]}, "gains[1]"),
        ({"poles": [[-3200, 2400], [-3200, -2400]]}, "choose slower poles"),
        ({"observer_pole": 320}, "less than 0"),
        ({"pole": -320}, "it has poles, observer_pole, gains"),
    ],
)
def test_options_that_will_not_do_are_refused(options, fault):
    with pytest.raises(InputError) as error:
        tracking("X", **options)
    assert fault in str(error.value)


@pytest.mark.parametrize("name", ["feedforward", "zero-phase"])
def test_a_spindle_is_told_what_to_use(name):
    with pytest.raises(InputError, match="use 'tracking', 'p', 'pid' or 'modified-pid'"):
        library_controller(name, axis_model("spindle"), T, RANGE, unit="rev/min")


def test_slower_sampling_stays_damped():
    for period in (1e-3, 2e-3, 5e-3, 1e-2):
        controller = library_controller("tracking", axis_model("X"), period, RANGE)
        measured, _ = run(controller, plant("X", friction=False), step(0.1, round(1 / period)), period)
        assert measured.max() < 0.1 * 1.1
        assert measured[-1] == pytest.approx(0.1, rel=1e-3)
        assert np.abs(measured[round(0.3 / period) :] - 0.1).max() < 0.002
