"""The verdict of a validation: what the model is good for, in a sentence, and a list of reasons.

Cannot tell      the data do not allow a verdict: they are the fit's own, hold too little motion, or are too good to be
                 a measurement; or feedback hides what the model does by itself
not valid        the model contradicts the data, also where only its sign or unit is wrong
valid for ...    it passes what the sentence names, and fails or was not tried beyond
valid            free run, residuals and voltage all within the bands, on data that the fit has not seen

The bands are conventions, not truths: `Bands` holds them all, and a report shows them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Any

from rds.core.errors import InputError


class Word(StrEnum):
    """The verdict in a word, from best to worst; `cannot tell` is none."""

    VALID = "valid"
    PARTLY = "valid for"
    NOT = "not valid"
    CANNOT_TELL = "cannot tell"


class Side(StrEnum):
    """What a reason speaks for."""

    FOR = "for"
    AGAINST = "against"
    CANNOT_TELL = "cannot tell"
    NOTE = "note"


@dataclass(frozen=True)
class Reason:
    """One reason: `kind` for programs, `what` a sentence with numbers and units."""

    side: Side
    kind: str
    what: str


@dataclass(frozen=True)
class Verdict:
    """The verdict: `sentence` says it, `reasons` why; `purpose` is what a model that is valid for something only is
    valid for.
    """

    word: Word
    sentence: str
    reasons: tuple[Reason, ...]
    purpose: str = ""

    @property
    def ok(self) -> bool:
        """Whether the model may be used, for `purpose` if that is said: exit code 0."""
        return self.word in (Word.VALID, Word.PARTLY)

    def ranked(self) -> list[Reason]:
        """The reasons, those that decide first: what nobody can tell, what speaks against, what for, and notes."""
        order = (Side.CANNOT_TELL, Side.AGAINST, Side.FOR, Side.NOTE)
        return [reason for side in order for reason in self.reasons if reason.side is side]

    def __str__(self) -> str:
        """The sentence, and a line for each reason."""
        return "\n".join([self.sentence, *(f"- {reason.side}: {reason.what}" for reason in self.ranked())])

    def to_json(self) -> dict[str, Any]:
        """As JSON's own types."""
        return {
            "verdict": str(self.word),
            "purpose": self.purpose,
            "sentence": self.sentence,
            "reasons": [{"side": str(r.side), "kind": r.kind, "what": r.what} for r in self.reasons],
        }


@dataclass(frozen=True)
class Bands:
    """The limits of the verdict. Each can be set: `Bands(fit_percent=80.0)`, `--band fit_percent=80`."""

    fit_percent: float = 90.0  # %: a free run that fits less is not that of the axis
    voltage_percent: float = 15.0  # %: of the voltage that the model needs beside the one given, to the latter
    significance: float = 0.01  # of the residual tests: 1 % of exact models fail each
    seen: float = 0.05  # share of the log that the fit may have seen
    least_changes: float = 3.0  # of the velocity, from above its mean to below it or back
    least_steps: float = 20.0  # of the encoder, that the axis must at least move
    least_speed_steps: float = 8.0  # of a speed, where that was logged: it counts anew in each sample
    skill: float = 0.5  # a prediction's RMSE must be less than so much of that without a model
    worse: float = 2.0  # RMSE of predictions here over those on the fit's data: beyond it, these were particular
    attainable: float = 2.0  # RMSE over that of the same structure fitted to this very log
    unexplained: float = 3.0  # RMS that no parameters explain, over the noise: beyond it, the structure lacks something
    apart: float = 3.5  # standard errors by which a parameter may differ from what this log says of it
    beyond: float = 1.1  # speeds and voltages here over the fit's, beyond which the model extrapolates
    covered: float = 0.5  # share of the fit's speeds that a log must cover to speak for all of them
    bandwidth: float = 0.0  # Hz, that a loop on this axis is to have; 0: half of 1/τ
    gain_percent: float = 3.0  # %: of the gain at the bandwidth or at rest, whichever the log tells better
    phase_degrees: float = 4.0  # at the bandwidth
    delay: float = 1.5e-3  # s, and one and a half samples: of the delay alone
    friction_percent: float = 3.0  # %: of the largest command
    floor: float = 0.8  # RMSE over the encoder's own rounding (step / √12), below which no measurement comes

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < 1e9:
                raise InputError(f"band {field.name} = {value!r} must be a number of 0 or more")

    def steps(self, is_rate: bool) -> float:
        """How many steps of its resolution a position, or a speed, must at least go through."""
        return self.least_speed_steps if is_rate else self.least_steps

    @classmethod
    def read(cls, given: Mapping[str, float]) -> Bands:
        """The bands with those given in place of the usual ones; InputError for an unknown one."""
        known = [field.name for field in fields(cls)]
        for name in given:
            if name not in known:
                raise InputError(f"there is no band {name!r}; the bands are {', '.join(known)}")
        return cls(**given)

    def to_json(self) -> dict[str, float]:
        """Every band by name."""
        return asdict(self)
