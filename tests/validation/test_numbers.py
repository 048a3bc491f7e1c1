"""The numbers that a validation rests on: residual tests, needed voltage, initial state, fingerprints, criteria."""

from __future__ import annotations

import re
from dataclasses import replace
from math import exp, log, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.identification.fit.initial_state import estimate_start
from rds.identification.fit.needed_voltage import needed_voltage, static_curve
from rds.identification.fit.residuals import BAND, LONGEST, bandwidth, block_length, effective_samples, residual_tests
from rds.identification.fit.smoothing import speed_range
from rds.identification.logs.fingerprint import fingerprint, shared
from rds.identification.logs.log import Log
from rds.identification.logs.motion import noise as noise_of
from rds.identification.structures.structures import structure
from rds.identification.validate.assessment import Range, assess, smoothed_velocity
from rds.identification.validate.candidate import Candidate
from rds.identification.validate.conclusion import _limits
from rds.identification.validate.criterion import Rival, rank
from rds.identification.validate.discrepancy import error_of
from rds.identification.validate.validate import compare_models, validate
from rds.identification.validate.verdict import Bands
from tests.validation.validation_logs import STEP, T, X, candidate, moved, square
from tests.validation.validation_logs import log as made_log

STRUCTURE = candidate().structure


def test_an_exact_model_fails_the_residual_tests_as_often_as_they_say() -> None:
    """30 logs of signals, noise and starts by chance, behind an encoder that rounds down: about 1 in 100 may fail."""
    draw = np.random.default_rng(5)
    t = np.arange(5000) * T
    white, free = [], []
    for number in range(30):
        wave = np.sin(2 * pi * draw.uniform(0.4, 2.0) * t + draw.uniform(0, 6))
        u = draw.uniform(1.5, 4.0) * (wave if number % 2 else np.where(wave >= 0, 1.0, -1.0))
        true = moved(u, step=None, start=draw.uniform(0, 1))
        noise = (0.0, 0.3 * STEP, 2.0 * STEP)[number % 3]
        y = np.floor((true + noise * draw.standard_normal(len(t))) / STEP) * STEP
        a = assess(candidate(), made_log(u, y))
        assert a.tests is not None
        white.append(a.tests.p_white)
        free.append(a.tests.p_command)
    assert sum(p <= 0.01 for p in white) <= 3 and sum(p <= 0.01 for p in free) <= 3
    assert 0.3 < np.mean(white) < 0.7 and 0.3 < np.mean(free) < 0.7


def test_rounding_alone_fails_a_test_at_the_rate_of_sampling_and_not_this_one() -> None:
    t = np.arange(5000) * T
    for frequency in (0.6, 0.9, 1.3):
        u = 0.75 * np.sin(2 * pi * frequency * t)  # V: below 1 mm/s, so below a step of the encoder in a sample
        a = assess(candidate(), made_log(u))
        e = a.residual - a.residual.mean()
        assert a.tests is not None
        assert float(e[1:] @ e[:-1]) / float(e @ e) > 5.0 * BAND / np.sqrt(len(e))
        assert a.tests.p_white > 0.01 and a.tests.p_command > 0.01


def test_a_standard_error_counts_how_a_figure_is_bent() -> None:
    line = error_of(lambda p: 3.0 * float(p[0]) - float(p[1]), np.array([1.0, 2.0]), np.diag([4.0, 9.0]))
    assert line == pytest.approx(np.hypot(6.0, 3.0))
    bent = error_of(lambda p: float(np.hypot(1.0, p[0])), np.array([0.0]), np.array([[4.0]]))
    assert bent == pytest.approx(np.sqrt(5.0) - 1.0)  # where its slope is 0
    assert error_of(lambda p: float(p[0] ** 2), np.array([0.0]), np.array([[np.inf]])) == np.inf


def test_noise_is_told_beside_the_steps_of_an_encoder() -> None:
    draw = np.random.default_rng(3)
    motion = 200.0 * np.sin(np.arange(5000) * 0.005)
    for size in (0.3, 0.43, 0.6, 0.8):  # steps
        y = np.rint(motion + size * draw.standard_normal(5000))
        assert noise_of(y) == pytest.approx(np.hypot(size, np.sqrt(1.0 / 12.0)), rel=0.12)


def test_the_range_of_speeds_is_that_of_the_motion_and_not_of_its_noise() -> None:
    """An axis of 10 mm/s behind 0.2 mm of noise was called valid up to the 75 mm/s tried here."""
    t = np.arange(6000) * T
    y = 10.0 / (4.0 * pi) * np.sin(4.0 * pi * t) + 0.2 * np.random.default_rng(1).standard_normal(len(t))
    low, high = speed_range(Log("noisy", t, np.cos(4.0 * pi * t), y))
    assert -12.0 < low < -8.0 and 8.0 < high < 12.0


