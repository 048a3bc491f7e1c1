"""The drawing panel in a browser: cells drawn by mouse and keys, refused with the reason, made into a program."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.panels.conftest import PROGRAM_TEXT, App

GOOD, BAD = ".rds-verdict .rds-notice-good", ".rds-verdict .rds-notice-error"
LEFT, TOP = 30, 18  # px from the canvas's corner to the first cell


def opened(same_page: Callable[[str], Any]) -> Any:
    page = same_page("Drawing")
    page.wait_for_selector(f"{GOOD}, {BAD}")
    return page


def filled(page: Any) -> int:
    return int(page.get_attribute(".rds-cells", "data-filled"))


def stroke(page: Any, start: tuple[int, int], end: tuple[int, int]) -> None:
    """The mouse drawn from cell to cell (row, column from 0)."""
    box, size = page.locator(".rds-cells canvas").bounding_box(), int(page.get_attribute(".rds-cells", "data-cell"))
    for k, (row, column) in enumerate((start, end)):
        page.mouse.move(box["x"] + LEFT + (column + 0.5) * size, box["y"] + TOP + (row + 0.5) * size)
        if k == 0:
            page.mouse.down()
    page.mouse.up()


def test_cells_are_drawn_traced_and_made_into_a_program(same_page: Callable[[str], Any], app: App) -> None:
    page = opened(same_page)
    page.click('.rds-cells-bar button:text-is("Clear")')
    page.wait_for_selector(f'{BAD}:has-text("there is no outline to trace")')
    for row in range(4, 8):
        stroke(page, (row, 4), (row, 11))
    assert filled(page) == 32
    page.wait_for_selector(GOOD)
    page.wait_for_selector('.rds-cells[data-rings="1"]')
    page.click('button:text-is("Make the program")')
    page.wait_for_selector('.rds-title h1:text-is("Program")')
    page.wait_for_selector(f'{GOOD}:has-text("the machine can run it")')
    assert "outline of your drawing" in page.evaluate(PROGRAM_TEXT)
    assert "G1" in (app.folder / "drawing.ngc").read_text()


def test_cells_are_filled_with_the_keys_and_two_islands_are_refused_with_their_places(
    same_page: Callable[[str], Any],
) -> None:
    page = opened(same_page)
    page.click('.rds-cells-bar button:text-is("Clear")')
    page.wait_for_selector('.rds-cells[data-filled="0"]')
    page.focus(".rds-cells canvas")
    for key in 30 * ("ArrowUp", "ArrowLeft"):  # into the corner, wherever it was left
        page.keyboard.press(key)
    for key in ("ArrowDown", "ArrowRight", "Space", "Shift+ArrowRight", "Shift+ArrowDown"):
        page.keyboard.press(key)
    page.wait_for_selector('.rds-cells[data-filled="3"]')
    assert page.inner_text(".rds-cells-said") == "row 3, column 3, filled"
    page.click('.rds-cells-bar button:text-is("Undo")')
    page.wait_for_selector('.rds-cells[data-filled="0"]')

    page.click('.rds-cells-bar button:text-is("Clear")')
    for row in (3, 4, 9, 10):
        stroke(page, (row, 3), (row, 8))
    page.wait_for_selector(f'{BAD}:has-text("has 2 islands")')
    page.click('button:text-is("Make the program")')
    page.wait_for_selector('.rds-main .rds-notice:has-text("has 2 islands")')


def test_a_picture_of_the_folder_is_traced(same_page: Callable[[str], Any], app: App) -> None:
    image = pytest.importorskip("PIL.Image", reason="pillow is not installed: it is in the extra drawing")
    across, up = np.meshgrid(np.arange(60), np.arange(60))
    disc = np.hypot(across - 30, up - 30) < 20
    path = app.folder.parent / "disc.png"
    image.fromarray(np.where(disc, 0, 255).astype(np.uint8)).save(path)
    page = opened(same_page)
    page.click('button:text-is("Picture")')
    page.wait_for_selector('.rds-verdict .rds-notice-note:has-text("choose a picture")')
    with page.expect_file_chooser() as chooser:
        page.click('.rds-side button:has-text("Take a picture")')
    chooser.value.set_files(path)
    page.wait_for_selector(f'{GOOD}:has-text("off the traced outline")')
    page.wait_for_selector(".rds-main .rds-figure canvas, .rds-main .rds-figure img")
    assert (app.folder / "disc.png").is_file()
