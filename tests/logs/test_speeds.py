"""Logs of a speed, as small motors make them: coarse speeds, steps that begin the log, spikes of a counter."""

from __future__ import annotations

import numpy as np
import pytest

from rds.identification.fit.fit import fit
from rds.identification.fit.upsets import upsets
from rds.identification.logs.describe_plot import overview
from rds.identification.logs.findings import with_findings
from rds.identification.logs.log import Finding, Gravity, Log
from rds.identification.structures.structures import structure
from rds.identification.validate.candidate import Candidate
from rds.identification.validate.discrepancy import as_axis
from rds.identification.validate.validate import validate

T, TAU, K, FRICTION = 0.005, 0.08, 22.0, 15.0  # s, s, (rev/min)/V, rev/min


def speed_log(command: np.ndarray, step: float = 0.1, tau: float = TAU, name: str = "motor", period: float = T) -> Log:
    """The speed of a motor from rest, in steps of `step` rev/min as a counter makes them, with the log's findings."""
    w = np.zeros(len(command))
    share = 1.0 - np.exp(-period / tau)
    for k, u in enumerate(command[:-1]):
        w[k + 1] = w[k] + share * (K * u - FRICTION * np.sign(u) - w[k])
    place = np.cumsum(w) * period  # differences of a rounded position
    counted = np.diff(np.floor(place / (step * period) + 0.3) * step * period, prepend=0.0) / period
    counted = np.round(counted, 6)
    units = {"position": "rev/min", "command": "V"}
    t = np.arange(len(command)) * period
    return with_findings(Log(name, t, command, counted, units=units, closed_loop=False))


def said(log: Log, kind: str) -> list[Finding]:
    return [finding for finding in log.findings if finding.kind == kind]


def test_a_log_that_begins_with_its_step_is_no_fault() -> None:
    """Several levels together tell gain, friction and time constant, as courses find them."""
    logs = [speed_log(np.full(120, volts), name=f"{volts:g} V") for volts in (3.0, 5.0, 8.0, 12.0)]
    (first, *_) = said(logs[0], "excitation")
    assert first.gravity is Gravity.WARNING and "the log begins with its step" in first.what
    found = fit(logs, structure("axis"))
    assert not found.unusable()
    assert found.parameters["K"].value == pytest.approx(K, rel=0.01)
    assert found.parameters["tau"].value == pytest.approx(TAU, rel=0.03)
    assert found.parameters["friction_plus"].value == pytest.approx(FRICTION, rel=0.05)


def test_steps_from_rest_are_no_fault_however_coarse_the_encoder_and_one_that_rests_is_none_beside_them() -> None:
    """Degrees counted every 6 ms: a window's speed leaps by 80 deg/s. Friction holds the axis at the least level."""
    made, period = structure("axis", output="deg", command="%"), 0.0062
    truth = {"tau": 0.11, "K": 6.8, "friction_plus": 140.0, "friction_minus": -50.0}
    t = np.arange(160) * period
    logs = []
    for level in (20.0, 40.0, 60.0, 100.0, -20.0, -60.0):
        y = np.floor(made.respond(t, np.full(160, level), (0.2, 0.0), truth))
        units = {"position": "deg", "command": "%"}
        logs.append(with_findings(Log(f"{level:g}", t, np.full(160, level), y, units=units, closed_loop=False)))
    (rests, *others) = [said(log, "excitation")[0] for log in logs]
    assert rests.gravity is Gravity.FAULT and "excites nothing" in rests.what
    assert all(found.gravity is Gravity.WARNING and "begins with its step" in found.what for found in others)
    found = fit(logs, made)
    assert not found.unusable() and not any("contradict" in warning for warning in found.warnings)
    assert found.parameters["K"].value == pytest.approx(6.8, rel=0.02)
    assert found.parameters["friction_minus"].value == pytest.approx(-50.0, rel=0.1)


def test_a_log_of_one_level_does_not_contradict_another_about_friction() -> None:
    """By itself it tells gain and friction together only; each was given an error many times too small."""
    bend = {3.0: 8.0, 5.0: 14.0, 8.0: 15.0, 12.0: 11.0}  # rev/min: friction that is not the structure's
    steps = []
    for level, friction in bend.items():
        command = np.r_[np.zeros(20), np.full(200, level)]
        log = speed_log(command + np.where(command > 0.0, (FRICTION - friction) / K, 0.0), name=f"{level:g} V")
        steps.append(with_findings(Log(log.name, log.time, command, log.position, units=log.units, closed_loop=False)))
    warnings = fit(steps, structure("axis")).warnings
    assert not any("contradict each other about friction" in warning for warning in warnings)


