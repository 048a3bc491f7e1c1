"""Describe, fit and validate in a sitting, on logs of our own modules."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.nc.compiled_file import MAGIC
from rds.panels.data.state import DataDesk
from rds.panels.session import Session

PATIENCE = 120  # s


@pytest.fixture
def desk(tmp_path: Path) -> DataDesk:
    """A folder with a log of X in CSV, made by the exact model."""
    import rds

    for name, frequency in (("a.csv", 0.7), ("b.csv", 0.9)):
        signal = rds.sinusoid(4.0, frequency)
        run = rds.Experiment(axis="X", duration=4.0, sample_period=0.002, signal=signal).run()
        rows = np.column_stack([run["time"], run["X_voltage"], run["X_measured"]])
        header = "time [s],command [V],position [mm]"
        np.savetxt(tmp_path / name, rows, delimiter=",", header=header, comments="", fmt="%.9g")
    desk = DataDesk(Session(tmp_path))
    desk.choices.set("file", "a.csv")
    return desk


def test_from_a_log_to_a_validated_model_file(desk: DataDesk) -> None:
    assert desk.files() == ["a.csv", "b.csv"]
    described = desk.describe()
    assert described.wait(PATIENCE) and described.error is None
    assert desk.description is not None and desk.description.usable
    fitted = desk.fit()
    assert fitted.wait(PATIENCE) and fitted.error is None
    assert desk.estimate is not None
    assert desk.estimate.parameters["K"].value == pytest.approx(1.764, rel=0.01)
    path = desk.write_model()
    assert path.read_text().count("tau")
    desk.choices.set("validation_file", "b.csv")
    validated = desk.validate()
    assert validated.wait(PATIENCE) and validated.error is None
    assert desk.validation is not None and "fit 99" in str(desk.validation)
    again = desk.fit()
    assert again.wait(PATIENCE) and again.error is None
    for use in (desk.validate, desk.model_to_use):  # which would take the model of the first fit
        with pytest.raises(InputError, match=r"fitted\.toml is from before the last fit; Save model"):
            use()
    desk.choices.set("model", "second.toml")
    assert desk.model_to_use() == path.with_name("second.toml") and path.with_name("second.toml").is_file()
    desk.choices.set("model", "fitted.toml")  # named by hand now
    assert desk.model_to_use() == path


def test_what_a_run_has_made_of_a_part_program_is_no_log(desk: DataDesk) -> None:
    (desk.session.folder / "part.dat").write_bytes(MAGIC + b"{}")
    (desk.session.folder / "log.dat").write_text("0 1 2\n")
    (desk.session.folder / "folder.csv").mkdir()
    assert desk.files() == ["a.csv", "b.csv", "log.dat"]


def test_what_is_missing_is_said_at_once(desk: DataDesk) -> None:
    with pytest.raises(InputError, match="fit first"):
        desk.write_model()
    with pytest.raises(InputError, match="other data"):
        desk.validate()
    desk.choices.set("file", "")
    with pytest.raises(InputError, match="name a file with logged data"):
        desk.describe()


def test_an_unreadable_file_is_the_task_s_error(desk: DataDesk) -> None:
    shutil.copyfile(desk.session.folder / "a.csv", desk.session.folder / "c.mat")
    desk.choices.set("file", "c.mat")
    task = desk.describe()
    assert task.wait(PATIENCE) and isinstance(task.error, InputError)


def test_a_wrong_map_is_refused_and_the_old_one_stays(desk: DataDesk) -> None:
    with pytest.raises(InputError):
        desk.keep_map("colour = 3\n")
    assert not (desk.session.folder / "a.csv.map.toml").exists()
