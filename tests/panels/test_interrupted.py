"""A page reloaded, a second page, a kernel that dies during a run: the machine is safe, and the record is offered."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rds.panels.session import Session
from rds.panels.session.kept_runs import State, state_of
from rds.results import open_result
from tests.panels.conftest import App, begin_with

LONG = 120.0  # s of a run that is stopped
ORPHANED = 6.0  # s of one that is waited for, whose kernel is killed at its beginning
PATIENCE = 120.0  # s
PERIOD = 0.005  # s: a loop of 1 ms takes a whole processor, before all others, and both pages wait for one
MORE = 100  # samples: half a second


@pytest.fixture
def busy_app(second_app: App) -> App:
    """An app that is about to emulate."""
    begin_with(second_app, mode="emulation", sample_period=PERIOD)
    return second_app


@pytest.fixture
def begin(busy_app: App, open_page: Callable[..., Any]) -> Callable[[float], tuple[App, Any, Path]]:
    """A page in the middle of an emulation of so many seconds, and the run's folder."""

    def run(duration: float) -> tuple[App, Any, Path]:
        runs = busy_app.folder / "runs"
        before = set(runs.glob("*"))
        page = open_page("Equipment control", on=busy_app)
        page.fill('.rds-field:has(.rds-label:has-text("Final time")) input', f"{duration:g}")
        page.click('button:visible:text-is("Run")')
        folder = wait_for(lambda: next(iter(set(runs.glob("*")) - before), None))
        wait_for(lambda: state_of(folder) is State.GOES_ON)
        return busy_app, page, folder

    return run


def wait_for(look: Callable[[], Any]) -> Any:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        if found := look():
            return found
        time.sleep(0.05)
    raise AssertionError("it did not come about")


def recorded(folder: Path) -> int:
    """Samples of a run until now: a run goes on for a while before its first."""
    return len(open_result(folder)) if (folder / "record.rds").is_file() else 0


def test_a_run_outlives_a_reload_and_is_taken_up_there_and_in_a_second_page_which_can_stop_it(
    begin: Callable[..., Any], open_page: Callable[..., Any]
) -> None:
    app, page, folder = begin(LONG)
    second = open_page("Equipment control", on=app)
    page.reload()  # its kernel goes on until the run is kept
    for each in (page, second):  # the reloaded page begins where the run is, not at its menu
        each.wait_for_selector('.rds-notice:has-text("goes on, which was begun elsewhere")')
        each.wait_for_selector(".rds-strip canvas:visible")
        each.wait_for_selector(".rds-live-values .rds-field:visible")
        each.wait_for_selector('.rds-work button:text-is("Stop"):visible')
        assert each.locator('button:visible:text-is("Run")').is_disabled()
    before = wait_for(lambda: recorded(folder))
    wait_for(lambda: recorded(folder) > before + MORE)  # the loop goes on, too
    second.click("button.rds-stop")
    wait_for(lambda: state_of(folder) is State.WHOLE)
    result = open_result(folder)
    assert result.meta["ending"] == "machine lost" and len(result) > before + MORE
    assert (result["time"] == np.arange(len(result)) * PERIOD).all()  # no sample is missing
    for each in (page, second):  # its end is told, and what was said of its going on is gone
        each.wait_for_selector('.rds-main .rds-notice:has-text("ended early"):visible')
        assert each.locator('.rds-notice:has-text("begun elsewhere"):visible').count() == 0
    page.click('.lm-TabBar-tab:visible:has-text("Earlier runs")')
    page.wait_for_selector(f'.rds-runs tr[data-run="{folder.name}"]')


def test_a_kernel_that_dies_leaves_the_record_and_no_claim(
    begin: Callable[..., Any], open_page: Callable[..., Any]
) -> None:
    app, _, folder = begin(ORPHANED)
    wait_for(lambda: recorded(folder) > 0.3 / PERIOD)
    os.kill(json.loads((app.folder / ".machine.json").read_text())["process"], signal.SIGKILL)
    wait_for(lambda: state_of(folder) is State.CUT_SHORT)
    assert len(open_result(folder)) == ORPHANED / PERIOD  # the loop has gone on to its end
    session, nobody = Session(app.folder), object()
    session.take_machine("a run after it", nobody)  # whoever died holds nothing
    session.give_machine_back(nobody)
    page = open_page(on=app)
    page.wait_for_selector('.rds-notice:has-text("was cut short")')


def test_a_click_does_not_overtake_what_was_typed_before_it(app: App, open_page: Callable[..., Any]) -> None:
    page = open_page("Equipment control")
    page.click('button:visible:text-is("View model")')
    page.click(':text("Show as file")')
    name = page.locator('input[placeholder="experiment.toml"]')
    amplitude = page.locator('.rds-field:has(.rds-label:has-text("Amplitude")) input')
    for last in (21, 22, 23, 24, 25):  # a change that the kernel has not taken holds up those behind it
        name.fill(f"typed-{last}.toml")
        for value in ("2", "3", "4"):
            amplitude.fill(value)
            amplitude.press("Enter")
        amplitude.fill(str(last))
        page.click('button:visible:text-is("Save the file")')
        written = wait_for(lambda file=app.folder / f"typed-{last}.toml": file.is_file() and file.read_text())
        assert f"amplitude = {last}.0" in written, written


ONCE_WITHOUT_MODEL = """
if (sessionStorage.getItem("made") === null) {
  sessionStorage.setItem("made", "once");
  const parse = JSON.parse;
  const model = /("application.vnd.jupyter.widget-view.json": ?{"model_id": ?")[0-9a-f]{32}/;
  JSON.parse = (text, ...more) => parse(String(text).replace(model, "$1" + "0".repeat(32)), ...more);
}
"""


def test_a_page_whose_kernel_was_lost_before_it_was_shown_is_loaded_again(
    app: App, new_page: Callable[..., Any]
) -> None:
    """It stayed empty but for "model not found"."""
    page = new_page(1280, 800)
    page.add_init_script(ONCE_WITHOUT_MODEL)
    loaded: list[str] = []
    page.on("domcontentloaded", lambda _: loaded.append(page.url))
    page.goto(app.url)
    page.wait_for_selector(".rds-app .rds-nav button")
    assert len(loaded) == 2
    page.wait_for_function("sessionStorage.getItem('rds-loaded-again') === null")
