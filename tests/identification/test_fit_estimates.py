"""What a fit by simulation error finds, beside the parameters that the logs were made with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.fit import starting_values
from rds.identification.fit.estimate import Errors
from rds.identification.fit.fit import fit
from rds.identification.logs.log import Log
from rds.identification.structures.axis_structure import make
from tests.identification.fit_logs import axis_log, mini_cnc


def test_on_200_logs_the_95_percent_intervals_contain_the_truth_in_90_to_99_percent() -> None:
    """Three axes, three signals, from no noise beside the encoder's steps to two steps of it; floor and round."""
    structure, inside = make(), []
    for number in range(200):
        values = mini_cnc("XYZ"[number % 3])
        log = axis_log(
            values,
            ("square", "sine", "multisine")[number // 3 % 3],
            seed=number,
            seconds=3.0,
            noise=(0.0, 0.0005, 0.001, 0.002)[number // 9 % 4],
            rounding=(np.floor, np.round)[number // 36 % 2],
        )
        found = fit([log], structure).parameters
        inside.append([found[name].low <= value <= found[name].high for name, value in values.items()])
    share = np.mean(inside, axis=0)
    assert ((share >= 0.90) & (share <= 0.99)).all(), dict(zip(mini_cnc("X"), share, strict=True))


def test_60_logs_of_a_slow_sine_all_settle_and_their_intervals_contain_the_truth_in_90_to_99_percent() -> None:
    """5.35 V at 0.5 Hz, 0.09 V beside 0, 2 µm of noise: friction and gain are hard to tell apart."""
    structure, inside, t = make(), [], np.arange(4000) * 0.001
    u = 0.09 + 5.35 * np.sin(np.pi * t)
    for number in range(60):
        values = mini_cnc("XYZ"[number % 3])
        noise = 0.002 * np.random.default_rng(number).standard_normal(len(t))
        found = fit([Log("sine", t, u, structure.respond(t, u, (0.0, 0.0), values) + noise)], structure)
        assert not found.unidentifiable and all("strongly correlated" in warning for warning in found.warnings), number
        inside += [found.parameters[name].low <= value <= found.parameters[name].high for name, value in values.items()]
    assert 0.90 <= np.mean(inside) <= 0.99


STUCK = [  # tau (s), K, the share of the largest voltage that friction takes forward and backward
    *((0.002, 0.1, 0.3, 0.6), (0.003, 100.0, 0.8, 0.1), (0.01, 1.8, 0.85, 0.85), (0.02, 3.0, 0.75, 0.8)),
    *((0.05, 1.4, 0.7, 0.7), (0.08, 4.0, 0.85, 0.8), (0.2, 0.5, 0.5, 0.5), (0.2, 100.0, 0.1, 0.8)),
]


@pytest.mark.parametrize("tau, K, plus, minus", STUCK)
def test_axes_that_rest_most_of_the_time_are_found(tau: float, K: float, plus: float, minus: float) -> None:
    """The voltage jumps between random levels, of which few overcome friction: most first guesses are far off."""
    values = {"tau": tau, "K": K, "friction_plus": 5.0 * K * plus, "friction_minus": -5.0 * K * minus}
    t = np.arange(8000) * 0.001
    for seed in range(2):
        draw = np.random.default_rng(seed)
        u = np.repeat(draw.uniform(-5.0, 5.0, 20), 400)
        y = make().respond(t, u, (0.0, 0.0), values)
        y += 1e-4 * np.ptp(y) * draw.standard_normal(len(t))
        found = fit([Log("levels", t, u, y)], make())
        assert not any("settled" in sentence for sentence in found.warnings)
        for name, value in values.items():
            estimated = found.parameters[name]
            assert abs(estimated.value - value) < 5.0 * estimated.std_error, (seed, name, estimated)


def test_without_noise_or_steps_it_finds_the_numbers_themselves() -> None:
    values = mini_cnc("Y")
    found = fit([axis_log(values, noise=0.0, resolution=None, seconds=4.0)], make())
    for name, value in values.items():
        assert found.parameters[name].value == pytest.approx(value, rel=1e-7)


def test_every_option_is_found_where_the_data_hold_it() -> None:
    values = mini_cnc("X") | {
        "stribeck": 0.15,
        "stribeck_velocity": 0.8,
        "delay": 0.0034,
        "backlash": 0.02,
        "dead_zone": 0.12,
    }
    options = ("stribeck", "dead-zone", "delay", "backlash")
    logs = [axis_log(values, kind, seed=3, options=options, noise=0.0005) for kind in ("multisine", "sine")]
    found = fit(logs, make(options))
    for name, value in values.items():
        estimated = found.parameters[name]
        assert abs(estimated.value - value) < 4.0 * estimated.std_error, (name, estimated)
        assert estimated.std_error < 0.1 * abs(value), (name, estimated)


@pytest.mark.parametrize(
    "options", [("stribeck",), ("delay", "backlash"), ("stribeck", "dead-zone", "delay", "backlash")]
)
def test_a_structure_with_options_fits_no_worse_than_the_plain_one(options: tuple[str, ...]) -> None:
    for number, kind in enumerate(("square", "sine", "multisine")):
        log = axis_log(mini_cnc("Y"), kind, seed=number, seconds=4.0)
        plain, more = fit([log], make()), fit([log], make(options))
        assert more.details["noise_rms"] <= 1.0001 * plain.details["noise_rms"]


def test_an_offset_goes_with_friction_that_is_the_same_both_ways() -> None:
    values = {"tau": 0.01, "K": 1.8, "friction": 0.4, "offset": -0.15}
    found = fit([axis_log(values, options=("offset",))], make(("offset",)))
    for name, value in values.items():
        assert found.parameters[name].low <= value <= found.parameters[name].high


def test_viscous_friction_is_held_unless_another_parameter_is() -> None:
    values = mini_cnc("X") | {"viscous": 0.2}
    log = axis_log(values, options=("viscous",))
    alone = fit([log], make(("viscous",)))
    assert alone.parameters["viscous"].value == 0.0
    assert "ratios to 1 + viscous" in alone.unidentifiable[0]
    assert alone.parameters["K"].value == pytest.approx(values["K"] / 1.2, rel=1e-3)
    beside = fit([log], make(("viscous",)), options={"fixed": {"K": values["K"]}})
    assert beside.parameters["viscous"].value == pytest.approx(0.2, abs=5 * beside.parameters["viscous"].std_error)
    assert beside.parameters["K"].std_error == 0.0


def test_two_logs_tell_more_than_one_and_each_has_its_own_initial_state() -> None:
    values = mini_cnc("Z")
    logs = [axis_log(values, "multisine", seed=seed, seconds=5.0) for seed in (1, 2)]
    one, both = fit(logs[:1], make()), fit(logs, make())
    assert both.parameters["friction_plus"].std_error < 0.9 * one.parameters["friction_plus"].std_error
    for log in logs:
        assert both.initial_state[log.name][0] == pytest.approx(log.position[0], abs=0.005)


def test_a_log_that_begins_with_a_long_rest_is_fitted_by_what_comes_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(starting_values, "MOST_SAMPLES", 1000)
    truth = mini_cnc("X")
    log = axis_log(truth, seconds=2.0)
    before = np.zeros(1500)
    log = Log(
        "rests first",
        np.arange(3500) * 0.001,
        np.concatenate([before, log.command]),
        np.concatenate([before + log.position[0], log.position]),
        resolution=log.resolution,
    )
    for name, parameter in fit([log], make()).parameters.items():
        assert abs(parameter.value - truth[name]) < 4.0 * parameter.std_error, name


def test_irregular_times_are_used_as_they_are() -> None:
    draw, values = np.random.default_rng(5), mini_cnc("X")
    times = np.cumsum(draw.uniform(0.0004, 0.0021, 6000))
    found = fit([axis_log(values, times=times)], make())
    for name, value in values.items():
        assert abs(found.parameters[name].value - value) < 4.0 * found.parameters[name].std_error


def test_standard_errors_follow_the_residuals_correlation() -> None:
    """Noise that is correlated over 20 samples is worth as many fewer: the spread of estimates says so as well."""
    values, draw, structure = mini_cnc("X"), np.random.default_rng(1), make()
    scores = []
    for seed in range(20):
        log = axis_log(values, seed=seed, noise=0.0, resolution=None, seconds=5.0)
        noise = np.convolve(draw.standard_normal(len(log) + 19), np.full(20, 0.0005), mode="valid")
        found = fit([type(log)(log.name, log.time, log.command, log.position + noise)], structure).parameters
        scores.append([(found[name].value - value) / found[name].std_error for name, value in values.items()])
    assert 0.6 < np.std(scores) < 1.5


def test_predictions_stand_beside_the_free_run() -> None:
    log = axis_log(mini_cnc("X"))
    found = fit([log], make())
    assert set(found.ahead[log.name]) == {1, 10, 100}
    assert found.free_run[log.name].rmse == pytest.approx(np.hypot(0.001, 0.001 / np.sqrt(12.0)), rel=0.05)
    # the noise of two samples is in a prediction that starts from a measurement
    assert found.ahead[log.name][10].rmse == pytest.approx(np.sqrt(2.0) * found.free_run[log.name].rmse, rel=0.05)
    assert found.relative_error_percent is not None and found.relative_error_percent < 10.0
    for of_rest in (("rest", log.name), (log.name, "rest")):  # an axis at rest has no fit, wherever its log stands
        runs = {"rest": Errors(np.nan, 0.0, 0.0, "mm"), **found.free_run}
        both = replace(found, free_run={name: runs[name] for name in of_rest}, logs=found.logs * 2)
        assert both.to_json()["fit_percent"] == found.free_run[log.name].fit_percent


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({"fixed": {"taw": 1.0}}, "did you mean 'tau'"),
        ({"fixed": {"tau": -1.0}}, "must be more than 0"),
        ({"fixed": {"friction_minus": 0.5}}, "must be at most 0"),
        ({"fixed": {"K": 1.7}, "start": {"K": 2.0}}, r"K is held at 1\.7, so no search begins at 2; leave"),
        ({"speed": 1}, "has no option 'speed'"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, sentence) -> None:
    with pytest.raises(InputError, match=sentence):
        fit([axis_log(mini_cnc("X"), seconds=1.0)], make(), options=options)


def test_a_single_log_is_fitted_and_a_path_is_no_log() -> None:
    log, structure = axis_log(mini_cnc("X"), "sine", seconds=3.0), make()
    assert fit(log, structure).values() == fit([log], structure).values()
    with pytest.raises(InputError, match=r"'run1\.csv' is no log; rds\.read_log\(FILE\) gives those of a file"):
        fit("run1.csv", structure)  # type: ignore[arg-type]
