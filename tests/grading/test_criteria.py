"""Each criterion of a controller against numbers that are known beforehand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rds.grading.criteria import KINDS
from rds.grading.criteria.measuring import NotMeasured, Step, crossing
from rds.grading.sandbox.work_counts import WorkCounts
from tests.grading.made import T, run_of

N = 2000
TIME = np.arange(N) * T
TAU = 0.1  # s


def measured(kind: str, run: Any, **options: Any) -> float:
    module = KINDS.module(kind)
    return float(module.measure(run, {**getattr(module, "DEFAULTS", {}), **options}))


def errors(error: np.ndarray, **more: Any) -> Any:
    return run_of({"X_reference": error, "X_measured": np.zeros(len(error))}, **more)


def response(position: np.ndarray) -> Any:
    return run_of({"X_reference": np.ones(len(position)), "X_measured": position})


def test_the_errors_of_a_sine_are_those_of_calculus() -> None:
    run = errors(3.0 * np.sin(2 * np.pi * TIME))  # two whole periods
    assert measured("rms-error", run) == pytest.approx(3.0 / np.sqrt(2.0), rel=1e-12)
    assert measured("mean-error", run) == pytest.approx(6.0 / np.pi, rel=1e-5)
    assert measured("max-error", run) == 3.0


def test_the_first_period_is_left_out_as_in_every_result_and_a_window_goes_before_it() -> None:
    error = np.where(TIME < 1.0, 5.0, 1.0)
    assert measured("max-error", errors(error, period=1.0)) == 1.0
    assert measured("max-error", errors(error, period=1.0), **{"from": 0.5}) == 5.0
    assert measured("max-error", errors(error), **{"from": 1.0, "until": 1.5}) == 1.0
    with pytest.raises(NotMeasured, match="no sample"):
        measured("max-error", errors(error), **{"from": 9.0})
    numbered = errors(np.arange(float(N)))
    assert measured("mean-error", numbered, **{"from": 0.1, "until": 0.2}) == 149.5, "samples 100 to 199"
    for end in (0.3, 0.7):  # neither is a whole number of periods in floating point
        assert measured("max-error", numbered, until=end) == round(end / T) - 1


def test_what_has_no_reference_or_no_finite_error_is_not_measured() -> None:
    with pytest.raises(NotMeasured, match="axis X has no reference"):
        measured("max-error", run_of({"X_measured": np.zeros(N)}))
    with pytest.raises(NotMeasured, match="no finite error"):
        measured("rms-error", errors(np.full(N, 1e200)))


def test_a_first_order_response_rises_and_settles_by_its_time_constant() -> None:
    run = response(1.0 - np.exp(-TIME / TAU))
    assert measured("rise-time", run) == pytest.approx(TAU * np.log(9.0), abs=1e-5)
    assert measured("settling-time", run) == pytest.approx(TAU * np.log(50.0), abs=T)
    assert measured("settling-time", run, within=5.0) == pytest.approx(TAU * np.log(20.0), abs=T)
    assert measured("settling-time", run, within=100.0) == 0.0
    assert measured("overshoot", run) == 0.0
    assert measured("steady-state-error", run, last=0.1) < 1e-7


@pytest.mark.parametrize("zeta", [0.2, 0.5, 0.7])
def test_a_second_order_response_overshoots_by_its_damping(zeta: float) -> None:
    w, d = 40.0, np.sqrt(1.0 - zeta**2)
    position = 1.0 - np.exp(-zeta * w * TIME) * (np.cos(w * d * TIME) + zeta / d * np.sin(w * d * TIME))
    assert measured("overshoot", response(position)) == pytest.approx(100.0 * np.exp(-np.pi * zeta / d), abs=0.02)


def test_a_step_downwards_is_measured_as_one_upwards() -> None:
    position = 1.0 - np.exp(-TIME / TAU) * np.cos(30.0 * TIME)
    down = run_of({"X_reference": -np.ones(N), "X_measured": -position})
    for kind in ("overshoot", "rise-time", "settling-time"):
        assert measured(kind, down) == measured(kind, response(position))


def test_a_step_later_and_from_elsewhere_is_measured_as_one_from_zero_at_the_start() -> None:
    first = response(1.0 - np.exp(-TIME / TAU) * np.cos(30.0 * TIME))
    late = np.r_[np.full(500, 2.0), 2.0 + 3.0 * first.result["X_measured"]]
    reference = np.r_[np.full(500, 2.0), np.full(N, 5.0)]
    step = {"from": 500 * T, "until": (500 + N) * T}
    for more in (0, 9):  # whatever comes then does not count
        columns = {"X_reference": np.r_[reference, np.full(more, -7.0)], "X_measured": np.r_[late, np.full(more, 9.0)]}
        for kind in ("overshoot", "rise-time", "settling-time"):
            assert measured(kind, run_of(columns), **step) == pytest.approx(measured(kind, first), rel=1e-9)


def test_a_level_is_crossed_on_the_line_between_two_samples() -> None:
    step = Step(np.array([0.0, 1.0, 2.0, 4.0]), np.array([0.0, 0.2, 0.6, 1.0]))
    assert [crossing(step, level) for level in (0.1, 0.4, 0.6, 0.9)] == pytest.approx([0.5, 1.5, 2.0, 3.5])


def test_what_is_in_the_band_at_the_last_sample_has_settled() -> None:
    assert measured("settling-time", response(np.where(np.arange(N) < N - 1, 0.0, 1.0))) == pytest.approx((N - 1) * T)


def test_what_never_rises_or_settles_has_no_value() -> None:
    with pytest.raises(NotMeasured, match="no samples"):
        measured("overshoot", response(TIME), **{"from": 9.0})
    with pytest.raises(NotMeasured, match="no step to make"):
        measured("overshoot", response(np.ones(N)))
    with pytest.raises(NotMeasured, match="never reaches"):
        measured("rise-time", response(np.minimum(TIME, 0.5)))
    with pytest.raises(NotMeasured, match="has not settled"):
        measured("settling-time", response(np.full(N, 0.5) + 0.5 * np.sin(TIME)))
    for changing in (TIME, np.where(np.arange(N) < 2, 0.5, 1.0)):
        with pytest.raises(NotMeasured, match="no step"):
            measured("overshoot", run_of({"X_reference": changing, "X_measured": 0.0 * TIME}))


def test_steady_state_error_is_the_mean_of_the_end() -> None:
    run = errors(np.where(TIME < 1.9, 9.0, -0.25 + 0.1 * np.sign(np.sin(2 * np.pi * (TIME + T / 2) / 0.02))))
    assert measured("steady-state-error", run) == pytest.approx(0.25, abs=1e-12)
    numbered = errors(np.arange(float(N)))
    assert measured("steady-state-error", numbered) == 1949.5, "the last 100 samples"
    assert measured("steady-state-error", numbered, last=0.01, until=0.3) == 294.5, "samples 290 to 299"
    with pytest.raises(NotMeasured, match="ended before"):
        measured("steady-state-error", numbered, until=9.0)


def test_effort_and_saturation_of_a_square_wave() -> None:
    command = np.where(TIME < 0.5, 12.0, -4.0)
    run = run_of({"X_command": command, "X_voltage": np.clip(command, -10.0, 9.995)}, facts={"limits": (-10.0, 9.995)})
    assert measured("effort", run) == pytest.approx(np.sqrt(0.25 * 9.995**2 + 0.75 * 16.0), rel=1e-12)
    assert measured("saturation-time", run) == pytest.approx(0.5, abs=1e-12)


def test_disturbance_counts_from_its_start_and_recovery_from_the_last_time_outside() -> None:
    error = np.where(TIME < 1.0, 7.0, 2.0 * np.exp(-(TIME - 1.0) / TAU))
    run = errors(error, facts={"disturbed_from": 1.0})
    assert measured("disturbance-error", run) == 2.0
    assert measured("recovery-time", run, within=0.1) == pytest.approx(TAU * np.log(20.0), abs=T)
    assert measured("recovery-time", run, within=3.0) == 0.0
    with pytest.raises(NotMeasured, match="not recovered"):
        measured("recovery-time", run, within=1e-6)
    with pytest.raises(NotMeasured, match="not recovered"):
        measured("recovery-time", errors(np.zeros(N), facts={"disturbed_from": 9.0}), within=0.1)
    at_once = errors(np.where(np.arange(N) == 300, 5.0, 0.0), facts={"disturbed_from": 0.3})
    assert measured("recovery-time", at_once, within=0.1) == pytest.approx(T), "its first sample counts"


def test_noise_counts_for_the_axis_itself_and_in_the_voltage() -> None:
    alternating = np.where(np.arange(N) % 2 == 0, 0.3, -0.3)
    table = {
        "X_reference": np.zeros(N),
        "X_measured": np.full(N, 9.0),
        "X_actual": alternating,
        "X_voltage": alternating,
    }
    assert measured("noise-error", run_of(table)) == pytest.approx(0.3, rel=1e-12)
    assert measured("noise-voltage", run_of(table)) == pytest.approx(0.6, rel=1e-12)
    assert measured("max-error", run_of(table)) == 0.3
    assert measured("max-error", run_of({**table, "X_reference": np.ones(N)})) == 1.3


def test_lagging_on_a_circle_is_no_contour_error_and_a_smaller_circle_is() -> None:
    from rds.grading.cases import CaseRun
    from rds.results import Result

    def circle(radius: float, lag: float, **noise: Any) -> CaseRun:
        wanted, there = np.pi * TIME, np.pi * TIME - lag
        columns = {
            "time": TIME,
            "X_reference": 10.0 * np.cos(wanted),
            "Y_reference": 10.0 * np.sin(wanted),
            "X_measured": radius * np.cos(there),
            "Y_measured": radius * np.sin(there),
        }
        columns |= {"contour_error": np.full(N, 0.7)} if noise else {}
        return CaseRun("circle", 0, Result(columns, {}, {"axes": ["X", "Y"], "sample_period": T}), facts=noise)

    assert measured("contour-error", circle(10.0, 0.05), **{"from": 0.1}) < 2e-5  # the chords of the path
    assert measured("contour-error", circle(9.8, 0.05), **{"from": 0.1}) == pytest.approx(0.2, abs=2e-5)
    assert measured("path-followed", circle(9.8, 0.05), tolerance=0.21, **{"from": 0.1}) == 100.0
    assert measured("path-followed", circle(9.8, 0.05), tolerance=0.19, **{"from": 0.1}) == 0.0
    assert measured("contour-error", circle(9.8, 0.05, noisy=False)) == 0.7, "as the program's run has judged it"
    assert measured("contour-error", circle(9.8, 0.05, noisy=True), **{"from": 0.1}) == pytest.approx(0.2, abs=2e-5)
    with pytest.raises(NotMeasured, match="two linear axes"):
        measured("contour-error", errors(np.ones(N)))


def test_fit_is_that_of_validation() -> None:
    y = np.sin(2 * np.pi * TIME)
    run = run_of({"X_measured": y, "X_modelled": 0.9 * y})
    assert measured("model-fit", run) == pytest.approx(90.0, abs=1e-9)
    with pytest.raises(NotMeasured):
        measured("model-fit", run_of({"X_measured": np.zeros(N), "X_modelled": y}))


def test_work_is_events_per_sample_or_why_there_are_none() -> None:
    assert measured("work", errors(np.ones(10), counts=WorkCounts(10, 190))) == 19.0
    assert measured("work", errors(np.ones(10), counts=WorkCounts(1, 190), rows=np.zeros((19, 3, 1)))) == 10.0
    with pytest.raises(NotMeasured, match="tampered"):
        measured("work", errors(np.ones(10), counts=WorkCounts(10, refused="it has tampered with the counter")))


def test_more_is_better_of_margins_and_shares_only() -> None:
    better = {name for name in KINDS.names() if not KINDS.module(name).MORE_IS_WORSE}
    margins = {"damping", "gain-margin", "modulus-margin", "phase-margin"}
    assert better == margins | {"model-fit", "path-followed", "unit-tests"}


def test_every_criterion_says_what_it_measures() -> None:
    for name in KINDS.names():
        module = KINDS.module(name)
        assert module.MEANING.startswith("the ")
        assert module.UNIT is None or isinstance(module.UNIT, str)
        assert isinstance(module.MORE_IS_WORSE, bool)
        assert set(module.FOR) <= {"controller", "model", "interpolator", "functions"}
        assert set(getattr(module, "DEFAULTS", {})) <= set(getattr(module, "OPTIONS", {}))
        assert set(getattr(module, "NEEDED", ())) <= set(getattr(module, "OPTIONS", {}))
