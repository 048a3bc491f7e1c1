"""The interpolator panel in a browser: an arc, a table, a program, a user's file with a fault, refusals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.panels.conftest import App

BROKEN = (
    "def interpolate(segment, T, params):\n    for k in range(10):\n        yield segment.end, nothing, segment.end\n"
)


PAINTED = """() => [...document.querySelectorAll(".rds-figure canvas")].some(
    (each) => each.width && each.getContext("2d").getImageData(0, 0, each.width, each.height).data.some(Boolean))"""


def _type(page: Any, label: str, text: str) -> None:
    field = page.locator(f'.rds-field:has(.rds-label:has-text("{label}")) input')
    field.fill(text)
    field.press("Enter")


def _opened(same_page: Callable[[str], Any]) -> Any:
    """The panel at the arc that it begins with."""
    page = same_page("Interpolator")
    page.click('button:text-is("Circular")')
    page.click('button:text-is("Single segment")')
    _type(page, "Start", "10, 0")
    _type(page, "End", "0, 10")
    return page


def _go(page: Any, done: str = '.rds-notice-good:has-text("done:")') -> None:
    page.click('button:text-is("Interpolate")')
    page.wait_for_selector(done)


def _turn_to(page: Any, picture: str) -> None:
    page.click(f'.widget-toggle-buttons button:text-is("{picture}")')
    page.wait_for_function(PAINTED)  # by the kernel; the picture of the page is to be looked at


def test_an_arc_with_its_errors_magnified(same_page: Callable[[str], Any], app: App) -> None:
    page = _opened(same_page)
    page.select_option('.rds-field:has(.rds-label:has-text("Method for arcs")) select', "improved tustin")
    page.wait_for_selector('.rds-label:has-text("blu (arcs) [mm]")')
    _go(page)
    page.wait_for_selector('tr:has-text("within one BLU of 0.01 mm"):has-text("yes")')
    page.wait_for_selector(".rds-figure canvas")
    _turn_to(page, "Errors magnified")
    _type(page, "Save as", "arc.csv")
    page.click('button:text-is("Save")')
    page.wait_for_selector('.rds-notice-good:has-text("arc.csv")')
    assert (app.folder / "arc.csv").is_file()
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280


def test_the_machine_goes_along_the_arc_and_the_model_is_drawn(same_page: Callable[[str], Any]) -> None:
    page = _opened(same_page)
    page.click('button:text-is("View model")')
    page.wait_for_selector('svg[aria-label*="Circular (interpolator"]')
    _go(page)
    page.click('button:text-is("Show the machine")')
    page.wait_for_selector('.rds-scene[data-open="true"] canvas')
    page.select_option('.rds-scene select[title="how fast it is played"]', "20")
    page.wait_for_function(  # it is played to its end, a quarter of a circle further
        """() => document.querySelector(".rds-scene")?.dataset.tip?.startsWith("0.000 10.000")"""
    )
    assert int(page.locator(".rds-scene").get_attribute("data-rows")) > 100


def test_a_table_of_segments_and_what_it_refuses(same_page: Callable[[str], Any]) -> None:
    page = _opened(same_page)
    page.click('button:text-is("Both")')
    page.click('button:text-is("Several")')
    _type(page, "Start", "0, 0")
    page.click('button:text-is("Add an arc")')
    page.wait_for_selector('.rds-group button[title="Remove this segment"] >> nth=2')
    _go(page)
    page.wait_for_selector('h2:has-text("3 segments")')
    first = page.locator('input[placeholder="feed"]').first
    first.fill("fast")
    first.press("Enter")
    page.wait_for_selector(".rds-refusal:has-text(\"segment 1: feed rate 'fast' must be a number above 0\")")
    page.click('button:text-is("Interpolate")')
    page.wait_for_selector('.rds-notice-error:has-text("first mend what is refused")')
    first.fill("300")
    first.press("Enter")
    _go(page)
    page.click('button:text-is("Linear")')
    _go(page, '.rds-notice-error:has-text("segment 2 is an arc")')


def test_a_part_program_a_faulty_one_and_a_user_s_file_with_its_fault_at_its_line(
    same_page: Callable[[str], Any], app: App
) -> None:
    (app.folder / "good.ngc").write_text("G21 G90 G17 F600\nG1 X10 Y0\nG3 X0 Y10 I-10 J0\nM2\n")
    (app.folder / "bad.ngc").write_text("G21 G90 F600\nG1 X10 Q\nM2\n")
    page = _opened(same_page)
    page.click('button:text-is("Both")')
    page.click('button:text-is("Your G-code")')
    _type(page, "Part program", "bad.ngc")
    _go(page, '.rds-notice-error:has-text("bad.ngc")')
    _type(page, "Part program", "good.ngc")
    _go(page)
    _turn_to(page, "Path")

    (app.folder / "broken.py").write_text(BROKEN)
    page.click('button:text-is("Linear")')
    page.click('button:text-is("Single segment")')
    page.select_option('.rds-field:has(.rds-label:has-text("Method for lines")) select', "user-defined")
    _type(page, "File for lines", "broken.py")
    page.click('button:text-is("Check my file")')
    page.wait_for_selector('.rds-notice-error:has-text("broken.py, line 3")')
    page.wait_for_selector('.rds-source-fault:has-text("nothing")')
    _go(page, '.rds-notice-error:has-text("broken.py, line 3")')


def test_refusals_beside_their_fields(same_page: Callable[[str], Any]) -> None:
    page = _opened(same_page)
    page.click('button:text-is("Dark")')
    page.click('button:text-is("Circular")')
    page.click('button:text-is("Single segment")')
    _type(page, "Start", "here")
    page.wait_for_selector('.rds-refusal:has-text("two or three positions in mm")')
    _type(page, "Feed rate", "-5")
    page.wait_for_selector('.rds-refusal:has-text("Feed rate must be more than 0")')
    page.click('button:text-is("Interpolate")')
    page.wait_for_selector('.rds-notice-error:has-text("first mend what is refused: Start")')
    _type(page, "Start", "10, 0")
    _type(page, "Feed rate", "600")
    _type(page, "End", "0, 12")
    _go(page, '.rds-notice-error:has-text("on one circle")')
    _type(page, "End", "10, 0")
    _go(page)
    _turn_to(page, "Path")
