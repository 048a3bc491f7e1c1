"""Feedback pages: what a student sees of a run, and that nothing of a submission can act on the page."""

from __future__ import annotations

import re
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from math import inf, nan, ulp
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rds.grading.assignment.assignment import Assignment, read_assignment
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.bands import Bands
from rds.grading.exports.pictures import pictures_of
from rds.grading.feedback.band_bar import band_bar
from rds.grading.feedback.causes_of_errors import error_panels
from rds.grading.feedback.chart import Curve, Panel, chart, ticks
from rds.grading.feedback.class_report import class_page
from rds.grading.feedback.feedback import feedback_page
from rds.grading.feedback.feedback_plots import case_picture
from rds.grading.feedback.histogram import histogram
from rds.grading.feedback.plain_text import cell, one_line, plain
from rds.grading.grade import Band, Status
from rds.results import Result
from tests.grading.grades import HOSTILE, grade, score
from tests.grading.made import HEAD, RMS, SINE, assignment_in

HIDDEN_CASE = SINE.replace('"sine"', '"hidden sine"\nvisible = false')
HIDDEN = RMS.replace('"rms"', '"hidden"\nvisible = false').replace('"sine"', '"hidden sine"')
T = 0.001


@pytest.fixture
def assignment(tmp_path: Path) -> Assignment:
    return read_assignment(assignment_in(tmp_path / "a", HEAD + SINE + HIDDEN_CASE + RMS + HIDDEN))


def run_with(error: float, case: str = "sine", number: int = 0, samples: int = 2000, fault: str = "") -> CaseRun:
    """A run of an axis that is off by `error` mm throughout."""
    time = np.arange(samples) * T
    reference = 2.0 * np.sin(2 * np.pi * time)
    columns = {
        "time": time,
        "X_reference": reference,
        "X_measured": reference - error,
        "X_command": 3.0 * reference,
        "X_voltage": 3.0 * reference,
    }
    result = Result(columns, {"X_reference": "mm", "X_measured": "mm"}, {"axes": ["X"], "sample_period": T})
    return CaseRun(case, number, result, fault, facts={"limits": (-10.0, 10.0)})


class Tags(HTMLParser):
    """Every tag of a page, with its attributes."""

    def __init__(self, page: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))


def assert_harmless(page: str) -> None:
    """No script, nothing fetched, no attribute that runs code."""
    for tag, attributes in Tags(page).tags:
        assert tag not in ("script", "iframe", "object", "embed", "form", "base", "link")
        assert not any(name.startswith("on") for name in attributes), (tag, attributes)
        for name in ("src", "href"):
            assert re.match(r"(data:image/svg\+xml;base64,|\./)", attributes.get(name) or "./"), attributes
    assert "Content-Security-Policy" in page


@pytest.mark.parametrize("student", HOSTILE)
def test_hostile_text_is_only_text(assignment: Assignment, student: str) -> None:
    text = "</pre><script>alert(1)</script>\x1b[31m\u202e" + "x" * 100_000
    bad = replace(
        grade(student, Status.BROKE_CONTRACT, score(sentence=text)), reason=text, notes=(f"It printed:\n{text}",)
    )
    page = feedback_page(assignment, bad, [run_with(0.1, fault=text[:200])])
    assert_harmless(page)
    assert "\x1b" not in page and "\u202e" not in page
    assert len(page) < 120_000
    assert_harmless("".join(class_page("T", [bad], {student: "students/x/feedback.html"})))


def test_points_penalty_and_reason_are_said(assignment: Assignment) -> None:
    late = replace(grade("ada", score=20.8), late_days=1.25)
    page = feedback_page(assignment, late)
    assert "20.8 of 30 points" in page
    assert "1.25 days after the due time: 5.2 of the 26 points earned are lost, 20 %; each day that has begun" in page
    assert "Handed in 1 s after the due time" in feedback_page(assignment, replace(late, late_days=1.1574e-05))
    assert "Handed in 30 min after" in feedback_page(assignment, replace(late, late_days=0.0208))
    broken = feedback_page(assignment, grade("bob", Status.BROKE_CONTRACT))
    assert "broke the contract" in broken and "control() returned nan at t = 0.5 s" in broken
    ours = feedback_page(assignment, grade("cy", Status.GRADER_ERROR))
    assert "not graded yet" in ours and "0 of 30" not in ours


def test_the_page_names_the_file_and_when_it_came(assignment: Assignment) -> None:
    about = {"file": "Übung 1.py", "handed_in": "2026-12-02T18:30:00+01:00"}
    page = feedback_page(assignment, replace(grade(), sha256="f7a4", details=about))
    assert "graded, <bdi>Übung 1.py</bdi>, handed in 2026-12-02 18:30:00+01:00; its SHA-256: f7a4" in page


