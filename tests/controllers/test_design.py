"""The design functions against Table 2 of mini-cnc-rds and against python-control."""

from __future__ import annotations

import subprocess
import sys
from math import exp, inf

import control
import numpy as np
import pytest
from control_loops import POLES, T, axis_model
from hypothesis import given, settings
from hypothesis.strategies import floats

from rds.controllers import observer
from rds.controllers.design import (
    observer_parameters,
    reduced_order_observer,
    sampled_observer,
    tracking_controller_system,
    tracking_gains,
)
from rds.core.errors import InputError

# Value and half of its last printed digit; g2 of Z with the sign that its equations give (printed: 22.0).
TABLE_2 = {
    "X": {"g1": (1.60e3, 5), "g2": (-36.6, 0.05), "L": (219.4, 0.05), "G": (-7.02e4, 50), "H": (177.4, 0.05)},
    "Y": {"g1": (1.60e3, 5), "g2": (-31.8, 0.05), "L": (224.2, 0.05), "G": (-7.17e4, 50), "H": (180.3, 0.05)},
    "Z": {"g1": (1.60e3, 5), "g2": (-22.0, 0.05), "L": (234.0, 0.05), "G": (-7.49e4, 50), "H": (137.1, 0.05)},
}


@pytest.mark.parametrize("axis", "XYZ")
def test_design_reproduces_table_2(axis):
    tau, K = axis_model(axis, friction=False).values()
    g1, g2 = tracking_gains(tau, POLES)
    L, F, G, H = observer_parameters(tau, K, -320)
    assert pytest.approx(-320, abs=0.5) == F
    for name, value in {"g1": g1, "g2": g2, "L": L, "G": G, "H": H}.items():
        printed, half_a_digit = TABLE_2[axis][name]
        assert value == pytest.approx(printed, rel=0, abs=half_a_digit), name


@pytest.mark.parametrize("poles", [[-32 + 24j, -32 - 24j], [-50, -50], [-10, -90]])
def test_the_closed_form_is_that_of_python_control(poles):
    A, B = np.array([[0.0, 1.0], [0.0, -1.0 / 9.943e-3]]), np.array([[0.0], [1.0]])
    assert tracking_gains(9.943e-3, poles) == tuple(np.ravel(control.acker(A, B, poles)))


def test_a_run_does_not_wait_for_python_control():
    script = "import sys; from rds.controllers.design import tracking_gains; tracking_gains(0.01, [-30, -40])"
    script += "; assert not {'control', 'matplotlib'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", script], check=True)


@given(tau=floats(1e-3, 0.5), slow=floats(-400, -1), fast=floats(-400, -1))
@settings(max_examples=50, deadline=None)
def test_gains_place_the_poles(tau, slow, fast):
    g1, g2 = tracking_gains(tau, [slow, fast])
    assert g1 == pytest.approx(slow * fast, rel=1e-6)
    assert g2 + 1 / tau == pytest.approx(-slow - fast, rel=1e-6)


def test_a_double_pole_can_be_placed():
    assert tracking_gains(0.01, np.array([[-40, 0], [-40, 0]])) == pytest.approx((1600, -20))
    assert tracking_gains(0.01, [-40, -40]) == pytest.approx((1600, -20))


@pytest.mark.parametrize(
    "poles, fault",
    [
        ([-32], "2 poles"),
        ([[-32, 24], [-32, 24]], "conjugate"),
        ([32, -32], "not stable"),
        ([float("nan"), -1], "finite"),
        (["fast", -1], "number"),
        (-32, "must be a list"),
        (np.array(-32.0), "must be a list"),
        ([[-32, 24, 1], [-32, -24]], "[real, imaginary]"),
    ],
)
def test_bad_poles_are_refused(poles, fault):
    with pytest.raises(InputError) as error:
        tracking_gains(0.01, poles)
    assert fault in str(error.value)


