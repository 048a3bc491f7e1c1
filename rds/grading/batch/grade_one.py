"""One submission graded: every case run in the sandbox, every criterion measured here.

from rds.grading.batch.grade_one import grade

with Pool() as pool:
    print(grade(assignment, "submission.py", "ada", pool).score)
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from datetime import datetime
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

from rds.grading.assignment.assignment import Assignment
from rds.grading.assignment.late_rules import days_late, told_days
from rds.grading.assignment.unit_tests import UnitTest, failing
from rds.grading.cases.case import Answers, Case, CaseRun
from rds.grading.criteria.criterion import GATE, UNKNOWN, Criterion
from rds.grading.criteria.measuring import NotKnown, NotMeasured
from rds.grading.grade import Band, CriterionScore, Grade, Status
from rds.grading.sandbox.errors import SubmissionError
from rds.grading.sandbox.limits import Limits

_LONGEST_OUTPUT = 4000  # characters of what it printed, in the notes
_MOST_CALLS = 3  # of failing tests, in a sentence
_MOST_KILLS = 2  # by SIGKILL: from then on the submission is taken to end itself
_HIDDEN = "in a case that is hidden"
_ENDED = {
    Status.MISSING: "nothing was handed in",
    Status.REFUSED: "the file was not opened",
    Status.FAILED_TO_LOAD: "the file could not be loaded",
    Status.TIMED_OUT: "the file had taken too long before",
    Status.KILLED: "the file had been ended before",
}
"""Why nothing more is run. What it was in full is the grade's reason, and need not be said at every criterion."""


class Opener(Protocol):
    """What opens submissions: `sandbox.Pool`, or what takes its place for one's own file."""

    @property
    def counts_work(self) -> bool:
        """Whether its subjects' `counts` hold events."""

    def open(self, path: str | Path, limits: Limits | None, kind: str) -> Any:
        """A context manager with the methods of `sandbox.LoadedSubmission`."""


@dataclass(frozen=True)
class Graded:
    """A grade with the runs that it rests on, in the order of cases; of a case that failed there are none."""

    grade: Grade
    runs: tuple[CaseRun, ...]


class OpenSubmission:
    """A submission whose subjects are loaded when they are first asked for, and ended with it."""

    def __init__(self, path: Path, assignment: Assignment, pool: Opener):
        self._path, self._assignment, self._pool = path, assignment, pool
        self._stack = ExitStack()
        self._subjects: dict[tuple[str, int], Any] = {}
        self._printed = ""  # by a process that could not be loaded

    def subject(self, number: int = 0) -> Answers:
        """The submission, loaded; further numbers are further processes of it."""
        return self._get(self._assignment.kind, number)

    def functions(self) -> Answers:
        """The submission as a module of functions."""
        return self._get("functions", 0)

    def _get(self, kind: str, number: int) -> Answers:
        if (kind, number) not in self._subjects:
            try:
                made = self._stack.enter_context(self._pool.open(self._path, self._assignment.limits, kind))
            except SubmissionError as error:
                self._printed += error.printed
                raise
            self._subjects[kind, number] = made
        answers: Answers = self._subjects[kind, number]
        return answers

    @property
    def output(self) -> str:
        """What it has printed, in all its processes; what it prints whenever it is loaded only once."""
        texts, told = [], ""
        for subject in self._subjects.values():
            texts.append(subject.output.removeprefix(told))
            told = told or subject.said_loading
        return "".join([*texts, self._printed])

    def close(self) -> None:
        """End its processes."""
        self._stack.close()


def grade(
    assignment: Assignment,
    path: str | Path,
    student: str,
    pool: Opener,
    *,
    submitted: datetime | None = None,
    seed: int | None = None,
) -> Grade:
    """The grade of the file at `path`; see `grade_with_runs`."""
    return grade_with_runs(assignment, path, student, pool, submitted=submitted, seed=seed).grade


