"""What to change first: the criterion that costs the most points, where that comes from, and the picture that shows it.

Nothing here is a matter of taste: each cause is a number that is computed from the student's own run, and the sentence
says it. Which change a cause asks for is the textbook's: what follows the velocity is answered by feedforward, what
stays by integral action, what swings by damping or less gain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType

from rds.grading.assignment.assignment import Assignment
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.criterion import Criterion
from rds.grading.feedback.chart import Chart, Panel, chart
from rds.grading.feedback.plain_text import one_line
from rds.grading.grade import Band, CriterionScore, Grade, Status


@dataclass(frozen=True)
class Cause:
    """Where points are lost, in a sentence that says what to change; `panels` show it."""

    sentence: str
    panels: tuple[Panel, ...] = ()


@dataclass(frozen=True)
class Advice:
    """The sentence, and the picture that shows it if there is one, with what it shows in words."""

    sentence: str
    picture: Chart | None = None
    caption: str = ""


_NOTHING_RAN = (Status.MISSING, Status.REFUSED, Status.FAILED_TO_LOAD)
_OF_ERRORS, _OF_STEPS = "rds.grading.feedback.causes_of_errors", "rds.grading.feedback.causes_of_steps"
_OF_LOOPS, _OF_OTHERS = "rds.grading.feedback.causes_of_loops", "rds.grading.feedback.causes_of_others"
_UNSEEN = (
    "Everything that was measured and is explained on this page has full points. Points are missing in hidden "
    "criteria, which were not met in full; their values are not shown."
)
CAUSES: Mapping[str, str] = MappingProxyType(
    {
        **dict.fromkeys(("mean-error", "max-error", "rms-error", "contour-error", "path-followed"), _OF_ERRORS),
        **dict.fromkeys(("steady-state-error", "disturbance-error", "recovery-time", "noise-error"), _OF_ERRORS),
        **dict.fromkeys(("overshoot", "settling-time", "rise-time"), _OF_STEPS),
        **dict.fromkeys(("gain-margin", "phase-margin", "modulus-margin", "damping", "pole-radius"), _OF_LOOPS),
        **dict.fromkeys(("effort", "noise-voltage", "saturation-time", "work", "model-fit"), _OF_OTHERS),
        **dict.fromkeys(("end-point-error", "path-error", "chord-error", "largest-velocity"), _OF_OTHERS),
        **dict.fromkeys(("largest-acceleration", "duration", "feed-error", "row-consistency", "rows"), _OF_OTHERS),
    }
)
"""By the kind of a criterion the module that knows its causes, by `cause(run, criterion, score)`."""


def advice(assignment: Assignment, grade: Grade, runs: Sequence[CaseRun]) -> Advice | None:
    """What to change first; None where no points are lost, or only in what waits for a review.

    Where a gate takes the points, it is the gate that is to be mended. Of what the student does not see, it says that
    points are lost there, and nothing else.
    """
    shows_all = assignment.feedback == "all"
    seen = [score for score in grade.criteria if (score.visible or shows_all) and score.band is not Band.REVIEW]
    if grade.status in _NOTHING_RAN:
        return Advice(f"Nothing could be run: {one_line(grade.reason, 600)}") if seen else None
    lost = max(seen, key=lambda score: score.max_score - score.score, default=None)
    if lost is None or not _loses(lost):
        unseen = [s for s in grade.criteria if not (s.visible or shows_all) and s.band is not Band.REVIEW]
        return Advice(_UNSEEN) if any(map(_loses, unseen)) else None
    gate = next((score for score in seen if lost.gate and score.title == lost.gate), None)
    target = gate or lost
    most = max(score.max_score - score.score for score in grade.criteria)
    which = "costs the most" if lost.max_score - lost.score >= most else "costs the most of what is explained here"
    head = f"{lost.title} {which}: {lost.max_score - lost.score:.4g} of {lost.max_score:.4g} points are lost"
    head += f", because it needs {target.title}. " if gate is not None else ". "
    criterion = next((each for each in assignment.criteria if each.name == target.name), None)
    run = _worst(criterion, target, runs) if criterion is not None else None
    if criterion is None or run is None or run.fault or criterion.kind not in CAUSES:
        return Advice(head + one_line(target.sentence, 600))
    case = assignment.case(run.case)
    if not (shows_all or case.is_visible):
        return Advice(head + one_line(target.sentence, 600))
    of: Callable[[CaseRun, Criterion, CriterionScore], Cause] = import_module(CAUSES[criterion.kind]).cause
    found = of(run, criterion, target)
    if not found.panels:
        return Advice(head + found.sentence)
    return Advice(
        head + found.sentence, chart(found.panels), f"{case.title}: where the points for {target.title} are lost"
    )


def _loses(score: CriterionScore) -> bool:
    return score.max_score - score.score > 1e-9 * score.max_score


def _worst(criterion: Criterion, score: CriterionScore, runs: Sequence[CaseRun]) -> CaseRun | None:
    """The run that decided: the one in which the criterion has the value of the score."""
    of_case = [run for run in runs if run.case == score.case and len(run.result) > 1]
    for run in of_case:
        try:
            if score.value is not None and criterion.measure(run) == score.value:
                return run
        except ArithmeticError:
            continue
        except Exception as error:  # what cannot be measured is not the run that decided
            from rds.core.errors import RdsError

            if not isinstance(error, RdsError):
                raise
    return of_case[0] if of_case else None
