"""The grading panel in a browser: a class is graded, seen and exported; what is missing is said."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from typing import Any

import pytest

from rds.grading.sandbox import available
from tests.grading.batches import ASSIGNMENT, law
from tests.panels.conftest import App

IDLE = "def control(t, r, y, state, params):\n    return 0.0, state\n"


def fill(page: Any, label: str, value: str) -> None:
    page.get_by_label(label, exact=True).fill(value)
    page.keyboard.press("Tab")


@pytest.mark.skipif(available() is not None, reason=str(available()))
def test_a_class_is_graded_and_exported(app: App, open_page: Callable[..., Any]) -> None:
    assignment = app.folder / "small"
    assignment.mkdir()
    (assignment / "assignment.toml").write_text(ASSIGNMENT)
    (assignment / "solution.py").write_text(law())
    for student, text in (("ada", law()), ("<i>ben<i>", IDLE)):
        folder = app.folder / "handed in" / student
        folder.mkdir(parents=True)
        (folder / "controller.py").write_text(text)
    # what somebody handed in, in the folder that the page works in: it is no module of the grader's
    (app.folder / "typer.py").write_text("raise SystemExit('the grader runs what was handed in')")
    page = open_page("Grading")
    page.click('button:text-is("Grade")')
    page.wait_for_selector('.rds-notice:has-text("name the assignment\'s folder")')
    fill(page, "Assignment", "small")
    fill(page, "Submissions", "handed in")
    fill(page, "Grades", "grades")
    page.click('button:text-is("Grade")')
    page.wait_for_selector('.rds-notice:has-text("2 submissions are graded")')
    assert page.locator("tbody tr td:first-child").all_inner_texts() == ["<i>ben<i>", "ada"]  # the worst first
    assert page.get_by_label("Points", exact=True).is_visible() and not page.get_by_label("Days").is_visible()
    page.get_by_label("What", exact=True).select_option("Excuse")
    fill(page, "Student", "ada")
    fill(page, "Reason", "ill")
    fill(page, "Your name", "ann")
    page.get_by_label("Points", exact=True).wait_for(state="hidden")
    page.click('button:text-is("Keep")')
    page.wait_for_selector('.rds-notice:has-text("entry 1 is kept: excuse of ada")')
    page.wait_for_selector('table:has(caption:text-is("Audit trail")) td:text-is("ill")')
    page.get_by_label("What", exact=True).select_option("Take back")
    fill(page, "Entry", "1")
    page.click('button:text-is("Keep")')
    page.wait_for_selector('.rds-notice:has-text("entry 2 is kept: undo of entry 1")')
    page.click('button:text-is("Export")')
    page.wait_for_selector('.rds-notice:has-text("2 students: ")')
    assert (app.folder / "grades" / "grades.csv").is_file()
    shutil.copytree(app.folder / "grades", app.folder / "first")
    fill(page, "Other attempts", "first")
    fill(page, "New folder", "best")
    page.click('button:text-is("Best of attempts")')
    page.wait_for_selector('.rds-notice:has-text("2 students, the best of 2 attempts")')
    assert page.get_by_label("Grades", exact=True).input_value() == "best"
    # a mended assignment: who changes and why, and the new folder is the one that is shown
    (assignment / "assignment.toml").write_text(ASSIGNMENT.replace("none = 1.0", "none = 5.0"))
    fill(page, "Grades", "grades")
    fill(page, "New folder", "again")
    page.click('button:text-is("Grade again")')
    page.wait_for_selector('.rds-notice:has-text("2 students change; the grades are those of the new folder now")')
    why = page.locator('table:has(caption:text-is("Changes")) tbody tr td:last-child').all_inner_texts()
    assert len(why) == 2 and all("bands are others" in each for each in why)
