"""The DC motor with current: its transfer function, exactness, and the linear axis that is its limit."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats
from scipy.linalg import expm

import rds
from rds.core.errors import InputError
from rds.models import library_model
from rds.models.dc_motor_axis import coefficients, force, torque

# chosen: a 12 V motor of 80 W on a screw
MOTOR = {
    "resistance": 0.6,
    "inductance": 0.4e-3,
    "torque_constant": 0.04,
    "inertia": 4e-5,
    "damping": 2e-5,
    "lead": 5.0,
}


def system(p):
    """dx/dt = A x + B u in mm, mm/s and A."""
    h = p["lead"] / (2 * pi)
    k, L, J = p["torque_constant"], p["inductance"], p["inertia"]
    A = [[0, 1, 0], [0, -p["damping"] / J, k * h / J], [0, -k / (h * L), -p["resistance"] / L]]
    return np.array(A), np.array([0, 0, 1 / L])


@settings(max_examples=60)
@given(L=floats(1e-7, 0.05), b=floats(0.0, 1e-2), k=floats(1e-3, 0.5), J=floats(1e-6, 1e-2), T=floats(1e-4, 0.05))
def test_a_sample_is_the_matrix_exponential(L, b, k, J, T):
    params = MOTOR | {"inductance": L, "damping": b, "torque_constant": k, "inertia": J}
    A, B = system(params)
    whole = expm(np.vstack([np.column_stack([A, B]), np.zeros(4)]) * T)[:3]
    scale = np.abs(whole).max(axis=0) + 1e-300
    assert np.array(coefficients(params, T)) / scale == pytest.approx(whole / scale, abs=3e-8)


def test_two_halves_are_a_whole():
    motion = library_model("dc-motor-axis", **MOTOR)
    whole = motion.advance((1.0, 2.0, 0.3), 5.0, 2e-3, motion.params)
    half = motion.advance((1.0, 2.0, 0.3), 5.0, 1e-3, motion.params)
    assert motion.advance(half, 5.0, 1e-3, motion.params) == pytest.approx(whole, rel=1e-12)


def test_the_steady_speed_and_current_are_those_of_equation_7_17():
    model = library_model("dc-motor-axis", **MOTOR)
    _, v, i = model.advance((0.0, 0.0, 0.0), 12.0, 5.0, model.params)
    k, R, b = MOTOR["torque_constant"], MOTOR["resistance"], MOTOR["damping"]
    omega = 12.0 * k / (b * R + k * k)  # P(0) = K/(b R + K²)
    assert v == pytest.approx(omega * MOTOR["lead"] / (2 * pi), rel=1e-9)
    assert i == pytest.approx(b * omega / k, rel=1e-9)
    assert torque(i, MOTOR) == pytest.approx(b * omega, rel=1e-9)
    assert force(1.0, MOTOR) == pytest.approx(0.04 * 2 * pi / 0.005)


def test_without_inductance_it_is_the_linear_axis():
    motor = library_model("dc-motor-axis", **{**MOTOR, "inductance": 0.0})
    axis = library_model("linear-axis", tau=motor.params["tau"], K=motor.params["K"])
    state, other = (0.0, 0.0, 0.0), (0.0, 0.0)
    for k in range(200):
        u = 8.0 * np.sin(0.05 * k)
        state, other = motor.advance(state, u, 1e-3, motor.params), axis.advance(other, u, 1e-3, axis.params)
        assert state[:2] == pytest.approx(other, rel=1e-9, abs=1e-12)


def test_it_comes_the_nearer_to_the_linear_axis_the_smaller_the_inductance():
    def path(inductance):
        motor = library_model("dc-motor-axis", **{**MOTOR, "inductance": inductance})
        state = (0.0, 0.0, 0.0)
        return [state := motor.advance(state, 6.0, 1e-3, motor.params) for _ in range(100)][-1][0]

    errors = [abs(path(L) - path(0.0)) for L in (1e-4, 1e-5, 1e-6, 1e-9)]
    assert errors == sorted(errors, reverse=True)
    assert errors[1] == pytest.approx(errors[0] / 10, rel=0.05)  # of first order in L
    assert errors[-1] < 1e-6


def test_a_run_records_the_current_and_the_cascade_limits_it():
    result = rds.Experiment(
        axis="X",
        model={"name": "dc-motor-axis", **MOTOR},
        controller={"name": "cascade", "current_limit": 3.0},
        reference={"kind": "square", "amplitude": 2.0, "frequency": 0.5},
        duration=1.0,
    ).run("simulation")
    current = result["X_plant_current"]
    assert result.units["X_plant_current"] == "A"
    assert 2.0 < np.abs(current).max() < 3.3  # the demand's limit, and what the speed changes within the delay
    assert np.abs(result["X_current"]).max() <= 3.0


def test_missing_parameters_are_named():
    with pytest.raises(InputError, match=r"dc-motor-axis needs torque_constant \(torque constant k.*N m/A\)"):
        library_model("dc-motor-axis", resistance=1.0)


def test_numbers_that_nothing_can_be_computed_with_are_refused() -> None:
    with pytest.raises(InputError, match=r"cannot be computed .* torque_constant = 1e-300"):
        library_model("dc-motor-axis", resistance=1.0, torque_constant=1e-300, inertia=1.0, lead=1.0)
