"""The page that a student gets: points, each criterion with its bands, runs beside the reference solution's.

One file that fetches nothing. It is made from what the grader measured, so nothing in it is the submission's doing but
the text that it printed, which is shown as text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from statistics import median

from rds.grading.assignment.assignment import Assignment
from rds.grading.assignment.late_rules import told_days
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.criterion import Criterion
from rds.grading.feedback import band_bar, histogram
from rds.grading.feedback.advice import advice
from rds.grading.feedback.feedback_plots import case_picture
from rds.grading.feedback.plain_text import isolated, one_line, plain
from rds.grading.grade import Band, CriterionScore, Grade, Status, with_unit
from rds.results.report import page

LEAST_CLASS = 10  # students: of fewer, a distribution would tell whose points they are
_BANDS = {
    Band.FULL: "full points",
    Band.PARTIAL: "part of the points",
    Band.NONE: "no points",
    Band.REVIEW: "not measured: for a review",
}
_WHAT_IT_MEANS = {
    Status.OK: "",
    Status.MISSING: "Nothing was handed in.",
    Status.REFUSED: "What was handed in was not opened.",
    Status.FAILED_TO_LOAD: "Your file could not be loaded. Try it with `rds check` and hand it in again.",
    Status.BROKE_CONTRACT: "Your file answered in a way that its interface does not allow.",
    Status.TIMED_OUT: "Your file took longer than the assignment allows.",
    Status.KILLED: "Your file was ended, because it ended itself or went over a limit.",
    Status.EXCUSED: "You are excused: this counts neither for nor against you.",
    Status.GRADER_ERROR: "The grader failed. This is not your fault, and will be graded again.",
}

_STYLE = f"""<style>
.total {{ font-size: 2rem; margin: .3rem 0; line-height: 1.2; font-weight: 700; font-variant-numeric: tabular-nums; }}
.criterion {{ border-top: 1px solid var(--line); padding: .7rem 0; display: grid; gap: .1rem 1.6rem;
  grid-template-columns: minmax(0, 1fr) minmax(0, 340px); }}
.criterion h3 {{ margin: 0; font-size: 1rem; }} .criterion p {{ margin: .15rem 0; }}
.points {{ font-variant-numeric: tabular-nums; }} .full b {{ color: var(--met); }}
.none b {{ color: var(--missed); }} .partial b {{ color: var(--void); }}
.said {{ border-left: 3px solid var(--line); padding-left: .8rem; }}
.printed {{ white-space: pre-wrap; overflow-wrap: anywhere; background: var(--band); padding: .6rem .8rem;
  border: 1px solid var(--line); border-radius: 4px; max-height: 24rem; overflow-y: auto; }}
