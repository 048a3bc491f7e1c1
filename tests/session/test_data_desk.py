"""Describe, fit and validate in a sitting, on logs of our own modules."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.nc.compiled_file import MAGIC
from rds.panels.data.state import DataState
from rds.panels.session import Session

PATIENCE = 120  # s


@pytest.fixture
def state(tmp_path: Path) -> DataState:
    """A folder with a log of X in CSV, made by the exact model."""
    import rds

    for name, frequency in (("a.csv", 0.7), ("b.csv", 0.9)):
        signal = rds.sinusoid(4.0, frequency)
        run = rds.Experiment(axis="X", duration=4.0, sample_period=0.002, signal=signal).run()
        rows = np.column_stack([run["time"], run["X_voltage"], run["X_measured"]])
        header = "time [s],command [V],position [mm]"
        np.savetxt(tmp_path / name, rows, delimiter=",", header=header, comments="", fmt="%.9g")
    state = DataState(Session(tmp_path))
    state.choices.set("file", "a.csv")
    return state


def test_from_a_log_to_a_validated_model_file(state: DataState) -> None:
    assert state.files() == ["a.csv", "b.csv"]
    described = state.describe()
    assert described.wait(PATIENCE) and described.error is None
    assert state.description is not None and state.description.usable
    fitted = state.fit()
    assert fitted.wait(PATIENCE) and fitted.error is None
    assert state.estimate is not None
    assert state.estimate.parameters["K"].value == pytest.approx(1.764, rel=0.01)
    path = state.write_model()
    assert path.read_text().count("tau")
    state.choices.set("validation_file", "b.csv")
    validated = state.validate()
    assert validated.wait(PATIENCE) and validated.error is None
    assert state.validation is not None and "fit 99" in str(state.validation)
    again = state.fit()
    assert again.wait(PATIENCE) and again.error is None
    for use in (state.validate, state.model_to_use):  # which would take the model of the first fit
        with pytest.raises(InputError, match=r"fitted\.toml is from before the last fit; Save model"):
            use()
    state.choices.set("model", "second.toml")
    assert state.model_to_use() == path.with_name("second.toml") and path.with_name("second.toml").is_file()
    state.choices.set("model", "fitted.toml")  # named by hand now
    assert state.model_to_use() == path


def test_what_a_run_has_made_of_a_part_program_is_no_log(state: DataState) -> None:
    (state.session.folder / "part.dat").write_bytes(MAGIC + b"{}")
    (state.session.folder / "log.dat").write_text("0 1 2\n")
    (state.session.folder / "folder.csv").mkdir()
    assert state.files() == ["a.csv", "b.csv", "log.dat"]


def test_a_map_that_was_saved_can_be_corrected(state: DataState) -> None:
    """It went out of the page when a column that it names was not there, and only an editor brought it back."""
    assert state.map_text() == ""
    text = '[time]\ncolumn = "time"\nunit = "s"\n[axis.X]\ncommand = "command"\nposition = "ch9"\n'
    state.keep_map(text)
    described = state.describe()
    assert described.wait(PATIENCE) and state.description is not None and not state.description.usable
    assert state.map_text() == text
    state.choices.set("map", "another.toml")
    assert state.map_text() == ""


def test_what_is_missing_is_said_at_once(state: DataState) -> None:
    with pytest.raises(InputError, match="fit first"):
        state.write_model()
    with pytest.raises(InputError, match="other data"):
        state.validate()
    state.choices.set("file", "")
    with pytest.raises(InputError, match="name a file with logged data"):
        state.describe()


def test_an_unreadable_file_is_the_task_s_error(state: DataState) -> None:
    shutil.copyfile(state.session.folder / "a.csv", state.session.folder / "c.mat")
    state.choices.set("file", "c.mat")
    task = state.describe()
    assert task.wait(PATIENCE) and isinstance(task.error, InputError)


def test_a_wrong_map_is_refused_and_the_old_one_stays(state: DataState) -> None:
    with pytest.raises(InputError):
        state.keep_map("colour = 3\n")
    assert not (state.session.folder / "a.csv.map.toml").exists()
