"""What a model is off by, in numbers: the figures by hand, their errors, and where a measure is wrong or told."""

from __future__ import annotations

from dataclasses import replace
from math import atan, degrees, inf, pi, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rds.identification.validate.discrepancy import Off, _figure, _gain_of, by_chance, clear, error_of, log_of
from rds.identification.validate.verdict import Bands
from rds.identification.validate.within import (
    Measure,
    as_good,
    as_good_velocity,
    foreseen_at,
    judged_by,
    of_noise,
    passes,
    skilled_at,
)

MODEL = {"K": 2.2, "tau": 0.02, "delay": 0.003, "friction": 0.5, "offset": 0.1}
LOG = {"K": 2.0, "tau": 0.01, "delay": 0.001, "friction": 0.3, "offset": 0.0}
F = 50.0 / pi  # Hz: 100 rad/s


def test_each_figure_is_model_less_log() -> None:
    found = {name: _figure(name, MODEL, LOG, F, 10.0) for name in ("gain", "static", "phase", "lag", "delay")}
    assert found == pytest.approx(
        {
            "gain": 100.0 * (1.1 * sqrt(2.0) / sqrt(5.0) - 1.0),
            "static": 10.0,
            "phase": degrees(-0.2 + atan(1.0) - atan(2.0)),
            "lag": 0.012,
            "delay": 0.002,
        }
    )
    # friction in V, with what the offset adds: (0.5 ∓ 0.22)/2.2 less 0.3/2, over 10 V
    assert _figure("forward", MODEL, LOG, F, 10.0) == pytest.approx(100.0 * (0.28 / 2.2 - 0.15) / 10.0)
    assert _figure("backward", MODEL, LOG, F, 10.0) == pytest.approx(100.0 * (0.72 / 2.2 - 0.15) / 10.0)
    apart = {"K": 2.0, "tau": 0.01, "delay": 0.001, "friction_plus": 0.4, "friction_minus": -0.6}
    assert _figure("backward", apart, LOG, F, 10.0) == pytest.approx(100.0 * (0.3 - 0.15) / 10.0)
    plain = {"K": 2.0, "tau": 0.01, "delay": 0.001, "friction": 0.4}
    assert _figure("forward", plain, LOG, F, 10.0) == pytest.approx(100.0 * (0.2 - 0.15) / 10.0)
    still = {**LOG, "K": 0.0}
    assert _figure("gain", MODEL, still, F, 10.0) == _figure("static", MODEL, still, F, 10.0) == inf
    assert _figure("forward", still, LOG, F, 10.0) == inf


def test_viscous_friction_which_both_have_takes_of_gain_and_time_constant() -> None:
    model, log = ({**values, "K": 2.0 * values["K"], "tau": 2.0 * values["tau"]} for values in (MODEL, LOG))
    for name in ("gain", "static", "phase", "lag"):
        found = _figure(name, {**model, "viscous": 1.0}, log, F, 10.0)
        assert found == pytest.approx(_figure(name, MODEL, LOG, F, 10.0))


def test_the_error_of_a_figure_is_that_of_its_covariance() -> None:
    point = np.array([1.0, 2.0, 3.0])
    covariance = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, inf]])
    assert error_of(lambda p: 3.0 * p[0] - 2.0 * p[1], point, covariance) == pytest.approx(sqrt(36 + 36 - 12))
    assert error_of(lambda p: p[2], point, covariance) == inf
    assert error_of(lambda p: 5.0, point, covariance) == 0.0
    for one_sided in (lambda p: max(p[0], 0.0), lambda p: min(p[0], 0.0)):  # a bound at which it is flat to one side
        assert error_of(one_sided, np.zeros(1), np.eye(1)) == 1.0
    # bent: to the farther end, from 0 to 1 of x² (no slope), from 1 to 9 at 1
    assert error_of(lambda p: p[0] ** 2, np.zeros(1), np.eye(1)) == 1.0
    assert error_of(lambda p: p[0] ** 2, np.ones(1), 4.0 * np.eye(1)) == pytest.approx(8.0)


def test_chance_is_told_by_the_distribution_of_chi_square() -> None:
    bound = 2.0 * (1.0 + 11.344866730144373 / 50.0)  # of three degrees of freedom, 99 %
    assert by_chance(bound * (1 - 1e-9), 2.0, 50.0, 3) and not by_chance(bound * (1 + 1e-9), 2.0, 50.0, 3)


