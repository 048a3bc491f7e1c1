"""Light or dark: as the browser prefers, until somebody chooses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rds.panels.page.colours import Colours


def test_the_browser_s_preference_is_followed_until_the_button_is_pressed() -> None:
    shown: list[bool] = []
    colours = Colours(shown.append)

    def prefers(dark: Any) -> None:
        colours._said(None, {"kind": "prefers", "dark": dark}, None)

    prefers(True)
    prefers(False)
    prefers("yes")
    prefers(True)
    assert shown == [True, False, True] and colours.name == "dark"
    colours.button.value = False  # somebody presses it
    prefers(False)
    prefers(True)
    assert shown == [True, False, True, False] and colours.name == "light"


def test_a_page_is_dark_for_a_browser_that_prefers_it(app: Any, new_page: Callable[..., Any]) -> None:
    page = new_page(1280, 800)
    page.emulate_media(color_scheme="dark")
    page.goto(app.url)
    page.wait_for_selector(".rds-app.rds-dark")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
    page.click('.rds-head button:text-is("Dark")')
    page.wait_for_selector(".rds-app:not(.rds-dark)")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
