"""The program panel in a browser: faults at their words, preview, a run with an operator's hand on it."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rds.machines import load_machine
from rds.modes.loop.execution import State
from rds.nc.active import Modes
from rds.nc.language.blocks import G_GROUPS, M_GROUPS
from rds.nc.language.expressions import FUNCTION
from rds.nc.language.owords import KIND
from rds.nc.run.run import Status
from rds.panels.program.status import status_html
from rds.panels.program.words import words
from tests.panels.conftest import PROGRAM_TEXT, App
from tests.panels.test_interrupted import wait_for

EDITOR = ".rds-editor .cm-content"
SELECTED = "getSelection().toString()"
SAVED = 180_000  # ms until the pictures of a report are drawn, on a busy computer
SCENE = "document.querySelector('.rds-scene').dataset"
VALID = '.rds-verdict .rds-notice-good:has-text("the machine can run it")'


def lines(*middle: str) -> str:
    return "\n".join(("G21 G90 G94", *middle, "M2", ""))


def opened(open_page: Callable[[str], Any]) -> Any:
    """The panel, once it has looked at whatever an earlier test has left in the editor."""
    page = open_page("Program")
    page.click('.lm-TabBar-tab:visible:has-text("Preview")')
    page.wait_for_selector(".rds-verdict .rds-notice-good, .rds-verdict .rds-notice-error")
    return page


def reports(app: App) -> set[Path]:
    """Of the runs of programs until now."""
    return set(app.folder.glob("runs/*/program.html"))


def write(page: Any, text: str) -> None:
    page.fill(EDITOR, text)


def stands(page: Any) -> None:
    """Wait until the axes stand: the page shows the same for a second, though its kernel beats on."""
    page.wait_for_function("""() => {
        const shown = document.querySelector('.rds-positions').innerText;
        if (window.shown !== shown) [window.shown, window.since] = [shown, performance.now()];
        return performance.now() - window.since > 1000;
    }""")


def test_a_limit_that_is_near_is_said_by_a_sign() -> None:
    machine = load_machine("mini-cnc")
    measured = {"X": 72.0, "Y": 0.0, "Z": -10.0, "spindle": 1500.0}
    status = Status(1.0, 3, State.RUNS, 1.0, 300.0, 0.5, measured, dict(measured), to_go={"X": -2.0})
    shown = status_html(status, {2: Modes(("G1", "G54"), 4, 300.0, 1500.0, origin=(2.0, 0.0, 0.0))}, machine, 100.0)
    assert "⚠ 3.0 to high" in shown and shown.count("⚠") == 1
    assert (
        '<td class="rds-dro">70.000</td><td>-2.000</td><td>72.000</td>' in shown
        and "T4" in shown
        and "<code>G54</code>" in shown
    )
    assert "–" in status_html(None, {}, machine, 100.0)


def test_a_fault_is_marked_at_its_word_and_the_mark_goes_when_it_is_mended(same_page: Callable[[str], Any]) -> None:
    page = opened(same_page)
    write(page, lines("G1 X10 Q5 F300"))
    word = page.locator(".rds-editor-word.rds-editor-error")
    page.wait_for_selector('.rds-editor-error[data-word="Q5"]')  # a check of a text half typed may have marked another
    assert "nothing on the line uses Q" in page.inner_text(".rds-editor-list button")
    box, area = word.bounding_box(), page.locator(EDITOR).bounding_box()
    assert box["y"] - area["y"] == pytest.approx(4 + 19, abs=2)  # line 2, below the padding
    page.click('button:text-is("Run")')
    page.wait_for_selector('.rds-notice:has-text("it cannot run yet: 1 fault; line 2")')
    write(page, lines("G1 X10 F300"))
    page.wait_for_selector(VALID)
    page.wait_for_function("!document.querySelector('.rds-editor-error, .rds-editor-list button')")


def test_each_word_of_the_interpreter_has_its_meaning() -> None:
    known = {f"G{code / 10:g}" for code in G_GROUPS} | {f"M{code}" for code in (*M_GROUPS, 98)}
    assert {word["label"] for word in words() if word["kind"] == "code"} == known
    assert {word["label"] for word in words() if word["kind"] == "o"} == set(KIND.pattern.split("|"))
    assert {word["label"].lower() for word in words() if word["kind"] == "function"} == set(FUNCTION.pattern.split("|"))


def test_words_are_offered_and_say_what_they_mean(same_page: Callable[[str], Any]) -> None:
    page = opened(same_page)
    write(page, lines("(G2 in a remark)", "G2 X10 Y0 I5 J0 F300"))
    page.hover('.cm-line:has-text("G2 X10") .rds-editor-code')
    page.wait_for_selector('.rds-editor-meaning:has-text("G2 arc clockwise")')
    page.click('.rds-editor-code:text-is("M2")')
    page.keyboard.press("Home")
    page.keyboard.type("G8")
    page.wait_for_selector('.cm-completionLabel:has-text("G83")')
    page.keyboard.press("Enter")  # ends the line, whatever is offered
    page.keyboard.type("g83")
    page.wait_for_selector('.cm-completionDetail:has-text("comes out after each Q")')
    page.wait_for_timeout(200)  # keys that come as soon as words are offered are not for them
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    page.wait_for_function(f"{PROGRAM_TEXT}.endsWith('G8\\nG83M2\\n')")
    page.keyboard.press("Control+f")
    page.keyboard.type("remark")
    page.keyboard.press("Enter")
    page.wait_for_selector('.cm-searchMatch-selected:has-text("remark")')
    page.wait_for_selector('.rds-editor-says:has-text("G83")')  # what was written is checked
    page.keyboard.press("Escape")  # no search any more


def test_what_leaves_the_travel_is_crossed_in_the_preview_in_the_dark_too(same_page: Callable[[str], Any]) -> None:
    page = opened(same_page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    page.click('button:text-is("Dark")')
    page.wait_for_selector(".rds-app.rds-dark")
    write(page, lines("G1 X90 F300"))
    page.wait_for_selector('.rds-verdict .rds-notice-error:has-text("beyond its travel")')
    page.wait_for_function("Number(document.querySelector('.rds-path').dataset.beyond) > 0")
    for side in ("YZ", "ZX", "XY"):
        page.click(f'.rds-path-bar button:text-is("{side}")')
        page.wait_for_selector(f'.rds-path canvas[aria-label^="{side} view"]')
    page.click('button:text-is("In space (3-D)")')
    page.wait_for_selector(".k3d-target canvas")
    page.click('button:text-is("In space (3-D)")')  # which would be drawn on and on


def test_a_text_that_was_not_saved_is_there_after_a_reload(
    same_page: Callable[[str], Any], open_page: Callable[..., Any], app: App
) -> None:
    page = opened(same_page)
    write(page, lines("(unsaved words)", "G0 X1"))
    page.wait_for_selector('.rds-program :text("● ")')
    page.wait_for_selector(VALID)
    page.wait_for_timeout(500)
    again = open_page("Program")
    again.wait_for_function(f"{PROGRAM_TEXT}.includes('unsaved words')")
    again.fill(".rds-program-name input", "kept.ngc")
    again.press(".rds-program-name input", "Tab")
    again.click('button:text-is("Save as")')
    again.wait_for_selector('.rds-program :text("✔ saved")')
    assert "unsaved words" in (app.folder / "kept.ngc").read_text()


def test_a_run_is_held_resumed_changed_and_stopped_in_the_middle(same_page: Callable[[str], Any], app: App) -> None:
    page = opened(same_page)
    before = reports(app)
    page.locator(".rds-override input").fill("100")
    write(page, lines("G1 X70 F120", "X0", "X70"))
    page.wait_for_selector(VALID)
    page.click('button:text-is("Emulation")')
    page.click('button:text-is("Run")')
    page.wait_for_selector('.rds-state:has-text("Line 2 runs")')
    page.wait_for_selector('.rds-editor[data-running="2"]')
    page.click('button:text-is("Hold")')
    page.wait_for_selector('.rds-state:has-text("Line 2 held")')
    stands(page)
    page.click('button:text-is("Resume")')
    page.wait_for_selector('.rds-state:has-text("Line 2 runs")')
    slider = page.locator(".rds-override input")
    slider.press("ArrowRight")
    page.wait_for_selector('.rds-state:has-text("override 105 %")')
    slider.focus()
    page.wait_for_function("performance.now() > 5e3")  # no event of a page is older than the page
    key = {"key": "End", "code": "End", "windowsVirtualKeyCode": 35, "timestamp": time.time() - 4.5}
    page.context.new_cdp_session(page).send("Input.dispatchKeyEvent", {"type": "rawKeyDown"} | key)
    refusal = "The override was moved . s ago, while this page was busy"
    page.wait_for_selector(f'.rds-notice-warning:text-matches("{refusal}")')
    page.wait_for_function("document.querySelector('.rds-override input').value === '105'")  # nor does it stay in sight
    for each in ("ArrowRight", "ArrowLeft", "ArrowLeft"):  # more is taken back by less, which waits for nothing
        slider.press(each)
    page.wait_for_selector('.rds-state:has-text("override 100 %")')
    slider.press("End")
    page.wait_for_selector('.rds-state:has-text("override 200 %")')
    page.wait_for_function("Number(/Feed (\\d+)/.exec(document.querySelectorAll('.rds-state')[1].innerText)[1]) > 200")
    page.click('.rds-work button:text-is("Stop")')
    page.wait_for_selector('.rds-notice:has-text("ended early: stopped in line")')
    page.wait_for_selector('.rds-main :text("Where the contour error is largest")')
    page.click('.rds-main button:has-text("Line 2:")')
    page.wait_for_function(f"{SELECTED} === 'G1 X70 F120'")
    wait_for(lambda: reports(app) - before)
    page.wait_for_selector('.rds-main :text("Saved with its report in")', timeout=SAVED)
    assert re.search(r"override\s+1\s+1\.05\s", page.inner_text(".rds-main"))


def test_a_stop_of_the_program_waits_for_resume_and_home_ends_it(same_page: Callable[[str], Any], app: App) -> None:
    page = opened(same_page)
    before = reports(app)
    write(page, lines("G1 X1 F600", "M0", "G1 X70 F120"))
    page.wait_for_selector(VALID)
    page.click('button:text-is("Emulation")')
    page.click('button:text-is("Run")')
    page.wait_for_selector('.rds-state:has-text("Line 3 stops (M0, M1")')
    page.click('button:text-is("Resume")')
    page.wait_for_selector('.rds-state:has-text("Line 4 runs")')
    page.click('button:text-is("Home")')
    page.wait_for_selector('.rds-notice:has-text("ended early: went home from line 4")')
    wait_for(lambda: reports(app) - before)  # which the panel turns to, before the next test is on the page
    page.wait_for_selector('.rds-main :text("Saved with its report in")', timeout=SAVED)


def test_a_simulation_ends_with_its_worst_lines(same_page: Callable[[str], Any], app: App) -> None:
    page = opened(same_page)
    before = reports(app)
    write(page, lines("G1 Z-0.5 F300", "X3", "Y3"))
    page.wait_for_selector(VALID)
    page.click('button:text-is("Simulation")')
    page.click('.lm-TabBar-tab:visible:has-text("Machine")')
    page.click('button:text-is("Show the machine")')
    page.locator(".rds-scene select").select_option("20")
    page.click('.rds-scene button:text-is("Part")')
    page.click('button:text-is("Run")')
    at_end = f"{SCENE}.tip?.split(' ').slice(0, 2).every((each) => Math.abs(each - 3) < 0.1)"
    page.wait_for_function(f"{at_end} && {SCENE}.state === 'paused'")  # played
    gone, over, under = (float(page.evaluate(f"{SCENE}.{name}")) for name in ("cut", "over", "under"))
    swept = 2 * (3 * 6 + math.pi * 9) - math.pi * 9 - (9 - math.pi * 9 / 4)  # two slots of 6 mm that share a corner
    assert gone == pytest.approx(0.5 * swept, rel=0.12) and over < 0.06 and under < 0.06
    page.click('.lm-TabBar-tab:visible:has-text("Result")')
    page.wait_for_selector('.rds-main :text("Saved with its report in")', timeout=SAVED)
    wait_for(lambda: reports(app) - before)
    page.set_viewport_size({"width": 640, "height": 800})  # what was beside the editor is below it
    page.wait_for_function("""() => {
        const [editor, result] = [".rds-editor", ".rds-program .rds-main"].map(
            (each) => document.querySelector(each).getBoundingClientRect());
        return result.top >= editor.bottom && result.top - editor.bottom < 200;
    }""")


def test_a_program_is_run_from_its_cursor_and_by_the_nodes_a_line_by_hand_and_the_work_is_touched_off(
    open_page: Callable[..., Any], app: App
) -> None:
    page = opened(open_page)
    write(page, lines("G1 X1 F600", "Y1", "X0"))
    page.wait_for_selector(VALID)
    page.click('button:text-is("Simulation")')
    page.click(EDITOR)
    page.keyboard.press("Control+Home")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    page.click('button:text-is("Run from line")')
    page.wait_for_selector('.rds-main button:has-text("Line 3:")')
    assert not page.locator('.rds-main button:has-text("Line 2:")').count()

    page.click('.lm-TabBar-tab:visible:has-text("Nodes")')
    page.get_by_label("A: each period a frame").uncheck()
    page.click('button:text-is("Run by the nodes")')
    page.wait_for_selector('.rds-main p:has-text("keeps nearest to the path"):visible')
    page.wait_for_selector('.rds-main td:text-is("C: cyclic buffer"):visible')
    assert not page.locator('.rds-main td:text-is("A: each period a frame")').count()
    page.wait_for_selector(".rds-main .jupyter-matplotlib canvas:visible, .rds-main .rds-figure img:visible")
    assert list(app.folder.glob("runs/*-by-B-C-*/methods.html"))

    page.click('.lm-TabBar-tab:visible:has-text("MDI")')
    page.wait_for_selector('button:text-is("Run line"):enabled')
    for line, said in (
        ("G1 X2 F600", 'td:text-is("G1 X2 F600"):visible'),
        ("G91", 'td:text-is("G91"):visible'),
        ("G1 X", '.rds-notice:has-text("mdi.ngc:3:4")'),
    ):
        page.fill('input[placeholder="G0 X10"]', line)
        page.keyboard.press("Enter")
        page.click('button:text-is("Run line")')
        page.wait_for_selector(said)
        page.wait_for_selector('button:text-is("Run line"):enabled')
    assert (app.folder / "mdi.ngc").read_text().splitlines()[:2] == ["G1 X2 F600", "G91"]

    page.click('.lm-TabBar-tab:visible:has-text("Touch off")')
    page.click('button:text-is("Touch off")')
    page.wait_for_selector('.rds-notice-error:has-text("say what an axis should read")')
    page.get_by_label("X machine [mm]").fill("70")
    page.get_by_label("X should read [mm]").fill("-3")
    page.click('button:text-is("Touch off")')
    page.wait_for_selector('td:text-is("73.000")')
    assert "5221\t73.0" in (app.folder / "offsets.var").read_text()
    page.click('.lm-TabBar-tab:visible:has-text("Preview")')
    write(page, lines("G1 X3 F600"))  # in the work's coordinates that is beyond the travel now
    page.wait_for_selector('.rds-verdict .rds-notice-error:has-text("beyond its travel")')
