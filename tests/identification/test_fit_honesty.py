"""Bad data: what a fit says of them to somebody who might believe it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.identification.fit.fit import fit
from rds.identification.logs import shipped
from rds.identification.logs.log import Log
from rds.identification.structures.axis_structure import make
from rds.identification.structures.structures import structure
from rds.identification.validate.validate import validate
from tests.identification.fit_logs import axis_log, mini_cnc

X = mini_cnc("X")


def said(log: Log, **options: object) -> str:
    found = fit([log], make(), options=options)
    return "\n".join((*found.unidentifiable, *found.warnings))


def forward(u: np.ndarray) -> Log:
    t = np.arange(len(u)) * 0.001
    y = make().respond(t, u, (0.0, 0.0), X) + 0.001 * np.random.default_rng(0).standard_normal(len(u))
    return Log("forward", t, u, y)


def test_good_data_raise_no_doubt_about_the_structure() -> None:
    text = said(axis_log(X))
    assert "lacks" not in text and "white" not in text and "hardly" not in text


def test_a_reversed_sign_is_suspected() -> None:
    log = axis_log(X)
    assert "Is the sign of the command or of the position reversed?" in said(replace(log, position=-log.position))


def test_swapped_columns_explain_nothing() -> None:
    log = axis_log(X)
    text = said(replace(log, position=log.command, command=log.position, resolution=None))
    assert "do not use these parameters" in text


def test_metres_for_millimetres_are_suspected() -> None:
    log = axis_log(X)
    assert "is the position in mm" in said(replace(log, position=log.position / 1000.0, resolution=None))


def test_milliseconds_for_seconds_are_suspected() -> None:
    log = axis_log(X)
    assert "no time constant" in said(replace(log, time=log.time * 1e6))


def test_an_option_of_which_nothing_shows_is_to_be_left_out() -> None:
    found = fit([axis_log(X, seconds=3.0, seed=3)], make(("delay",)))
    assert found.parameters["delay"].value < 1e-9
    (sentence,) = [warning for warning in found.warnings if warning.startswith("delay = ")]
    assert "these data show nothing of it; fit without that option" in sentence


def test_a_search_that_ends_in_a_valley_of_endless_gain_is_not_the_last() -> None:
    """Gain and friction grew without end from the first start here, and tau settled at twice what it is."""
    quick = X | {"tau": 0.001}
    t = np.arange(10_000) * 0.001
    u = 4.0 * np.sign(np.sin(2.0 * np.pi * t * 4.0 / t[-1] * 2.0 + 1e-9))
    y = np.round(make().respond(t, u, (0.3, 0.0), quick) / 0.001) * 0.001
    found = fit([Log("square", t, u, y, resolution=0.001)], make())
    for name, value in quick.items():
        assert abs(found.parameters[name].value - value) < 3.0 * found.parameters[name].std_error, name


def test_a_direction_in_which_the_axis_only_creeps_is_said() -> None:
    """Intervals were found too narrow where one way is some fifty noises long and the other is not."""
    t = np.arange(4000) * 0.001
    u = np.where((t > 1.0) & (t < 1.3), -0.17, 2.0 + np.sin(9.0 * t) + np.sin(23.0 * t))
    y = np.round(make().respond(t, u, (0.0, 0.0), X), 3)
    text = said(Log("creeps", t, u, y, resolution=0.001))
    assert "moves backward by 0.0" in text and "moves forward" not in text
    assert "intervals reach to where the residuals grow" in text


def test_a_direction_that_never_occurs_is_not_told() -> None:
    t = np.arange(5000) * 0.001
    log = forward(2.5 + np.sin(9.0 * t) + np.sin(23.0 * t))
    found = fit([log], make())
    assert (
        "friction_minus has no effect" in found.unidentifiable[0] and "never moves backward" in found.unidentifiable[0]
    )
    assert np.isinf(found.parameters["friction_minus"].std_error)
    assert found.parameters["K"].value == pytest.approx(X["K"], rel=0.01)
    assert found.to_json()["parameters"]["friction_minus"]["std_error"] is None


@pytest.mark.parametrize("seed", range(3))
def test_friction_of_a_direction_that_hardly_shows_does_not_disturb_the_rest(seed: int) -> None:
    """Some twenty noises of backward motion are worth estimating from; what noise can make is not."""
    t, draw = np.arange(4000) * 0.001, np.random.default_rng(seed)
    for dip, told in ((-0.02, False), (-0.28, True)):
        u = np.where((t > 1.0) & (t < 1.3), dip, 2.0 + np.sin(9.0 * t) + np.sin(23.0 * t))
        y = make().respond(t, u, (0.0, 0.0), X) + 0.001 * draw.standard_normal(len(t))
        found = fit([Log("one way", t, u, y)], make())
        assert np.isfinite(found.parameters["friction_minus"].std_error) == told
        for name in X if told else ("tau", "K", "friction_plus"):
            assert abs(found.parameters[name].value - X[name]) < 4.0 * found.parameters[name].std_error, name


def test_a_search_that_does_not_settle_is_said_loudly_and_widens_the_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    log, start = axis_log(X), {name: 3.0 * value for name, value in X.items()}
    settled = fit([log], make(), options={"start": start})
    monkeypatch.setattr("rds.identification.fit.solve.EVALUATIONS", 2)
    found = fit([log], make(), options={"start": start})
    assert found.warnings[0].startswith("do not use these parameters yet: the search had not settled after 2 free runs")
    for name, value in X.items():
        assert found.parameters[name].std_error > 10.0 * settled.parameters[name].std_error
        assert found.parameters[name].low < value < found.parameters[name].high


def test_little_motion_is_said() -> None:
    t = np.arange(4000) * 0.001
    u = np.where(t < 1.0, 0.0, 0.31)
    y = make().respond(t, u, (0.0, 0.0), X) + 0.001 * np.random.default_rng(0).standard_normal(len(t))
    assert "record more motion" in said(Log("creeps", t, u, y))


def test_a_constant_voltage_tells_only_a_combination_of_gain_and_friction() -> None:
    found = fit([forward(np.full(4000, 3.0))], make())
    assert any(s.startswith("K and friction_plus cannot be told apart") for s in found.unidentifiable), (
        found.unidentifiable
    )
    assert np.isinf(found.parameters["K"].std_error)


def test_half_a_log_widens_the_intervals_and_nothing_else() -> None:
    log = axis_log(X)
    whole, half = fit([log], make()), fit([log.part(5000, 10000)], make())
    for name, value in X.items():
        assert abs(half.parameters[name].value - value) < 4.0 * half.parameters[name].std_error
    ratio = half.parameters["tau"].std_error / whole.parameters["tau"].std_error
    assert 1.1 < ratio < 2.2


def test_a_structure_that_lacks_something_is_said_to() -> None:
    values = X | {"stribeck": 0.3, "stribeck_velocity": 0.8, "backlash": 0.02}
    log = axis_log(values, options=("stribeck", "backlash"), noise=0.0002)
    text = said(log)
    assert "the machine does something that structure axis lacks" in text
    assert "the residuals are not white" in text


def test_closed_loop_data_are_flagged() -> None:
    assert "closed-loop" in said(replace(axis_log(X), closed_loop=True))


@pytest.mark.parametrize(
    "position, command, sentence",
    [
        (lambda log: np.full(len(log), 3.0), lambda log: log.command, "never moves"),
        (
            lambda log: 3.0 + 0.001 * np.round(np.random.default_rng(0).standard_normal(len(log))),
            lambda log: log.command,
            "never moves",
        ),
        (lambda log: log.position, lambda log: 0.0 * log.command, "command is 0 throughout"),
    ],
)
def test_data_that_hold_nothing_are_refused(position, command, sentence) -> None:
    log = axis_log(X)
    with pytest.raises(InputError, match=sentence):
        fit([replace(log, position=position(log), command=command(log))], make())


def test_too_few_samples_and_no_log_are_refused() -> None:
    with pytest.raises(InputError, match="too few"):
        fit([axis_log(X).part(0, 6)], make())
    with pytest.raises(InputError, match="no log"):
        fit([], make())


def test_a_unit_that_the_structure_does_not_take_is_refused() -> None:
    with pytest.raises(InputError, match="position is in counts, and structure axis takes mm or deg"):
        fit([replace(axis_log(X), units={"position": "counts"})], make())


def test_a_log_sampled_too_slowly_gives_no_model_and_says_which_period_would_do() -> None:
    t = np.arange(300) * 0.1
    u = 4.0 * np.sin(2.0 * np.pi * 0.31 * t) + 2.0 * np.sign(np.sin(2.0 * np.pi * 0.13 * t))
    fine = np.arange(30000) * 1e-3
    y = make().respond(fine, np.repeat(u, 100), (0.0, 0.0), X)[::100]
    found = fit([Log("slow", t, u, np.round(y, 3), resolution=0.001)], make())
    said = " ".join(found.unusable())
    assert "sampled too slowly" in said and "a period of 12 ms" in said.lower()
    assert "in seconds" not in " ".join(found.warnings)


def test_an_axis_on_a_spring_is_no_want_of_samples_and_its_model_is_not_valid() -> None:
    """The fit puts tau at 0, where it is ten samples: no faster sampling would help."""
    pull, steps = 5.0, 5  # 1/s, speed by position; steps of integration in a sample
    logs = []
    for seed in (1, 2):
        u, x, v, y = np.repeat(np.random.default_rng(seed).uniform(-6.0, 6.0, 10), 400), 0.0, 0.0, []
        for voltage in u.tolist():
            y.append(x)
            for _ in range(steps):
                v += 1e-3 / steps * (X["K"] * voltage - pull * x - v) / X["tau"]
                x += 1e-3 / steps * v
        t = np.arange(len(u)) * 1e-3
        logs.append(Log(f"{seed}", t, u, np.round(y, 3), resolution=0.001, closed_loop=False))
    found = fit(logs[:1], make())
    said = " ".join(found.unusable())
    assert "has a spring" in said and "sampled too slowly" not in said
    verdict = validate(found, logs[1]).verdict
    assert str(verdict.word) == "not valid", verdict
    assert not any(reason.kind in ("whiteness", "command") and reason.side == "for" for reason in verdict.reasons)


def test_a_lag_that_is_tau_or_delay_is_no_want_of_samples() -> None:
    """Under a triangle, time constant and delay make the same motion: faster samples would not tell them apart."""
    t = np.arange(500) * 0.004
    u = 8.0 / np.pi * np.arcsin(np.sin(0.8 * np.pi * t))
    truth = {"tau": 0.001, "K": 20.0, "friction_plus": 5.0, "friction_minus": -5.0, "delay": 0.069}
    y = make(("delay",)).respond(t, u, (0.0, 0.0), truth) + 0.1 * np.random.default_rng(1).standard_normal(len(t))
    found = fit([Log("triangle", t, u, y, resolution=0.01)], make(("delay",)))
    said = " ".join(found.unusable())
    assert "the sum of tau and delay, 70.1 ms, and neither of them" in said and "sampled too slowly" not in said


def test_logs_of_different_axes_contradict_each_other() -> None:
    logs = [axis_log(X, seed=1, seconds=4.0), axis_log(X, seed=2, seconds=4.0)]
    assert not any("contradict" in warning for warning in fit(logs, make()).warnings)
    other = axis_log(X | {"K": 1.1 * X["K"]}, seed=3, seconds=4.0)
    (said,) = [w for w in fit([logs[0], other], make()).warnings if "contradict each other about K" in w]
    assert f"{logs[0].name} 1.7" in said and f"{other.name} 1.9" in said


def test_a_slip_of_the_encoder_is_pointed_at_in_time() -> None:
    log = axis_log(X, seconds=4.0)
    slipped = replace(log, position=log.position + 0.08 * (log.time >= 2.345))
    (said,) = [w for w in fit([slipped], make()).warnings if "leaps by" in w]
    assert "at 2.345 s the measurement leaps by +0.0" in said
    assert not any("leaps by" in w or "another regime" in w for w in fit([log], make()).warnings)


def test_what_the_structure_lacks_throughout_is_no_slip_and_no_other_regime() -> None:
    """It was both, at each step of the command, with the advice to leave these stretches out."""
    u = np.repeat(np.random.default_rng(1).uniform(-6.0, 6.0, 25), 400)
    t = np.arange(len(u)) * 1e-3
    y = make(("delay",)).respond(t, u, (0.0, 0.0), X | {"delay": 2.3e-3})
    log = Log("late", t, u, np.round(y, 3), resolution=0.001, closed_loop=False)
    for part in (log, log.part(0, 6000), shipped.log("mini-cnc-X-steps")):  # this one has play and Stribeck friction
        assert not any("leaps by" in w or "another regime" in w for w in fit([part], make()).warnings)


def test_a_fit_s_free_run_is_measured_as_a_validation_measures_it() -> None:
    log = axis_log(X, seconds=4.0)
    found = fit([log], make())
    a = validate(found, log).assessments[log.name]
    assert a.free_run == found.free_run[log.name] and a.ahead == found.ahead[log.name]


def test_a_stretch_of_another_regime_is_pointed_at_in_time() -> None:
    log = axis_log(X)
    t, u, axis = log.time, log.command, make()
    rubbing = X | {"friction_plus": 1.5, "friction_minus": -1.0}
    y, state = np.empty(len(t)), (0.0, 0.0)
    for values, first, end in ((X, 0, 4000), (rubbing, 4000, 5500), (X, 5500, 10000)):
        part = axis.respond(t[first : end + 1], u[first : end + 1], state, values)
        y[first:end] = part[: end - first]
        state = (float(part[-1]), 0.0)
    noise = 0.001 * np.random.default_rng(0).standard_normal(len(y))
    found = fit([replace(log, position=np.round(y + noise, 3))], axis)
    (said,) = [w for w in found.warnings if "another regime" in w]
    begin, end = (float(word) for word in said.split(" s the log")[0].split("from ")[1].split(" to "))
    assert 3.8 <= begin <= 4.2 and 5.1 <= end <= 5.7


def test_rounding_where_the_axis_creeps_is_no_other_regime() -> None:
    """There a step of the encoder lasts longer than a block, and an exact model was said to lack something."""
    t, axis = np.arange(4000) * 0.001, make()
    values = {"tau": 0.01, "K": 14.0, "friction_plus": 5.0, "friction_minus": -5.0}
    u = np.repeat(np.random.default_rng(1).uniform(-4.0, 4.0, 20), 200)
    u[2000:2300] = (5.0 + 0.012) / 14.0  # at 0.012 mm/s: a quarter of a step in a block
    log = Log("creeps", t, u, np.round(axis.respond(t, u, (0.0, 0.0), values), 3), resolution=0.001)
    assert not any("another regime" in warning for warning in fit([log], axis).warnings)


def speed_levels(name: str, torques: tuple[float, float], speeds: tuple[float, float]) -> Log:
    """From rest to one speed within a few seconds, and after 10 s to another (Nm, rad/s), as a motor was logged."""
    t, position, velocity, places = np.arange(2000) * 0.01, 0.0, 0.0, []
    for instant in t:
        places.append(position)
        target = np.degrees(speeds[int(instant >= 10.0)])
        position += 0.01 * target + (velocity - target) * 1.6 * -np.expm1(-0.01 / 1.6)
        velocity = target + (velocity - target) * np.exp(-0.01 / 1.6)
    torque, units = np.where(t < 10.0, *torques), {"position": "deg", "command": "Nm"}
    return Log(name, t, torque, np.array(places), resolution=0.01, units=units, closed_loop=False)


def test_a_leap_of_the_initial_velocity_that_hides_an_error_is_told() -> None:
    """Friction that no structure here has: least squares began the motors, which rest, at up to -5450 deg/s."""
    logs = [
        speed_levels("back", (-0.03, -0.04), (-143.0, -183.0)),
        speed_levels("forth", (0.05, 0.06), (139.5, 214.3)),
    ]
    found = fit(logs, structure("axis-inertia", output="deg", command="Nm"), method="simulation")
    sentences = [warning for warning in found.warnings if "the fit begins the free run at" in warning]
    assert [sentence.split(":")[0] for sentence in sentences] == ["back", "forth"]
    assert all("do not use these parameters" in sentence for sentence in sentences)
