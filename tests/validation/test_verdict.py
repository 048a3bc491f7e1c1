"""Verdicts: what is right passes, and what misleads is caught and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.core.types import Model, Source
from rds.identification.fit.estimate import Errors
from rds.identification.fit.fit import fit
from rds.identification.fit.made_estimate import fitted_stretch
from rds.identification.fit.model_file import write_model
from rds.identification.logs.findings import with_findings
from rds.identification.logs.log import Finding, Gravity
from rds.identification.structures.structures import structure
from rds.identification.validate.alternatives import with_alternatives
from rds.identification.validate.assessment import Assessment, Range, assess
from rds.identification.validate.candidate import as_candidate
from rds.identification.validate.conclusion import conclude, overall, sentence_of
from rds.identification.validate.discrepancy import Off
from rds.identification.validate.judge import judge
from rds.identification.validate.same_data import overlap
from rds.identification.validate.validate import Validation, validate
from rds.identification.validate.verdict import Bands, Reason, Side, Verdict, Word
from rds.identification.validate.within import Measure, frequency_told
from tests.validation.validation_logs import STEP, T, X, candidate, log, moved, square

FRESH = square(8.0, 3.0, 0.7)


def kinds(validation: Validation, side: str) -> set[str]:
    return {reason.kind for reason in validation.verdict.reasons if reason.side == side}


def test_the_true_model_is_valid_on_data_of_another_signal() -> None:
    fit_data = log(square(6.0, 2.5, 1.0), name="fit")
    # its errors are those that such data leave; the values are the true ones
    made = candidate(share=1e-4, fitted_on=(fitted_stretch(fit_data),))
    found = validate(made, log(FRESH, name="fresh"), bands=Bands(beyond=2.0))
    assert found.verdict.word is Word.VALID, found.verdict.sentence
    assert found.exit_code == 0
    a = found.assessments["fresh"]
    assert a.free_run is not None and a.free_run.fit_percent > 99.9
    assert a.free_run.rmse < 0.5e-3  # mm: half a step of the encoder
    assert a.voltage is not None and a.voltage.relative_percent is not None and a.voltage.relative_percent < 3.0
    assert found.verdict.sentence == "model is valid for fresh (up to 7.08 mm/s, 4.2 V and 11 Hz)."
    first, *reasons = str(found).splitlines()
    assert first == found.verdict.sentence and len(reasons) == len(found.verdict.reasons)
    sides = [line.split(":")[0] for line in reasons]
    assert sides == sorted(sides, key=["- cannot tell", "- against", "- for", "- note"].index)


def test_a_limit_in_hz_is_below_the_frequency_at_which_the_phase_is_open() -> None:
    """By a lag of microseconds alone, a phase that may be 7° off at 8 Hz would be within 4° up to hundreds of Hz."""
    a = assess(candidate(), log(FRESH))
    assert a.as_axis is not None and frequency_told(a, Bands()) is None
    open_phase = replace(a.as_axis, phase=Off(1.0, 3.0, "°"), lag=Off(1e-6, 1e-6, "s"))
    told = frequency_told(replace(a, as_axis=open_phase, as_motion=None), Bands())
    assert told == pytest.approx(a.as_axis.frequency * 4.0 / 7.0)


def test_a_gain_that_is_a_per_cent_off_simulates_but_leaves_a_residual_that_follows_the_command() -> None:
    found = validate(candidate(X | {"K": 1.78}), log(FRESH))
    assert found.verdict.word is Word.PARTLY
    assert {"whiteness", "command"} <= kinds(found, "against")
    assert "simulating position and velocity" in found.verdict.purpose


def test_a_model_that_repeats_the_last_measurement_is_not_valid_however_good_one_sample_ahead() -> None:
    still = candidate(X | {"K": 1e-9})
    found = validate(still, log(FRESH))
    a = found.assessments["log"]
    assert a.ahead[1].fit_percent > 99.0  # this is what misleads
    assert a.free_run is not None and a.free_run.fit_percent < 5.0
    assert a.ahead[1].rmse > a.naive[1].rmse
    assert found.verdict.word is Word.NOT
    assert {"free-run", "free-run-velocity", "ahead"} <= kinds(found, "against")
    (said,) = [reason.what for reason in found.verdict.reasons if reason.kind == "ahead"]
    assert "1, 10, 100 ahead, the model is worse than none, whatever its fit" in said
    assert found.exit_code == 1


def test_a_position_that_drifts_leaves_a_model_for_velocities_only() -> None:
    found = validate(candidate(X | {"friction_plus": 0.45}), log(FRESH))
    a = found.assessments["log"]
    assert found.verdict.word is Word.PARTLY and found.verdict.purpose == "simulating the velocity"
    assert "drift" in kinds(found, "against")
    # the forward half of the time is too fast by the friction's error
    assert a.drift == pytest.approx(-0.089 / 2, rel=0.25)  # mm/s


@pytest.mark.parametrize(
    ("factor", "kind", "word"),
    [
        (-1.0, "sign", "reversed"),
        (1000.0, "unit", "the model computes in m"),
        (800.0, "unit", "1000 times smaller"),  # of a model in m without friction: the axis loses a part of its speed
        (1e-3, "unit", "1000 times larger"),
        (25.4, "unit", "inches"),
    ],
)
def test_a_wrong_sign_or_unit_is_named(factor: float, kind: str, word: str) -> None:
    y = factor * moved(FRESH, step=None)
    found = validate(candidate(), log(FRESH, y, resolution=None))
    assert found.verdict.word is Word.NOT
    (reason,) = [r for r in found.verdict.reasons if r.kind == kind]
    assert word in reason.what
    assert found.assessments["log"].gain == pytest.approx(factor, rel=0.03)


def test_an_axis_that_never_moves_gives_no_verdict_and_no_fit() -> None:
    u = np.full(4000, 0.1)  # V: friction holds it
    found = validate(candidate(), log(u))
    assert found.verdict.word is Word.CANNOT_TELL
    assert kinds(found, "cannot tell") == {"no-motion", "no-excitation"}
    numbers = found.to_json()["logs"]["log"]
    assert numbers["free_run"]["fit_percent"] is None  # not 0, not 100, and no NaN in JSON
    assert found.exit_code == 1


def test_a_few_steps_of_the_encoder_are_too_few() -> None:
    u = 0.38 * np.sign(np.sin(2 * np.pi * 2.0 * np.arange(4000) * T))
    y = moved(u)
    assert np.ptp(y) > 0 and np.ptp(np.rint(y / 0.05)) < 20
    found = validate(candidate(), log(u, np.rint(y / 0.05) * 0.05, resolution=0.05))
    assert found.verdict.word is Word.CANNOT_TELL and kinds(found, "cannot tell") == {"no-motion"}


def test_a_short_log_is_too_short() -> None:
    found = validate(candidate(), log(square(0.5)))
    assert found.verdict.word is Word.CANNOT_TELL and "short" in kinds(found, "cannot tell")


def test_the_fit_s_own_data_prove_nothing_and_are_known_by_file_and_by_content() -> None:
    first = log(FRESH, sha256="ab" * 32)
    seen = candidate(fitted_on=(fitted_stretch(first),))
    renamed = log(FRESH, name="copy", sha256="cd" * 32)
    shifted = replace(log(FRESH, moved(FRESH) + 12.5, name="shifted"), sha256="")
    for data in (first, renamed, shifted, first.part(2000, 6000), renamed.part(1000, 8000)):
        found = validate(seen, data)
        assert found.verdict.word is Word.CANNOT_TELL, data.name
        assert kinds(found, "cannot tell") == {"same-data"}
        assert "validate on another log" in str(found)
    other = validate(seen, log(square(8.0, 2.0, 0.9), sha256="ef" * 32))
    assert "same-data" not in kinds(other, "cannot tell")


def test_the_fit_s_own_data_are_known_with_noise_resampled_and_thinned_out() -> None:
    first = log(FRESH)
    seen = candidate(share=1e-4, fitted_on=(fitted_stretch(first),))
    draw = np.random.default_rng(3)
    noisy = log(FRESH, first.position + STEP * draw.integers(-1, 2, len(FRESH)), name="noisy")
    every = slice(None, None, 2)
    half = replace(first, time=first.time[every], command=FRESH[every], position=first.position[every], name="half")
    t = first.time[:-1] + 0.37 * T
    between = np.interp(t, first.time, first.position)
    resampled = replace(first, time=t, command=FRESH[:-1], position=between, resolution=None, name="resampled")
    later = replace(noisy, time=noisy.time + 100.0, name="later")
    mean = np.convolve(np.pad(first.position, 4, "edge"), np.ones(9) / 9, "valid")
    smooth = replace(first, position=mean, resolution=None, name="smooth")
    for data in (noisy, half, resampled, later, smooth, noisy.part(1000, 7000)):
        known = overlap(seen, data)
        assert known.known and known.share > 0.9 and "the same motion" in known.how, data.name
    found = validate(seen, half)
    assert "same-data" in kinds(found, "cannot tell") and found.verdict.word is Word.CANNOT_TELL
    assert overlap(seen, log(square(8.0, 3.0, 0.72), name="other")).share == 0.0


def test_the_rest_of_a_file_of_which_a_part_was_fitted_is_new() -> None:
    whole = log(FRESH, sha256="ab" * 32)
    half = candidate(share=1e-4, fitted_on=(fitted_stretch(whole.part(0, 4000)),))
    rest = validate(half, whole.part(4000, 8000)).assessments["log"]
    assert rest.overlap.share == 0.0 and rest.overlap.known
    assert validate(half, whole.part(2000, 6000)).assessments["log"].overlap.share == pytest.approx(0.5, abs=0.15)


def test_a_model_that_fails_on_its_own_data_has_failed() -> None:
    data = log(FRESH, sha256="ab" * 32)
    found = validate(candidate(X | {"K": -1.7}, fitted_on=(fitted_stretch(data),)), data)
    assert found.verdict.word is Word.NOT and "same-data" in kinds(found, "cannot tell")


def test_the_model_s_own_output_is_no_measurement() -> None:
    found = validate(candidate(), log(FRESH, moved(FRESH, step=None), resolution=None))
    assert found.verdict.word is Word.CANNOT_TELL and kinds(found, "cannot tell") == {"own-output"}


def test_an_error_below_the_encoder_s_rounding_is_too_good() -> None:
    found = validate(candidate(), log(FRESH, moved(FRESH, step=1e-4), resolution=1e-3))
    assert found.verdict.word is Word.CANNOT_TELL and kinds(found, "cannot tell") == {"too-good"}


def test_an_error_that_grows_on_new_data_is_overfitting() -> None:
    record = fitted_stretch(log(square(6.0), name="fit")) | {"ahead": {100: Errors(99.9, 0.002, 0.01, "mm")}}
    found = validate(candidate(X | {"K": 1.80}, fitted_on=(record,)), log(FRESH))
    (reason,) = [r for r in found.verdict.reasons if r.kind == "overfitted"]
    ahead = found.assessments["log"].ahead[100]
    speed = found.assessments["log"].ranges["velocity"]
    assert speed.fitted is not None
    own = 0.002 * max(1.0, speed.here[0] / speed.fitted[0])  # mm: of a motion that is so much faster
    assert f"100 samples ahead, the RMSE is {ahead.rmse / own:.1f} times" in reason.what
    assert found.verdict.word is not Word.VALID


def test_a_closed_loop_hides_no_delay() -> None:
    """A delay of 3 samples under a controller: inverse dynamics make a time constant far too long of it."""
    axis, values = structure("axis", ("delay",)), X | {"delay": 0.003}
    t = np.arange(6000) * T
    logs = []
    for number, frequency in enumerate((0.7, 0.9)):
        u = 9.0 * np.sin(2 * np.pi * frequency * t) + 6.0 * np.sin(2 * np.pi * 8.0 * t)
        y = np.rint(axis.respond(t, u, [0.0, 0.0], values) / STEP) * STEP
        logs.append(log(u, y, name=f"held-{number}", closed_loop=True))
    estimate = fit(logs[:1], structure("axis"), "inverse-dynamics")
    assert estimate.parameters["tau"].low > 1.1 * X["tau"]
    assert any("predictions 100 samples ahead are" in warning for warning in estimate.warnings)
    found = validate(estimate, logs[1])
    assert {"structure-held", "delay"} <= kinds(
        found, "against"
    ) and "delay is 3 ms too short" in found.verdict.sentence
    assert found.verdict.word is Word.NOT and found.exit_code == 1
    right = validate(fit(logs[:1], axis), logs[1])
    assert "structure-held" not in kinds(right, "against")


def test_a_sign_or_unit_that_model_and_log_share_is_not_valid(tmp_path: Path) -> None:
    """The fit's log had the same fault, so the model repeats this one: nothing is shown by that."""
    fitted, fresh = (with_findings(log(-u, moved(u))) for u in (square(6.0, 2.5, 1.0), FRESH))
    estimate = fit([fitted], structure("axis"))
    found = validate(estimate, fresh)
    assert found.verdict.word is Word.CANNOT_TELL and "data-sign" in kinds(found, "cannot tell")
    assert "fit" in kinds(found, "against")
    assert "fit" in kinds(validate(write_model(tmp_path / "reversed.toml", estimate), fresh), "against")
    slow = [replace(log(u, moved(u)), time=np.arange(len(u)) * 1.0) for u in (square(6.0, 2.5, 1.0), FRESH)]
    found = validate(fit([with_findings(slow[0])], structure("axis")), with_findings(slow[1]))
    assert found.verdict.word is not Word.VALID and "data-units" in kinds(found, "against")


