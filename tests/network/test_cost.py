"""The cost of a delayed loop: closed forms, published numbers, and an event simulation that shares nothing."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats

import rds
from rds.network.cost import Law, cost
from rds.network.delays import Delay
from rds.network.late_messages import chain
from rds.network.monte_carlo import simulate
from rds.network.sampled import Plant, part

ONE = np.eye(1)
INTEGRATOR = Plant(np.zeros((1, 1)), ONE, ONE, ONE)
AXIS = Plant(
    np.array([[0.0, 1.0], [0.0, -100.0]]), np.array([0.0, 200.0]), np.array([[1.0, 0.0]]), np.diag([0.0, 4.0]), 1e-4
)


def test_the_integrator_without_delay() -> None:
    """Published: the minimum-variance integrator sampled at h = 1, K = -(3 + √3)/(2 + √3)."""
    found = cost(INTEGRATOR, Law.gain(-(3 + sqrt(3)) / (2 + sqrt(3))), 1.0, Delay())
    assert found.y == pytest.approx(1.077350269189626, rel=1e-13)
    assert found.u == pytest.approx(1.732050807568876, rel=1e-13)
    # between samples: x_s = (1 + K s) x + noise, so that the mean over time is var (1 + K + K²/3) + 1/2
    K = -(3 + sqrt(3)) / (2 + sqrt(3))
    assert found.cost == pytest.approx(found.y * (1 + K + K**2 / 3) + 0.5, rel=1e-12)


@settings(max_examples=40)
@given(gain=floats(0.1, 0.9), delay=floats(0.0, 1.0))
def test_the_integrator_with_a_constant_delay(gain: float, delay: float) -> None:
    """x⁺ = x - (1 - τ) L x - τ L x₋ + v is an AR(2) process, whose variance Yule and Walker give."""
    a1, a2 = 1 - (1 - delay) * gain, -delay * gain
    expected = (1 - a2) / ((1 + a2) * ((1 - a2) ** 2 - a1**2))
    found = cost(INTEGRATOR, Law.gain(-gain), 1.0, Delay.named("constant", delay=delay))
    assert found.y == pytest.approx(expected, rel=1e-9)
    assert found.u == pytest.approx(gain**2 * expected, rel=1e-9)


@pytest.mark.parametrize("K", [1.2, 1.9, 2.5, 3.0])
def test_the_published_region_of_delays_of_the_integrator(K: float) -> None:
    """W. Zhang, M. S. Branicky, S. M. Phillips, Stability of networked control systems, IEEE Control Systems Magazine
    21 (2001): dx = u dt, u = -K x, delay τ below h: stable for max(h/2 - 1/K, 0) < τ < min(1/K, h)."""
    h = 0.7
    K /= h
    low, high = max(h / 2 - 1 / K, 0.0), min(1 / K, h)
    for tau, holds in ((0.999 * low, False), (1.001 * low, True), (0.999 * high, True), (1.001 * high, False)):
        if tau > 0.0:
            found = cost(INTEGRATOR, Law.gain(-K), h, Delay.named("constant", delay=tau))
            assert found.stable == holds, tau


def test_delay_makes_a_loop_better_as_published() -> None:
    """H. J. Kushner, L. Tobias, IEEE AC-14 (1969), as the toolbox Jitterbug has it among its examples (kushner.m).

    6/((s + 1)(s + 2)) under u = -y, sampled every 1.42 s, is all but unstable; with delays that change from sample to
    sample it is not. Told apart, it is the mean delay that helps, and the jitter costs a little.
    """
    A, C, R = np.array([[-3.0, -2.0], [1.0, 0.0]]), np.array([[0.0, 6.0]]), np.diag([1.0, 0.0])
    plant, law = Plant(A, np.array([1.0, 0.0]), C, R), Law.gain(-1.0)
    none, jittered = (cost(plant, law, 1.42, Delay.named("uniform", high=most), bins=15).cost for most in (0.0, 0.1))
    mean = cost(plant, law, 1.42, Delay.named("constant", delay=0.05)).cost
    assert none > 100.0 and mean < jittered < 15.0


@pytest.mark.parametrize("tau", [0.0, 0.3, 0.75])
def test_the_least_cost_of_a_delayed_integrator(tau: float) -> None:
    """(3 + √3)/6 h + τ, derived in docs/network.md; Åström and Bernhardsson (2002) publish (3 + √3)/6 h at τ = 0."""
    K = -(3 + sqrt(3)) / (2 + sqrt(3))
    # the law predicts the state at t + τ: u = K (y + τ u of the sample before), which is its state
    law = Law(np.array([[K * tau]]), np.array([[K]]), np.array([[K * tau]]), K)
    delay = Delay.named("constant", delay=tau) if tau else Delay()
    assert cost(INTEGRATOR, law, 1.0, delay).cost == pytest.approx((3 + sqrt(3)) / 6 + tau, rel=1e-10)


def test_the_integrator_with_two_delays_by_hand() -> None:
    """Delays 0 and 1, each half of the time: E of the squares is three linear equations in E x², E x x₋', E u²."""
    L, delays = 0.5, (0.0, 1.0)
    # state (x, a) with a the voltage that acts: x⁺ = x + τ a + (1 - τ)(-L x) + v, a⁺ = -L x
    system, noise = np.eye(3), np.array([1.0, 0.0, 0.0])  # E x², E x a, E a²
    for tau in delays:
        c, d = 1 - (1 - tau) * L, tau
        system[0] -= 0.5 * np.array([c * c, 2 * c * d, d * d])
        system[1] -= 0.5 * np.array([-L * c, -L * d, 0.0])
        system[2] -= 0.5 * np.array([L * L, 0.0, 0.0])
    expected = np.linalg.solve(system, noise)[0]
    half = Delay.recorded(np.array([0.0, 1.0 - 1e-12]))  # arrives just within the sample
    assert cost(INTEGRATOR, Law.gain(-L), 1.0, half).y == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("delay", "loss", "every"),
    [
        (Delay.named("uniform", low=0.0, high=0.009), 0.0, 1),
        (Delay.named("uniform", low=0.002, high=0.022), 0.1, 1),
        (Delay.named("exponential", mean=0.006), 0.05, 2),
        (Delay.recorded(np.array([0.001, 0.004, np.nan, 0.013])), 0.0, 3),
    ],
    ids=("within a sample", "longer than a sample", "two rates", "trace with losses"),
)
def test_an_event_simulation_agrees(delay: Delay, loss: float, every: int) -> None:
    law = Law(np.array([[0.5]]), np.array([[0.2]]), np.array([[-1.0]]), -4.0)
    exact = cost(AXIS, law, 0.01, delay, loss=loss, bins=8, every=every)
    drawn = simulate(AXIS, law, 0.01, delay, loss=loss, bins=8, every=every, samples=12_000)
    for name in ("cost", "y", "u"):
        estimate = getattr(drawn, name)
        assert abs(estimate.value - getattr(exact, name)) < 4.5 * estimate.error, name
        assert estimate.error < 0.1 * estimate.value