h1, p {{ overflow-wrap: anywhere; }}
@media (max-width: 760px) {{ .criterion {{ grid-template-columns: 1fr; }} }}
{band_bar.STYLE}{histogram.STYLE}</style>"""


def feedback_page(
    assignment: Assignment,
    grade: Grade,
    runs: Sequence[CaseRun] = (),
    solution: Sequence[CaseRun] = (),
) -> str:
    """The page of one student as HTML.

    `runs` are the runs that the grade rests on, `solution` those of the reference solution, on plants of its own.
    What is hidden is only shown if the assignment says `feedback = "all"`.
    """
    shows_all = assignment.feedback == "all"
    title = f"{assignment.title}: {one_line(grade.student, 80)}"
    parts = [
        _STYLE,
        f"<header><h1>{escape(assignment.title)}</h1>{_marked('total', total_part(grade))}</header>",
        _advice(assignment, grade, runs),
        _marked("criteria", criteria_part(assignment, grade)),
        _marked("class", ""),
        _runs(assignment, runs, solution, shows_all),
        _notes(grade),
    ]
    return page(title, "\n".join(filter(None, parts)))


def with_parts(page: str, parts: Mapping[str, str]) -> str:
    """A page that `feedback_page` made with other parts by name: total, basis, criteria, class."""
    for name, part in parts.items():
        pattern = re.compile(f"<!--{name}-->.*?<!--/{name}-->", re.DOTALL)
        page = pattern.sub(lambda _, name=name, part=part: _marked(name, part), page, count=1)  # type: ignore[misc]
    return page


def _marked(name: str, part: str) -> str:
    """Between marks that nothing else on the page can hold: whatever others wrote is escaped."""
    return f"<!--{name}-->{part}<!--/{name}-->"


def total_part(grade: Grade) -> str:
    """Whose page it is, the points, and what graders said."""
    return f'<p class="about">Feedback for {isolated(grade.student)}</p>{_total(grade)}{_said_by_graders(grade)}'


def class_part(grade: Grade, everybody: Sequence[Grade]) -> str:
    """How the class did, with this student's place in it; nothing of a class so small that it would name somebody."""
    ungraded = (Status.GRADER_ERROR, Status.EXCUSED, Status.MISSING)
    graded = [each for each in everybody if each.status not in ungraded]
    if len(graded) < LEAST_CLASS or grade.status in ungraded:
        return ""
    points, most = [each.score for each in graded], max(each.max_score for each in graded)
    drawn = histogram.histogram(points, most, mark=grade.score)
    said = f"{len(graded)} of the class were graded; the median is {median(points):.4g} points. The mark is you."
    return f'<section><h2>The class</h2>{drawn}<p class="note">{said}</p></section>'


def _said_by_graders(grade: Grade) -> str:
    """Comments, and what an extension or late days did; who wrote it is the graders' own affair."""
    review = grade.details.get("review")
    if not isinstance(review, Mapping):
        return ""
    titles = {score.name: score.title for score in grade.criteria}
    lines = [
        f"{titles.get(each['criterion'], '')}: {each['text']}".removeprefix(": ") for each in review.get("comments", ())
    ]
    if _points_by_hand(grade):
        lines.append("Points were set by hand.")
    if days := review.get("extension_days"):
        lines.append(f"Your due time was moved by {days:.3g} days.")
    if spent := review.get("late_days_spent"):
        lines.append(f"{spent} of your late days are spent here.")
    if not lines:
        return ""
    items = "".join(f"<li>{escape(one_line(line, 4000))}</li>" for line in lines)
    return f'<div class="said"><strong>From your instructors</strong><ul>{items}</ul></div>'


def _points_by_hand(grade: Grade) -> bool:
    review = grade.details.get("review")
    return isinstance(review, Mapping) and any(each["kind"] == "points" for each in review.get("entries", ()))


def basis_part(grade: Grade) -> str:
    """At the advice: that it knows nothing of the points that graders set."""
    said = "This goes by the points as measured, before some were set by hand."
    return f"<p><em>{said}</em></p>" if _points_by_hand(grade) else ""


def _advice(assignment: Assignment, grade: Grade, runs: Sequence[CaseRun]) -> str:
    found = advice(assignment, grade, runs)
    if found is None:
        return ""
    parts = [f"<h2>What to change first</h2>{_marked('basis', '')}<p>{escape(found.sentence)}</p>"]
    if found.picture is not None:
        caption = escape(one_line(found.caption))
        parts.append(
            f'<figure style="margin:0"><figcaption>{caption}</figcaption>'
            f'<img alt="{caption}" src="{found.picture.url}"></figure>'
        )
    return f"<section>{''.join(parts)}</section>"


def _total(grade: Grade) -> str:
    if grade.status is Status.GRADER_ERROR:
        return f'<p class="verdict void"><strong>not graded yet</strong> {_WHAT_IT_MEANS[grade.status]}</p>'
    is_excused = grade.status is Status.EXCUSED
    parts = [] if is_excused else [f'<p class="total">{grade.score:.4g} of {grade.max_score:.4g} points</p>']
    lost = grade.before_penalty - grade.score
    if grade.late_days > 0.0 and not is_excused:
        said = f"Handed in {told_days(grade.late_days)} after the due time: "
        if lost > 0.0:
            said += f"{lost:.4g} of the {grade.before_penalty:.4g} points earned are lost, "
            said += f"{100 * lost / grade.before_penalty:.3g} %; each day that has begun counts."
        else:
            said += "nothing is lost."
        parts.append(f'<p class="note">{said}</p>')
    if grade.status is not Status.OK:
        parts.append(
            f'<p class="verdict missed"><strong>{escape(str(grade.status))}</strong> '
            f"{escape(_WHAT_IT_MEANS[grade.status])}<br>{escape(one_line(grade.reason, 1000))}</p>"
        )
    return "".join(parts)


