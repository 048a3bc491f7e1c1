"""The page around the panels, in a browser."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.panels.conftest import App, turn_to


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


def test_a_panel_that_was_left_stays_out_of_sight_and_is_not_made_anew(same_page: Callable[[str], Any]) -> None:
    page = same_page("Objects")
    page.evaluate("document.querySelector('.rds-panel > :not(.rds-away)').id = 'left'")
    turn_to(page, "Main menu")
    page.wait_for_selector("#left", state="hidden")
    turn_to(page, "Objects")
    page.wait_for_selector("#left", state="visible")


def test_the_emergency_stop_has_its_corner_at_every_width_and_zoom_and_is_hit_at_its_centre(
    second_app: App, open_page: Callable[..., Any]
) -> None:
    """A zoom of 200 % halves what a page has, in px of CSS: 160 px are the width of a screen of 320 px at 200 %."""
    page = open_page("Program", on=second_app)
    where = """() => {
        const stop = document.querySelector("button.rds-stop"), box = stop.getBoundingClientRect();
        const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
        const inside = box.x >= 0 && box.right <= innerWidth && box.y >= 0 && stop.scrollWidth <= stop.clientWidth;
        return [x, y, inside, document.elementFromPoint(x, y) === stop];
    }"""
    for width in (160, 195, 320, 390, 643, 800, 960, 1280, 1920):
        page.set_viewport_size({"width": width, "height": 400})
        for down in (0, 3000):
            page.evaluate(f"document.querySelector('.rds-app').scrollTop = {down}")
            x, y, inside, hit = page.evaluate(where)
            assert inside and hit, (width, down)
        if width in (160, 320, 1920):
            page.mouse.click(x, y)
            page.wait_for_selector('.rds-notice:has-text("no module is on the bus")')