def test_a_command_in_another_unit_than_the_model_s_is_refused_with_a_remedy() -> None:
    drive = log(FRESH, units={"position": "mm", "command": "A"})
    with pytest.raises(InputError, match=r'command is in A and the model model takes V.*unit = "V"'):
        validate(candidate(), drive)
    estimate = fit([drive], structure("axis"))
    assert estimate.parameters["K"].unit == "(mm/s)/A"
    found = validate(estimate, replace(drive, name="again"))
    assert found.candidate.structure.command_unit == "A"
    assert "the current that the model needs for the measured motion" in str(found)
    assert "current error, RMS [A]" in found._repr_html_() and "voltage" not in str(found)


def test_a_longer_log_is_not_overfitting() -> None:
    """Errors of a free run add up: of 2 s and of 10 s they cannot be compared, predictions over 0.1 s can."""
    values = X | {"friction_plus": 0.545}
    short, long = (assess(candidate(values), log(square(seconds)), None) for seconds in (2.0, 10.0))
    assert short.free_run is not None and long.free_run is not None and long.free_run.rmse > 3.0 * short.free_run.rmse
    record = fitted_stretch(log(square(2.0), name="fit")) | {"free_run": short.free_run, "ahead": short.ahead}
    found = validate(candidate(values, fitted_on=(record,)), log(square(10.0)))
    assert all(reason.kind != "overfitted" for reason in found.verdict.reasons)