@given(tau=floats(1e-3, 0.5), K=floats(0.1, 1e3), pole=floats(-1000, -1), T=floats(1e-4, 0.05))
def test_sampled_observer_is_the_observer_of_the_held_plant(tau, K, pole, T):
    """From the right start it stays right for any voltage; from a wrong one its error shrinks by F each sample."""
    c = sampled_observer(tau, K, pole, T)
    L, F, _, _ = c
    assert pytest.approx(exp(pole * T)) == F
    a12, a22, b1, b2 = observer.held_axis(tau, K, T)
    x, v, u = 1.0, 2.0, 3.0
    scale = abs(v) + abs(L * x) + K * u
    for z, error in ((v - L * x, 0.0), (v - L * x - 1.0, 1.0)):
        estimate, after = observer.step(z, x, u, c)
        assert v - estimate == pytest.approx(error, abs=1e-9 * scale)
        x2, v2 = x + a12 * v + b1 * u, a22 * v + b2 * u
        scale2 = scale + abs(L) * (abs(x2) + abs(b1 * u))
        assert v2 - observer.step(after, x2, u, c)[0] == pytest.approx(F * error, abs=1e-9 * scale2)


def test_held_axis_is_python_controls_zero_order_hold():
    tau, K = axis_model("Y", friction=False).values()
    held = control.ss([[0, 1], [0, -1 / tau]], [[0], [K / tau]], [[1, 0]], 0).sample(T, method="zoh")
    a12, a22, b1, b2 = observer.held_axis(tau, K, T)
    np.testing.assert_allclose(held.A, [[1, a12], [0, a22]], rtol=1e-12)
    np.testing.assert_allclose(held.B, [[b1], [b2]], rtol=1e-9)


def test_controller_system_closes_the_loop_at_the_poles_asked_for():
    tau, K = axis_model("X", friction=False).values()
    law = tracking_controller_system(tau, K, POLES, -320)
    axis = control.ss([[0, 1], [0, -1 / tau]], [[0], [K / tau]], [[1, 0]], 0, inputs=["u"], outputs=["y"])
    loop = control.interconnect([law, axis], inputs=["r_position", "r_velocity", "r_acceleration"], outputs=["y"])
    assert sorted(loop.poles(), key=lambda p: (p.real, p.imag)) == pytest.approx([-320, -32 - 24j, -32 + 24j], rel=1e-6)


def test_sampled_controller_system_has_the_sampled_observers_pole():
    tau, K = axis_model("X", friction=False).values()
    law = tracking_controller_system(tau, K, POLES, -320, T)
    assert law.dt == T
    axis = control.ss([[0, 1], [0, -1 / tau]], [[0], [K / tau]], [[1, 0]], 0).sample(T, method="zoh")
    axis = control.ss(axis, inputs=["u"], outputs=["y"])
    loop = control.interconnect([law, axis], inputs=["r_position", "r_velocity", "r_acceleration"], outputs=["y"])
    assert np.abs(loop.poles() - exp(-0.32)).min() < 1e-9


def _estimation_errors(sys, observer_system, seconds):
    """State minus estimate over time, both driven by the same input, the observer starting from zero."""
    n, p = sys.nstates, sys.noutputs
    both = control.append(sys, observer_system)
    A = np.zeros((sys.nstates + observer_system.nstates,) * 2)
    B_y = observer_system.B[:, -p:]
    A[:n, :n] = sys.A
    A[n:, :n] = B_y @ sys.C
    A[n:, n:] = observer_system.A
    B = np.vstack([sys.B, observer_system.B[:, :-p] + B_y @ sys.D])
    D_y = observer_system.D[:, -p:]
    C = np.hstack([np.eye(n) - D_y @ sys.C, -observer_system.C])
    D = -(observer_system.D[:, :-p] + D_y @ sys.D)
    assert both.nstates == len(A)
    errors = control.ss(A, B, C, D, dt=sys.dt)
    t = np.arange(0, seconds, sys.dt) if sys.dt else np.linspace(0, seconds, 2001)
    start = np.concatenate([np.arange(1.0, n + 1), np.zeros(observer_system.nstates)])
    inputs = np.array([np.sin((3 + i) * t) for i in range(sys.ninputs)])
    return control.forced_response(errors, t, inputs, start).outputs


