"""What a model is off by, in numbers: the figures by hand, their errors, and where a measure is wrong or told."""

from __future__ import annotations

from math import atan, degrees, inf, pi, sqrt

import numpy as np
import pytest

from rds.identification.validate.discrepancy import Off, _figure, _gain_of, by_chance, clear, error_of, log_of
from rds.identification.validate.within import Measure

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