def test_what_the_structure_lacks_is_no_matter_of_wide_intervals() -> None:
    """Low speed, play and Stribeck friction, fitted without them: intervals allow for any residual, and K is off."""
    t = np.arange(6000) * T
    axis = structure("axis", ("stribeck", "backlash"))
    truth = X | {"stribeck": 0.5, "stribeck_velocity": 0.2, "backlash": 0.02}
    logs = []
    for number, frequency in enumerate((0.5, 0.6)):
        u = 0.9 * np.sin(2 * np.pi * frequency * t)
        y = np.rint(axis.respond(t, u, [0.0, 0.0, 0.0], truth) / STEP) * STEP
        logs.append(log(u, y, name=f"slow-{number}"))
    estimate = fit(logs[:1], structure("axis"))
    assert abs(estimate.parameters["K"].value / X["K"] - 1.0) > 0.1
    model = as_candidate(estimate)
    verdict = judge(model, assess(model, logs[1]), Bands())
    assert verdict.word is Word.NOT and "its gain is" in verdict.sentence
    (reason,) = [r for r in verdict.reasons if r.kind == "structure"]
    assert reason.side is Side.AGAINST and "times the measurement's noise" in reason.what


def test_a_loop_that_only_holds_the_axis_tells_nothing_of_it() -> None:
    """Disturbances move it and the command answers them, so the true model looks as if its gain had the other sign."""
    draw = np.random.default_rng(1)
    speed, load = 0.0, 0.0
    rows: list[tuple[float, float]] = []
    for _ in range(2000):  # tau = 0.1 s, K = 10 (mm/s)/V
        load = 0.995 * load + 0.05 * draw.standard_normal()
        u = -0.5 * speed
        rows.append((u, speed))
        speed += T / 0.1 * (10.0 * (u + load) - speed)
    u, y = np.array(rows).T
    known = {"units": {"position": "mm/s", "command": "V"}, "closed_loop": True, "resolution": None}
    values = {"tau": 0.1, "K": 10.0, "friction_plus": 0.0, "friction_minus": 0.0}
    model = replace(candidate(values), structure=structure("axis", output="mm/s"))
    held = log(u, y, **known, extra={"reference": np.zeros(len(u))})
    found = validate(model, held).verdict
    (reason,) = [r for r in found.reasons if r.kind == "disturbed"]
    assert found.word is Word.CANNOT_TELL and reason.side is Side.CANNOT_TELL
    moved_on = log(u, y, **known, extra={"reference": y})
    assert all(r.kind != "disturbed" for r in validate(model, moved_on).verdict.reasons)


