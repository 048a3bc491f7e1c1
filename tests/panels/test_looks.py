"""What everybody must be able to see and reach: on a projector, without a mouse, before anything is typed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rds.panels.kit.figure import DPI, WIDTH

CONTROLLER = """params = {"Kp": 20.0}  # V/mm


def control(t, r, y, state, params):
    return params["Kp"] * (r.position - y), state
"""


def test_a_projector_of_1024_and_the_keyboard_alone(open_page: Callable[..., Any], app: Any) -> None:
    (app.folder / "looked_at.py").write_text(CONTROLLER)
    page = open_page("Equipment control", width=1024, height=768)
    nav, side = page.locator(".rds-nav").bounding_box(), page.locator(".rds-side:visible").bounding_box()
    assert nav["y"] + nav["height"] <= side["y"] and side["x"] < 20  # panels are chosen in a row on top
    main = page.locator(".rds-main:visible").bounding_box()
    assert main["width"] >= WIDTH * DPI and main["x"] + main["width"] <= 1024  # as wide as a figure

    controller = page.locator('.rds-field:visible:has-text("Controller") select').first
    controller.focus()
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    controller.select_option(label="User-defined")
    file = page.locator('.rds-field:visible:has-text("File of the controller") input')
    file.fill("looked_at.py")
    file.press("Enter")
    header = page.locator('.jupyter-widget-Collapse-header[tabindex="0"]:visible:has-text("Parameters (1)")')
    header.wait_for()
    header.focus()
    page.keyboard.press("Enter")
    page.wait_for_selector('.jupyter-widget-Collapse-header[aria-expanded="true"]:visible')
    gain = page.locator('.rds-field:visible:has-text("Kp, V/mm") input[type=text]')
    assert gain.input_value() == "" and gain.get_attribute("placeholder") == "20"
    style = "getComputedStyle(document.querySelector('.rds-field input[placeholder]'), '::placeholder').fontStyle"
    assert page.evaluate(style) == "italic"  # the file's value, not one that was typed


def test_what_is_said_of_a_button_is_in_sight_beside_it_as_the_stop_is_and_each_panel_begins_at_its_top(
    open_page: Callable[..., Any],
) -> None:
    page = open_page("Data", height=600)
    page.click('button:text-is("Validate")')  # below what fits on the page
    said = page.locator('.rds-main .rds-notice:visible:has-text("other data")')
    said.wait_for()
    assert page.evaluate("document.querySelector('.rds-app').scrollTop") > 0
    head = page.locator(".rds-head").bounding_box()
    assert said.bounding_box()["y"] >= head["y"] + head["height"]
    file = page.locator('.rds-field:has-text("File with logged data") input')
    page.mouse.move(640, 400)
    page.mouse.wheel(0, 3000)
    page.wait_for_function("document.querySelector('.rds-nav').getBoundingClientRect().y < 0")
    stop = page.locator("button.rds-stop").bounding_box()
    assert stop["y"] >= 0 and stop["y"] + stop["height"] <= 120
    file.focus()
    assert file.bounding_box()["y"] >= head["y"] + head["height"]
    page.click('.rds-nav button:text-is("Help")')
    page.wait_for_selector('.rds-title h1:text-is("Help")')
    page.wait_for_function("document.querySelector('.rds-app').scrollTop === 0")
    page.set_viewport_size({"width": 1024, "height": 600})
    page.click('.rds-nav button:text-is("Data")')
    page.wait_for_selector('.rds-title h1:text-is("Data")')
    right = page.evaluate("""() => {
        const places = [...document.querySelectorAll(".rds-main .widget-html-content")];
        const place = places.find((each) => each.offsetParent);
        place.innerHTML = `<pre>${"x".repeat(400)}</pre>`;
        return place.firstChild.getBoundingClientRect().right;
    }""")
    assert right <= 1024  # long lines of a command scroll within the panel
    page.set_viewport_size({"width": 640, "height": 400})  # as at a zoom of 200 %
    page.click('.rds-nav button:text-is("Equipment control")')
    page.wait_for_selector('.rds-title h1:text-is("Equipment control")')
    run = page.locator("button.rds-run:visible").bounding_box()
    assert run["y"] >= 0 and run["y"] + run["height"] <= 400  # below the settings it was not reached without scrolling
