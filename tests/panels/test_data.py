"""The data panel in a browser: a log becomes a model file, and a doubtful one a map to correct."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.panels.conftest import App


def fill(page: Any, label: str, value: str) -> None:
    page.fill(f'.rds-field:has(.rds-label:has-text("{label}")) input', value)
    page.keyboard.press("Tab")


def test_from_a_log_to_a_model(app: App, open_page: Callable[..., Any]) -> None:
    import rds

    run = rds.Experiment(
        axis="X", duration=3.0, sample_period=0.002, mode="simulation", signal=rds.square(3.0, 1.0)
    ).run()
    rows = np.column_stack([run["time"], run["X_voltage"], run["X_measured"]])
    header = "time [s],command [V],position [mm]"
    np.savetxt(app.folder / "x.csv", rows, delimiter=",", header=header, comments="", fmt="%.9g")
    page = open_page("Data")
    fill(page, "File with logged data", "x.csv")
    page.click('button:text-is("Describe")')
    page.wait_for_selector('.rds-notice:has-text("can be fitted")')
    page.click('button:text-is("Fit")')
    page.wait_for_selector('.rds-notice:has-text("fitted")')
    page.wait_for_selector('td:has-text("tau")')
    page.click('button:text-is("Save model")')
    page.wait_for_selector('.rds-notice:has-text("fitted.toml")')
    assert (app.folder / "fitted.toml").is_file()


def test_a_file_that_is_not_there_is_refused(open_page: Callable[..., Any]) -> None:
    page = open_page("Data")
    fill(page, "File with logged data", "no.csv")
    page.click('button:text-is("Describe")')
    page.wait_for_selector('.rds-notice:has-text("no.csv")')