def test_speeds_and_voltages_beyond_the_fit_s_are_said() -> None:
    slow = fitted_stretch(log(square(6.0, 1.0), name="slow"))
    found = validate(candidate(share=1e-4, fitted_on=(slow,)), log(FRESH))
    said = [r.what for r in found.verdict.reasons if r.kind == "extrapolation"]
    assert len(said) == 2 and said[0].startswith("command up to") and said[1].startswith("velocity up to")
    fast = fitted_stretch(log(square(6.0, 8.0), name="fast"))
    narrow = validate(candidate(share=1e-4, fitted_on=(fast,)), log(FRESH))
    assert narrow.verdict.word is Word.PARTLY and "up to" in narrow.verdict.purpose


def test_motion_one_way_speaks_for_one_way() -> None:
    u = 3.0 + np.sin(2 * np.pi * 1.3 * np.arange(8000) * T)
    found = validate(candidate(), log(u))
    assert found.verdict.word is Word.PARTLY and "in one direction" in found.verdict.purpose


def _unstable(x, u, T, params):  # type: ignore[no-untyped-def]
    return [x[0] + T * x[1], 1.1 * x[1] + u]


@pytest.mark.parametrize(("closed", "word"), [(False, Word.NOT), (True, Word.CANNOT_TELL)])
def test_an_unstable_free_run_has_its_instant(closed: bool, word: Word) -> None:
    model = Model(_unstable, (0.0, 0.0), {}, source=Source("wild"))
    found = validate(model, log(FRESH, closed_loop=closed))
    a = found.assessments["log"]
    assert found.verdict.word is word
    assert not kinds(found, "against") - {"unstable"}  # no fit of -1e85 %, nor that "it moves the other way"
    assert a.unstable_at is not None and 0.2 < a.unstable_at < 1.0  # 1.1^k passes 1e9 near k = 220
    assert a.free_run is None and found.to_json()["logs"]["log"]["free_run"] is None