def grade_with_runs(
    assignment: Assignment,
    path: str | Path,
    student: str,
    pool: Opener,
    *,
    submitted: datetime | None = None,
    seed: int | None = None,
    criteria: Sequence[Criterion] | None = None,
) -> Graded:
    """Run the submission on every case that `criteria` (default: all) need, and score them.

    `seed` stands in for the student's own. What a submission does wrong is in the grade. A case in which it breaks its
    interface earns nothing, and the others go on; after a limit or a kill nothing more is run. A submission that was
    ended by SIGKILL is graded once more: somebody else may have done it. Raises SandboxError where the computer fails:
    that is to be graded again.
    """
    path = Path(path)
    seed = assignment.seed(student) if seed is None else seed
    for _ in range(_MOST_KILLS):
        work = _Work(assignment, list(assignment.criteria if criteria is None else criteria), seed)
        for is_hidden in (False, True):
            work.go(path, pool, is_hidden)
        if not work.may_be_foreign:
            break
    scores = work.scores()
    before = _rounded(sum(score.score for score in scores))
    days = days_late(assignment.due, submitted)
    lost = assignment.late.lost(days)
    notes = list(work.notes)
    if lost:
        notes.append(f"Late by {told_days(days, '.2f')}: {100 * lost:.3g} % of the points are lost.")
    if work.output[False]:
        notes.append(f"It printed:\n{_cut(work.output[False])}")
    made = Grade(
        student=student,
        status=work.status,
        reason=work.reason,
        score=_rounded(before * (1.0 - lost)),
        max_score=_rounded(sum(score.max_score for score in scores)),
        before_penalty=before,
        criteria=scores,
        sha256=_sha256(path) if work.was_opened else "",
        seed=seed,
        late_days=days,
        notes=tuple(notes),
        details={"assignment": assignment.sha256, "late_share": lost, "cases": work.details} | work.withheld(),
    )
    order = [case.name for case in assignment.cases]
    return Graded(made, tuple(sorted(work.runs, key=lambda run: order.index(run.case))))


