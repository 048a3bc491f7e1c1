"""The page around the panels, in a browser."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def test_page_shows_its_menu_dark_and_light_with_the_stop_in_sight_which_answers(open_page: Callable[..., Any]) -> None:
    page = open_page()
    assert page.inner_text(".rds-title h1") == "Main menu"
    box = page.locator("button.rds-stop").bounding_box()
    assert box["x"] + box["width"] <= 1280 and box["y"] + box["height"] <= 800
    light = page.evaluate("getComputedStyle(document.querySelector('.rds-app')).backgroundColor")
    page.click('button:text-is("Dark")')
    page.wait_for_selector(".rds-app.rds-dark")
    assert page.evaluate("getComputedStyle(document.querySelector('.rds-app')).backgroundColor") != light
    page.click("button.rds-stop")  # no module is there
    page.wait_for_selector('.rds-notice:has-text("no module is on the bus")')


def test_emergency_stop_stays_in_sight_on_a_long_panel(open_page: Callable[..., Any]) -> None:
    page = open_page("Data", height=600)
    page.mouse.move(640, 400)
    page.mouse.wheel(0, 3000)
    page.wait_for_function("document.querySelector('.rds-app').scrollTop > 50")
    box = page.locator("button.rds-stop").bounding_box()
    assert box["y"] >= 0 and box["y"] + box["height"] <= 120