def test_an_unstable_loop_costs_without_end() -> None:
    found = cost(INTEGRATOR, Law.gain(-1.2), 1.0, Delay.named("constant", delay=1.0))
    assert not found.stable
    assert found.cost == inf
    assert found.radius == pytest.approx(1.2)  # |poles|² of z² - z + 1.2


def test_the_large_system_is_solved_as_the_small_one(monkeypatch: pytest.MonkeyPatch) -> None:
    delay = Delay.named("uniform", low=0.0, high=0.015)
    dense = cost(AXIS, Law.gain(-3.0), 0.01, delay, bins=6)
    monkeypatch.setattr("rds.network.cost._DENSE", 0)
    sparse = cost(AXIS, Law.gain(-3.0), 0.01, delay, bins=6)
    assert sparse.y == pytest.approx(dense.y, rel=1e-8)
    assert sparse.radius == pytest.approx(dense.radius, rel=1e-6)


def test_modes_of_messages_on_their_way() -> None:
    modes, steps = chain([0.5, 1.25, inf], [0.5, 0.25, 0.25])
    assert modes == [(), ((1, 0.25),)]
    late = [step.changes for step in steps if step.source == 1]
    assert late == [((0.25, 1), (0.5, 0)), ((0.25, 1),), ((0.25, 1),)]
    with pytest.raises(rds.InputError, match="take fewer bins"):
        chain(list(np.linspace(0.0, 9.3, 50)), [0.02] * 50)


def test_a_part_of_a_sample_is_what_quadrature_gives() -> None:
    over, n = part(AXIS, 0.004), 60
    times = (np.arange(n) + 0.5) * 0.004 / n
    pieces = [part(AXIS, float(t)) for t in times]
    V = sum(piece.Phi @ AXIS.R @ piece.Phi.T for piece in pieces) * 0.004 / len(pieces)
    found = over.V
    assert found == pytest.approx(V, rel=1e-3, abs=1e-15)
    w = sum(np.trace(AXIS.Q[:2, :2] @ piece.V) for piece in pieces) * 0.004 / len(pieces)
    assert over.w == pytest.approx(w, rel=1e-3)


def test_a_sample_of_many_time_constants_is_what_the_closed_form_gives() -> None:
    """τ v' + v = w over T = 40 τ; the exponential of it all at once gave −10¹⁴ mm² for the variance of the position."""
    tau, T = 0.001, 0.04
    axis = Plant(np.array([[0.0, 1.0], [0.0, -1 / tau]]), np.zeros(2), np.array([[1.0, 0.0]]), np.diag([0.0, tau**-2]))
    expected = [[T - 1.5 * tau, 0.5], [0.5, 0.5 / tau]]  # e^(-40) is nothing
    np.testing.assert_allclose(part(axis, T).V, expected, rtol=1e-9)