def test_of_the_gains_the_worse_of_two_that_are_told_counts_else_the_surer() -> None:
    def off(value: float, error: float) -> Off:
        return Off(value, error, "%")

    for rest, bandwidth, expected in (
        (off(1.0, 0.5), off(-3.0, 1.0), "bandwidth"),
        (off(-3.0, 0.5), off(1.0, 0.5), "rest"),
        (off(1.0, 0.5), off(1.05, 0.5), "rest"),  # they are one
        (off(1.0, 0.5), off(9.0, 1.1), "rest"),
        (off(9.0, 1.1), off(1.0, 0.5), "bandwidth"),
    ):
        assert _gain_of(rest, bandwidth) is {"rest": rest, "bandwidth": bandwidth}[expected]
    assert clear(off(-3.0, 0.5)) == 6.0 and clear(off(3.0, inf)) == clear(off(3.0, 0.0)) == clear(off(inf, inf)) == 0.0
    assert (
        log_of(2.0) == -log_of(0.5) == pytest.approx(0.6931, abs=1e-4)
        and log_of(-1.0) == log_of(inf) == log_of(0.0) == 0.0
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    "kind, value, error, wrong, told",
    [
        ("gain", 5.1, 1.9, True, True),  # beyond the band of 5, and more than 2.6 errors
        ("gain", 5.1, 2.0, False, True),  # of which nobody is sure, but within twice the band
        ("gain", 4.9, 0.1, False, True),
        ("gain", 4.0, 2.9, False, True),
        ("gain", 4.0, 3.1, False, False),
        ("phase", 3.0, 1.9, False, True),  # 1.4 times the band
        ("phase", 3.0, 2.1, False, False),
        ("friction", 1.0, 1.9, False, True),
        ("friction", 1.0, 2.1, False, False),
        ("delay", 5.1, 1.1, False, False),  # five errors
        ("delay", 5.6, 1.1, True, True),
        ("gain", 50.0, inf, False, False),
    ],
)
def test_where_a_measure_is_wrong_and_where_the_log_tells_it(
    kind: str, value: float, error: float, wrong: bool, told: bool, sign: float
) -> None:
    measure = Measure(kind, Off(sign * value, error, "%"), 5.0)
    assert (measure.wrong, measure.told) == (wrong, told)
    assert not Measure(kind, measure.off, 5.0, by_chance=True).wrong


def test_borderline_is_from_three_quarters_to_four_thirds_of_the_band() -> None:
    for value, expected in ((3.74, False), (3.76, True), (-6.6, True), (6.7, False)):
        assert Measure("gain", Off(value, 1.0, "%"), 5.0).borderline is expected
    assert Measure("gain", Off(-3.0, 1.5, "%"), 5.0).reach == 6.0


def seen(**more: Any) -> Any:
    """What the rules read of an assessment: noise of 0.01 mm, velocities over blocks of 10 samples of 1 ms."""
    usual = {"noise": 0.01, "block": 10, "log": SimpleNamespace(sample_period=0.001), "as_motion": "motion"}
    errors = {"residual": np.array([0.1, -0.1]), "free_run": fit(90.0, 1.0), "velocity": None}
    return SimpleNamespace(**{**usual, **errors, **more})


def fit(percent: float, rmse: float) -> Any:
    return SimpleNamespace(fit_percent=percent, rmse=rmse)


def test_a_model_is_as_good_as_noise_lets_any_be_within_a_fifth() -> None:
    for size, expected in ((0.0119, True), (0.0121, False)):
        noisy = seen(residual=3.0 + size * np.array([1.0, -1.0]))  # a constant beside it does not count
        assert as_good(noisy) is expected and not as_good(seen(residual=noisy.residual, as_motion=None))
        assert of_noise(noisy, fit(0.0, sqrt(2.0) * size)) is expected
        # of the difference over 10 ms of two positions
        assert as_good_velocity(seen(velocity=fit(0.0, sqrt(2.0) * size / 0.01))) is expected
    assert not as_good(seen(residual=np.zeros(2), free_run=None)) and not as_good_velocity(seen())


def test_the_free_run_passes_by_its_band_or_by_noise_in_position_and_velocity() -> None:
    bands = replace(Bands(), fit_percent=90.0)
    good, bad, quiet = fit(90.0, 9.0), fit(89.9, 9.0), np.zeros(2)
    assert passes(seen(free_run=good), bands) == (True, True)
    assert passes(seen(free_run=bad), bands) == passes(seen(free_run=None), bands) == (False, False)
    assert passes(seen(free_run=bad, residual=quiet), bands) == (True, True)
    assert passes(seen(free_run=good, velocity=bad), bands) == (True, False)
    assert passes(seen(free_run=bad, velocity=good), bands) == (False, True)
    assert passes(seen(free_run=good, velocity=fit(0.0, 1.0)), bands) == (True, True)  # 1.4 mm/s is noise


def test_skill_is_to_beat_no_model_and_foresight_to_leave_what_a_free_run_may_of_the_way() -> None:
    bands = replace(Bands(), fit_percent=90.0, skill=0.5)
    ahead = {1: fit(0.0, 0.49), 2: fit(0.0, 0.5), 5: fit(0.0, 0.51), 10: fit(0.0, 0.1)}
    naive = {1: fit(0.0, 1.0), 2: fit(0.0, 1.0), 5: fit(0.0, 2.0)}
    a = seen(ahead=ahead, naive=naive, measured=np.arange(50.0) * 1.01)
    assert skilled_at(a, bands) == [1, 5]
    assert foreseen_at(a, bands) == []  # after 5 samples, a tenth of the way of 5.05 mm is 0.505 mm
    ahead[5] = fit(0.0, 0.5)
    assert foreseen_at(a, bands) == [5]


def test_the_axis_is_the_measure_where_it_explains_the_log_or_the_model_does_not_come_near_it() -> None:
    bands = replace(Bands(), unexplained=2.0, attainable=1.5)
    for reached, rmse, judged in ((0.02, 0.02, True), (0.021, 0.031, False), (0.021, 0.032, True)):
        axis = SimpleNamespace(reached=reached, rmse=rmse)
        assert judged_by(seen(as_axis=axis), bands) is (axis if judged else "motion")
    assert judged_by(seen(as_axis=None), bands) == "motion"
