"""Margins of sampled loops against python-control and against finer frequencies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rds.core.linear_law import Law
from rds.identification.robustness.margins import loop_margins, margins_of, open_loop
from rds.models import library_model

T = 0.001  # s


def axis(tau: float, K: float) -> Any:
    """tau in s, K in (mm/s)/V."""
    return library_model("linear-axis", tau=tau, K=K)


def proportional(gain: float) -> Law:
    """V/mm."""
    return Law.gain(-gain)


def test_the_gain_margin_counts_less_gain_too() -> None:
    """A PID is often unstable with less gain as well: python-control's gain margin is then below 1, here 0.54."""
    import control

    tau, P, Ki, D = 0.07239, 58.04, 1678.7, 1.8035  # s, V/mm, V/(mm s), V s/mm; K = 1 (mm/s)/V
    law = Law(np.diag([1.0, 0.0]), np.array([[T], [1.0]]), np.array([[-Ki, D / T]]), -(P + D / T + Ki * T))
    found = loop_margins(law, [axis(tau, 1.0)], T)[0]
    plant = control.tf([1.0], [tau, 1.0, 0.0]).sample(T)
    pid = control.tf([P + D / T + Ki * T, -(P + 2 * D / T), D / T], [1.0, -1.0, 0.0], T)
    with pytest.warns(UserWarning, match="stability_margins"):
        wanted = control.stability_margins(plant * pid)
    assert wanted[0] < 1.0
    assert found[0] == pytest.approx(-20 * np.log10(wanted[0]), abs=0.05)
    assert found[1] == pytest.approx(wanted[1], abs=0.05)
    edge = 10 ** (-found[0] / 20)
    radius = loop_margins(law, [axis(tau, edge * 0.99), axis(tau, edge * 1.01)], T)[:, 3]
    assert radius[0] > 1.0 > radius[1]


def test_a_loop_that_is_slower_than_the_lowest_frequency_has_the_phase_margin_of_an_integrator() -> None:
    for gain in (1e-3, 1e-8):  # V/mm
        assert loop_margins(proportional(gain), [axis(0.01, 1.0)], T)[0, 1] == pytest.approx(90.0, abs=0.1)


def test_a_slow_axis_that_is_sampled_often_has_its_own_phase_margin() -> None:
    """It crosses 1 at a millionth of Nyquist's frequency: 47° and a distance of 0.82 came of frequencies above."""
    tau, gain, period = 1.481, 5.35, 50e-6  # s, V/mm, s; K = 0.063 (mm/s)/V, the modulus optimum
    found = loop_margins(proportional(gain), [axis(tau, 0.06303)], period)[0]
    crossing = np.sqrt((np.sqrt(1.0 + 4.0 * (0.06303 * gain * tau) ** 2) - 1.0) / 2.0) / tau  # of K P/(s (τ s + 1))
    assert found[1] == pytest.approx(90.0 - np.degrees(np.arctan(crossing * tau)), abs=0.05)
    s = 1j * np.geomspace(1e-3, 1e3, 100_001)
    assert found[2] == pytest.approx(np.abs(1.0 + 0.06303 * gain / (s * (tau * s + 1.0))).min(), abs=2e-3)


def test_a_loop_that_ends_on_the_negative_axis_has_a_gain_margin() -> None:
    """An axis faster than its sampling is unstable at Nyquist's frequency first; its margin was said to be infinite."""
    models = [axis(tau, 1.0) for tau in (0.1 * T, 0.3 * T)]
    for k, margin in enumerate(loop_margins(proportional(200.0), models, T)[:, 0]):
        edge = 200.0 * 10 ** (margin / 20)
        below, above = (loop_margins(proportional(edge * by), models[k : k + 1], T)[0, 3] for by in (0.99, 1.01))
        assert below < 1.0 < above


def test_the_least_distance_may_lie_between_two_frequencies() -> None:
    model = axis(0.01, 1.0)
    edge = 10 ** (loop_margins(proportional(1.0), [model], T)[0, 0] / 20)
    law = proportional(0.99 * edge)
    fine = np.pi / T * np.logspace(-3, 0, 200_001)
    wanted = margins_of(fine, open_loop(law, model, T, fine)[None])[0, 2]
    assert loop_margins(law, [model], T)[0, 2] == pytest.approx(wanted, rel=0.05)


def test_a_loop_of_a_long_delay_turns_no_further_than_half_a_lap_between_two_frequencies() -> None:
    """A Smith predictor over 60 samples of delay, whose margins were 0.15 dB, 1.5° and 0.02, by a grid too coarse."""
    from rds.controllers import library_controller
    from rds.identification.robustness.margins import law_about_rest

    tau, K, period = 0.030, 0.6, 0.05
    controller = library_controller("smith", {"tau": tau, "K": K}, period, np.inf, delay=60 * period)
    model = library_model("machine-axis", tau=1.4 * tau, K=0.9 * K, delay=60 * period)
    law = law_about_rest(controller)
    assert law is not None
    found = loop_margins(law, [model], period)[0]
    for share, stable in ((0.95, True), (1.05, False)):  # of the margin, up and down
        gains = [0.9 * K * 10 ** (way * share * found[0] / 20) for way in (1, -1)]
        models = [library_model("machine-axis", tau=1.4 * tau, K=gain, delay=60 * period) for gain in gains]
        assert (loop_margins(law, models, period)[:, 3] < 1.0).all() == stable
    fine = np.linspace(1e-4, np.pi / period, 40_001)
    assert found[2] == pytest.approx(np.abs(1.0 + open_loop(law, model, period, fine)).min(), rel=0.01)
