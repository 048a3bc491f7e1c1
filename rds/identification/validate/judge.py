"""From what was measured of a model to the verdict, by reasons. Each rule is a function that gives some or none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf, log10, sqrt

from rds.identification.fit.estimate import said_of_guesses
from rds.identification.fit.kstep import over_noise
from rds.identification.logs.units import acting
from rds.identification.validate.assessment import Assessment, largest
from rds.identification.validate.candidate import Candidate
from rds.identification.validate.conclusion import UNTOLD, conclude, sentence_of
from rds.identification.validate.judge_data import of_data, of_extent, of_upsets
from rds.identification.validate.verdict import Bands, Reason, Side, Verdict, Word
from rds.identification.validate.within import (
    Measure,
    as_good,
    judged_by,
    measures,
    of_noise,
    passes,
    skilled_at,
    slight,
)

_FACTORS = {  # of measured over modelled, and what makes it
    -1.0: "the sign of the position or of the command is reversed",
    1000.0: "the position is in a unit 1000 times smaller than stated (µm for mm, mm for m), the command is in mV, or "
    "the model computes in m where its unit is mm",
    0.001: "the position is in a unit 1000 times larger than stated (m for mm, mm for µm), or the model computes in µm "
    "where its unit is mm",
    25.4: "the position is in mm where inches are stated",
    1.0 / 25.4: "the position is in inches where mm are stated",
    60.0: "the speed is per minute where it is stated per second",
    1.0 / 60.0: "the speed is per second where it is stated per minute",
}
NEAR_FIT = 0.25  # of what the band leaves to 100 %: so near, a fit is borderline
_BLOCKS = 50  # with fewer, the residual tests find nothing
_NEAR = 0.15  # how near to such a factor is suspicious
_OF_A_UNIT = 2.0  # times 1000, or its part: what friction takes of a velocity is no reason to miss it
_FEW = 0.1  # share of lags beyond the plain band that is still called white
_NEGLIGIBLE = 99.8  # %: of a free run's fit, for what a structure lacks


def judge(candidate: Candidate, a: Assessment, bands: Bands, more: Iterable[Reason] = ()) -> Verdict:
    """The verdict on `candidate` by its assessment on one log, and by `more` reasons."""
    reasons = [
        *of_data(a, bands),
        *_unstable(candidate, a),
        *_discrepancy(a, bands),
        *_free_run(a, bands),
        *_scale(a, bands),
        *_ahead(a, bands),
        *_voltage(a, bands),
        *_residuals(a, bands),
        *_attainable(a, bands),
        *_structure(a, bands),
        *_guesses(candidate),
        *_overfit(candidate, a, bands),
        *of_extent(a, bands),
        *of_upsets(a),
        *more,
    ]
    word, purpose = conclude(a, reasons, bands)
    if word is Word.NOT:  # what the log leaves open does not matter then
        reasons = [replace(r, side=Side.NOTE) if r.kind in UNTOLD else r for r in reasons]
    if word is Word.CANNOT_TELL and all(reason.side is not Side.CANNOT_TELL for reason in reasons):
        reasons.append(
            Reason(
                Side.CANNOT_TELL,
                "closed-loop",
                "in a closed loop, the free run drifts away while the voltage it needs is right: only a log without "
                "feedback tells which is at fault",
            )
        )
    return Verdict(word, sentence_of(candidate, a, word, purpose, reasons), tuple(reasons), purpose)


def _unstable(candidate: Candidate, a: Assessment) -> Iterator[Reason]:
    if a.unstable_at is None:
        return
    if a.log.closed_loop:
        yield Reason(
            Side.CANNOT_TELL,
            "unstable",
            f"the free run is unstable from {a.unstable_at:.4g} s on, which in a closed loop may be the axis's own way",
        )
    else:
        yield Reason(
            Side.AGAINST,
            "unstable",
            f"the free run is unstable from {a.unstable_at:.4g} s on; the axis stays within {a.motion:.4g} {a.unit}",
        )


def _free_run(a: Assessment, bands: Bands) -> Iterator[Reason]:
    if a.free_run is None or a.motion == 0.0:
        return
    e = a.free_run
    position, velocity = passes(a, bands)
    what = "speed" if a.velocity is None else "position"
    if as_good(a) and e.fit_percent < bands.fit_percent:
        yield Reason(
            Side.NOTE,
            "as-good",
            f"the free run's error is the measurement's noise ({a.noise:.2g} {a.unit}): the model is as good as this "
            "log can tell",
        )
    yield Reason(
        Side.FOR if position else Side.AGAINST,
        "free-run",
        f"free run, {what}: fit {e.fit_percent:.2f} % ({_band(e.fit_percent, bands.fit_percent)}), RMSE {e.rmse:.4g} "
        f"{e.unit}, at most {e.maximum:.4g} {e.unit}",
    )
    if a.velocity is None:
        return
    v = a.velocity
    yield Reason(
        Side.FOR if velocity else Side.AGAINST,
        "free-run-velocity",
        f"free run, velocity: fit {v.fit_percent:.2f} % ({_band(v.fit_percent, bands.fit_percent)}), RMSE {v.rmse:.4g} "
        f"{v.unit}, at most {v.maximum:.4g} {v.unit}",
    )
    if velocity and not position and a.drift is not None:
        yield Reason(
            Side.AGAINST,
            "drift",
            f"the position drifts from the model's by {a.drift:.3g} {a.unit}/s: the error of the velocity adds up",
        )


def _band(percent: float, least: float) -> str:
    """The band of a fit, and that it is near."""
    near = abs(percent - least) <= NEAR_FIT * (100.0 - least)
    return f"band {least:g} %{', borderline' if near else ''}"


def _discrepancy(a: Assessment, bands: Bands) -> Iterator[Reason]:
    found = judged_by(a, bands)
    moves = a.motion > 0.0 and a.motion >= bands.steps(a.log.is_rate) * (a.log.resolution or 0.0)
    if found is None or a.free_run is None or not moves:
        return
    for measure in measures(a, bands):
        off, limit = measure.off, f"band {_shown(measure.band, measure.off.unit)}"
        if measure.borderline and measure.told:
            limit += ", borderline"
        what = f"{_said_of(measure, found.frequency)}: ± {_shown(off.error, off.unit)} standard error; {limit}"
        untold = f"this log does not tell the {measure.kind}: {what}"
        if off.value == inf:
            what = _said_of(measure, found.frequency)
        elif off.error == inf:
            untold = f"this log does not tell the {measure.kind} at all; {limit}"
        if measure.wrong:
            yield Reason(Side.AGAINST, measure.kind, what)
        elif measure.told:
            yield Reason(Side.FOR, measure.kind, what)
        elif measure.kind in ("gain", "speed") or (measure.kind == "phase" and measure.reach == inf):
            yield Reason(Side.CANNOT_TELL, f"{measure.kind}-unidentifiable", untold)
        else:
            yield Reason(Side.NOTE, f"{measure.kind}-unidentifiable", untold)


def _said_of(measure: Measure, frequency: float) -> str:
    """A clause: what the model is off by."""
    value = measure.off.value
    size, more = _shown(abs(value), measure.off.unit), value > 0.0
    if measure.kind in ("gain", "speed") and value == inf:
        return "the axis does not move as the model does, or moves the other way"
    if measure.kind == "gain":
        where = f" at {measure.off.at:.2g} Hz" if measure.off.at > 0.0 else ""
        return f"its gain{where} is {size} too {'high' if more else 'low'}"
    if measure.kind == "speed":
        blame = ", by its gain or its friction, which this log does not tell apart" if measure.wrong else ""
        return f"its speed is {size} too {'high' if more else 'low'}{blame}"
    if measure.kind == "phase":
        return f"at {frequency:.2g} Hz its phase {'leads' if more else 'lags'} that of the axis by {size}"
    if measure.kind == "delay":
        return f"its delay is {size} too {'long' if more else 'short'}"
    return f"its friction is too {'high' if more else 'low'} by {size} of the largest command"


def _shown(value: float, unit: str) -> str:
    return f"{1e3 * value:.3g} ms" if unit == "s" else f"{value:.3g}{'' if unit == '°' else ' '}{unit}"


def _scale(a: Assessment, bands: Bands) -> Iterator[Reason]:
    if a.gain is None or all(passes(a, bands)):
        return
    for factor, meaning in _FACTORS.items():
        ratio, steep = a.gain / factor, abs(log10(abs(factor))) >= 3.0
        if 1.0 / _OF_A_UNIT < ratio < _OF_A_UNIT if steep else abs(ratio - 1.0) < _NEAR:
            text = f"the measured velocity is {a.gain:.4g} times the model's: {meaning}"
            yield Reason(Side.AGAINST, "sign" if factor < 0.0 else "unit", text)
            return
    if a.gain < 0.0:
        text = f"the measured velocity is {a.gain:.4g} times the model's: it moves the other way"
        yield Reason(Side.AGAINST, "sign", text)


def _ahead(a: Assessment, bands: Bands) -> Iterator[Reason]:
    if not a.ahead or a.motion == 0.0:
        return
    skilled = skilled_at(a, bands)
    said = ", ".join(
        f"{k}: {e.rmse:.3g} ({a.naive[k].rmse:.3g} without a model)" for k, e in a.ahead.items() if k in a.naive
    )
    worse = [k for k in a.ahead if k in a.naive and a.ahead[k].rmse > a.naive[k].rmse]
    little = [k for k in a.ahead if k not in skilled and k not in worse]
    text = f"RMSE of predictions so many samples ahead, {a.unit}: {said}"
    for which, of_it in (
        (little, f"the error is {bands.skill:g} times that without a model, or more"),
        (worse, "the model is worse than none"),
    ):
        if which:
            text += f"; {', '.join(map(str, which))} ahead, {of_it}, whatever its fit"
    noisy = all(of_noise(a, e) for e in a.ahead.values())
    yield Reason(Side.NOTE if skilled or noisy else Side.AGAINST, "ahead", text)


def _voltage(a: Assessment, bands: Bands) -> Iterator[Reason]:
    if a.voltage is None or a.motion == 0.0:
        return
    unit, percent = a.ranges["command"].unit, a.voltage.relative_percent
    if percent is None:
        yield Reason(
            Side.NOTE,
            "voltage",
            f"no {acting(unit)} error: {len(a.voltage.extra)} blocks of steady direction are too few, or the model "
            f"does not answer to the {acting(unit)} there",
        )
        return
    beyond = Side.NOTE if slight(a, bands) else Side.AGAINST  # of a slow or noisy motion, blocks tell little
    yield Reason(
        Side.FOR if percent <= bands.voltage_percent else beyond,
        "voltage",
        f"the {acting(unit)} that the model needs for the measured motion differs by {percent:.2f} % "
        f"(RMS {a.voltage.rmse:.3g} {unit}) from the one given; band {bands.voltage_percent:g} %",
    )


def _residuals(a: Assessment, bands: Bands) -> Iterator[Reason]:
    tests = a.tests
    if tests is None or tests.blocks < _BLOCKS or a.motion == 0.0:
        return
    r, lag = tests.auto.largest
    numbers = (
        f"p = {tests.p_white:.3f}, {tests.blocks} means over {tests.block * a.log.sample_period * 1e3:.3g} ms; largest "
        f"autocorrelation {r:.2f} after {lag:.3g} s"
    )
    against = Side.NOTE if slight(a, bands) else Side.AGAINST
    # wide intervals allow for any residual: of a model that fails, that says nothing for it
    allowed = Side.FOR if all(passes(a, bands)) else Side.NOTE
    make_it = "the encoder's rounding and the uncertainty of the parameters make it"
    if tests.p_white <= bands.significance:
        yield Reason(against, "whiteness", f"the residual is not white ({numbers})")
    elif tests.auto.outside > _FEW:
        text = f"the residual is not white, but no less so than {make_it} ({numbers})"
        yield Reason(allowed, "whiteness", text)
    else:
        yield Reason(Side.FOR, "whiteness", f"the residual is white ({numbers})")
    if a.log.closed_loop:
        yield Reason(
            Side.NOTE,
            "closed-loop",
            "the log is of a closed loop: the command answers the axis, so a correlation of residual and command "
            "proves nothing either way",
        )
        return
    c, lag = tests.cross.largest
    numbers = f"p = {tests.p_command:.3f}; largest correlation {c:.2f} at {lag:.3g} s"
    if tests.p_command <= bands.significance:
        yield Reason(against, "command", f"the residual is correlated with the command ({numbers})")
    elif tests.cross.outside > _FEW:
        text = f"the residual is correlated with the command, but no more so than {make_it} ({numbers})"
        yield Reason(allowed, "command", text)
    else:
        yield Reason(Side.FOR, "command", f"the residual is independent of the command ({numbers})")


def _attainable(a: Assessment, bands: Bands) -> Iterator[Reason]:
    found = a.attainable
    if found is None or a.motion == 0.0:
        return
    numbers = f"{found.rmse:.3g} {a.unit} (RMSE) for the model, {found.reached:.3g} {a.unit} for the fit"
    if found.reached < found.noise:
        numbers += f", {found.noise:.3g} {a.unit} for the measurement's noise"
    if found.samples < len(a.log):
        numbers += f", over {found.samples * a.log.sample_period:.3g} s of the log"
    if found.ratio > bands.attainable:
        text = (
            f"the free run is {found.ratio:.3g} times as far off as that of the same structure fitted to this log "
            f"({numbers}): noise and structure do not explain that, the parameters are off"
        )
        yield Reason(Side.NOTE if slight(a, bands) else Side.AGAINST, "attainable", text)
    elif all(passes(a, bands)):
        text = f"no other parameters of this structure would come much nearer ({numbers})"
        yield Reason(Side.FOR, "attainable", text)
    if off := [p for p in found.parameters if p.apart > bands.apart]:
        said = ", ".join(
            f"{p.name} {p.model:.4g} {p.unit}".rstrip()
            + f" where this log says {p.here:.4g} ({p.apart:.1f} standard errors)"
            for p in off
        )
        yield Reason(Side.NOTE if slight(a, bands) else Side.AGAINST, "parameters", f"beyond their intervals: {said}")


def _guesses(candidate: Candidate) -> Iterator[Reason]:
    for sentence in candidate.unusable:
        yield Reason(Side.AGAINST, "fit", f"the fit warned: {sentence}")
    for sentence in said_of_guesses(candidate.parameters):
        yield Reason(Side.AGAINST, "guess", f"{sentence}, whatever this log says of the model as a whole")


def _structure(a: Assessment, bands: Bands) -> Iterator[Reason]:
    """What no parameters of this structure explain. The residual tests cannot see it: a fit with such residuals states
    wide intervals, which allow for as much.
    """
    if a.free_run is None or a.noise == 0.0 or a.motion == 0.0:
        return
    if a.log.closed_loop:
        found = over_noise(a.ahead, a.noise)
        if found is not None and found[1] > bands.unexplained:
            yield Reason(
                Side.NOTE if _negligible(a, bands) else Side.AGAINST,
                "structure-held",
                f"{found[0]} samples ahead, where the missing controller hardly shows, the model is {found[1]:.3g} "
                f"times as far off as noise makes it ({a.ahead[found[0]].rmse:.3g} {a.unit} RMSE): the axis does "
                "something that the model lacks (a delay, play, ...), or the parameters are off",
            )
        return
    if a.attainable is not None:
        left, what = a.attainable.reached, "fitted to this very log, the same structure still leaves"
    else:
        left, what = a.free_run.rmse, "the free run leaves"
    if left > bands.unexplained * a.noise:
        yield Reason(
            Side.NOTE if _negligible(a, bands) else Side.AGAINST,
            "structure",
            f"{what} {left:.3g} {a.unit} (RMS), {left / a.noise:.3g} times the measurement's noise "
            f"({a.noise:.2g} {a.unit}, if it is white): the axis does something that the model lacks, and its "
            "parameters may make up for that",
        )


def _negligible(a: Assessment, bands: Bands) -> bool:
    """Whether what the structure lacks is so small a part of the motion that nobody will feel it."""
    return slight(a, bands) and a.free_run is not None and a.free_run.fit_percent >= _NEGLIGIBLE


def _overfit(candidate: Candidate, a: Assessment, bands: Bands) -> Iterator[Reason]:
    """Errors on the fit's data beside those here, where no fit to this log is the measure.

    Errors of a free run grow with the length of a log; those of predictions over the same time can be compared.
    """
    if a.attainable is not None or a.overlap.share > bands.seen:
        return
    known = [ahead for ahead in candidate.fit_predictions() if ahead]
    shared = [k for k in a.ahead if all(k in ahead for ahead in known)]
    if not known or not shared:
        return
    k = max(shared)
    own = max(max(ahead[k].rmse for ahead in known), (a.log.resolution or 0.0) / sqrt(12.0))
    speed = a.ranges["velocity"]
    if speed.fitted is not None and largest(speed.fitted) > 0.0:
        own *= max(1.0, largest(speed.here) / largest(speed.fitted))
    if own > 0.0 and (ratio := a.ahead[k].rmse / own) > bands.worse:
        yield Reason(
            Side.AGAINST,
            "overfitted",
            f"{k} samples ahead, the RMSE is {ratio:.1f} times what it was on the fit's own data at such speeds "
            f"({own:.3g} {a.unit}): the fit followed what was particular to them, the model lacks what shows here, or "
            "the axis has changed",
        )
