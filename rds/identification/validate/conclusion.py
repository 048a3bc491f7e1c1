"""From the reasons to the verdict: its word, what the model is valid for, and the sentence."""

from __future__ import annotations

from collections.abc import Iterator

from rds.identification.fit.estimate import guesses, names_of
from rds.identification.validate.assessment import Assessment, Range, largest
from rds.identification.validate.candidate import Candidate
from rds.identification.validate.verdict import Bands, Reason, Side, Verdict, Word
from rds.identification.validate.within import foreseen_at, frequency_told, passes

WRONG = frozenset({"gain", "phase", "delay", "friction", "speed", "loop"})  # what a loop would feel, or does
UNTOLD = frozenset({"gain-unidentifiable", "speed-unidentifiable", "phase-unidentifiable"})
DATA = "data-"  # how the kind of a reason begins that is a finding about the log


def conclude(a: Assessment, reasons: list[Reason], bands: Bands) -> tuple[Word, str]:
    """The word of the verdict, and what the model is valid for where that is only something."""
    cannot_tell = {reason.kind for reason in reasons if reason.side is Side.CANNOT_TELL}
    decisive = {kind for kind in cannot_tell if kind != "same-data" and not kind.startswith(DATA)}
    if decisive and not (decisive <= UNTOLD and _fails(a, reasons, bands)):
        return Word.CANNOT_TELL, ""
    word, purpose = _from_errors(a, reasons, bands)
    # what fails even on its own data, or on faulty ones, has failed; what passes there has shown nothing
    return (Word.CANNOT_TELL, "") if cannot_tell and word is not Word.NOT else (word, purpose)


def _fails(a: Assessment, reasons: list[Reason], bands: Bands) -> bool:
    """Whether the model moves otherwise than the axis in all respects, whatever its gain is: no controller had a part
    in it, and neither free run, voltage nor predictions are right.
    """
    against = {reason.kind for reason in reasons if reason.side is Side.AGAINST}
    return a.log.closed_loop is False and not any(passes(a, bands)) and {"voltage", "ahead"} <= against


def _from_errors(a: Assessment, reasons: list[Reason], bands: Bands) -> tuple[Word, str]:
    against = {reason.kind for reason in reasons if reason.side is Side.AGAINST}
    position, velocity = passes(a, bands)
    if ({"unstable", "sign", "unit"} | WRONG) & against:
        return Word.NOT, ""
    if not position and not velocity:
        if a.log.closed_loop and any(r.kind == "forces" and r.side is Side.FOR for r in reasons):
            return Word.PARTLY, " ".join(["foretelling the force of a motion", *_limits(a, bands)])
        if a.log.closed_loop and "voltage" not in against and a.voltage and a.voltage.relative_percent is not None:
            return Word.CANNOT_TELL, ""
        foreseen = foreseen_at(a, bands)
        if foreseen and "voltage" not in against:
            return Word.PARTLY, f"predicting {_and([str(k) for k in foreseen])} samples ahead"
        return Word.NOT, ""
    purposes = []
    rate = "speed" if a.velocity is None else "velocity"
    if a.velocity is None or not position:
        purposes.append(f"simulating the {rate}")
    elif not velocity:
        purposes.append("simulating the position")
    else:
        purposes.append("simulating position and velocity")
    limits = list(_limits(a, bands))
    if against or limits or a.log.closed_loop:
        return Word.PARTLY, " ".join([*purposes, *limits])
    return Word.VALID, ""


def _limits(a: Assessment, bands: Bands) -> Iterator[str]:
    """What the log did not try of that which the model claims."""
    speed: Range = a.ranges["velocity"]
    low, high = speed.here
    still = 0.05 * largest(speed.here)
    if a.velocity is not None and (high <= still or low >= -still):
        yield "in one direction"
    if speed.fitted is not None and largest(speed.here) < bands.covered * largest(speed.fitted):
        yield f"up to {largest(speed.here):.3g} {speed.unit}"
    elif beyond := [
        found
        for found in a.ranges.values()
        if found.fitted is not None and largest(found.here) > bands.beyond * largest(found.fitted)
    ]:
        found = speed if speed in beyond else beyond[0]
        yield f"up to the {largest(found.here):.3g} {found.unit} tried here"
    if (frequency := frequency_told(a, bands)) is not None:
        yield f"up to {frequency:.2g} Hz"
    if a.log.closed_loop:
        yield "in a closed loop such as this"


def sentence_of(candidate: Candidate, a: Assessment, word: Word, purpose: str, reasons: list[Reason]) -> str:
    """The verdict in a sentence."""
    name, log = candidate.name, f"{a.log.name} ({_tried(a)})"
    if word is Word.CANNOT_TELL:
        return f"Cannot tell whether {name} is valid, from {log}."
    if word is Word.NOT:
        wrong = [r.what.split(":")[0] for r in reasons if r.side is Side.AGAINST and r.kind in WRONG]
        return f"{name} is not valid for {log}{': ' if wrong else ''}{'; '.join(wrong)}."
    if word is Word.VALID:
        return f"{name} is valid for {log}."
    sentence = f"{name} is valid for {purpose} only, by {log}."
    kinds = {reason.kind for reason in reasons if reason.side is Side.AGAINST}
    if "parameters" in kinds:
        sentence += " Do not take its parameters for the axis's own: this log contradicts them."
    elif "structure" in kinds:
        sentence += " Its parameters may not be the axis's own: they may make up for something that it lacks."
    elif "structure-held" in kinds:
        sentence += " That its parameters are the axis's own is not shown: see the predictions."
    if guessed := guesses(candidate.parameters):
        sentence += f" Do not take its {_and(guessed)} for the axis's own: the fit's data did not tell."
    return sentence


def _tried(a: Assessment) -> str:
    """How fast and at which voltages the log went: what a verdict by it speaks of."""
    speed, command = a.ranges["velocity"], a.ranges["command"]
    fastest, most = f"{largest(speed.here):.3g} {speed.unit}", f"{largest(command.here):.3g} {command.unit}"
    return f"up to {fastest}, {most} and {a.frequency:.2g} Hz" if a.frequency > 0.0 else f"up to {fastest} and {most}"


def _and(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def overall(verdicts: dict[str, Verdict], between: tuple[Reason, ...] = ()) -> Verdict:
    """The verdict over several logs: not valid if any says so; else the narrowest of those that can tell.

    `between` are reasons that no single log gives.
    """
    if len(verdicts) == 1:
        return next(iter(verdicts.values()))
    for word in (Word.NOT, Word.PARTLY, Word.VALID, Word.CANNOT_TELL):
        chosen = {name: verdict for name, verdict in verdicts.items() if verdict.word is word}
        if chosen:
            break
    others = {name: verdict for name, verdict in verdicts.items() if name not in chosen}
    purposes = list(dict.fromkeys(verdict.purpose for verdict in chosen.values() if verdict.purpose))
    sentence = " ".join(verdict.sentence for verdict in chosen.values())
    if others:
        sentence += " Beside that: " + ", ".join(f"{name}: {verdict.word}" for name, verdict in others.items()) + "."
    given: dict[tuple[Side, str, str], list[str]] = {}  # names of the logs by what they say
    for name, verdict in verdicts.items():
        for reason in verdict.reasons:
            given.setdefault((reason.side, reason.kind, reason.what), []).append(name)
    reasons = tuple(Reason(side, kind, f"{names_of(names)}: {what}") for (side, kind, what), names in given.items())
    if between:
        sentence += " The logs contradict each other."
    return Verdict(word, sentence, (*between, *reasons), "; ".join(purposes))
