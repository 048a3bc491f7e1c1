"""Designs and cheats graded as a student's submission, and what is unfair about their grades."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from rds.core.private_files import write_private
from rds.core.types import Segment
from rds.grading.assignment.assignment import Assignment
from rds.grading.batch.grade_one import Graded, Opener, grade_with_runs
from rds.grading.batch.scratch import scratch
from rds.grading.cases.case import LINEAR, CaseRun
from rds.grading.cases.segment import SegmentCase
from rds.grading.criteria.criterion import Criterion
from rds.grading.grade import Band, Grade
from rds.grading.intake.single import wanted

DECIDES = 20  # samples after which a cheat knows the case by its reference
_MOST = 1 / 3  # of all points: what students see may be known by heart, and must not pay more


class TrialGrades:
    """Designs graded for the first student of a check."""

    def __init__(
        self,
        assignment: Assignment,
        pool: Opener,
        criteria: list[Criterion],
        announce: Callable[[str], None] = lambda text: None,
    ):
        self._assignment, self._pool, self._criteria, self._announce = assignment, pool, criteria, announce

    def zeroed(self, name: str, text: str, reference: Grade) -> list[str]:
        """Criteria in which a design earns nothing, and the solution does."""
        full = {score.name for score in reference.criteria if score.band is Band.FULL and score.max_score}
        return [
            f"{score.title}: an honest design earns nothing ({name}): {score.sentence}"
            for score in self._graded(name, text).grade.criteria
            if score.name in full and not score.score
        ]

    def gated(self, name: str, text: str) -> list[str]:
        """Gates that a design does not pass."""
        gates = {name for each in self._criteria for name in each.requires}
        sound = {each.name for each in self._criteria if LINEAR in each.needs or each.kind == "noise-voltage"}
        return [
            f"{score.title}: an honest design earns nothing ({name}), and so nothing that requires it: {score.sentence}"
            for score in self._graded(name, text).grade.criteria
            if score.name in gates & sound and score.band is Band.NONE
        ]

    def paid(self, name: str, text: str, cases: set[str]) -> list[str]:
        """Criteria of these cases alone that pay a cheat."""
        scores = {score.name: score for score in self._graded(name, text).grade.criteria}
        return [
            f"{each.title}: {name} earns {scores[each.name].score:.4g} of {each.max_score:.4g} points; let it require "
            "a margin that is measured in its own cases, or a criterion that such a loop does not pass"
            for each in self._criteria
            if each.cases and set(each.cases) <= cases and LINEAR not in each.needs and scores[each.name].score
        ]

    def shaken(self, name: str, text: str) -> list[str]:
        """Whether a law that shakes the motor is paid for what it does beside."""
        graded = self._graded(name, text).grade
        scores = {score.name: score for score in graded.criteria}
        paid = [
            each.title
            for each in self._criteria
            if each.cases and LINEAR not in each.needs and each.kind != "noise-voltage" and scores[each.name].score
        ]
        if not paid:
            return []
        return [
            f"{name} earns {graded.score:.4g} of {self._assignment.max_score:.4g} points; let these require a "
            f"criterion of the kind noise-voltage, which such a law does not pass: {', '.join(paid)}"
        ]

    def timed(self, name: str, text: str, cases: set[str]) -> list[str]:
        """Criteria of the time in these cases alone that pay a cheat."""
        timed = [each for each in self._criteria if each.kind == "duration" and set(each.cases) <= cases]
        if not timed:
            return []
        scores = {score.name: score for score in self._graded(name, text).grade.criteria}
        return [
            f"{each.title}: {name} earns {scores[each.name].score:.4g} of {each.max_score:.4g} points; let it require "
            "a path-error in its own cases"
            for each in timed
            if scores[each.name].score
        ]

    def names(self) -> tuple[str, ...]:
        """What is kept of a notebook."""
        return wanted(self._assignment)

    def segments(self) -> Iterator[tuple[str, Segment]]:
        """The segment of each case, by the case's name."""
        for case in self._assignment.cases:
            if isinstance(case, SegmentCase):
                yield case.name, case.segment

    def bought(self, name: str, text: str) -> list[str]:
        """Whether a cheat that has only what students see earns more than a third of all points."""
        found, most = self._graded(name, text).grade.score, self._assignment.max_score
        if found <= _MOST * most:
            return []
        said = f"{name} earns {found:.4g} of {most:.4g} points: more than a third is for what students see beforehand"
        return [
            f"{said}; give more points to hidden cases, or let it require a margin that is measured in its own cases"
        ]

    def visible_runs(self, solution: Path) -> tuple[CaseRun, ...]:
        """The solution's runs of the cases that students see."""
        visible = {case.name for case in self._assignment.cases if case.is_visible}
        seen = [each for each in self._criteria if set(each.cases) <= visible and LINEAR not in each.needs]
        return grade_with_runs(self._assignment, solution, "student 1", self._pool, criteria=seen).runs

    def references(self, solution: Path, cases: set[str]) -> list[float]:
        """By what a cheat knows these cases: the reference of each axis after `DECIDES` samples."""
        found = grade_with_runs(self._assignment, solution, "student 1", self._pool, criteria=self._criteria)
        runs = [run for run in found.runs if run.case in cases and len(run.result) > DECIDES]
        return [float(run.result[f"{axis}_reference"][DECIDES]) for run in runs for axis in run.result.axes]

    def _graded(self, name: str, text: str) -> Graded:
        self._announce(f"trying {name}")
        with scratch("audit") as folder:
            path = folder / "submission.py"
            write_private(path, text.encode(), is_own=True)
            return grade_with_runs(self._assignment, path, "student 1", self._pool, criteria=self._criteria)
