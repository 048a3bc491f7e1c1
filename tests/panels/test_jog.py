"""The jog panel in a browser: an axis moves while a button is held, a spindle turns while the page is in sight."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rds.machines import load_machine
from tests.panels.conftest import App, end

SPEED = "parseFloat(document.querySelectorAll('.rds-jog-at')[3].innerText)"  # of the spindle, rev/min


FAR = 50.0  # mm: not at the end of the travel, where an axis that nobody stops comes to rest


def position(page: Any) -> float:
    """Of the first axis, as the page shows it."""
    found = re.match(r"-?\d+\.\d+", page.inner_text(".rds-jog-at >> nth=0"))
    assert found is not None
    return float(found.group())


def at_rest(page: Any) -> float:
    """The same, once it does not change any more."""
    seen = [position(page)]
    while len(seen) < 3 or len(set(seen[-3:])) > 1:
        page.wait_for_timeout(400)
        seen.append(position(page))
    return seen[-1]


def _speed_beyond_the_machine_is_refused(page: Any) -> None:
    field = page.locator('.rds-field:has(.rds-label:has-text("Speed [mm")) input')
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
    rested = at_rest(page)
    assert 1.0 < rested < FAR
    plus.focus()
    page.keyboard.down("ArrowLeft")
    page.wait_for_function(f"parseFloat(document.querySelector('.rds-jog-at').innerText) < {rested - 0.5}")
    page.click('button:text-is("Dark")')  # takes the focus away: the key counts as let go
    let_go = at_rest(page)
    page.keyboard.up("ArrowLeft")
    assert -FAR < let_go < rested - 0.5
    page.click('button:text-is("by step")')
    page.click('button:text-is("10")')
    page.wait_for_selector('button[aria-label="X plus"].rds-order')  # the choice has come back: a press is a step
    plus.press("Enter")
    page.wait_for_function(f"parseFloat(document.querySelector('.rds-jog-at').innerText) > {let_go + 9.95}")
    for said, shown in (("200", "X would leave its travel, -75 to 75 mm, at 200.000"), ("-1.5", "")):
        field = page.locator('.rds-field:has(.rds-label:has-text("Position")) input')
        field.fill(said)
        field.press("Enter")
        page.click('button:text-is("Go")')
        if shown:
            page.wait_for_selector(f'.rds-notice-error:has-text("{shown}")')
    page.wait_for_function("Math.abs(parseFloat(document.querySelector('.rds-jog-at').innerText) + 1.5) < 0.02")
    assert "would leave" not in page.inner_text(".rds-main"), "what was refused before is not said of this motion"
    page.click("button.rds-stop")
    page.wait_for_selector('.rds-notice:has-text("modules are at zero volts")')
    page.wait_for_selector('button[aria-label="X plus"]:disabled')


def test_drives_are_held_turned_and_homed(
    start_app: Callable[..., App], open_page: Callable[..., Any], tmp_path: Path
) -> None:
    machine = Path(load_machine("mini-cnc").path).read_text().replace("[-75.0, 75.0]", "[-3.0, 3.0]")
    (tmp_path / "small.toml").write_text(machine.replace('name = "mini-cnc"', 'name = "small-cnc"'))
    (tmp_path / "bus.toml").write_text('[bus]\nchannel = "bench"\ndialect = "cia402"\n')
    named = ("--machine", str(tmp_path / "small.toml"), "--experiment", str(tmp_path / "bus.toml"))
    app = start_app(tmp_path, *named)
    page = open_page("Machine", on=app)
    page.select_option('.widget-dropdown:has-text("cia402") select', "cia402: drives")
    page.click('button:text-is("Start modules")')
    page.wait_for_selector("td:has-text('cia402')")
    page.click('.rds-nav button:text-is("Jog")')
    page.click('button:text-is("Take the machine")')
    page.wait_for_selector('.rds-notice-good:has-text("the axes can be moved")')
    for way in range(2):  # clear of the limit switches at 3 mm
        page.wait_for_selector(f"text=2.994 mm to the >> nth={way}")
    plus = page.locator('button[aria-label="X plus"]')
    plus.focus()
    page.keyboard.down("ArrowRight")
    page.wait_for_function("parseFloat(document.querySelector('.rds-jog-at').innerText) > 0.5")
    page.keyboard.up("ArrowRight")
    page.click('button[aria-label="spindle reverse"]')
    page.wait_for_function(f"Math.abs({SPEED} + 1000) < 50")
    page.evaluate("Object.defineProperty(document, 'hidden', { value: true, configurable: true })")
    page.evaluate("document.dispatchEvent(new Event('visibilitychange'))")  # another tab is looked at
    page.wait_for_function(f"Math.abs({SPEED}) < 50")
    page.evaluate("delete document.hidden")
    page.click('button[aria-label="spindle forward"]')
    page.wait_for_function(f"Math.abs({SPEED} - 1000) < 50")
    page.click('.rds-nav button:text-is("Main menu")')  # another panel is looked at
    page.wait_for_function(f"Math.abs({SPEED}) < 50")
    page.click('.rds-nav button:text-is("Jog")')
    page.click('.rds-field:has-text("Axes to home") button:text-is("X")')
    page.select_option('.rds-field:has-text("Homing method") select', "17: negative limit switch")
    page.click('button:text-is("Find home")')
    page.wait_for_selector('.rds-notice:has-text("X looks for its home")')
    page.wait_for_selector('button[aria-label="X plus"]:disabled')
    page.wait_for_selector('.rds-notice:has-text("homed: X")')
    page.wait_for_selector("text=Not homed since the machine was taken: Y, Z")
    page.wait_for_function("Math.abs(parseFloat(document.querySelector('.rds-jog-at').innerText) + 2.95) < 0.05")
    page.click("button.rds-stop")
    page.wait_for_selector('.rds-notice:has-text("4 modules are at zero volts")')
    page.wait_for_selector('button[aria-label="X plus"]:disabled')
    end(app)
