"""The machine panel in a browser: modules found, configured, tuned, stepped; their bus watched."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.panels.conftest import App, end

DIALECT = '.rds-field:has(.rds-label:has-text("Dialect")) select'


def press(page: Any, text: str) -> None:
    page.click(f'button:visible:text-is("{text}")')


MODULE = '.rds-field:visible:has(.rds-label:has-text("Module")) select'


def tab(page: Any, title: str) -> None:
    page.click(f'.rds-tabs [role="tab"]:has-text("{title}")')


@pytest.fixture
def own_app(start_app: Callable[..., App]) -> Iterator[App]:
    """An app for itself: what it serves is on its bus."""
    app = start_app(None, "--machine", "mrmt-oacs")
    yield app
    end(app)  # its kernel would go on listening to the bus


def test_modules_are_found_configured_stepped_and_watched(own_app: App, open_page: Callable[..., Any]) -> None:
    page = open_page("Machine", on=own_app)
    press(page, "Scan")
    page.wait_for_selector('.rds-notice-error:has-text("no module answers"):has-text("start the simulated modules")')
    page.select_option(DIALECT, "oacs: distributed")
    press(page, "Start modules")
    page.wait_for_selector('.rds-notice-good:has-text("4 say what they are")')
    page.wait_for_selector("caption:has-text('What they say of themselves')")
    tab(page, "2 Configuration")
    page.wait_for_selector('.rds-notice-good:visible:has-text("this order makes a machine")')
    press(page, "Remove")  # the arm, which Z says is mounted on it
    press(page, "Add")  # the arm is what the list begins with
    page.wait_for_selector('b:visible:text-is("5")')  # places of four modules and the arm
    page.wait_for_selector(".rds-figure canvas:visible, .rds-figure img:visible")
    page.locator('button:visible:text-is("▼")').first.click()
    page.wait_for_selector('.rds-notice-error:visible:has-text("the tool (module 5) must be the first")')
    page.locator('button:visible:text-is("▲")').nth(1).click()
    press(page, "Write machine")
    page.wait_for_selector('.rds-notice-good:visible:has-text("wrote my-machine.toml")')
    written = (own_app.folder / "my-machine.toml").read_text()
    assert "[axis.X.module]" in written and 'module = "oacs-range-arm"' in written
    tab(page, "Bus")
    press(page, "Analyse")
    page.wait_for_selector("td:visible:has-text('met')")
    press(page, "Listen")
    tab(page, "3 Controllers")
    modules = page.locator('.widget-dropdown:visible:has-text("Module") select').element_handle()
    one = "(box) => box.selectedOptions[0]?.label.startsWith('2:')"  # of them, before any choice
    page.wait_for_function(one, arg=modules)
    page.select_option('.widget-dropdown:visible:has-text("Module") select', "4: LinrXa")
    press(page, "Step")
    page.wait_for_selector(".rds-figure canvas:visible, .rds-figure img:visible")
    page.wait_for_selector(':text("recorded in step-1"):visible')
    tab(page, "Bus")
    page.wait_for_selector("td:visible:has-text('Reply')")
    page.click('button:text-is("Dark")')
    page.wait_for_selector(".rds-app.rds-dark")


def test_a_gain_that_cannot_be_is_refused_beside_its_field(same_page: Callable[[str], Any]) -> None:
    page = same_page("Machine")
    tab(page, "3 Controllers")
    page.wait_for_selector('.rds-notice-warning:visible:has-text("no module with a controller is known")')
    field = page.locator('.rds-field:has(.rds-label:has-text("Kp")) input').first
    field.fill("-1")
    field.press("Enter")
    page.wait_for_selector('.rds-refusal:has-text("Kp must be from 0 to 1e+06 duty/count, not -1")')


def mount(page: Any, place: int, name: str) -> None:
    page.select_option(MODULE, **name_of(page, name))
    press(page, "Mount")
    page.wait_for_selector(f'b:visible:text-is("{place}")')


def name_of(page: Any, name: str) -> Any:
    """The words of a module of the library, as the list has them."""
    return {"label": page.locator(f"{MODULE} option", has_text=f": {name}, ").first.inner_text()}


def test_a_machine_is_put_together_by_hand(app: App, same_page: Callable[[str], Any]) -> None:
    page = same_page("Machine")
    tab(page, "By hand")
    mount(page, 1, "oacs-drill")
    mount(page, 2, "oacs-x")
    page.wait_for_selector('.rds-notice-error:visible:has-text("does not fit on")')
    page.locator('button:visible:text-is("Remove")').nth(1).click()
    page.wait_for_selector('.rds-notice-error:visible:has-text("nothing would move")')
    for place, each in enumerate(("oacs-range-arm", "oacs-z", "oacs-x"), start=2):
        mount(page, place, each)
    page.wait_for_selector('.rds-notice-good:visible:has-text("these modules make a machine")')
    press(page, "Write file")
    page.wait_for_selector('.rds-notice-good:visible:has-text("wrote by-hand.toml")')
    assert 'module = "oacs-range-arm"' in (app.folder / "by-hand.toml").read_text()


def test_a_machine_is_made_of_a_script(app: App, same_page: Callable[[str], Any]) -> None:
    """Limits alone change the machine that is chosen at Modules."""
    page = same_page("Machine")
    tab(page, "Script")
    text = page.locator("textarea:visible")
    text.fill("RF02 LN1 UP5 LW")
    press(page, "Check")
    page.wait_for_selector('.rds-notice-error:visible:has-text("line 1: LW cannot be read")')
    press(page, "Script of the machine")
    page.wait_for_selector('.rds-notice-good:visible:has-text("this script makes a machine")')
    page.locator(".rds-field:visible:has(.rds-label:has-text('Machine file')) input").fill("scripted.toml")
    press(page, "Write machine")
    page.wait_for_selector('.rds-notice-good:visible:has-text("wrote scripted.toml")')
    assert "[[link]]" in (app.folder / "scripted.toml").read_text()