def test_one_step_alone_tells_gain_and_friction_together_only() -> None:
    found = fit([speed_log(np.full(120, 8.0))], structure("axis"))
    assert any("K" in sentence and "friction_plus" in sentence for sentence in found.unidentifiable)


@pytest.mark.parametrize("start", [0.0, 161.0])
def test_a_constant_command_under_which_nothing_starts_is_a_fault(start: float) -> None:
    units = {"position": "rev/min", "command": "V"}
    t = np.arange(400) * T
    log = with_findings(Log("steady", t, np.full(400, 8.0), start + 0.1 * np.sin(7.0 * t), units=units))
    assert said(log, "excitation")[0].gravity is Gravity.FAULT


def test_a_steady_log_beside_others_spoils_no_fit() -> None:
    levels = np.repeat([2.0, -3.0, 6.0, -9.0, 12.0, -5.0], 80)
    steady = speed_log(np.full(400, 7.0), name="steady")
    steady = with_findings(
        Log("steady", steady.time[200:], steady.command[200:], steady.position[200:], units=steady.units)
    )
    assert said(steady, "excitation")[0].gravity is Gravity.FAULT
    found = fit([speed_log(levels), steady], structure("axis"))
    assert not found.unusable() and any(w.startswith("steady: the command is 7 V") for w in found.warnings)
    assert fit([steady], structure("axis")).unusable()


def test_a_coarse_speed_is_no_axis_that_hardly_moves() -> None:
    """A speed by the counts of each millisecond has few levels, and its means tell it all the same."""
    command = np.where(np.arange(2000) < 400, 0.0, 24.0)
    log = speed_log(command, step=38.5, tau=0.0265, period=0.001)
    assert not any(finding.gravity is Gravity.FAULT for finding in log.findings)
    assert any("steps of 38.5 rev/min in all" in finding.what for finding in said(log, "quantization"))
    found = fit([log], structure("axis"), options={"fixed": {"friction_plus": FRICTION}})
    assert found.parameters["K"].value == pytest.approx(K, rel=0.03)
    assert found.parameters["tau"].value == pytest.approx(0.0265, rel=0.1)
    fresh = speed_log(
        np.repeat([0.0, 24.0, 12.0, 20.0, 0.0, 22.0], 400), step=38.5, tau=0.0265, period=0.001, name="fresh"
    )
    verdict = validate(found, fresh).verdict
    assert verdict.ok, str(verdict)
    stands = speed_log(np.where(np.arange(2000) < 400, 0.0, 1.5), step=38.5, period=0.001)
    assert any("hardly moves" in finding.what for finding in stands.findings if finding.gravity is Gravity.FAULT)


def test_the_only_step_of_a_log_is_no_other_regime() -> None:
    """What a structure lacks shows where the axis accelerates, and nowhere else in such a log."""
    command = np.where(np.arange(2000) < 400, 0.0, 12.0)
    late = np.roll(speed_log(command).position, 8)  # a delay that the structure lacks
    late[:8] = 0.0
    units = {"position": "rev/min", "command": "V"}
    draw = np.random.default_rng(0)
    log = Log("late", np.arange(2000) * T, command, late + 0.5 * draw.standard_normal(2000), units=units)
    found = fit([log], structure("axis"))
    assert any("residuals" in warning for warning in found.warnings)
    assert not any("another regime" in warning or "leaps by" in warning for warning in found.warnings)
    reasons = validate(found, log).verdict.reasons
    assert not any("another regime" in reason.what or "leaps by" in reason.what for reason in reasons)


