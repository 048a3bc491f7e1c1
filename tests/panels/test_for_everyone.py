"""A panel without a mouse and without eyes: keys, labels, what is read out, and what axe-core finds."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rds.panels.registry import PANELS
from tests.panels.conftest import App, begin_with

ROOT = Path(__file__).parents[2]
AXE = Path(os.environ.get("RDS_AXE", ROOT / "node_modules" / "axe-core" / "axe.min.js"))
NO_AXE = f"no axe-core at {AXE}: `npm install --no-save axe-core` in the checkout, or set RDS_AXE to an axe.min.js"
PRESSES = 8  # of Tab, to Run
SERIOUS = """async () => (await axe.run(".rds-app", { resultTypes: ["violations"] })).violations
    .filter((each) => ["serious", "critical"].includes(each.impact))
    .map((each) => `${each.id}: ${each.nodes.slice(0, 4).map((node) => node.html.slice(0, 160)).join(" | ")}`)"""


def test_axe_finds_nothing_serious_on_any_panel_in_light_and_dark(
    second_app: App, open_page: Callable[..., Any]
) -> None:
    if not AXE.is_file():
        pytest.skip(NO_AXE)
    page = open_page(on=second_app)
    page.add_script_tag(path=AXE)
    found = {}
    for name in PANELS.names():
        title = PANELS.module(name).TITLE
        page.click(f'.rds-nav button:text-is("{title}")')
        page.wait_for_selector(f'.rds-title h1:text-is("{title}")')
        page.wait_for_selector(".rds-panel:not(.rds-opening)")
        page.wait_for_timeout(300)
        if page.locator('[title="null"], [aria-label="null"]').count():
            found[f"{name}, titles"] = ["of a widget without a tooltip: null"]
        for scheme in ("light", "dark"):
            if said := page.evaluate(SERIOUS):
                found[f"{name}, {scheme}"] = said
            page.click('.rds-head button:text-is("Dark")')  # and back again
            page.wait_for_selector(".rds-app.rds-dark" if scheme == "light" else ".rds-app:not(.rds-dark)")
    assert not found, "\n".join(f"{where}: {each}" for where, said in found.items() for each in said)


def test_no_panel_leaves_out_a_level_of_headings() -> None:
    """Below the panel's title, h1, all of them were h3, with no h2 above."""
    panels = ROOT / "rds" / "panels"
    sources = [path.read_text() for path in panels.rglob("*.py")]
    assert not any("<h3" in text for text in sources) and sum("<h2" in text for text in sources) >= 8


def test_the_keyboard_runs_and_stops_and_what_comes_of_it_is_read_out(
    second_app: App, open_page: Callable[..., Any]
) -> None:
    begin_with(second_app, system="X", mode="simulation", controller="p")
    page = open_page(on=second_app)
    for title in ("Equipment model", "Equipment control", "Program", "Interpolator"):
        page.click(f'.rds-nav button:text-is("{title}")')
        page.wait_for_selector(f'.rds-title h1:text-is("{title}")')
        page.wait_for_selector("button.rds-run:visible")
        page.evaluate("document.activeElement.blur()")
        pressed = 0
        while pressed <= PRESSES and not page.evaluate("document.activeElement.matches('.rds-run')"):
            page.keyboard.press("Tab")
            pressed += 1
        assert pressed <= PRESSES, title
    page.keyboard.press("Control+Enter")
    page.wait_for_selector('[aria-live=polite] :text("done:"):visible')

    page.click('.rds-nav button:text-is("Interpolator")')
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    page.wait_for_selector('.rds-title h1:text-is("Equipment control")')
    page.get_by_label("Final time").filter(visible=True).fill("0.25")  # its label is its name
    page.keyboard.press("Control+Enter")  # what was typed holds
    page.wait_for_selector('.rds-notice[aria-live=polite] [role=status]:has-text("done: 250 samples"):visible')
    page.get_by_label("Mode", exact=True).filter(visible=True).select_option(label="Emulation")
    page.get_by_label("Final time").filter(visible=True).fill("600")
    for _ in range(2):  # the first one waits for what was typed, the second one is on its way
        page.keyboard.press("Control+Enter")
        page.keyboard.press("Escape")  # before there is a Stop
        page.wait_for_timeout(500)
        page.wait_for_selector(".rds-work:visible", state="hidden")
    page.keyboard.press("Control+Enter")
    page.wait_for_selector('.rds-work:has-text("running"):visible')  # there are samples of this run
    page.keyboard.press("Escape")
    page.wait_for_selector('[aria-live=polite] :text("ended early: stopped"):visible')
    assert not page.locator('.rds-notice:has-text("emergency stop")').count()  # the run, and nothing more