def test_hidden_cases_and_values_are_shown_only_if_the_assignment_says_so(assignment: Assignment) -> None:
    runs = [run_with(0.1), run_with(0.2, "hidden sine")]
    page = feedback_page(assignment, grade(), runs)
    assert "secret 0.23 mm" not in page and "20 of 20 points" in page and "it counts only" not in page
    lost = score("hidden", 0.0, 20.0, visible=False, sentence="secret 0.23 mm", gate="Error rms")
    gated = feedback_page(assignment, grade("ada", Status.OK, score(), lost), runs)
    assert "value is not shown; it counts only as far as points are earned for Error rms" in gated
    assert "secret 0.23 mm" not in gated
    assert page.count("<img") == 1 and "hidden sine" not in page
    assert "Hidden cases, not shown: 1" in page
    whole = feedback_page(replace(assignment, feedback="all"), grade(), runs)
    assert "secret 0.23 mm" in whole and whole.count("<img") == 2


def test_points_lost_only_in_hidden_criteria_are_said_to_be_lost_there(assignment: Assignment) -> None:
    lost = score("hidden", 0.0, 20.0, visible=False, sentence="secret 0.23 mm")
    full = score("rms", 10.0)
    page = feedback_page(assignment, grade("ada", Status.OK, full, lost), [run_with(0.01)])
    assert "hidden criteria, which were not met in full" in page and "secret" not in page
    assert "not met in full" not in feedback_page(assignment, grade("ada", Status.OK, full), [run_with(0.01)])
    unknown = replace(lost, band=Band.REVIEW, value=None)  # nobody knows whether it was met
    assert "not met in full" not in feedback_page(assignment, grade("ada", Status.OK, full, unknown))


def test_a_command_beyond_the_limit_is_no_voltage() -> None:
    """The converter gives no more than its limit: what goes beyond is the command. The limits' labels are outside."""
    near = run_with(0.1)
    columns = {**near.result.columns, "X_command": 8.0 * near.result["X_command"]}
    far = replace(near, result=Result(columns, near.result.units, near.result.meta))
    picture = case_picture([far], (), "A sine")
    assert picture is not None and ">X command voltage [V]<" in picture.chart.svg
    assert all(">X command voltage [V]<" in chart([panel]).svg for panel in error_panels(far)[1:])
    lines = [float(each) for each in re.findall(r'<path d="M0 ([\d.]+)h', picture.chart.svg)]
    labels = [float(each) for each in re.findall(r'y="([\d.]+)" [^>]*>limit<', picture.chart.svg)]
    low, high = lines  # of -10 V and of +10 V, counted from above
    assert labels[0] > low > high > labels[1]


def test_the_worst_of_several_runs_is_shown_beside_the_same_run_of_the_solution() -> None:
    runs = [run_with(0.1), run_with(0.3, number=1), run_with(0.2, number=2)]
    solution = [run_with(0.001, number=k) for k in range(3)]
    picture = case_picture(runs, solution, "A sine")
    assert picture is not None
    assert picture.caption == "A sine; run 2 of 3, the one with the largest error."
    assert all(label in picture.chart.svg for label in ("reference", "your run", "reference solution"))
    fell = case_picture([*runs, run_with(0.0, number=3, fault="at t = 0.1 s it is not stable")], (), "A sine")
    assert fell is not None and "run 4 of 4" in fell.caption and "not stable" in fell.caption


def test_pictures_are_found_again(assignment: Assignment, tmp_path: Path) -> None:
    path = tmp_path / "feedback.html"
    path.write_text(feedback_page(assignment, grade(), [run_with(0.1)], [run_with(0.0)]), encoding="utf-8")
    (picture,) = pictures_of(path)
    assert picture.label == "sine."
    svg = b64decode(picture.url.partition(",")[2])
    assert ElementTree.fromstring(svg).tag == "{http://www.w3.org/2000/svg}svg"
    assert pictures_of(tmp_path / "none.html") == []


@given(
    st.lists(st.floats(width=32) | st.sampled_from([nan, inf, -inf, 1e300]), min_size=2, max_size=3000),
    st.booleans(),
)
def test_any_numbers_make_a_picture(values: list[float], is_path: bool) -> None:
    y = np.array(values)
    made = chart([Panel([Curve("<&>", np.arange(len(y)) * T, y, "#000000")], "y", is_path=is_path)])
    root = ElementTree.fromstring(made.svg)
    assert "nan" not in made.svg and "inf" not in made.svg
    assert len(made.svg) < 60_000
    assert root is not None


def test_no_peak_is_lost_when_samples_are_left_out() -> None:
    y = np.zeros(100_000)
    y[54_321] = 1.0
    made = chart([Panel([Curve("y", np.arange(len(y)) * T, y, "#000000")], "y")])
    line = re.findall(r'<path d="M([^"]*)" fill="none"', made.svg)[0]
    numbers = [int(number) for number in re.findall(r"-?\d+", line)]
    heights = np.cumsum(numbers[1::2])
    assert heights.max() - heights.min() == pytest.approx(1500 / 1.12, abs=1.0)  # the panel, without its margins
    assert len(made.svg) < 20_000


def test_what_runs_away_is_cut_and_said() -> None:
    picture = case_picture([run_with(1e6)], [run_with(0.0)], "A sine")
    assert picture is not None and picture.chart.is_cut and "cut off" in picture.caption
    near = case_picture([run_with(0.5)], [run_with(0.0)], "A sine")
    assert near is not None and not near.chart.is_cut


