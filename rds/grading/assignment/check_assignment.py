"""An assignment tried out: its reference solution earns all points, whoever hands it in, and doing nothing none."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.private_files import write_private
from rds.core.progress import Progress
from rds.grading.assignment.assignment import Assignment
from rds.grading.assignment.audit import audit
from rds.grading.assignment.hand_out import promised
from rds.grading.batch.grade_one import Opener, grade, grade_with_runs
from rds.grading.batch.scratch import scratch
from rds.grading.cases.case import COUNTS
from rds.grading.grade import Band, Grade, Status

SEEDS = 20
WORK_SEEDS = 3  # students for whom work is counted: it hardly depends on the plant, and takes a hundred times as long

IDLE = {
    "controller": "def control(t, r, y, state, params):\n    return 0.0 * y, state\n",
    "model": "def advance(x, u, T, params):\n    return x\n",
    "interpolator": (
        "def interpolate(segment, T, params):\n"
        "    still = [0.0] * len(segment.start)\n"
        "    yield segment.start, still, still\n"
    ),
    "functions": "",
}
"""What does nothing, and keeps its interface."""


@dataclass(frozen=True)
class CriterionCheck:
    """One criterion: the reference solution's values for all seeds, and what doing nothing earns. Values in `unit`.

    `margin` is the least of all seeds, in per cent of the band: 100 where full points begin.
    """

    name: str
    title: str
    max_score: float
    unit: str
    full: float
    none: float
    least: float | None
    median: float | None
    largest: float | None
    margin: float | None
    idle: float  # points


@dataclass(frozen=True)
class AssignmentCheck:
    """What was found: `faults` make the assignment unfit, `notes` are worth knowing."""

    criteria: tuple[CriterionCheck, ...]
    max_score: float
    seeds: int
    faults: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether it can be given to students."""
        return not self.faults

    def to_json(self) -> dict[str, Any]:
        """In JSON's own types."""
        return {
            "ok": self.ok,
            "max_score": self.max_score,
            "seeds": self.seeds,
            "criteria": [dict(vars(criterion)) for criterion in self.criteria],
            "faults": list(self.faults),
            "notes": list(self.notes),
        }


@dataclass
class _Found:
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def check_assignment(
    assignment: Assignment,
    pool: Opener,
    seeds: int = SEEDS,
    progress: Progress | None = None,
    audited: bool = True,
    announce: Callable[[str], None] = lambda text: None,
) -> AssignmentCheck:
    """Grade the reference solution for `seeds` students, and what does nothing. InputError without a solution.

    Work is counted for `WORK_SEEDS` of them. Where it is `audited`, honest designs and cheats are tried as well,
    which takes a minute and more: `announce` gets a sentence before each.
    """
    solution = assignment.path(assignment.solution)
    if solution is None:
        raise InputError(
            'solution is missing; add `solution = "solution.py"`, a submission that earns all points',
            str(assignment.folder / "assignment.toml"),
        )
    found = _Found()
    grades: list[Grade] = []
    announce(f"trying the reference solution on the plants of {seeds} students")
    for number in range(seeds):
        grades.append(_of_student(assignment, solution, number + 1, grades, pool))
        if progress:
            progress(number + 1, seeds + 1)
    again = grade(assignment, solution, "student 1", pool)
    if again.to_json() != grades[0].to_json():
        found.faults.append("the reference solution, graded twice, earned different values: it is not deterministic")
    _judge_solution(assignment, grades, found)
    announce("trying what does nothing")
    idle = _idle(assignment, pool, grades[0], found)
    if progress:
        progress(seeds + 1, seeds + 1)
    _notes(assignment, found)
    if audited and not found.faults:  # else the designs would be blamed for what the solution is
        faults, notes = audit(assignment, pool, grades[0], announce)
        found.faults += faults
        found.notes += notes
    rows = tuple(_row(assignment, number, grades, idle) for number in range(len(assignment.criteria)))
    for row in rows:
        if row.idle:
            found.faults.append(
                f"{row.title}: a submission that does nothing earns {row.idle:g} of {row.max_score:g} points; move the "
                'bands, or add `requires = ["..."]`, the criterion that says that it does its work'
            )
    return AssignmentCheck(rows, assignment.max_score, seeds, tuple(found.faults), tuple(found.notes))


