"""The papers' machines, built anew by script and from what their modules say, run programs at once."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rds.bus.modules.oacs.module_data import read_modules
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.machines.assembly import judged, machine_text, order_of
from rds.machines.ncc import machine_text_of_script, read_script, script_of
from rds.machines.power import power_budget
from rds.nc.run.run import PartProgram

ORDERS = {
    "mrm-mill": [5, 4, "column", "bed", 3, 2, "work-table"],
    "mrm-mill-4": [6, 4, "column", "bed", 3, 2, 5, "vice"],
    "mrm-lathe": [5, 2, 3, 4],
    "mrmt-oacs": [5, "oacs-range-arm", 2, 4, 3],
}


def described(name: str) -> dict[int, dict[str, Any]]:
    """What the modules of a machine say of themselves, without a bus."""
    found = {}
    for data in read_modules(load_machine(name)).values():
        told = data.describe(1)
        found[data.node] = asdict(told) | {"kind": told.kind.name.lower(), "unit": told.unit}
    return found


def run_on(machine: Path, folder: Path) -> None:
    axes = [axis for axis in load_machine(str(machine)).axes.values() if not axis.is_spindle]
    there = {axis.name: min(0.2, axis.travel[1]) or -0.2 for axis in axes}
    words = " ".join(f"{name}{value}" for name, value in there.items())
    (folder / "part.ngc").write_text(f"G21 G90 G94\nG1 {words} F60\nM2\n")
    result = PartProgram(folder / "part.ngc", str(machine)).run()
    assert result.meta["ending"] == "done"
    assert [result[f"{name}_measured"][-1] for name in there] == pytest.approx(list(there.values()), abs=0.06)


@pytest.mark.parametrize("name", ORDERS)
def test_a_machine_from_what_its_modules_say(name: str, tmp_path: Path) -> None:
    data, own, path = described(name), load_machine(name), tmp_path / "mine.toml"
    assert order_of(own, data) == ORDERS[name]
    assert judged(ORDERS[name], data).ok
    path.write_text(machine_text("mine", ORDERS[name], data))
    assert path.read_text().count(f" are from {name}") == len(own.axes)
    made = load_machine(str(path))
    nodes = [own.axes[joint].node for joint in own.kinematics.joints]
    columns = [nodes.index(made.axes[joint].node) for joint in made.kinematics.joints]
    q = own.kinematics.random(20)
    poses, theirs = own.kinematics.forward(q), made.kinematics.forward(q[:, columns])
    away = np.linalg.inv(poses) @ theirs  # tool and work's zero are where the modules end: the same at all poses
    if "work-table" in ORDERS[name] or own.tool is None:
        np.testing.assert_allclose(away, away[:1].repeat(20, axis=0), atol=1e-4)
    run_on(path, tmp_path)


def test_the_power_budget_goes_on_after_a_reconfiguration(tmp_path: Path) -> None:
    own, data, path = load_machine("mrmt-oacs"), described("mrmt-oacs"), tmp_path / "two.toml"
    path.write_text(machine_text("two", [5, "oacs-range-arm", 2], data, own))
    two = power_budget(load_machine(str(path)))
    assert (two.voltage, two.current, two.unknown) == (12.0, 29.0, ())
    assert two.peak == pytest.approx(6.2 + 3.9)  # A, of Z and the drill
    path.write_text(machine_text_of_script(read_script(script_of(own.kinematics)), "scripted", own))
    assert load_machine(str(path)).power == own.power


def test_a_module_that_left_leaves_the_order_of_the_others() -> None:
    data, own = described("mrm-mill-4"), load_machine("mrm-mill-4")
    del data[5]
    assert order_of(own, data) == [6, 4, "column", "bed", 3, 2, "vice"]
    assert order_of(own, data | {9: data[2]}) is None, "a module that the machine does not have"


def test_modules_that_nobody_knows_get_chosen_motion_within_their_speeds(tmp_path: Path) -> None:
    data = {number: each | {"type_text": f"Own{number}"} for number, each in described("mrm-mill").items()}
    path = tmp_path / "mine.toml"
    path.write_text(machine_text("mine", ORDERS["mrm-mill"], data))
    assert "those of X are chosen" in path.read_text()
    limits = load_machine(str(path)).axes["X"].limits
    assert limits is not None and limits.velocity == pytest.approx(1476.0 / 60.0)
    run_on(path, tmp_path)


@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("like", [False, True])
def test_a_machine_from_its_script(name: str, like: bool, tmp_path: Path) -> None:
    own, path = load_machine(name), tmp_path / "own.toml"
    path.write_text(machine_text_of_script(read_script(script_of(own.kinematics)), "own", own if like else None))
    made = load_machine(str(path))
    assert ({axis.name for axis in own.axes.values()} <= set(made.axes)) == (like and name != "mrmt-oacs")
    run_on(path, tmp_path)


def test_limits_of_a_script_are_virtual_on_the_machine_that_it_reconfigures() -> None:
    own = load_machine("mrm-mill")
    script = script_of(own.kinematics).replace("RF02 LN6 UP100", "RF02 LN6 UP5")
    text = machine_text_of_script(read_script(script), "own", own)
    assert "travel = [-100.0, 100.0]" in text and "limits = [-100.0, 5.0]" in text
    far = replace(own, axes=own.axes | {"X": replace(own.axes["X"], travel=(200.0, 300.0))})
    with pytest.raises(InputError, match="limits of LN6 are outside the travel of X, 200 to 300; mend RF02"):
        machine_text_of_script(read_script(script), "own", far)