def test_a_limit_is_told_of_what_was_beyond_the_fit() -> None:
    """The voltages went beyond the fit's: the speeds, which did not, were named as the limit."""
    u = square()
    within = {"velocity": Range((-9.0, 9.0), (-9.0, 9.0), "mm/s"), "command": Range((-8.0, 8.0), (-5.0, 5.0), "V")}
    a = replace(assess(candidate(), made_log(u)), ranges=within)
    said = list(_limits(a, Bands()))
    assert "up to the 8 V tried here" in said and not any("mm/s tried here" in each for each in said)
    beyond = within | {"velocity": Range((-9.0, 9.0), (-5.0, 5.0), "mm/s")}
    assert "up to the 9 mm/s tried here" in list(_limits(replace(a, ranges=beyond), Bands()))


def test_the_velocity_changes_where_it_swings_whatever_the_encoder() -> None:
    """Forward at 0 and 6 mm/s by turns, then back: every change counts, and none of the encoder's steps does."""
    u = np.repeat([0.3, 4.0, 0.3, 4.0, -2.0, -6.0], 600)
    for step in (None, STEP, 50.0 * STEP):
        assert assess(candidate(), made_log(u, moved(u, step=step), resolution=step)).changes == 4


def test_a_wrong_time_constant_is_found_in_the_residual() -> None:
    """20 % of 10 ms displaces the axis by 4 µm at each reversal, four steps of the encoder."""
    a = assess(candidate(X | {"tau": 1.2 * X["tau"]}), made_log(square()))
    assert a.tests is not None and a.free_run is not None
    assert a.free_run.fit_percent > 98.0
    assert a.tests.p_white <= 0.01 and a.tests.p_command <= 0.01


def test_the_uncertainty_of_the_parameters_excuses_what_it_explains_and_no_more() -> None:
    data = made_log(square())
    off = X | {"K": X["K"] * 1.004}
    sure, unsure = assess(candidate(off, share=1e-5), data), assess(candidate(off, share=4e-3), data)
    assert sure.tests is not None and unsure.tests is not None
    assert sure.tests.p_white <= 0.01 < unsure.tests.p_white


def test_bandwidth_and_blocks() -> None:
    t = np.arange(10000) * T
    assert bandwidth(np.sin(2 * pi * 5.0 * t), T) == pytest.approx(5.0, abs=0.1)
    assert bandwidth(np.ones(100), T) == 0.0
    assert block_length(5.0, T, 10000) == 50  # 1 / (4 · 5 Hz)
    assert block_length(0.1, T, 10000) == 100  # so that 100 blocks are left
    assert block_length(0.0, T, 50) == 1


def test_independent_samples_of_a_first_order_process() -> None:
    """A process with correlation a^k is worth N (1 - a) / (1 + a) samples."""
    draw = np.random.default_rng(0)
    a, e = 0.9, [0.0]
    for noise in draw.standard_normal(50_000):
        e.append(a * e[-1] + noise)
    assert effective_samples(np.array(e)) == pytest.approx(50_000 * 0.1 / 1.9, rel=0.15)
    assert effective_samples(draw.standard_normal(50_000)) == pytest.approx(50_000, rel=0.05)
    assert effective_samples(np.zeros(10)) == 10.0


def test_a_residual_of_zeros_passes() -> None:
    u = square(2.0)
    found = residual_tests(np.zeros(len(u)), u, moved(u, step=None), T, frequency=10.0)
    assert found.p_white == 1.0 and found.p_command == 1.0


@settings(max_examples=10)
@given(missing=st.floats(-0.4, 0.4))
def test_the_needed_voltage_is_the_one_that_is_missing(missing: float) -> None:
    """The axis got `missing` V more than the log says, so the model needs that much more."""
    u = square(4.0)
    data = made_log(u, moved(u + missing, step=None), resolution=None)
    velocity = smoothed_velocity(data, 20, False)
    found = needed_voltage(data, STRUCTURE, X, velocity, 20, False)
    assert len(found.extra) > 100
    assert np.median(found.extra) == pytest.approx(missing, abs=2e-3)
    assert found.relative_percent is not None


def test_the_needed_voltage_counts_the_delay_of_commands_before_a_block() -> None:
    """A random binary command, 4 ms late: an exact model was said to need 30 % more voltage."""
    axis, values = structure("axis", ("delay",)), X | {"tau": 0.04, "delay": 4e-3}
    u = 5.0 * np.repeat(np.random.default_rng(2).choice([-1.0, 1.0], 100), 20)
    t = np.arange(len(u)) * 2e-3
    data = Log("late", t, u, axis.respond(t, u, (0.0, 0.0), values), closed_loop=False)
    found = needed_voltage(data, axis, values, smoothed_velocity(data, 8, False), 8, False)
    assert found.relative_percent is not None and found.relative_percent < 5.0


