"""Machines put together by hand of modules of the library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.machines.by_hand import machine_of_modules, text_of_modules, verdict_of_modules
from rds.nc.run.run import PartProgram

MILL = ["milling-head", "slide-z", "column", "bed", "slide-y", "slide-x", "work-table"]


def test_the_mill_of_the_paper_by_hand_moves_as_the_one_that_is_shipped() -> None:
    made, shipped = machine_of_modules(MILL), load_machine("mrm-mill")
    assert made.kinematics.joints == shipped.kinematics.joints == ("X", "Y", "Z")
    q = shipped.kinematics.random(20, seed=1)
    assert made.kinematics.forward(q) == pytest.approx(shipped.kinematics.forward(q), abs=1e-9)


def test_the_thesiss_machine_by_hand_moves_as_the_one_that_is_shipped() -> None:
    made = machine_of_modules(["oacs-drill", "oacs-range-arm", "oacs-z", "oacs-x", "oacs-a"])
    shipped = load_machine("mrmt-oacs")
    q = made.kinematics.random(20, seed=1)
    columns = [made.kinematics.joints.index({"A": "C"}.get(name, name)) for name in shipped.kinematics.joints]
    assert made.kinematics.forward(q) == pytest.approx(shipped.kinematics.forward(q[:, columns]), abs=1e-9)


@pytest.mark.parametrize(
    ("order", "says"),
    [
        ([], "no module is named"),
        (["bed"], "nothing would move"),
        (["milling-head"], "nothing would move"),
        (["oacs-drill", "oacs-x"], "does not fit on 'oacs-x'"),
        ([*MILL[:-1], "work-table", "slide-x"], "which carries no module"),
        (["slide-z", *MILL[2:]], "mount a cutting head on it"),
        (["sledge"], "there is no module 'sledge'"),
    ],
)
def test_what_makes_no_machine_says_why(order: list[str], says: str) -> None:
    assert says in str(verdict_of_modules(order))
    with pytest.raises(InputError, match="these modules make no machine in this order"):
        text_of_modules(order, "made")


def test_the_command_writes_a_machine_that_runs(tmp_path: Path) -> None:
    out = tmp_path / "own.toml"
    told = CliRunner().invoke(app, ["machine", "new", "--modules", ",".join(MILL), "-o", str(out)])
    assert told.exit_code == 0 and "own: a machine" in told.stdout
    (tmp_path / "part.ngc").write_text("G21 G90 G94\nG1 X2 Y1 Z-1 F200\nM2\n")
    result = PartProgram(tmp_path / "part.ngc", str(out)).run()
    assert [result[f"{axis}_measured"][-1] for axis in "XYZ"] == pytest.approx([2.0, 1.0, -1.0], abs=0.02)
    assert np.isfinite(result["contour_error"]).all()