def _mimo(dt=0):
    random = np.random.default_rng(7)
    A = random.normal(size=(5, 5)) - 2 * np.eye(5)
    sys = control.ss(A, random.normal(size=(5, 2)), random.normal(size=(2, 5)), random.normal(size=(2, 2)))
    return sys.sample(dt) if dt else sys


def test_reduced_order_observer_of_a_system_with_several_outputs():
    sys = _mimo()
    built = reduced_order_observer(sys, [-8, [-10, 3], [-10, -3]])
    assert (built.nstates, built.ninputs, built.noutputs) == (3, 4, 5)
    assert built.output_labels == [f"{label}_hat" for label in sys.state_labels]
    assert sorted(built.poles(), key=lambda p: (p.real, p.imag)) == pytest.approx([-10 - 3j, -10 + 3j, -8], rel=1e-6)
    errors = _estimation_errors(sys, built, 3.0)
    assert np.abs(errors[:, 0]).max() > 0.1
    assert np.abs(errors[:, -1]).max() < 1e-6


def test_reduced_order_observer_of_a_discrete_system():
    sys = _mimo(dt=0.02)
    built = reduced_order_observer(sys, [0.5, 0.6, 0.7])
    assert built.dt == 0.02
    assert np.abs(_estimation_errors(sys, built, 2.0)[:, -1]).max() < 1e-6
    assert np.abs(reduced_order_observer(sys, [0.0, 1e-5, -1e-5]).poles()).max() < 1e-3  # nearly deadbeat


def test_reduced_order_observer_of_the_axis_is_equation_9():
    tau, K = axis_model("X", friction=False).values()
    axis = control.ss([[0, 1], [0, -1 / tau]], [[0], [K / tau]], [[1, 0]], 0)
    built = reduced_order_observer(axis, [-320])
    L, F, G, H = observer_parameters(tau, K, -320)
    s = 10j
    np.testing.assert_allclose(built(s)[1], [H / (s - F), L + G / (s - F)], rtol=1e-9)


def test_observer_without_unmeasured_states_hands_the_outputs_through():
    sys = control.ss(-np.eye(2), np.ones((2, 1)), [[2.0, 0], [0, 4.0]], 0)
    built = reduced_order_observer(sys, [])
    np.testing.assert_allclose(built.D, [[0, 0.5, 0], [0, 0, 0.25]])


def test_poles_that_rounding_puts_elsewhere_are_refused():
    """Modes at almost one place: python-control's gains of some 1e8 put a pole of the observer at +9.9 and the like."""
    sys = control.ss(np.diag([-1.0, -1.0 - 1e-6, -1.0 - 2e-6, -1.0 - 3e-6, -2.0]), np.ones((5, 1)), np.ones((1, 5)), 0)
    with pytest.raises(InputError, match="cannot be placed: the system is nearly not reachable"):
        reduced_order_observer(sys, [-6, -7, -9, -18])


@pytest.mark.parametrize(
    "C, poles, fault",
    [
        ([[1, 0], [2, 0]], [-3], "not independent"),
        ([[1, 0]], [-3, -4], "1 pole"),
        ([[0, 1]], [-3], "cannot be placed"),  # position cannot be observed from velocity
    ],
)
def test_observers_that_cannot_be_are_refused(C, poles, fault):
    sys = control.ss([[0, 1], [0, -100]], [[0], [100]], C, 0)
    with pytest.raises(InputError) as error:
        reduced_order_observer(sys, poles)
    assert fault in str(error.value)


@pytest.mark.parametrize("pole", [0, 320, inf, True, "fast"])
def test_bad_observer_poles_are_refused(pole):
    with pytest.raises(InputError, match="observer_pole"):
        sampled_observer(0.01, 1.7, pole, T)