def test_commands_from_before_a_log_count_in_its_initial_state() -> None:
    """They act on where there is a delay. The velocity of an exact model was held where the log never begins."""
    axis, values = structure("axis", ("delay",)), X | {"tau": 0.04, "delay": 0.01}
    u = np.random.default_rng(1).choice([-5.0, 5.0], 600)
    t = np.arange(len(u)) * 0.01
    y = axis.respond(t, u, (0.0, 0.0), values)
    for begin in range(100, 400, 20):
        part = slice(begin, begin + 200)
        few = slice(begin, begin + 20)
        start = estimate_start(axis, values, t[few], u[few], y[few])
        error = axis.respond(t[part], u[part], start, values) - y[part]
        assert np.abs(error[20:]).max() < 0.01 * np.ptp(y[part])


def test_no_voltage_explains_motion_that_the_model_cannot_make() -> None:
    data = made_log(square(3.0))
    found = needed_voltage(data, STRUCTURE, X | {"K": 1e-9}, smoothed_velocity(data, 20, False), 20, False)
    assert len(found.extra) == 0 and found.relative_percent is None and found.rmse is None


def test_the_static_curve_is_the_friction_of_the_axis() -> None:
    """v = K u - F±, for |K u| beyond friction."""
    speeds, voltages = static_curve(STRUCTURE, X, np.linspace(-4, 4, 17), False)
    friction = np.where(speeds > 0, X["friction_plus"], X["friction_minus"])
    assert len(speeds) == 16  # 0 V moves nothing
    np.testing.assert_allclose(speeds, X["K"] * voltages - friction, rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(position=st.floats(-50, 50), velocity=st.floats(-8, 8))
def test_the_initial_state_is_found(position: float, velocity: float) -> None:
    t, u = np.arange(50) * T, np.full(50, 2.5)
    y = STRUCTURE.respond(t, u, (position, velocity), X)
    found = estimate_start(STRUCTURE, X, t, u, y)
    assert found[0] == pytest.approx(position, abs=1e-4)
    assert found[1] == pytest.approx(velocity, abs=2e-2)


def test_a_wrong_model_begins_no_faster_than_was_measured() -> None:
    u = np.full(50, 3.0)
    y = moved(u)
    wrong = X | {"K": -X["K"]}
    found = estimate_start(STRUCTURE, wrong, np.arange(50) * T, u, y)
    assert abs(found[1]) < 2.0 * np.diff(y).max() / T


def test_fingerprints_know_cut_and_shifted_data_and_no_others() -> None:
    u = square(8.0)
    whole = made_log(u)
    known = fingerprint(whole)
    assert 0 < len(known) <= 64 * 17
    moved_away = made_log(u, whole.position - 31.0)
    assert shared(whole.part(1500, 5200), [known]) == 1.0
    assert shared(moved_away, [known]) == 1.0
    first, last = fingerprint(whole.part(0, 4000)), fingerprint(whole.part(4000, 8000))
    assert shared(whole, [first]) == pytest.approx(0.5, abs=0.2)
    assert shared(whole, [first, last]) > 0.9
    assert shared(made_log(square(8.0, 2.9, 0.7)), [known]) == 0.0
    assert shared(whole, []) == 0.0 and shared(whole, [""]) == 0.0
    with pytest.raises(InputError, match="must be hashes of 16 hexadecimal digits"):
        shared(whole, ["not hexadecimal"])


def test_rest_and_steady_speed_leave_no_fingerprint() -> None:
    assert fingerprint(made_log(np.zeros(5000))) == ""
    u = np.full(5000, 2.0)
    assert fingerprint(made_log(u).part(1000, 5000)) == ""


def test_the_criteria_are_their_equations() -> None:
    """With white residuals N is nearly the number of samples."""
    draw = np.random.default_rng(3)
    first, second = draw.standard_normal(400), 1.05 * draw.standard_normal(400)
    found = rank([Rival("a", first, 4, 2, True), Rival("b", second, 6, 2, True)])
    N = found.independent
    assert pytest.approx(400, rel=0.1) == N
    for row, residual, k in zip(found.ranks, (first, second), (7, 9), strict=True):
        loss = N * log(np.mean(residual**2))
        assert row.counted == k
        assert row.aicc == pytest.approx(loss + 2 * k + 2 * k * (k + 1) / (N - k - 1))
        assert row.bic == pytest.approx(loss + k * log(N))
    best, other = found.ranks
    assert best.aicc_difference == 0.0
    assert other.aicc_weight == pytest.approx(best.aicc_weight * exp(-other.aicc_difference / 2))
    assert best.bic_weight + other.bic_weight == pytest.approx(1.0)
    assert "all models were fitted on these data" in found.warnings[0]


def test_parameters_are_charged_where_they_were_fitted() -> None:
    draw = np.random.default_rng(4)
    e = draw.standard_normal(500)
    found = rank([Rival("plain", e, 4, 2, True), Rival("rich", 0.999 * e, 12, 2, True)])
    assert [row.name for row in found.ranks] == ["plain", "rich"]  # 0.1 % does not pay for 8 parameters
    fresh = rank([Rival("plain", e, 4, 2, False), Rival("rich", 0.999 * e, 12, 2, False)])
    assert [row.name for row in fresh.ranks] == ["rich", "plain"] and not fresh.warnings
    mixed = rank([Rival("plain", e, 4, 2, False), Rival("rich", e, 12, 2, True)])
    assert "rich was fitted on these data and plain was not" in mixed.warnings[0]


def test_a_model_without_a_finite_response_has_no_weight() -> None:
    e = np.random.default_rng(1).standard_normal(300)
    found = rank([Rival("wild", np.full(300, np.inf), 2, 2, False), Rival("tame", e, 2, 2, False)])
    assert [row.name for row in found.ranks] == ["tame", "wild"]
    assert found.ranks[0].aicc_weight == 1.0 and found.ranks[1].aicc_weight == 0.0
    with pytest.raises(InputError, match="none of the models has a finite response"):
        rank([Rival("wild", np.full(3, np.inf), 2, 2, False)] * 2)


def test_what_a_short_log_leaves_undefined_is_shown_as_a_dash(capsys: pytest.CaptureFixture[str]) -> None:
    from rds.cli.validate import _show
    from rds.identification.validate.report import _ranking

    e = np.random.default_rng(4).standard_normal(12)
    ranking = rank([Rival("plain", e, 12, 2, True), Rival("rich", 0.999 * e, 14, 2, True)])
    assert all(row.aicc_difference == np.inf for row in ranking.ranks)
    found = replace(validate(candidate(), made_log(square())), rankings={"short": ranking})
    _show(found)
    shown = capsys.readouterr().out
    table = shown[shown.index("Models compared") :]
    assert "–" in table and not re.search(r"\b(inf|nan)\b", table + _ranking(ranking))


def test_models_are_compared_on_one_log() -> None:
    data = made_log(square())
    models = [candidate(name="right"), candidate(X | {"friction_plus": 0.0, "friction_minus": 0.0}, name="bare")]
    found = compare_models(models, data)
    assert [row.name for row in found.ranks] == ["right", "bare"]
    assert found.ranks[0].rmse < 0.5 * STEP and found.ranks[0].aicc_weight > 0.999
    with pytest.raises(InputError, match="a comparison needs two models or more"):
        compare_models(models[:1], data)


def test_an_exact_model_with_backlash_needs_hardly_another_voltage() -> None:
    """A block begins with the play taken up in the direction of motion; begun in its middle, a third of the voltage was
    missing.
    """
    made = structure("axis", ["backlash"])
    values = X | {"backlash": 0.02}
    u = np.repeat(np.random.default_rng(0).uniform(-4.0, 4.0, 20), 200)
    t = np.arange(len(u)) * T
    y = np.rint(made.respond(t, u, (0.0, 0.0, 0.0), values) / STEP) * STEP
    found = assess(Candidate("play", made, values), made_log(u, y)).voltage
    assert found is not None and found.relative_percent is not None and found.relative_percent < 10.0


def test_the_bandwidth_of_a_long_log_is_summed_over_its_parts() -> None:
    t = np.arange(2 * LONGEST + 1234) * T
    rate = np.sin(2 * np.pi * 3.0 * t) + 0.5 * np.sin(2 * np.pi * 11.0 * t) + 7.0
    assert bandwidth(rate, T) == pytest.approx(11.0, abs=0.02)
    assert bandwidth(rate[:LONGEST], T) == pytest.approx(11.0, abs=0.02)
    assert bandwidth(np.full(2 * LONGEST, 3.0), T) == 0.0


@pytest.mark.parametrize("samples", [40, 100, 160])
def test_a_short_log_may_begin_with_its_step(samples: int) -> None:
    """Its few first samples show velocities that are all above that of their begin, which is rest."""
    volts = np.repeat([2.0, -3.0, 4.0, -2.0], samples // 4)
    true = {"tau": 20e-3, "K": 1.764, "friction_plus": 0.539, "friction_minus": -0.222}
    a = assess(candidate(true), made_log(volts, moved(volts, true, step=1e-6)))
    assert abs(a.initial_state[1]) < 0.01 and a.free_run is not None and a.free_run.fit_percent > 99.0