def test_spikes_of_a_speed_are_told_with_their_times() -> None:
    t = np.arange(6000) * T
    log = speed_log(6.0 * np.sin(2.0 * np.pi * 0.2 * t) + 4.0 * np.sign(np.sin(2.0 * np.pi * 0.55 * t)))
    assert not said(log, "leap")
    spiked = log.position.copy()
    for k in (1311, 3932):
        spiked[k : k + 12] += 1500.0 * np.exp(-np.arange(12) / 4.0)  # a filter behind the faulty difference
    with_spikes = with_findings(Log("spikes", log.time, log.command, spiked, units=log.units))
    (found,) = said(with_spikes, "leap")
    assert "at 6.555 s" in found.what and "at 19.66 s" in found.what and found.gravity is Gravity.WARNING
    lost = log.position.copy()
    lost[[0, 1266]] = 3000.0, 0.0  # before the first difference, and where one is missing
    (found,) = said(with_findings(Log("lost", log.time, log.command, lost, units=log.units)), "leap")
    assert "at 0 s to 3000, at 6.33 s to 0 rev/min" in found.what


@pytest.mark.parametrize("kind", ["pulse", "steps", "noise"])
def test_a_speed_that_the_command_asks_for_is_no_spike(kind: str) -> None:
    k = np.arange(6000)
    draw = np.random.default_rng(1)
    command = {
        "pulse": np.where((k > 3000) & (k < 3025), 24.0, 3.0),
        "steps": np.repeat(draw.uniform(-12.0, 12.0, 60), 100),
        "noise": draw.normal(0.0, 4.0, 6000),
    }[kind]
    assert not said(speed_log(command, tau=0.004), "leap")


def test_what_several_logs_have_in_common_is_said_once() -> None:
    logs = [speed_log(np.full(120, 8.0), name=f"run {k}") for k in range(6)]
    warnings = fit(logs, structure("axis")).warnings
    (step,) = [w for w in warnings if "the log begins with its step" in w]
    assert step.startswith("run 0, run 1, run 2, run 3 and 2 more: the command is 8 V")


def test_a_model_that_is_too_slow_sees_no_slip_of_the_encoder() -> None:
    """Beside the quick start of a chirp the error grows within a tenth of a second, and not in a sample."""
    t = np.arange(10000) * 0.001
    u = 12.0 * np.sin(2.0 * np.pi * (1.0 * t + 1.0 * t**2))
    axis = structure("axis")
    values = {"tau": 0.2, "K": 2000.0, "friction_plus": 100.0, "friction_minus": -100.0}
    y = axis.respond(t, u, (0.0, 0.0), values)
    drift = np.cumsum(np.random.default_rng(0).normal(0.0, 0.02, len(t)))  # friction differs from place to place
    late = y - axis.respond(t, u, (0.0, 0.0), {**values, "tau": 0.22}) + drift
    slipped = late + 120.0 * (t >= 6.0)
    assert not any("leaps by" in sentence for sentence in upsets(t, late, 0.2, "deg", y - late))
    assert any("at 6 s the measurement leaps by" in sentence for sentence in upsets(t, slipped, 0.2, "deg", y - late))


def test_a_flywheel_s_gain_at_rest_is_not_told_by_a_log_that_never_comes_to_rest() -> None:
    """Of a time constant of many swings only its ratio to the gain is known, however sure a slope looks."""
    made = structure("axis", output="rev/min")
    draw = np.random.default_rng(1)
    t = np.arange(3000) * 0.01
    u = np.repeat(draw.uniform(-0.8, 0.8, 30), 100)
    truth = {"tau": 300.0, "K": 54e3, "friction_plus": 1500.0, "friction_minus": -1500.0}
    y = made.respond(t, u, (0.0,), truth) + 0.3 * draw.standard_normal(len(t)) + 8.0 * np.sin(0.4 * t)
    units = {"position": "rev/min", "command": "V"}
    log = Log("flywheel", t, u, y, units=units, closed_loop=False)
    model = {
        "tau": 11.0,
        "K": 1980.0,
        "friction_plus": 55.0,
        "friction_minus": -55.0,
    }  # the same gain over time constant
    found = as_axis(Candidate("model", made, model), log, 0.3)
    assert found is not None and not (found.gain.at == 0.0 and abs(found.gain.value) > 3.5 * found.gain.error)