def test_a_closed_loop_is_valid_for_a_closed_loop() -> None:
    found = validate(candidate(), log(FRESH, closed_loop=True))
    assert found.verdict.word is Word.PARTLY and "closed loop" in found.verdict.purpose
    assert "command" not in kinds(found, "for") | kinds(found, "against")


def test_findings_about_the_data_are_handed_on() -> None:
    data = replace(log(FRESH), findings=(Finding("gap", "3 samples are missing at 2 s", Gravity.WARNING),))
    assert "3 samples are missing at 2 s" in {r.what for r in validate(candidate(), data).verdict.reasons}


def test_several_logs_have_the_verdict_of_the_worst() -> None:
    good, bad = log(FRESH, name="good"), log(FRESH, -moved(FRESH), name="bad")
    found = validate(candidate(), [good, bad])
    assert found.verdicts["good"].word is Word.VALID and found.verdicts["bad"].word is Word.NOT
    assert found.verdict.word is Word.NOT and "good: valid" in found.verdict.sentence


def test_bands_move_the_verdict_and_unknown_ones_are_refused() -> None:
    strict = validate(candidate(X | {"K": 1.85}), log(FRESH), bands=Bands(fit_percent=99.0))
    mild = validate(candidate(X | {"K": 1.85}), log(FRESH), bands=Bands(fit_percent=50.0, gain_percent=10.0))
    assert strict.verdict.word is Word.NOT and mild.verdict.word is Word.PARTLY
    with pytest.raises(InputError, match="there is no band 'fit'; the bands are fit_percent"):
        Bands.read({"fit": 90.0})
    with pytest.raises(InputError, match="band skill = -1 must be a number of 0 or more"):
        Bands(skill=-1)
    none = Bands(gain_percent=0.0, phase_degrees=0.0, friction_percent=0.0)
    assert validate(candidate(), log(FRESH), bands=none).verdict.word is not Word.VALID


