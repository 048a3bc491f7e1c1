"""What grading says of one submission. Plain data: journals, pages and gradebooks are made from it alone."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

BEHAVIOUR, AS_SOLUTION = "behaviour", "same_loop_as_solution"  # of a grade's details: its runs
LISTED = "listed"  # of its details: what the class list calls the student


class Status(StrEnum):
    """What happened to a submission."""

    OK = "ok"  # it was graded; its score may be low
    MISSING = "missing"  # nothing was handed in
    REFUSED = "refused"  # it was not opened: a device, a link, an archive that is too large, ...
    FAILED_TO_LOAD = "failed to load"  # its code could not be loaded, or defines no interface
    BROKE_CONTRACT = "broke the contract"  # it answered what no controller may: NaN, text, too late a sample, ...
    TIMED_OUT = "timed out"  # more CPU or wall time than the assignment allows
    KILLED = "killed"  # it ended its process, or went over a limit of memory, processes or output
    EXCUSED = "excused"  # by a grader's word: it counts neither for nor against the student
    GRADER_ERROR = "grader error"  # our fault: to be graded again, never a zero


class Band(StrEnum):
    """Where a value lies in a criterion's bands."""

    FULL = "full"
    PARTIAL = "partial"
    NONE = "none"
    REVIEW = "review"  # it could not be measured: somebody has to look; never a zero


def with_unit(value: float, unit: str, digits: int = 4) -> str:
    """A criterion's value in words; the unit "1" is none."""
    return f"{value:.{digits}g} {'' if unit == '1' else unit}".rstrip()


@dataclass(frozen=True, slots=True)
class CriterionScore:
    """One criterion's answer. `value` is None where nothing could be measured; `sentence` says what it means."""

    name: str
    title: str
    score: float
    max_score: float
    value: float | None
    unit: str
    band: Band
    sentence: str
    visible: bool = True  # whether the student may see the value and the bands before grades are out
    case: str = ""  # the case that decided it
    gate: str = ""  # the heading of the criterion that it requires, where that took points
    ungated: float | None = None  # points before what it requires took some; None where it requires nothing
    gates: Mapping[str, float] = field(default_factory=dict)  # by required criterion the share that it leaves, 0 to 1


@dataclass(frozen=True, slots=True)
class Grade:
    """One row of a batch. Scores are after the late penalty; `before_penalty` is what the criteria add up to."""

    student: str  # an identifier as it was handed in; may hold any printable text
    status: Status
    reason: str  # a sentence; empty where the status is ok
    score: float
    max_score: float
    before_penalty: float
    criteria: tuple[CriterionScore, ...]
    sha256: str = ""  # of the file that was graded
    seed: int = 0  # of this student's plants
    late_days: float = 0.0
    notes: tuple[str, ...] = ()  # such as what it printed, capped
    details: Mapping[str, Any] = field(default_factory=dict)  # per case: its columns' file, budget figures

    @property
    def for_review(self) -> tuple[CriterionScore, ...]:
        """What could not be measured: points are given in proportion to the others, until somebody has looked."""
        return tuple(score for score in self.criteria if score.band is Band.REVIEW)

    def to_json(self) -> dict[str, Any]:
        """In JSON's own types, whole: `from_json` gives the same grade back."""
        from dataclasses import asdict

        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Grade:
        """The grade that `to_json` was made from."""
        criteria = tuple(CriterionScore(**{**_shared(each), "band": Band(each["band"])}) for each in data["criteria"])
        data = {**data, "details": _shared(dict(data["details"]))}
        whole = {**data, "status": Status(data["status"]), "criteria": criteria, "notes": tuple(data["notes"])}
        return cls(**whole)


def _shared(data: Any) -> Any:
    """The same, with one copy of the keys, and of those texts that all students of a class have in common."""
    if type(data) is not dict:
        return [_shared(each) for each in data] if type(data) is list else data
    return {
        sys.intern(key): sys.intern(value) if key in _COMMON and type(value) is str else _shared(value)
        for key, value in data.items()
    }


_COMMON = frozenset({"name", "title", "unit", "case", "gate", "assignment"})
