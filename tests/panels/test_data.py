"""The data panel in a browser: a log becomes a model file, and a doubtful one a map to correct."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.panels.conftest import App


def fill(page: Any, label: str, value: str) -> None:
    page.fill(f'.rds-field:has(.rds-label:has-text("{label}")) input', value)
    page.keyboard.press("Tab")


def test_a_log_becomes_a_model_and_one_that_is_not_there_is_refused(app: App, open_page: Callable[..., Any]) -> None:
    import rds

    run = rds.Experiment(
        axis="X", duration=3.0, sample_period=0.002, mode="simulation", signal=rds.square(3.0, 1.0)
    ).run()
    rows = np.column_stack([run["time"], run["X_voltage"], run["X_measured"]])
    header = "time [s],command [V],position [mm]"
    np.savetxt(app.folder / "x.csv", rows, delimiter=",", header=header, comments="", fmt="%.9g")
    page = open_page("Data")
    fill(page, "File with logged data", "no.csv")
    page.click('button:text-is("Describe")')
    page.wait_for_selector('.rds-notice:has-text("no.csv")')
    fill(page, "File with logged data", "x.csv")
    page.click('button:text-is("Describe")')
    page.wait_for_selector('.rds-notice:has-text("can be fitted")')
    page.click('button:text-is("Fit")')
    page.wait_for_selector('.rds-notice:has-text("fitted")')
    page.wait_for_selector('td:has-text("tau")')
    page.click('button:text-is("Save model")')
    page.wait_for_selector('.rds-notice:has-text("fitted.toml")')
    assert (app.folder / "fitted.toml").is_file()


def test_a_log_of_some_size_is_imported(app: App, open_page: Callable[..., Any], tmp_path: Path) -> None:
    log = tmp_path / "large.csv"
    log.write_bytes(b"time [s],command [V],position [mm]\n" + b"0.001,1.25,3.5\n" * 800_000)
    assert log.stat().st_size > 11e6  # more than a page may send to a server of tornado as it comes
    sent: list[int] = []  # bytes of each message of the page
    page = open_page()
    page.on("websocket", lambda socket: socket.on("framesent", lambda message: sent.append(len(message))))
    page.reload()
    page.click('.rds-nav button:text-is("Data")')
    with page.expect_file_chooser() as chooser:
        page.click('button:has-text("Import a file")')
    chooser.value.set_files(log)
    page.wait_for_function("""() => [...document.querySelectorAll("input")].some(each => each.value == "large.csv")""")
    assert (app.folder / log.name).read_bytes() == log.read_bytes()
    assert log.stat().st_size / 10 < max(sent) < 5e6  # JupyterLab's server ends the connection at 10 MB
    with page.expect_file_chooser() as chooser:
        page.click('button:text-is("Import a file")')
    chooser.value.set_files(log)
    page.wait_for_selector('.rds-notice:has-text("large.csv is there already")')
    assert not [said for said in page.warned if "405" in said]  # the page that went asks for the end of its kernel