def test_units_that_differ_are_refused() -> None:
    with pytest.raises(InputError, match="the position is in rev/min and the model model answers in mm"):
        validate(candidate(), log(FRESH, units={"position": "rev/min"}))


def test_no_log_and_too_short_a_log_are_refused() -> None:
    with pytest.raises(InputError, match="there is no log to validate on"):
        validate(candidate(), [])
    with pytest.raises(InputError, match="the log has 15 samples, and its initial state takes 10"):
        validate(candidate(), log(FRESH[:15]))
    with pytest.raises(InputError, match="initial_samples = 3 must be at least 10"):
        validate(candidate(), log(FRESH), initial_samples=3)


@pytest.mark.parametrize("estimated", [True, False])
def test_logs_of_two_axes_contradict_each_other(estimated: bool) -> None:
    heavy = X | {"tau": 1.5 * X["tau"]}
    other = log(
        FRESH,
        np.rint(structure("axis").respond(np.arange(len(FRESH)) * T, FRESH, [0.0, 0.0], heavy) / STEP) * STEP,
        name="b",
    )
    model = candidate(share=1e-3) if estimated else candidate()
    found = validate(model, [log(FRESH, name="a"), other])
    told = [r.what for r in found.verdict.reasons if r.kind == "contradiction"]
    about = "tau" if estimated else "what the model is off by in its lag"
    assert any(what.startswith(f"the logs contradict each other about {about}: by ") for what in told)
    assert "The logs contradict each other." in found.verdict.sentence
    alike = validate(model, [log(FRESH, name="a"), log(FRESH, name="b")])
    assert not any(r.kind == "contradiction" for r in alike.verdict.reasons)


def test_a_reason_that_logs_share_is_given_once_with_their_names() -> None:
    shared = Reason(Side.AGAINST, "fit", "the fit warned of it")
    own = Reason(Side.FOR, "voltage", "the voltage is 2 % off")
    verdicts = {name: Verdict(Word.PARTLY, name, (shared, own) if name == "a" else (shared,)) for name in "abcdef"}
    given = [reason.what for reason in overall(verdicts).reasons]
    assert given == ["a, b, c, d and 2 more: the fit warned of it", "a: the voltage is 2 % off"]


@pytest.mark.parametrize(
    "words, word, purpose",
    [
        ("valid, valid", "valid", ""),
        ("valid, valid for", "valid for", "purpose of b"),
        ("valid for, valid for", "valid for", "purpose of a; purpose of b"),
        ("valid, not valid, valid for", "not valid", ""),
        ("cannot tell, valid", "valid", ""),
        ("cannot tell, not valid", "not valid", ""),
        ("cannot tell, cannot tell", "cannot tell", ""),
    ],
)
def test_several_logs_are_as_valid_as_the_least_that_can_tell(words: str, word: str, purpose: str) -> None:
    given = [Word(each) for each in words.split(", ")]
    verdicts = {
        name: Verdict(each, f"{name} said.", (), f"purpose of {name}" if each is Word.PARTLY else "")
        for name, each in zip("abc", given, strict=False)
    }
    found = overall(verdicts)
    assert (found.word, found.purpose) == (word, purpose)
    others = [f"{name}: {each}" for name, each in zip("abc", given, strict=False) if each != word]
    assert f"Beside that: {', '.join(others)}." in found.sentence if others else "Beside" not in found.sentence
    assert overall({"a": verdicts["a"]}) is verdicts["a"]
    assert overall(verdicts, (Reason(Side.NOTE, "contradiction", "so"),)).sentence.endswith("contradict each other.")


