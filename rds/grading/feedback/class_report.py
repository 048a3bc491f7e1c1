"""The instructor's page of a batch: what needs a look first, then distributions, then everybody."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from statistics import mean, median
from urllib.parse import quote

from rds.grading.assignment.late_rules import told_days
from rds.grading.batch.grades_table import criteria_of
from rds.grading.feedback import histogram
from rds.grading.feedback.plain_text import isolated, one_line
from rds.grading.grade import Band, CriterionScore, Grade, Status, with_unit
from rds.grading.review.applied import is_changed, of_review
from rds.grading.review.class_grades import SECTION
from rds.grading.review.entries import Kind, Review
from rds.results import html
from rds.results.report import around

_SLOWEST = 5  # of the class that are listed
_STYLE = f"""<style>
.cards {{ display: flex; flex-wrap: wrap; gap: 1rem 2.5rem; }} .cards figure {{ margin: 0; max-width: 412px; }}
figcaption {{ font-weight: 600; }} td, p {{ overflow-wrap: anywhere; }} td {{ max-width: 28rem; }}
td.number, td.status {{ white-space: nowrap; }} .everybody tbody tr {{ background: none; }}
.told td:not([rowspan]) {{ border-bottom: 0; }} .reason td {{ padding-top: 0; max-width: none; }}
.reason p {{ margin: 0; position: sticky; left: .4rem; width: calc(min(100vw, 1280px) - 14.5rem); min-width: 12rem; }}
.everybody td:first-child {{ min-width: 9rem; }}
td.gate {{ color: var(--missed); font-weight: 700; }} td.review {{ color: var(--void); font-weight: 700; }}
{histogram.STYLE}</style>"""


def class_page(
    title: str,
    grades: Sequence[Grade],
    links: Mapping[str, str],
    *,
    seconds: Mapping[str, float] | None = None,
    similar: str = "",
    about: str = "",
    review: Review | None = None,
) -> Iterator[str]:
    """The page as HTML, piece by piece: a large class's need not have room in memory.

    `links` are the students' pages by identifier, as paths from this page; `seconds` is how long each submission took;
    `similar` is HTML that points out submissions that are alike; `review` is what graders have said.
    """
    graded = [grade for grade in grades if grade.status not in (Status.GRADER_ERROR, Status.EXCUSED)]
    before, after = around(title)
    yield before
    parts = (
        _STYLE,
        f'<header><h1>{escape(one_line(title))}</h1><p class="about">{escape(about)}</p></header>',
        _first(grades, links),
        _summary(graded),
        _sections(graded),
        _distributions(graded),
        _trail(review),
        f"<section><h2>Submissions that are alike</h2>{similar}</section>" if similar else "",
        _slowest(grades, links, seconds or {}),
    )
    yield "".join(f"{part}\n" for part in parts if part)
    yield from _everybody(grades, links)
    yield after


def _first(grades: Sequence[Grade], links: Mapping[str, str]) -> str:
    """What the instructor has to look at: our own failures, and what could not be graded as it was meant."""
    parts = []
    ours = [grade.student for grade in grades if grade.status is Status.GRADER_ERROR]
    if ours:
        names = ", ".join(isolated(student) for student in ours)
        parts.append(
            f'<p class="verdict missed"><strong>{len(ours)} not graded</strong> by no fault of theirs; run the same '
            f"command again with --resume: {names}</p>"
        )
    review = [grade for grade in grades if grade.status is not Status.GRADER_ERROR and grade.for_review]
    if review:
        lines = "".join(
            f"<li>{_name(grade.student, links)}, {escape(one_line(score.title))}: "
            f"{escape(one_line(score.sentence, 400))}</li>"
            for grade in review
            for score in grade.for_review
        )
        parts.append(
            f'<div class="verdict void"><strong>{len(review)} for a review</strong>: these could not be measured, and '
            f"count in proportion to the rest of the submission until you have looked.<ul>{lines}</ul></div>"
        )
    differ = [(grade, name) for grade in grades for name in of_review(grade).get("differ", ())]
    if differ:
        names = "".join(f"<li>{_name(grade.student, links)}: {escape(one_line(name))}</li>" for grade, name in differ)
        parts.append(
            f'<div class="verdict void"><strong>{len(differ)} on which graders differ</strong>: the mean counts '
            f"until one of them gives a final word (--final).<ul>{names}</ul></div>"
        )
    counts = Counter(grade.status for grade in grades)
    rows = "".join(
        f'<tr><td>{escape(str(status))}</td><td class="number">{counts[status]}</td>'
        f"<td>{_some(grades, links, status)}</td></tr>"
        for status in Status
        if counts[status]
    )
    head = '<tr><th scope="col">status</th><th class="number" scope="col">students</th><th scope="col">who</th></tr>'
    table = f'<div class="scroll"><table><thead>{head}</thead><tbody>{rows}</tbody></table></div>'
    return f"<section><h2>What happened to {len(grades)} submissions</h2>{''.join(parts)}{table}</section>"


def _some(grades: Sequence[Grade], links: Mapping[str, str], status: Status) -> str:
    if status is Status.OK:
        return ""
    return ", ".join(_name(grade.student, links) for grade in grades if grade.status is status)


def _summary(graded: Sequence[Grade]) -> str:
    if not graded:
        return ""
    rows: list[list[object]] = [["total", *_statistics([g.score for g in graded]), max(g.max_score for g in graded)]]
    scores = {c.name: [s for g in graded for s in g.criteria if s.name == c.name] for c in criteria_of(graded)}
    rows[0] += [None, None, None]
    for criterion in criteria_of(graded):
        of = scores[criterion.name]
        counts = Counter(score.band for score in of)
        values = [score.value for score in of if score.value is not None]
        middle = with_unit(median(values), criterion.unit) if values else None
        row = [criterion.title, *_statistics([score.score for score in of]), criterion.max_score]
        rows.append([*row, middle, counts[Band.FULL], counts[Band.NONE]])
    columns = ["", "mean", "median", "lowest", "highest", "of points", "median value", "with full points", "with none"]
    return f"<section><h2>Points</h2>{html.table(columns, rows)}</section>"


def _statistics(points: Sequence[float]) -> list[float]:
    return [mean(points), median(points), min(points), max(points)]


def _sections(graded: Sequence[Grade]) -> str:
    """The sections beside each other, where there are some."""
    names = sorted({str(grade.details[SECTION]) for grade in graded if SECTION in grade.details})
    if not names:
        return ""
    rows = []
    for name in names:
        points = [grade.score for grade in graded if grade.details.get(SECTION) == name]
        rows.append([name, len(points), *_statistics(points)])
    columns = ["section", "students", "mean", "median", "lowest", "highest"]
    return f"<section><h2>Sections</h2>{html.table(columns, rows)}</section>"


def _trail(review: Review | None) -> str:
    """What graders said, the last first."""
    if review is None or not review.entries:
        return ""
    standing = {entry.number for entry in review.standing}
    rows = [
        [
            entry.number,
            entry.time,
            one_line(entry.by, 60),
            str(entry.kind) + ("" if entry.number in standing or entry.kind is Kind.UNDO else " (undone)"),
            one_line(entry.about, 80),
            one_line(entry.criterion, 60) or "–",
            entry.value,
            one_line(" ".join(filter(None, (entry.comment, entry.why))), 400),
        ]
        for entry in reversed(review.entries)
    ]
    columns = ["entry", "time", "by", "what", "about", "criterion", "value", "words"]
    return f"<section><h2>Review</h2>{html.table(columns, rows)}</section>"


def _distributions(graded: Sequence[Grade]) -> str:
    if not graded:
        return ""
    most = max(grade.max_score for grade in graded)
    parts = [_figure("total", histogram.histogram([grade.score for grade in graded], most))]
    for criterion in criteria_of(graded):
        points = [score.score for grade in graded for score in grade.criteria if score.name == criterion.name]
        parts.append(_figure(criterion.title, histogram.histogram(points, criterion.max_score)))
    return f'<section><h2>Distributions</h2><div class="cards">{"".join(parts)}</div></section>'


def _figure(title: str, drawn: str) -> str:
    return f"<figure><figcaption>{escape(one_line(title))}</figcaption>{drawn}</figure>"


def _slowest(grades: Sequence[Grade], links: Mapping[str, str], seconds: Mapping[str, float]) -> str:
    timed = sorted(((seconds[g.student], g) for g in grades if g.student in seconds), key=lambda pair: -pair[0])
    if not timed:
        return ""
    rows = "".join(
        f'<tr><td>{_name(grade.student, links)}</td><td class="number">{took:.2f}</td></tr>'
        for took, grade in timed[:_SLOWEST]
    )
    head = '<tr><th scope="col">student</th><th class="number" scope="col">time [s]</th></tr>'
    return f"<section><h2>Slowest</h2><table><thead>{head}</thead><tbody>{rows}</tbody></table></section>"


def _everybody(grades: Sequence[Grade], links: Mapping[str, str]) -> Iterator[str]:
    criteria = criteria_of(grades)
    heads = ["student", "status", "score", "late", *(criterion.name for criterion in criteria)]
    texts = ("student", "status")
    kinds = ["" if each in texts else ' class="number"' for each in heads]
    head = "".join(
        f'<th scope="col"{kind}>{escape(one_line(each))}</th>' for each, kind in zip(heads, kinds, strict=True)
    )
    yield '<section class="everybody"><h2>Everybody</h2><div class="scroll"><table>'
    yield f"<thead><tr>{head}</tr></thead><tbody>"
    names = [criterion.name for criterion in criteria]
    for grade in grades:
        yield _student(grade, names, links)
    yield "</tbody></table></div></section>"


def _student(grade: Grade, criteria: Sequence[str], links: Mapping[str, str]) -> str:
    """A row; the reason stands below it, in sight however many criteria there are."""
    is_graded = grade.status not in (Status.GRADER_ERROR, Status.EXCUSED)
    scores = {score.name: score for score in grade.criteria} if is_graded else {}
    cells = [
        _points(grade.score) if is_graded else "–",
        told_days(grade.late_days) if grade.late_days else "",
    ]
    numbers = "".join(f'<td class="number">{each}</td>' for each in cells)
    numbers += "".join(_cell(scores.get(name)) for name in criteria)
    why = escape(one_line(grade.reason, 300))
    below = f'<tr class="reason"><td colspan="{3 + len(criteria)}"><p>{why}</p></td></tr>' if why else ""
    begin = '<tr class="told"><td rowspan="2">' if why else "<tr><td>"
    return (
        f"{begin}{_name(grade.student, links)}</td>"
        f'<td class="status">{escape(str(grade.status))}{" (reviewed)" if is_changed(grade) else ""}</td>'
        f"{numbers}</tr>{below}"
    )


def _cell(score: CriterionScore | None) -> str:
    """A criterion's points; what a gate took of them, or nobody could measure, stands out."""
    if score is None:
        return '<td class="number">–</td>'
    if score.gate:
        title = f"required: {escape(one_line(score.gate))}"
        return f'<td class="number gate" title="{title}">{_points(score.score)} (gate)</td>'
    if score.band is Band.REVIEW:
        return f'<td class="number review">{_points(score.score)} (review)</td>'
    return f'<td class="number">{_points(score.score)}</td>'


def _points(value: float) -> str:
    return f"{value:.4g}"


def _name(student: str, links: Mapping[str, str]) -> str:
    if student not in links:
        return isolated(student)
    # "./" keeps a name with a colon from being taken for a scheme
    return f'<a href="{escape("./" + quote(links[student]))}">{isolated(student)}</a>'
