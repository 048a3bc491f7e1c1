"""A part program on the machines that are shipped: in simulation on each, and behind the bus where that is its own.

All of them in all modes are in benchmarks/README.md: each real-time run takes seconds to get ready.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from lost_machines import unless_lost

from rds.machines import load_machine, machine_names
from rds.nc.run.run import PartProgram

FIVE = (
    "G21 G90 G94 G64 P0.05\nG43.4\nG0 X0 Y0 Z2\nG1 X1 Y0 Z2 F900\nG1 X1 Y1 {tilt}2 C4\nG1 X0 Y0 {tilt}0 C0\nG49\nM2\n"
)
TILTS = {"xyzac": "A", "xyzbc": "B"}
DIALECTS = {"mrmt-oacs": "oacs", "starmill": "dcs"}


def part(folder: Path, name: str) -> PartProgram:
    """Some way of every axis and back, or the tip of a tool along a square while the table turns."""
    if name in TILTS:
        text = FIVE.format(tilt=TILTS[name])
    else:
        axes = [axis for axis in load_machine(name).axes.values() if axis.unit != "rev/min" and axis.limits]
        there = " ".join(f"{axis.name}{min(0.5, axis.travel[1]) or -0.5}" for axis in axes)
        back = " ".join(f"{axis.name}0" for axis in axes)
        text = f"G21 G90 G94\nG1 {there} F60\nG1 {back}\nM2\n"
    (folder / "part.ngc").write_text(text)
    bus = f'[bus]\ndialect = "{DIALECTS.get(name, "rds")}"\n'
    (folder / "experiment.toml").write_text(f'machine = "{name}"\nsample_period = 0.01\n{bus}')
    return PartProgram(folder / "part.ngc", experiment=folder / "experiment.toml")


@pytest.mark.parametrize("name", machine_names())
def test_a_program_on_every_machine(name: str, tmp_path: Path) -> None:
    program = part(tmp_path, name)
    result = program.run()
    assert result.meta["ending"] == "done"
    for axis in program.prepared.program.axes:
        assert np.ptp(result[f"{axis}_measured"]) > 0.3
    assert result["contour_error"].max() < 0.2


@pytest.mark.realtime
@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("name", ["xyzac", "mrmt-oacs"])
def test_a_program_behind_the_bus(name: str, tmp_path: Path) -> None:
    """Five axes for the tip of the tool; and modules of 12 V, which is more than a frame's own 10."""
    program = part(tmp_path, name)
    simulated = program.run()
    modes = ("emulation", "implementation") if name == "xyzac" else ("implementation",)
    *emulated, made = (unless_lost(partial(program.run, mode, out=tmp_path / mode)) for mode in modes)
    assert made.meta["ending"] == "done"
    for axis in program.prepared.program.axes:
        for each in emulated:
            assert np.array_equal(each[f"{axis}_measured"], simulated[f"{axis}_measured"])
        end = min(len(made), len(simulated))
        off = made[f"{axis}_measured"][:end] - simulated[f"{axis}_measured"][:end]
        assert np.abs(off).max() < 0.3