def assessed(position: float = 95.0, velocity: float | None = None, closed: bool = False, **more: object) -> Assessment:
    """What `conclude` looks at, of a log without findings: a free run that fits so many per cent."""
    whole = {"velocity": Range((-10.0, 10.0), (-10.0, 10.0), "mm/s"), "command": Range((-8.0, 8.0), (-8.0, 8.0), "V")}
    given = {
        "free_run": SimpleNamespace(fit_percent=position),
        "velocity": None if velocity is None else SimpleNamespace(fit_percent=velocity, rmse=1.0),
        "log": SimpleNamespace(closed_loop=closed, sample_period=T),
        "as_axis": None,
        "as_motion": None,
        "noise": 0.0,
        "block": 1,
        "ahead": {},
        "naive": {},
        "measured": np.zeros(9),
        "voltage": None,
        "ranges": whole,
    }
    return SimpleNamespace(**given | more)  # type: ignore[return-value]


def foretold(rmse: float) -> dict[str, object]:
    """Predictions two samples ahead, in which the axis goes on by 2; without a model they are off by as much."""
    ahead, naive = {2: SimpleNamespace(rmse=rmse)}, {2: SimpleNamespace(rmse=2.0)}
    return {"ahead": ahead, "naive": naive, "measured": np.arange(9.0)}


SLOWER = {"velocity": Range((-4.0, 4.0), (-10.0, 10.0), "mm/s")}
FASTER = {"velocity": Range((-12.0, 12.0), (-10.0, 10.0), "mm/s")}
FORWARD = {"velocity": Range((-0.4, 10.0), (-10.0, 10.0), "mm/s")}
BACKWARD = {"velocity": Range((-10.0, 0.4), (-10.0, 10.0), "mm/s")}
NEEDED = SimpleNamespace(relative_percent=5.0)
FOREIGN = "data-units"  # a finding about the log


@pytest.mark.parametrize(
    "a, reasons, word, purpose",
    [
        (assessed(), "", "valid", ""),
        (assessed(), "against residual", "valid for", "simulating the speed"),
        (assessed(95.0, 95.0), "against residual", "valid for", "simulating position and velocity"),
        (assessed(95.0, 50.0), "against free-run-velocity", "valid for", "simulating the position"),
        (assessed(50.0, 95.0), "against free-run", "valid for", "simulating the velocity"),
        (assessed(50.0, 50.0), "", "not valid", ""),
        (assessed(closed=True), "", "valid for", "simulating the speed in a closed loop such as this"),
        (assessed(ranges=SLOWER), "", "valid for", "simulating the speed up to 4 mm/s"),
        (assessed(ranges=FASTER), "", "valid for", "simulating the speed up to the 12 mm/s tried here"),
        (assessed(ranges=FORWARD), "", "valid", ""),  # a spindle may turn one way
        (assessed(95.0, 95.0, ranges=FORWARD), "", "valid for", "simulating position and velocity in one direction"),
        (assessed(95.0, 95.0, ranges=BACKWARD), "", "valid for", "simulating position and velocity in one direction"),
        (assessed(50.0, **foretold(0.19)), "", "valid for", "predicting 2 samples ahead"),
        (assessed(50.0, **foretold(0.19)), "against voltage", "not valid", ""),
        (assessed(50.0, **foretold(0.21)), "", "not valid", ""),
        *((assessed(), f"against {kind}", "not valid", "") for kind in ("unstable", "sign", "unit", "gain", "loop")),
        (assessed(), f"cannot tell {FOREIGN}", "cannot tell", ""),
        (assessed(), f"cannot tell {FOREIGN}, against gain", "not valid", ""),
        (assessed(), "cannot tell same-data, against gain", "not valid", ""),
        (assessed(), "cannot tell little, against gain", "cannot tell", ""),
        (assessed(50.0), "cannot tell gain-unidentifiable, against voltage, against ahead", "not valid", ""),
        (assessed(50.0), "cannot tell gain-unidentifiable, against voltage", "cannot tell", ""),
        (assessed(95.0), "cannot tell gain-unidentifiable, against voltage, against ahead", "cannot tell", ""),
        (assessed(50.0), "cannot tell little, against voltage, against ahead", "cannot tell", ""),
        (
            assessed(50.0, closed=True),
            "for forces",
            "valid for",
            "foretelling the force of a motion in a closed loop such as this",
        ),
        (assessed(50.0), "for forces", "not valid", ""),
        (assessed(50.0, closed=True), "", "not valid", ""),
        (assessed(50.0, closed=True, voltage=NEEDED), "", "cannot tell", ""),
        (assessed(50.0, closed=True, voltage=NEEDED), "against voltage", "not valid", ""),
        (assessed(50.0, voltage=NEEDED), "", "not valid", ""),
    ],
)
def test_from_errors_and_reasons_to_the_word(a: Assessment, reasons: str, word: str, purpose: str) -> None:
    said = [each.rsplit(" ", 1) for each in reasons.split(", ") if each]
    given = [Reason(Side(side), kind, "so it is") for side, kind in said]
    assert conclude(a, given, Bands()) == (word, purpose)


