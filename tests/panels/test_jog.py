"""The jog panel in a browser: an axis moves while a button is held, and stops when the page goes away."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any


def position(page: Any) -> float:
    """Of the first axis, as the page shows it."""
    found = re.match(r"-?\d+\.\d+", page.inner_text(".rds-jog-at >> nth=0"))
    assert found is not None
    return float(found.group())


def _speed_beyond_the_machine_is_refused(page: Any) -> None:
    field = page.locator('.rds-field:has(.rds-label:has-text("Speed")) input')
    before = field.input_value()
    field.fill("99")
    field.press("Enter")
    page.wait_for_selector('.rds-refusal:has-text("Speed must be more than 0 and at most 13 mm/s")')
    field.fill(before)
    field.press("Enter")


def test_an_axis_moves_while_held_and_by_step(open_page: Callable[..., Any]) -> None:
    page = open_page("Jog")
    _speed_beyond_the_machine_is_refused(page)
    page.click('button:text-is("Take the machine")')
    page.wait_for_selector('.rds-notice-good:has-text("the axes can be moved")')
    plus = page.locator('button[aria-label="X plus"]')
    box = plus.bounding_box()
    page.mouse.move(box["x"] + 10, box["y"] + 10)
    page.mouse.down()
    page.wait_for_function("parseFloat(document.querySelector('.rds-jog-at').innerText) > 1")
    page.mouse.up()
    page.wait_for_timeout(700)
    rested = position(page)
    page.wait_for_timeout(500)
    assert position(page) == rested > 1.0
    plus.focus()
    page.keyboard.down("ArrowLeft")
    page.wait_for_function(f"parseFloat(document.querySelector('.rds-jog-at').innerText) < {rested - 0.5}")
    page.click('button:text-is("Dark")')  # takes the focus away: the key counts as let go
    page.wait_for_timeout(700)
    page.keyboard.up("ArrowLeft")
    rested = position(page)
    page.click('button:text-is("by step")')
    page.click('button:text-is("10")')
    page.wait_for_timeout(300)
    plus.press("Enter")
    page.wait_for_function(f"parseFloat(document.querySelector('.rds-jog-at').innerText) > {rested + 9.95}")
    page.click("button.rds-stop")
    page.wait_for_selector('.rds-notice:has-text("modules are at zero volts")')
    page.wait_for_selector('button[aria-label="X plus"]:disabled')
