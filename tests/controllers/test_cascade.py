"""The servo cascade: equation 17, the limits of its tuned responses, current limit, and wind-up with its remedies."""

from __future__ import annotations

import numpy as np
import pytest
from control_loops import RANGE, T, axis_model, plant, ramp, run, step
from hypothesis import given, settings
from hypothesis.strategies import floats, lists

import rds
from rds.controllers import library_controller
from rds.core.errors import InputError
from rds.core.types import Reference

RESISTANCE = 1.5  # Ohm


def made(axis="X", T=T, limit=RANGE, **options):
    unit = "rev/min" if axis == "spindle" else "mm"
    return library_controller("cascade", axis_model(axis), T, limit, unit=unit, **options)


@settings(max_examples=30)
@given(lists(floats(-50.0, 50.0), min_size=2, max_size=20))
def test_the_current_is_that_of_equation_17(errors):
    Kp, Ki, Kd = 0.4, 7.0, 0.002
    controller = made(Kpp=0.0, Kp=Kp, Ki=Ki, Kd=Kd, limit=1e9)
    state, held, before = controller.initial_state, 0.0, errors[0]
    for e in errors:  # the axis stands still: the demand is the error
        u, state = controller.control(0.0, Reference(0.0, e, 0.0), 3.0, state, controller.params)
        held = (e + before) / 2.0 * T + held
        expected = Kp * e + Ki * held + Kd * (e - before) / T
        assert state[5] == pytest.approx(expected, rel=1e-12, abs=1e-9)
        assert u == pytest.approx(expected, rel=1e-12, abs=1e-9)  # resistance 1 Ohm, no back-EMF at rest
        before = e


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("period", [1e-3, 5e-3, 2e-2, 5e-2])
@pytest.mark.parametrize("delay", [0, 1])
def test_the_tuned_speed_overshoots_by_less_than_5_percent_and_the_position_not_at_all(axis, period, delay):
    model = plant(axis, friction=False)
    samples = round(8.0 / period)
    positions, _ = run(made(axis, period, Kpp=0.0), model, ramp(4.0, samples, period), period, delay)
    speed = np.diff(positions) / period
    assert speed.max() < 4.0 * 1.05
    assert speed[-1] == pytest.approx(4.0, rel=0.03)
    positions, _ = run(made(axis, period), model, step(0.1, samples), period, delay)
    assert positions.max() < 0.1 * 1.001
    assert positions[-1] == pytest.approx(0.1, rel=0.02)


@pytest.mark.parametrize("period", [1e-3, 1e-2, 5e-2])
def test_the_tuned_spindle_overshoots_by_less_than_5_percent(period):
    for delay in (0, 1):
        speed, _ = run(made("spindle", period), plant("spindle"), step(500.0, round(8 / period)), period, delay)
        assert speed.max() < 500.0 * 1.05
        assert speed[-1] == pytest.approx(500.0, rel=0.02)


def test_friction_leaves_no_error_in_steady_motion():
    measured, _ = run(made(), plant("X"), reference := ramp(4.0, 4000))
    assert abs(reference.position[-1] - measured[-1]) < 1e-3


def test_the_current_that_flows_stays_within_its_limit():
    most = 0.8
    controller = made(resistance=RESISTANCE, current_limit=most, speed_filter=0.0)
    model, gain = axis_model("X"), axis_model("X")["K"]
    positions, voltages = run(controller, plant("X", friction=False), step(0.3, 1500))
    speed = np.gradient(positions, T)
    current = (voltages - speed / gain) / RESISTANCE
    assert np.abs(voltages).max() < RANGE
    assert np.abs(current[1:-1]).max() < most * (1.0 + T / model["tau"])  # the speed changes within a sample
    assert positions[-1] == pytest.approx(0.3, abs=1e-3)


def test_the_integral_winds_up_without_its_remedies():
    """Figure 51 of oacs-thesis: a speed beyond what the voltage can do, and back to one that it can do."""
    high, low, samples = 30.0, 5.0, 3000  # mm/s; 10 V do 17.6
    velocity = np.where(np.arange(samples) < 1500, high, low)
    reference = Reference(np.zeros(samples), velocity, np.zeros(samples))

    def lag(**options):
        positions, _ = run(made(Kpp=0.0, **options), plant("X", friction=False), reference)
        speed = np.diff(positions) / T
        late = np.flatnonzero(np.abs(speed[1500:] - low) > 0.5)
        return late[-1] * T, speed.max()

    wound, fastest = lag(antiwindup=0)
    held, _ = lag()
    limited, _ = lag(antiwindup=0, integral_limit=0.3)
    assert fastest == pytest.approx(10.0 * axis_model("X")["K"], rel=1e-6)
    assert wound > 1.0  # s
    assert held < 0.1
    assert limited < 0.5 * wound


@pytest.mark.parametrize(
    "options, integral, leaves, settles",
    [
        ({"antiwindup": 0}, 19.6, 1.34, 1.50),
        ({"antiwindup": 0, "integral_limit": 0.3}, 0.30, 0.0, 0.03),
        ({}, 0.15, 0.0, 0.23),
    ],
)
def test_the_documents_table_of_wind_up(options, integral, leaves, settles):
    result = rds.Experiment(
        axis="X",
        duration=3.0,
        reference={"kind": "speed", "points": [[0.0, 30.0], [1.5, 30.0], [1.5, 5.0]]},
        controller={"name": "cascade", "Kpp": 0.0, **options},
    ).run("simulation")
    t, v = result["time"] - 1.5, result["X_plant_velocity"]
    assert result["X_integral"].max() == pytest.approx(integral, abs=0.05)
    assert t[(t > 0.0) & (v < 17.0)][0] == pytest.approx(leaves, abs=0.005)
    assert t[np.abs(v - 5.0) > 0.5][-1] == pytest.approx(settles, abs=0.005)


def test_the_position_loop_is_refused_on_a_spindle():
    with pytest.raises(InputError, match="Kpp is of the position loop, and a spindle has its speed controlled"):
        made("spindle", Kpp=4.0)


def test_the_resistance_of_the_model_is_taken():
    model = axis_model("X") | {"resistance": 2.0}
    assert library_controller("cascade", model, T, RANGE).params["resistance"] == 2.0
    assert made().params["resistance"] == 1.0


def test_gains_and_antiwindup_can_be_changed_while_it_runs():
    controller = made(antiwindup=0)
    values = {name: controller.params[name] for name in controller.tunable} | {"Kp": 0.1}
    params = controller.retune(values)
    assert params["Kp"] == 0.1 and params["antiwindup"] == 0
    with pytest.raises(InputError, match="antiwindup = 2 must be a whole number from 0 to 1"):
        made(antiwindup=2)
