"""A parameter that the data do not tell is shown as a guess wherever its value goes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.identification.fit.design import write_tracking
from rds.identification.fit.estimate import Estimate, guesses
from rds.identification.fit.estimate_json import parameter_rows
from rds.identification.fit.fit import fit
from rds.identification.fit.fit_report import fragment
from rds.identification.fit.made_estimate import made_estimate
from rds.identification.fit.model_file import read_model, write_model
from rds.identification.fit.run_model import check_model_file
from rds.identification.logs.log import Log
from rds.identification.structures.axis_structure import make
from rds.identification.validate.report import _parameters
from rds.identification.validate.validate import validate
from tests.identification.fit_logs import mini_cnc

SAID = "not determined by the data that were fitted: friction_minus = "


def forward(seed: int, low: float) -> Log:
    """2 s of the X axis that never moves backward, under voltages from `low` V to `low` + 5 V."""
    values, t = mini_cnc("X"), np.arange(2000) * 1e-3
    u = low + 2.5 * (1.0 - np.cos(2.0 * np.pi * (1.0 + 0.3 * seed) * t))
    y = make().respond(t, u, (0.0, 0.0), values)
    draw = np.random.default_rng(seed)
    return Log(f"forward-{seed}", t, u, y + 0.002 * draw.standard_normal(len(t)), units={"position": "mm"})


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    return fit([forward(1, 0.5)], make())


def test_the_fit_says_it(estimate: Estimate) -> None:
    assert guesses(estimate.parameters) == ["friction_minus"]
    (said,) = [sentence for sentence in estimate.warnings if sentence.startswith(SAID)]
    assert said.endswith("; its value is assumed") and not estimate.unusable()
    rows = {row[0]: row for row in parameter_rows(estimate)[1]}
    assert "assumed" in rows["friction_minus"][1] and rows["friction_minus"][2:4] == [
        "–",
        "not determined by these data",
    ]
    assert "not determined by these data" in fragment(estimate) and "inf" not in fragment(estimate)
    parameters = estimate.to_json()["parameters"]
    assert isinstance(parameters["friction_minus"]["value"], float)
    assert all(parameters["friction_minus"][key] is None for key in ("std_error", "low", "high"))
    assert "assumed" not in rows["K"][1] and parameters["K"]["std_error"] > 0.0


def test_a_held_parameter_has_no_interval_of_no_width() -> None:
    found = fit([forward(1, 0.5)], make(), options={"fixed": {"tau": 0.01}})
    assert parameter_rows(found)[1][0] == ["tau", "0.01", "–", "held", "s"]


def test_the_model_file_and_who_reads_it_say_it(estimate: Estimate, tmp_path: Path) -> None:
    path = write_model(tmp_path / "x.toml", estimate)
    file = read_model(path)
    assert guesses(file.parameters) == ["friction_minus"] and any(SAID in sentence for sentence in file.warnings)
    assert any(SAID in sentence for sentence in file.doubts())
    assert any(SAID in note for note in check_model_file(path).reports[0].notes)
    assert SAID in write_tracking(tmp_path / "law.py", path).read_text(encoding="utf-8")
    for args in (
        ["design", "tracking", str(path), "-o", str(tmp_path / "c.py")],
        ["machine", "from", str(path), "--axis", "X", "-o", str(tmp_path / "m.toml")],
    ):
        done = CliRunner().invoke(app, args)
        assert done.exit_code == 0 and SAID in done.stderr


def test_a_covariance_that_rounding_left_uneven_can_be_read_back(estimate: Estimate, tmp_path: Path) -> None:
    covariance = np.diag([1e-5, 1.7, 1.1, 0.9])
    covariance[0, 1], covariance[1, 0] = 0.0061701118, 0.0061701060
    log = forward(1, 0.5)
    made = made_estimate(make(), "simulation", [log], mini_cnc("X"), covariance, 100.0, states=[(0.0, 0.0)])
    read = read_model(write_model(tmp_path / "x.toml", made)).covariance
    assert (read == read.T).all() and read[0, 1] == pytest.approx(0.0061701089)


def test_validation_says_it_of_a_model_that_holds_otherwise(estimate: Estimate) -> None:
    found = validate(estimate, forward(2, 0.4))
    assert str(found.verdict.word) == "valid for"
    assert "Do not take its friction_minus for the axis's own" in found.verdict.sentence
    assert any(reason.kind == "guess" and SAID in reason.what for reason in found.verdict.reasons)
    page = _parameters(found)
    assert "friction_minus (assumed: not determined by the fit" in page and "K (assumed" not in page
