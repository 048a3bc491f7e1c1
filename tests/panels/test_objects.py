"""The panel of objects in a browser: filled in, refused at the field, made into a program."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from tests.panels.conftest import PROGRAM_TEXT, App

GOOD, BAD = ".rds-verdict .rds-notice-good:visible", ".rds-verdict .rds-notice-error:visible"
FITS = "document.documentElement.scrollWidth <= innerWidth"


def test_an_arc_is_filled_in_refused_at_its_field_and_made_into_a_program(
    open_page: Callable[..., Any], app: App
) -> None:
    page = open_page("Objects")
    page.wait_for_selector(GOOD)
    page.get_by_label("Object", exact=True).select_option("Arc")
    page.get_by_label("Sweep").fill("0")
    page.keyboard.press("Tab")
    page.wait_for_selector('.rds-refused:visible:has-text("is no arc; give degrees")')
    page.wait_for_selector(f'{BAD}:has-text("first mend what is refused: Sweep")')
    page.wait_for_function(FITS)
    page.set_viewport_size({"width": 800, "height": 900})
    page.wait_for_function(FITS)
    page.get_by_label("Sweep").fill("-90")
    page.keyboard.press("Tab")
    page.wait_for_selector(f'{GOOD}:has-text("lines: 0, arcs: 1")')
    page.wait_for_selector(".rds-main .rds-figure canvas:visible, .rds-main .rds-figure img:visible")
    page.wait_for_function(FITS)
    page.set_viewport_size({"width": 1280, "height": 900})
    page.wait_for_function(FITS)
    page.set_viewport_size({"width": 800, "height": 900})
    name = page.get_by_label("Name of the program").input_value()
    assert re.fullmatch(r"arc(-\d+)?\.ngc", name)
    page.click('button:visible:text-is("Make the program")')
    page.wait_for_selector('.rds-title h1:text-is("Program")')
    page.wait_for_selector(f'{GOOD}:has-text("the machine can run it")')
    assert "rds nc make: arc about 20,20 mm" in page.evaluate(PROGRAM_TEXT)
    assert "G2 " in (app.folder / name).read_text()
