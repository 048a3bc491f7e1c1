"""Whether another choice would change a verdict that is borderline: initial samples, a part of the log, friction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from rds.core.errors import InputError
from rds.identification.logs.log import Log
from rds.identification.validate.assessment import Assessment, assess
from rds.identification.validate.candidate import Candidate
from rds.identification.validate.judge import NEAR_FIT, judge
from rds.identification.validate.verdict import Bands, Reason, Side, Verdict
from rds.identification.validate.within import measures

_SHORTEST = 400  # samples of a half


def with_alternatives(
    candidate: Candidate, a: Assessment, verdict: Verdict, bands: Bands, more: Sequence[Reason] = ()
) -> Verdict:
    """The verdict with a note on what other choices would say, where one of its figures is near its band.

    `more` are the reasons that no choice changes: what the loop that was logged says.
    """
    if not _borderline(a, bands):
        return verdict
    words, tried = {}, []
    for what, model, log, samples in _choices(candidate, a):
        try:
            other = judge(model, assess(model, log, samples, bands.bandwidth), bands, more)
        except InputError:  # too little of a log
            continue
        tried.append(what)
        if other.word is not verdict.word:
            words[what] = other.word
    if not tried:
        return verdict
    if words:
        said = ", ".join(f"it would be {str(word)!r} with {what}" for what, word in words.items())
        what = f"the verdict hangs on a choice, as a figure is near its band: {said}"
    else:
        what = f"a figure is near its band; the verdict stays the same with {', '.join(tried)}"
    return replace(verdict, reasons=(*verdict.reasons, Reason(Side.NOTE, "choice", what)))


def _borderline(a: Assessment, bands: Bands) -> bool:
    if a.free_run is None or a.motion == 0.0:
        return False
    room = NEAR_FIT * (100.0 - bands.fit_percent)
    fits = [e.fit_percent for e in (a.free_run, a.velocity) if e is not None]
    if any(abs(fit - bands.fit_percent) <= room for fit in fits):
        return True
    return any(measure.borderline and measure.told for measure in measures(a, bands))


def _choices(candidate: Candidate, a: Assessment) -> Iterator[tuple[str, Candidate, Log, int | None]]:
    log, half = a.log, len(a.log) // 2
    if len(log) > 8 * a.first:
        yield f"the initial state from {2 * a.first} samples", candidate, log, 2 * a.first
    if half >= _SHORTEST:
        yield "the first half of the log", candidate, log.part(0, half), None
        yield "the second half", candidate, log.part(half, len(log)), None
    values = candidate.values
    if {"friction_plus", "friction_minus"} <= set(values):
        mean = 0.5 * (values["friction_plus"] - values["friction_minus"])
        same = {**values, "friction_plus": mean, "friction_minus": -mean}
        if abs(values["friction_plus"] - mean) > 1e-6 * abs(mean):
            yield "friction the same both ways", replace(candidate, values=same), log, a.first