def _of_student(assignment: Assignment, solution: Path, number: int, before: list[Grade], pool: Opener) -> Grade:
    """The solution's grade for one student; what is the same for everybody is that of the first."""
    student = f"student {number}"
    if not before:
        return grade(assignment, solution, student, pool)
    own = [each for each in assignment.criteria if any(assignment.case(name).is_drawn for name in each.cases)]
    if number > WORK_SEEDS:
        own = [each for each in own if COUNTS not in each.needs]
    if not own:
        return replace(before[0], student=student)
    found = grade_with_runs(assignment, solution, student, pool, criteria=own).grade
    scores = {score.name: score for score in (*before[0].criteria, *found.criteria)}
    return replace(found, criteria=tuple(scores.values()))


def _judge_solution(assignment: Assignment, grades: list[Grade], found: _Found) -> None:
    bad = [grade for grade in grades if grade.status is not Status.OK]
    if bad:
        found.faults.append(f"the reference solution fails for {bad[0].student}: {bad[0].status}: {bad[0].reason}")
    for number, criterion in enumerate(assignment.criteria):
        short = [grade for grade in grades if grade.criteria[number].band is not Band.FULL]
        if short:
            said = short[0].criteria[number].sentence
            found.faults.append(
                f"{criterion.title}: the reference solution does not earn full points for {len(short)} of "
                f"{len(grades)} students, such as {short[0].student}: {said}"
            )
    if not assignment.max_score:
        found.faults.append("there are no points to earn")


def _idle(assignment: Assignment, pool: Opener, reference: Grade, found: _Found) -> Grade:
    """The grade of doing nothing; an empty file and the template must not earn anything either."""
    with scratch("check") as folder:
        path = folder / "submission.py"
        write_private(path, b"", is_own=True)
        empty = grade(assignment, path, reference.student, pool)
        if empty.score:
            found.faults.append(f"an empty file earns {empty.score:g} points")
        idle_code = f"params = {_params(assignment)!r}\n{IDLE[assignment.kind]}"
        write_private(path, idle_code.encode(), is_own=True)
        idle = grade(assignment, path, reference.student, pool)
    template = assignment.path(assignment.template)
    if template is not None and template.suffix == ".py":
        score = grade(assignment, template, reference.student, pool).score
        if score:
            found.notes.append(f"the template as it is handed out earns {score:g} points")
    return idle


def _params(assignment: Assignment) -> dict[str, Any]:
    """What the cases set: a submission that lacks one of them could not be run."""
    return {key: value for case in assignment.cases for key, value in getattr(case, "params", {}).items()}


def _notes(assignment: Assignment, found: _Found) -> None:
    visible = {case.name for case in assignment.cases if case.is_visible}
    found.faults += promised(assignment)
    for criterion in assignment.criteria:
        if criterion.is_visible and not set(criterion.cases) <= visible:
            found.notes.append(f"{criterion.title}: it is visible, but a case of it is hidden: the hand-out lacks it")
    if assignment.self_check == "blind":
        found.notes.append("self_check is blind: it tries hidden criteria where the hidden cases are; keep them there")
    if assignment.handout is None:
        found.notes.append("there is no handout: students get no text")


def _row(assignment: Assignment, number: int, grades: list[Grade], idle: Grade) -> CriterionCheck:
    criterion = assignment.criteria[number]
    values = [value for grade in grades if (value := grade.criteria[number].value) is not None]
    return CriterionCheck(
        criterion.name,
        criterion.title,
        criterion.max_score,
        criterion.unit,
        criterion.bands.full,
        criterion.bands.none,
        min(values, default=None),
        statistics.median(values) if values else None,
        max(values, default=None),
        min((100.0 * criterion.bands.margin(value) for value in values), default=None),
        idle.criteria[number].score,
    )
