"""A page reloaded, a second page, a kernel that dies during a run: the machine is safe, and the record is offered."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rds.results import open_result
from rds.session import Session
from rds.session.kept_runs import State, state_of
from tests.panels.conftest import App

LONG = 30.0  # s that the runs of these tests would take
PATIENCE = 120.0  # s


@pytest.fixture
def running(start_app: Callable[..., App], open_page: Callable[..., Any], tmp_path: Path) -> tuple[App, Any, Path]:
    """A page in the middle of an emulation, and the run's folder."""
    kept = {"equipment control": {"mode": "emulation", "duration": LONG}}
    (tmp_path / "session.json").write_text(json.dumps(kept))
    app = start_app(tmp_path)
    page = open_page("Equipment control", on=app)
    page.click('button:visible:text-is("Run")')
    folder = wait_for(lambda: next(iter((tmp_path / "runs").glob("*")), None))
    wait_for(lambda: state_of(folder) is State.GOES_ON)
    return app, page, folder


def wait_for(look: Callable[[], Any]) -> Any:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        if found := look():
            return found
        time.sleep(0.05)
    raise AssertionError("it did not come about")


def test_a_reload_during_a_run_loses_nothing(running: tuple[App, Any, Path], open_page: Callable[..., Any]) -> None:
    app, page, folder = running
    page.reload()
    page.wait_for_selector(".rds-app .rds-nav button")
    wait_for(lambda: state_of(folder) is not State.GOES_ON)  # to its safe end, whoever looks
    result = open_result(folder)
    assert len(result) > 100 and abs(result["X_voltage"]).max() <= 10.0
    again = open_page(on=app)
    again.wait_for_selector('.rds-notice:has-text("was cut short")')


def test_a_second_page_finds_the_machine_in_use_and_can_stop_it(
    running: tuple[App, Any, Path], open_page: Callable[..., Any]
) -> None:
    app, _, folder = running
    second = open_page("Equipment control", on=app)
    second.wait_for_selector('.rds-notice:has-text("goes on")')
    second.click('button:visible:text-is("Run")')
    second.wait_for_selector(':text("in use by another page")')
    second.click("button.rds-stop")
    wait_for(lambda: state_of(folder) is State.WHOLE)
    assert open_result(folder).meta["ending"] != "done"


def test_a_kernel_that_dies_leaves_the_record_and_no_claim(
    running: tuple[App, Any, Path], open_page: Callable[..., Any]
) -> None:
    app, _, folder = running
    wait_for(lambda: len(open_result(folder)) > 300 if (folder / "record.rds").is_file() else False)
    os.kill(json.loads((app.folder / ".machine.json").read_text())["process"], signal.SIGKILL)
    wait_for(lambda: state_of(folder) is State.CUT_SHORT)
    assert len(open_result(folder)) > 300
    session = Session(app.folder)
    session.take_machine("a run after it", object())  # whoever died holds nothing
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