class _Work:
    """What has been run and measured of one submission.

    Hidden cases and tests are run apart, after the others. What the submission prints or raises there could be what it
    saw of them: it is withheld from all that a student reads, unless the assignment's feedback shows all.
    """

    def __init__(self, assignment: Assignment, criteria: list[Criterion], seed: int):
        self.assignment, self.criteria, self.seed = assignment, criteria, seed
        self.status, self.reason = Status.OK, ""
        self.notes: list[str] = []
        self.details: dict[str, Any] = {}
        self.runs: list[CaseRun] = []
        self.was_opened = True
        self.may_be_foreign = False  # an end by SIGKILL, which could be somebody else's doing
        self.output = {False: "", True: ""}  # what it printed: where all is visible, and in hidden cases
        self._told = ""  # of a hidden case: what went wrong
        self._failed: dict[str, str] = {}  # by case: why
        self._failing: dict[str, list[tuple[UnitTest, str]]] = {}  # by criterion: its tests that do not pass
        self._untested: dict[str, str] = {}  # by criterion: why its tests came to no end
        self._stopped: Status | None = None
        self._shares: dict[str, dict[str, float]] = {}  # of the points, by criterion and case
        self._unknown: dict[str, tuple[str, float]] = {}  # by criterion: why it could not be measured; most for it

    def go(self, path: Path, pool: Opener, is_hidden: bool) -> None:
        """Run what is visible, or what is hidden, of the cases and unit tests that the criteria need."""
        wanted = {name for criterion in self.criteria for name in criterion.cases}
        cases = [each for each in self.assignment.cases if each.name in wanted and self._hides(each) is is_hidden]
        tested = [each for each in self.criteria if each.tests and self._hides(each) is is_hidden]
        if self._stopped or not (cases or tested):
            return
        opened = OpenSubmission(path, self.assignment, pool)
        try:
            self._part(opened, cases, tested)
        finally:
            opened.close()
            self.output[is_hidden] = opened.output

    def withheld(self) -> dict[str, Any]:
        """What only the instructor reads."""
        found = {"hidden_output": _cut(self.output[True]), "hidden_reason": self._told}
        return {key: text for key, text in found.items() if text}

    def _hides(self, part: Case | Criterion) -> bool:
        return not part.is_visible and self.assignment.feedback != "all"

    def _part(self, opened: OpenSubmission, cases: Sequence[Case], tested: Sequence[Criterion]) -> None:
        if cases:
            try:
                opened.subject()
            except SubmissionError as error:
                self._blame(error, "")
                return
        for case in cases:
            try:
                self._run(case, opened)
            except SubmissionError as error:
                self._failed[case.name] = self._blame(error, f"case {case.title}: ", self._hides(case))
                if self._stopped:
                    return
        for criterion in tested:
            try:
                self._needs_a_function(opened)
                self._failing[criterion.name] = failing(criterion.tests, opened)
            except SubmissionError as error:
                self._untested[criterion.name] = self._blame(error, f"{criterion.title}: ", self._hides(criterion))
                if self._stopped:
                    return

    def _needs_a_function(self, opened: OpenSubmission) -> None:
        """SubmissionError where functions are handed in, and the file has none of those that are tested."""
        names = {test.function for criterion in self.assignment.criteria for test in criterion.tests}
        shown = sorted({t.function for c in self.assignment.criteria if not self._hides(c) for t in c.tests})
        if self.assignment.kind == "functions" and names.isdisjoint(there := opened.functions().defines):
            said = ", ".join(f"{name}()" for name in shown) or "the functions that the assignment asks for"
            close = ((own, name) for name in shown for own in get_close_matches(name, there, n=1, cutoff=0.7))
            said += "".join(f"; it has {own}(); did you mean {name}()?" for own, name in islice(close, 1))
            raise SubmissionError(Status.FAILED_TO_LOAD, f"it defines none of what is asked for: {said}")

    def _run(self, case: Case, opened: OpenSubmission) -> None:
        needs = {need for criterion in self.criteria if case.name in criterion.cases for need in criterion.needs}
        for number in range(case.runs):
            run = case.run(opened, self.seed, number, needs)
            self.runs.append(_without_words(run) if self._hides(case) else run)
            about = self.details.setdefault(case.name, {"runs": 0, "samples": 0, "faults": []})
            about["runs"] += 1
            about["samples"] += len(run.result)
            if run.fault:
                about["faults"].append(run.fault)
            if run.counts is not None:
                counts = {"calls": run.counts.calls, "events": run.counts.events, "refused": run.counts.refused}
                about.setdefault("counts", []).append(counts)

    def _blame(self, error: SubmissionError, place: str, is_hidden: bool = False) -> str:
        """Record the first thing that went wrong, and whether more can be run; the reason as a student may read it."""
        said = f"{place}{error.reason}"
        self.may_be_foreign |= error.may_be_foreign
        if is_hidden:
            self._told = self._told or said
            said = f"{_HIDDEN}: {error.status}"
        if self.status is Status.OK:
            self.status, self.reason = error.status, said
        if error.status in (Status.MISSING, Status.REFUSED):
            self.was_opened = False
        if error.status is not Status.BROKE_CONTRACT:
            self._stopped = error.status
        return said if is_hidden else error.reason

    def scores(self) -> tuple[CriterionScore, ...]:
        """Of all criteria, in their order."""
        found = {criterion.name: self._score(criterion) for criterion in self.criteria}
        for criterion in self.criteria:
            gates = {name: self._passes(name, criterion.cases) for name in criterion.requires if name in found}
            if gates:  # kept, so that points by hand for one of them can open or close it again
                found[criterion.name] = replace(found[criterion.name], ungated=found[criterion.name].score, gates=gates)
            name = min(gates, key=lambda each: gates[each], default="")
            if name and gates[name] < 1.0 and found[criterion.name].band not in (Band.NONE, Band.REVIEW):
                is_known = found[name].band is not Band.REVIEW
                found[criterion.name] = criterion.gated(found[criterion.name], found[name].title, gates[name], is_known)
        known = [score for score in found.values() if score.band is not Band.REVIEW]
        most = sum(score.max_score for score in known)
        share = sum(score.score for score in known) / most if most else 0.0
        for criterion in self.criteria:
            score = found[criterion.name]
            if score.band is Band.REVIEW:
                why, most = self._unknown[criterion.name]
                found[criterion.name] = criterion.unknown(why, score.case, min(share, most))
        return tuple(found.values())

    def _passes(self, name: str, cases: Sequence[str]) -> float:
        """How much of their points the criterion `name` leaves those that require it in these cases, 0 to 1.

        Where it is itself measured in some of the cases, these count, else all of its own. What could not be measured
        leaves half at most: who makes a margin unmeasurable shall not be paid as if it were good.
        """
        shares = self._shares[name]
        common = [shares[case] for case in cases if case in shares] or shares.values()
        return min((min(share / GATE, 1.0) for share in common), default=1.0)

    def _ended(self) -> str:
        return self.reason if self._stopped is None else _ENDED.get(self._stopped, str(self._stopped))

    def _score(self, criterion: Criterion) -> CriterionScore:
        """The worst of all runs of all its cases."""
        if criterion.tests:
            return self._score_tests(criterion)
        worst: tuple[float, str] | None = None
        nothing: tuple[str, str] | None = None
        unknown: tuple[str, str] | None = None
        most = 1.0  # that what was seen would earn where it is unknown
        shares = self._shares.setdefault(criterion.name, {})
        for name in criterion.cases:
            case = self.assignment.case(name)
            runs = [run for run in self.runs if run.case == name]
            if name in self._failed or len(runs) < case.runs:
                nothing = nothing or (self._failed.get(name) or self._ended(), name)
                shares[name] = 0.0
                continue
            found: list[float] = []
            for run in runs:
                try:
                    value = criterion.measure(run)
                except NotKnown as error:
                    unknown = unknown or (str(error), name)
                    seen = 1.0 if error.at_best is None else criterion.bands.share(error.at_best)
                    most = min(most, seen)
                    found.append(min(seen, UNKNOWN * GATE))
                    continue
                except NotMeasured as error:
                    nothing = nothing or (str(error), name)
                    found.append(0.0)
                    continue
                found.append(criterion.bands.share(value))
                if worst is None or criterion.worse(value, worst[0]):
                    worst = value, name
            shares[name] = min(found)
        if nothing is not None:
            return criterion.nothing(*nothing)
        if unknown is not None and (worst is None or criterion.bands.band(worst[0]) is not Band.NONE):
            self._unknown[criterion.name] = unknown[0], most
            return criterion.unknown(*unknown, 0.0)
        assert worst is not None  # every criterion has a case, every case a run
        return criterion.score(*worst)

    def _score_tests(self, criterion: Criterion) -> CriterionScore:
        """The share of tests passed, and which are not."""
        missed = self._failing.get(criterion.name)
        if missed is None:
            self._shares[criterion.name] = {"": 0.0}
            return criterion.nothing(self._untested.get(criterion.name) or self._ended())
        share = 100.0 * (len(criterion.tests) - len(missed)) / len(criterion.tests)
        self._shares[criterion.name] = {"": criterion.bands.share(share)}
        score = criterion.score(float(f"{share:.9g}"), "")
        if not missed:
            return score
        more = f" and {len(missed) - _MOST_CALLS} more" if len(missed) > _MOST_CALLS else ""
        calls = ", ".join(test.call for test, _ in missed[:_MOST_CALLS])
        why = f"The first of them: {missed[0][1].rstrip('.')}."
        return replace(score, sentence=f"{score.sentence} Not passed: {calls}{more}. {why}")


def _without_words(run: CaseRun) -> CaseRun:
    """The run without why its work was not counted: of a hidden case that could be what the submission saw of it."""
    if run.counts is None or not run.counts.refused:
        return run
    return replace(run, counts=replace(run.counts, refused=f"{_HIDDEN}: its work could not be counted"))


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_OUTPUT else text[:_LONGEST_OUTPUT] + "\n…"


def _rounded(points: float) -> float:
    return float(f"{points:.9g}")


def _sha256(path: Path) -> str:
    with suppress(OSError):
        if path.is_file():
            return hashlib.sha256(path.read_bytes()).hexdigest()
    return ""
