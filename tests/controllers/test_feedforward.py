"""Friction and backlash compensated along the reference: what they leave, beside the tracking controller."""

from __future__ import annotations

import numpy as np
import pytest
from control_loops import RANGE, T, axis_model, plant, ramp, run

from rds.controllers import library_controller
from rds.core.errors import InputError
from rds.core.types import Reference
from rds.models import library_model

PLAY = 0.02  # mm


def made(name, model, **options):
    return library_controller(name, model, T, RANGE, **options)


def circle_axis(samples=4000, radius=5.0, frequency=0.5):
    """A sinusoid of 0.5 Hz: what one axis does on a circle of 10 mm at 15.7 mm/s."""
    w, t = 2 * np.pi * frequency, np.arange(samples) * T
    return Reference(radius * np.sin(w * t), radius * w * np.cos(w * t), -radius * w**2 * np.sin(w * t))


def rms(controller, model):
    reference = circle_axis()
    measured, _ = run(controller, model, reference)
    error = (reference.position - measured)[2000:]  # from the second period on
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("speed", [-4.0, 1.0, 4.0])
def test_steady_motion_keeps_no_error_of_friction(axis, speed):
    reference = ramp(speed, 2000)
    measured, _ = run(made("feedforward", axis_model(axis)), plant(axis), reference)
    assert abs(reference.position[-1] - measured[-1]) < 1e-9  # tracking alone: 0.004 to 0.05 mm


@pytest.mark.parametrize("axis", "XYZ")
def test_without_friction_and_play_it_is_the_tracking_controller(axis):
    model = axis_model(axis, friction=False)
    ours, theirs = (run(made(name, model), plant(axis), circle_axis())[1] for name in ("feedforward", "tracking"))
    np.testing.assert_array_equal(ours, theirs)


def test_before_the_first_motion_no_friction_is_compensated():
    controller = made("feedforward", axis_model("X"), backlash=PLAY)
    still, state = Reference(0.0, 0.0, 0.0), controller.initial_state
    for _ in range(3):
        u, state = controller.control(0.0, still, 0.0, state, controller.params)
        assert u == 0.0


def test_the_mirrored_motion_takes_the_mirrored_voltage_from_the_first_sample_on():
    model = axis_model("X") | {"friction_plus": 0.4, "friction_minus": -0.4}
    controller, sine = made("feedforward", model, backlash=PLAY), circle_axis(3000)
    there = back = controller.initial_state
    for row in np.column_stack(sine).tolist():
        y, mirrored = 0.99 * row[0], Reference(*(-value for value in row))
        u, there = controller.control(0.0, Reference(*row), y, there, controller.params)
        opposite, back = controller.control(0.0, mirrored, -y, back, controller.params)
        assert u == -opposite != 0.0


def test_reversals_with_friction_leave_a_tenth_of_the_error():
    assert rms(made("feedforward", axis_model("X")), plant("X")) < 0.1 * rms(
        made("tracking", axis_model("X")), plant("X")
    )


def test_crossing_the_play_lessens_the_error_of_backlash():
    values = axis_model("X", friction=False)
    model = library_model("machine-axis", **values, backlash=PLAY)
    without = rms(made("feedforward", values), model)
    assert rms(made("feedforward", values, backlash=PLAY), model) < 0.5 * without


def test_the_voltage_of_a_reversal_moves_the_motor_by_the_play():
    values = axis_model("X", friction=False)
    still, state = Reference(0.0, -1e-300, 0.0), (0.0, 1.0, 1.0, 0.5 * PLAY)  # it has just turned back
    controller = made("feedforward", values, backlash=PLAY)
    total = 0.0
    for _ in range(200):
        u, state = controller.control(0.0, still, 0.0, state, controller.params)
        total += values["K"] * u * T
    assert total == pytest.approx(-PLAY, rel=1e-9)


def test_a_live_change_keeps_what_was_not_changed():
    controller = made("feedforward", axis_model("X"), backlash=PLAY)
    values = {name: controller.params[name] for name in controller.tunable}
    changed = controller.retune(values | {"friction_plus": 0.0})
    assert changed["coefficients"][9] == 0.0
    assert changed["coefficients"][10:] == controller.params["coefficients"][10:]


@pytest.mark.parametrize("option", [{"backlash": -0.1}, {"backlash_time": 0.0}, {"friction_minus": 0.1}])
def test_impossible_options_are_named(option):
    with pytest.raises(InputError, match=next(iter(option))):
        made("feedforward", axis_model("X"), **option)


def test_a_spindle_is_refused():
    with pytest.raises(InputError, match="controller 'feedforward' drives position axes"):
        library_controller("feedforward", axis_model("spindle"), T, RANGE, unit="rev/min")