OWN = "Do not take its parameters for the axis's own: this log contradicts them."
LACKS = "Its parameters may not be the axis's own: they may make up for something that it lacks."
HELD = "That its parameters are the axis's own is not shown: see the predictions."


@pytest.mark.parametrize(
    "word, reasons, sentence",
    [
        ("valid", "", "M is valid for a.csv (up to 10 mm/s and 8 V)."),
        ("cannot tell", "", "Cannot tell whether M is valid, from a.csv (up to 10 mm/s and 8 V)."),
        ("not valid", "against ahead, for gain", "M is not valid for a.csv (up to 10 mm/s and 8 V)."),
        ("not valid", "against gain, against delay", "M is not valid for a.csv (up to 10 mm/s and 8 V): gain; delay."),
        ("valid for", "", "M is valid for braking only, by a.csv (up to 10 mm/s and 8 V)."),
        *(
            ("valid for", reasons, f"M is valid for braking only, by a.csv (up to 10 mm/s and 8 V). {more}")
            for reasons, more in (
                ("against parameters, against structure", OWN),
                ("against structure, against structure-held", LACKS),
                ("against structure-held", HELD),
            )
        ),
        ("valid for", "for parameters", "M is valid for braking only, by a.csv (up to 10 mm/s and 8 V)."),
    ],
)
def test_the_sentence_of_a_verdict(word: str, reasons: str, sentence: str) -> None:
    said = [each.rsplit(" ", 1) for each in reasons.split(", ") if each]
    given = [Reason(Side(side), kind, f"{kind}: so it is") for side, kind in said]
    a = assessed(log=SimpleNamespace(name="a.csv"), frequency=0.0)
    model = SimpleNamespace(name="M", parameters={})
    assert sentence_of(model, a, Word(word), "braking", given) == sentence  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "kind, value, error, wrong, told, borderline",
    [
        ("gain", 3.0, 0.0, False, True, True),
        ("gain", 3.1, 1.0, True, True, True),  # 3.1 standard errors
        ("gain", 3.1, 1.3, False, True, True),  # 2.4; up to 5.7 %, of 6
        ("gain", -3.1, 1.5, False, False, True),
        ("gain", 2.2, 0.0, False, True, False),
        ("gain", -4.1, 0.0, True, True, False),
        ("gain", 0.0, float("inf"), False, False, False),
        ("phase", 2.0, 1.0, False, True, False),
        ("phase", 2.0, 1.2, False, False, False),  # up to 4.4, of 4.2
        ("delay", 4.0, 1.0, False, False, False),  # four standard errors are not enough of a delay
        ("delay", 5.1, 1.0, True, True, False),
        ("friction", 0.0, 1.5, False, True, False),
        ("friction", 0.0, 1.6, False, False, False),
    ],
)
def test_what_is_clearly_wrong_and_what_the_log_leaves_open(
    kind: str, value: float, error: float, wrong: bool, told: bool, borderline: bool
) -> None:
    """A band of 3: beyond it and 2.6 standard errors (of a delay 5) it is wrong."""
    measure = Measure(kind, Off(value, error, "%"), 3.0)
    assert (measure.wrong, measure.told, measure.borderline) == (wrong, told, borderline)
    assert not replace(measure, by_chance=True).wrong


def test_what_the_loop_that_was_logged_says_stands_whatever_the_choice() -> None:
    model, bands = candidate(X | {"K": 1.028 * X["K"]}), Bands()
    found = assess(model, log(square(2.0)))
    more = [Reason(Side.AGAINST, "loop", "simulated in the loop itself, it is off")]
    verdict = with_alternatives(model, found, judge(model, found, bands, more), bands, more)
    (note,) = [reason for reason in verdict.reasons if reason.kind == "choice"]
    assert verdict.word is Word.NOT and "valid" not in note.what  # neither from other samples, nor with other friction
