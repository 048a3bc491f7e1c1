"""The examples keep their interfaces and run, in every mode that they name."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from documents import ROOT, shorten

import rds
from rds.checks import check_file

EXAMPLES = ROOT / "examples"
RUNS = (
    ("experiment.toml", "simulation"),
    ("experiment.toml", "implementation"),
    ("three_axes.toml", "simulation"),
    ("three_axes.toml", "emulation"),
    ("contour.toml", "simulation"),
    ("my_path.toml", "simulation"),
    ("speed_step.toml", "simulation"),
    ("speed_ramps.toml", "simulation"),
    ("system_test.toml", "simulation"),
    ("system_test.toml", "system-test"),
    ("system_test.toml", "model-validation"),
)


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.py")), ids=lambda file: file.name)
def test_it_keeps_its_interface(file: Path) -> None:
    report = check_file(file, 0.001, coupled=file.name == "cross_coupled.py")
    assert report.ok, str(report)


def test_every_example_is_run() -> None:
    assert {name for name, _ in RUNS} == {file.name for file in EXAMPLES.glob("*.toml")}


@pytest.mark.parametrize("file, mode", RUNS)
def test_it_runs(file: str, mode: str, alone: Path) -> None:
    folder = alone / "examples"
    shutil.copytree(EXAMPLES, folder)
    if file not in ("contour.toml", "my_path.toml"):  # a path says itself how long it lasts
        shorten(folder / file, 0.5)
    rds.Experiment.from_toml(folder / file).run(mode, out="out")
    result = rds.open_result("out")
    assert result.mode == mode and result.meta["ending"] == "done"
    assert result["time"][-1] > 0.45  # the last periods may have been discarded


def test_the_first_controller_tracks() -> None:
    result = rds.Experiment.from_toml(EXAMPLES / "experiment.toml").run("simulation")
    assert result.metrics["X"]["rms_error"] == pytest.approx(0.00777, rel=0.01)  # mm


def test_the_circle_starts_where_the_axes_stand() -> None:
    result = rds.Experiment.from_toml(EXAMPLES / "three_axes.toml").run("simulation")
    for axis in result.axes:
        assert result[f"{axis}_reference"][0] == pytest.approx(0.0, abs=1e-9)
    radius = (result["X_reference"] ** 2 + (result["Y_reference"] + 5.0) ** 2) ** 0.5
    assert radius == pytest.approx(5.0, abs=1e-9)