@pytest.mark.parametrize("unit", ["rev/min", "mm/s"])
def test_a_speed_tells_its_direction_by_its_sign_and_has_no_end_stop(unit: str) -> None:
    t, units = np.arange(4000) * 1e-3, {"position": unit, "command": "V"}
    forward = with_findings(
        Log("one way", t, 2.0 + np.sin(6.0 * t), np.round(5.0 + 3.0 * np.sin(6.0 * t - 0.3), 2), units=units)
    )
    assert any("never moves in the negative direction" in finding.what for finding in said(forward, "excitation"))
    u = np.where(np.floor(2.0 * t) % 2.0, 5.0, -5.0)
    limited = with_findings(Log("limited", t, u, np.round(0.6 * u, 2), units=units))
    assert not any("end stop" in finding.what for finding in limited.findings)
    assert {axes.get_ylabel() for axes in overview([limited]).axes} >= {f"speed [{unit}]"}


def test_a_log_that_tells_no_gain_tells_no_delay_however_far_the_search_goes() -> None:
    """At the edge of the search a delay has no slope, and was told to the last digit: 177 ms too long, ± 0 ms."""
    k = np.arange(450)
    t = 0.02 * k
    y = np.round((30.0 + 8.0 * (k // 50)) / 1.07) * 1.07  # a controller's stairs, under a voltage that hardly changes
    units = {"position": "rev/min", "command": "V"}
    log = Log("stairs", t, 0.2 + np.minimum(t, 1.4), y, units=units, closed_loop=True)
    model = {"tau": 0.039, "K": 26.8, "friction_plus": 6.1, "friction_minus": -6.1, "delay": 0.017}
    found = as_axis(Candidate("model", structure("axis", ("delay",), "rev/min"), model), log, 0.36)
    assert found is not None and found.gain.error > 20.0 and found.delay is not None and found.delay.error == np.inf


def test_one_speed_tells_no_gain_though_a_few_samples_at_rest_seem_to_tell_friction() -> None:
    """A measured step of 5.24 ± 0.04 V whose first two samples turn: K was 0.3 % sure, and any K does as well."""
    k = np.arange(1200)
    draw = np.random.default_rng(3)
    command = np.where(k > 0, 5.24 + 0.04 * (draw.random(1200) < 0.03), 0.0)
    made, truth = structure("axis", ("delay",), "rev/min"), {"tau": 0.1, "K": 60.0, "delay": 0.33}
    truth |= {"friction_plus": 65.0, "friction_minus": -65.0}
    y = made.respond(0.004 * k, command, (0.0,), truth) + 2.0 * draw.standard_normal(1200) * (k > 83)
    y[:2] = 1.9  # still turning, without friction as it seems
    y[2:12] = 1.9 * np.exp(-0.004 * k[2:12] / 0.1)
    log = Log("step", 0.004 * k, command, np.round(y / 1.91) * 1.91, units={"position": "rev/min", "command": "V"})
    found = fit([with_findings(log)], made)
    gain = found.parameters["K"]
    assert gain.low <= 60.0 <= gain.high
    held = fit([with_findings(log)], made, options={"fixed": {"friction_plus": 65.0, "friction_minus": -65.0}})
    assert held.parameters["K"].value == pytest.approx(60.0, rel=0.01) and held.parameters["K"].std_error < 0.5


def test_one_speed_each_way_tells_no_gain_however_long_the_axis_rests_before() -> None:
    """K was 26.574 with a standard error of 0.009 of a motor whose gain is 32.618: friction was called zero."""
    t, made, truth = 0.002 * np.arange(413), structure("axis", (), "rev/min"), {"tau": 0.107, "K": 32.618}
    truth |= {"friction_plus": 33.0, "friction_minus": -33.0}
    draw = np.random.default_rng(5)

    def steps(*levels: float) -> list[Log]:
        commands = [np.where(t >= 0.076, level, 0.0) for level in levels]
        noisy = [made.respond(t, u, (0.0,), truth) + 0.2 * draw.standard_normal(len(t)) for u in commands]
        units = {"position": "rev/min", "command": "V"}
        return [
            with_findings(Log(f"{level:g}", t, u, y, units=units, closed_loop=False))
            for level, u, y in zip(levels, commands, noisy, strict=True)
        ]

    for levels in ((5.5,), (5.5, -5.5)):
        assert fit(steps(*levels), made).parameters["K"].std_error == np.inf
    gain = fit(steps(5.5, 8.0), made).parameters["K"]
    assert gain.low <= 32.618 <= gain.high and gain.std_error < 0.1