def test_what_hardly_changes_leaves_room_for_what_is_a_little_off() -> None:
    time, steady = np.arange(100) * T, np.full(100, 50.0)
    curves = [Curve("yours", time, steady - 4.0, "#000000"), Curve("solution", time, steady, "#111111", expected=True)]
    assert not chart([Panel(curves, "path velocity [mm/s]")]).is_cut


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_are_round_and_within(low: float, width: float) -> None:
    high = low + width
    if not high > low:
        return
    found = ticks(low, high)
    assert 1 <= len(found) <= 12
    slack = 1e-6 * width + 4.0 * ulp(max(abs(low), abs(high)))
    assert all(low - slack <= each <= high + slack for each in found)


@pytest.mark.parametrize(
    ("bands", "value", "zone"),
    [
        (Bands(full=0.1, none=0.5), 0.05, 0),
        (Bands(full=0.1, none=0.5), 0.3, 1),
        (Bands(full=0.1, none=0.5), 0.6, 2),
        (Bands(full=60.0, none=30.0), 70.0, 2),
        (Bands(full=60.0, none=30.0), 10.0, 0),
    ],
)
def test_the_mark_stands_in_its_zone(bands: Bands, value: float, zone: int) -> None:
    drawn = band_bar(bands, value, "mm")
    found = re.findall(r'<rect class="\w+" x="([\d.]+)" y="\d+" width="([\d.]+)"', drawn)
    zones = [(float(x), float(x) + float(width)) for x, width in found]
    at = float(re.findall(r'class="value" d="M([\d.]+) ', drawn)[0])
    assert zones[zone][0] <= at <= zones[zone][1]
    names = re.findall(r'<rect class="(\w+)"', drawn)
    assert names == (["full", "partial", "none"] if bands.more_is_worse else ["none", "partial", "full"])


def test_a_value_beyond_the_bar_is_an_arrow_at_its_end() -> None:
    assert 'd="M338 ' in band_bar(Bands(0.1, 0.5), 1e9, "mm")
    assert 'd="M2 ' in band_bar(Bands(60.0, 30.0), -1e9, "°")
    assert 'class="value"' not in band_bar(Bands(0.1, 0.5), None, "mm")


@given(st.lists(st.floats(0.0, 100.0), max_size=300))
def test_every_student_is_in_one_bar(points: list[float]) -> None:
    said = re.findall(r"points: ([\d, ]+)\"", histogram(points, 100.0))[0]
    assert sum(map(int, said.split(", "))) == len(points)


def test_the_class_page_names_what_needs_a_look_first() -> None:
    grades = [grade("ada"), grade("bob", Status.GRADER_ERROR), grade("cy", Status.TIMED_OUT)]
    page = "".join(class_page("T", grades, {"ada": "students/ada/feedback.html"}, seconds={"cy": 12.3, "ada": 0.1}))
    assert_harmless(page)
    assert "1 not graded" in page and "--resume" in page
    assert page.index("not graded") < page.index("<h2>Points") < page.index("<h2>Everybody")
    assert "12.30" in page
    # the mean leaves out whom the grader failed
    assert re.search(r"<td>total</td><td class=\"number\">13</td>", page)


@pytest.mark.parametrize("criteria", [3, 12])
def test_the_class_page_gives_a_reason_a_row_of_its_own_however_many_criteria_there_are(criteria: int) -> None:
    """As the last of many columns it was out of sight on a screen of 1100 pixels."""
    scores = [score(f"criterion {k}") for k in range(criteria)]
    page = "".join(class_page("T", [grade("ada", Status.TIMED_OUT, *scores), grade("bob", Status.OK, *scores)], {}))
    told = re.findall(r'<tr class="reason"><td colspan="(\d+)"><p>([^<]+)</p></td></tr>', page)
    assert told == [(str(3 + criteria), "control() returned nan at t = 0.5 s")]
    assert ">reason<" not in page


def test_the_class_page_says_which_criteria_could_not_be_measured() -> None:
    lost = [score(name, 0.0, value=None, band=Band.REVIEW, sentence="Its run was void.") for name in ("rms", "peak")]
    page = "".join(class_page("T", [grade("ada", Status.OK, *lost)], {}))
    assert "Error rms: Its run was void." in page and "Error peak: Its run was void." in page


def test_a_value_without_a_unit_has_none_on_the_class_page() -> None:
    page = "".join(class_page("T", [grade("ada", Status.OK, score("damping", value=0.7, unit="1"))], {}))
    assert ">0.7</td>" in page


@given(st.text())
@example("=1+1")
def test_text_of_others_can_do_nothing(text: str) -> None:
    assert all(each.isprintable() or each in "\n\t" for each in plain(text))
    assert one_line(text).isprintable()
    assert not cell(text).startswith(("=", "+", "-", "@", "\t", "\r", "\n"))
    assert cell(f" {text}").startswith("'") is (cell(text) != plain(text))  # some spreadsheets take blanks away
    assert len(plain(text, 10)) <= 10 * 10 + 40