def criteria_part(assignment: Assignment, grade: Grade) -> str:
    """Each criterion with its points; the value and its bands of those that the student may see."""
    if not grade.criteria:
        return ""
    shows_all = assignment.feedback == "all"
    known = {criterion.name: criterion for criterion in assignment.criteria}
    shown = [_criterion(score, known.get(score.name), shows_all or score.visible) for score in grade.criteria]
    note = (
        "The mark above each bar is your value. Green earns full points, amber a part of them, red none; between the "
        "two bounds the points fall in a straight line unless the sentence says otherwise."
    )
    return f'<section><h2>Criteria</h2><p class="note">{note}</p>{"".join(shown)}</section>'


def _criterion(score: CriterionScore, criterion: Criterion | None, is_shown: bool) -> str:
    head = (
        f'<h3>{escape(score.title)}</h3><p class="points {score.band}"><b>{score.score:.4g} of {score.max_score:.4g} '
        f"points</b> · {_BANDS[score.band]}"
    )
    if not is_shown:
        gate = f"; it counts only as far as points are earned for {escape(score.gate)}" if score.gate else ""
        return f'<div class="criterion"><div>{head} · hidden: its value is not shown{gate}</p></div></div>'
    value = "" if score.value is None else f" · {escape(with_unit(score.value, score.unit))}"
    bar = "" if criterion is None else band_bar.band_bar(criterion.bands, score.value, score.unit)
    return (
        f'<div class="criterion"><div>{head}{value}</p><p>{escape(one_line(score.sentence, 1000))}</p></div>'
        f"<div>{bar}</div></div>"
    )


def _runs(assignment: Assignment, runs: Sequence[CaseRun], solution: Sequence[CaseRun], shows_all: bool) -> str:
    parts = []
    for case in assignment.cases:
        if not (shows_all or case.is_visible):
            continue
        of_case = [run for run in runs if run.case == case.name]
        beside = [run for run in solution if run.case == case.name]
        picture = case_picture(of_case, beside, case.title)
        if picture is not None:
            has_own = beside and case.is_drawn
            own = " The reference solution ran on a plant of its own." if has_own else ""
            caption = escape(picture.caption + own)
            parts.append(
                f'<figure style="margin:0"><figcaption>{caption}</figcaption>'
                f'<img alt="{caption}" src="{picture.chart.url}"></figure>'
            )
    if not parts:
        return ""
    hidden = 0 if shows_all else sum(not case.is_visible for case in assignment.cases)
    left_out = f'<p class="note">Hidden cases, not shown: {hidden}.</p>' if hidden else ""
    return f"<section><h2>Your runs</h2>{''.join(parts)}{left_out}</section>"


def _notes(grade: Grade) -> str:
    parts = [f'<pre class="printed">{escape(plain(note))}</pre>' for note in grade.notes]
    head = "<h2>Notes, and what your file printed</h2>" if parts else ""
    if grade.sha256:
        parts.append(f'<p class="note">{_file(grade)}</p>')
    return f"<section>{head}{''.join(parts)}</section>" if parts else ""


def _file(grade: Grade) -> str:
    """Which file was graded, and when it was handed in, where that is known."""
    name, time = (str(grade.details.get(key) or "") for key in ("file", "handed_in"))
    called = f", {isolated(name)}" if name else ""
    when = f", handed in {escape(time.replace('T', ' '))}" if time else ""
    return f"The file that was graded{called}{when}; its SHA-256: {escape(grade.sha256)}"
