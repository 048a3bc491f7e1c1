"""Assembly errors from measured positions of the tool's tip: found, written as RF03, and taken out of the motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.machines.calibration import calibrate
from rds.machines.ncc import machine_of_script, read_script, script_of

MILL = load_machine("mrm-mill")
NOISE = 0.002  # mm
CROOKED = machine_of_script(
    read_script(
        script_of(MILL.kinematics).replace(
            "BUILD", "RF03 LN1 XA0 YA0 ZA0 X0.2 Y0 Z-0.5\nRF03 LN6 XA0 YA0.1 ZA0.3 X0 Y0 Z0\nBUILD"
        )
    )
).kinematics
NAMES = list(CROOKED.joints)  # in the same order of the mill's X, Y, Z


def tips(joints: np.ndarray) -> np.ndarray:
    """Where the crooked machine has its tip at the mill's joint values."""
    mine = [MILL.kinematics.joints.index(name) for name in NAMES]
    return np.asarray(CROOKED.forward(joints[:, mine])[:, :3, 3])


@pytest.fixture(scope="module")
def readings() -> tuple[np.ndarray, np.ndarray]:
    joints = MILL.kinematics.random(40, seed=3)
    return joints, tips(joints) + np.random.default_rng(4).normal(0.0, NOISE, (40, 3))


def test_the_errors_of_links_that_are_named_are_those_that_were_put_in(readings) -> None:
    joints, measured = readings
    found = calibrate(MILL, joints, dict(zip("xyz", measured.T, strict=True)), [1, 6])
    np.testing.assert_allclose(found.errors[6][:3], [0.0, 0.1, 0.3], atol=0.005)
    both = np.add(found.errors[1][3:], found.errors[6][3:])  # a shift of one looks like that of the other
    np.testing.assert_allclose(both, [0.2, 0.0, -0.5], atol=0.01)
    assert np.linalg.norm(found.before, axis=1).max() > 0.5
    assert np.sqrt(np.mean(found.after**2)) == pytest.approx(NOISE, rel=0.2)


def test_all_links_together_bring_the_tip_where_it_is_anywhere(readings) -> None:
    joints, measured = readings
    found = calibrate(MILL, joints, dict(zip("xyz", measured.T, strict=True)))
    assert found.determined < found.unknown == 42
    script = script_of(MILL.kinematics).replace("BUILD\n", found.script())
    told = machine_of_script(read_script(script)).kinematics
    elsewhere = MILL.kinematics.random(100, seed=9)
    mine = [MILL.kinematics.joints.index(name) for name in told.joints]
    off = told.forward(elsewhere[:, mine])[:, :3, 3] - tips(elsewhere)
    assert np.linalg.norm(off, axis=1).max() < 1.5 * NOISE


def test_too_few_readings_and_links_that_there_are_not(readings) -> None:
    joints, measured = readings
    few = {"z": measured[:2, 2]}
    with pytest.raises(InputError, match="2 readings of 1 coordinates do not tell 2 errors from noise"):
        calibrate(MILL, joints[:2], few)
    with pytest.raises(InputError, match=r"no link LN9 \(LN1 to LN7\); `rds machine script mrm-mill` lists them"):
        calibrate(MILL, joints, few, [9])


def test_the_command_writes_what_a_program_takes(readings, tmp_path: Path) -> None:
    joints, measured = readings
    table = tmp_path / "tips.csv"
    heading = ",".join([*(f"{name} [mm]" for name in MILL.kinematics.joints), "tip_x [mm]", "tip_y [mm]", "tip_z [mm]"])
    np.savetxt(table, np.column_stack([joints, measured]), delimiter=",", header=heading, comments="", fmt="%.6f")
    out = tmp_path / "errors.ncc"
    words = ["machine", "calibrate", "mrm-mill", str(table), "--link", "LN1", "--link", "LN6", "-o", str(out)]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.output
    read = read_script(out.read_text())
    assert [which for _, which, _ in read.changes] == [3, 3] and read.built and not told.stderr
    exchanged = tmp_path / "exchanged.csv"
    exchanged.write_text(table.read_text().replace("tip_x", "tip_q").replace("tip_y", "tip_x").replace("_q", "_y"))
    told = CliRunner().invoke(app, [*words[:3], str(exchanged)])
    assert told.exit_code == 0 and "see whether columns are exchanged" in told.stderr
    table.write_text(table.read_text().replace("tip_z", "height", 1))
    told = CliRunner().invoke(app, [*words, "--force"])
    assert told.exit_code == 2 and "column 'height' is neither joint nor tip" in " ".join(told.output.split())
