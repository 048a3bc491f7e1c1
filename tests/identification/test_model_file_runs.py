"""Model files in experiments: every mode takes them, and they move as the library's models with the same numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rds
from rds.core.errors import InputError
from rds.identification.fit.design import linear_axis_of
from rds.identification.fit.machine_file import write_machine
from rds.identification.fit.model_file import read_model
from rds.identification.fit.run_model import check_model_file, run_model
from rds.identification.structures.structures import structure
from rds.machines import load_machine
from tests.identification.model_files import UNITS, X, write_made

FULL = X | {"stribeck": 0.1, "stribeck_velocity": 0.8, "delay": 0.0017, "backlash": 0.003, "dead_zone": 0.1}
MASS_UNITS = {
    "M": "kg",
    "F_v_plus": "N·s/m",
    "F_v_minus": "N·s/m",
    "F_c_plus": "N",
    "F_c_minus": "N",
    "force_gain": "N/V",
}
OPTIONS = ("stribeck", "dead-zone", "delay", "backlash")
TRACKED: dict[str, Any] = {
    "axis": "X",
    "duration": 0.4,
    "reference": rds.sinusoid(2.0, 2.0),
    "controller": {"name": "tracking", "gains": [1600.0, -36.6]},
}


def measured(model: Any, **more: Any) -> np.ndarray:
    return rds.Experiment(model=model, **(TRACKED | more)).run()["X_measured"]


def test_a_plain_axis_is_the_linear_axis_compiled_or_not(tmp_path: Path) -> None:
    file = str(write_made(tmp_path / "x.toml", X))
    wanted = measured({"name": "linear-axis", **X})
    assert np.array_equal(measured(file), wanted)
    result = rds.Experiment(model=file, compiled=True, **TRACKED).run()
    assert not any("compiled" in note for note in result.meta["notes"])
    assert np.array_equal(result["X_measured"], wanted)
    fitted = result.meta["model"]["X"]["fitted"]
    assert fitted["sha256"] == read_model(file).sha256 and fitted["path"] == file


def test_an_axis_with_options_is_the_machine_s_own(tmp_path: Path) -> None:
    file = str(write_made(tmp_path / "x.toml", FULL, OPTIONS))
    assert np.array_equal(measured(file), measured({"name": "machine-axis", **FULL}))


def test_the_controller_is_designed_for_the_fitted_axis(tmp_path: Path) -> None:
    file = str(write_made(tmp_path / "x.toml", X | {"tau": 0.02, "K": 3.0}))
    plan = rds.Experiment(model=file, **(TRACKED | {"controller": "pid"})).plan()
    controller = plan.axes[0].controller
    assert controller is not None and controller.params["FF1"] == 1.0 / 3.0


def test_a_friction_the_same_both_ways_with_an_offset(tmp_path: Path) -> None:
    values = {"tau": 0.01, "K": 2.0, "friction": 0.4, "offset": 0.05}
    model = run_model(read_model(write_made(tmp_path / "x.toml", values, ("offset",))))
    assert model.params["friction_plus"] == pytest.approx(0.3)
    assert model.params["friction_minus"] == pytest.approx(-0.5)
    model = run_model(read_model(write_made(tmp_path / "y.toml", values | {"offset": 0.5}, ("offset",))))
    assert (model.params["offset"], model.params["friction_minus"]) == (0.5, -0.4)  # it creeps: no plain axis does


def test_a_spindle_runs_with_the_offset_and_dead_time_that_were_fitted(tmp_path: Path) -> None:
    values = {"tau": 0.08, "K": 1000.0, "offset": -0.04, "delay": 0.0021}
    units = {"tau": "s", "K": "(rev/min)/V", "offset": "V", "delay": "s"}
    file = write_made(tmp_path / "s.toml", values, ("offset", "delay"), structure="spindle", units=units)
    assert check_model_file(file).ok
    run = rds.Experiment(axis="spindle", duration=0.4, signal=rds.square(3.0, 2.0), model=str(file), mode="system-test")
    speed = run.run("simulation")["spindle_measured"][249]
    assert speed == pytest.approx(2960.0 * (1.0 - np.exp(-0.2469 / 0.08)), abs=5.0)  # the converter's step is 5 mV
    machine = load_machine(str(write_machine(tmp_path / "m.toml", file, "mini-cnc", "spindle").path))
    assert machine.axis("spindle").machine == values


def test_friction_that_differs_by_direction_runs_as_it_was_fitted(tmp_path: Path) -> None:
    """The structure's own solution, a controller for the mean of both directions, and no machine of it."""
    values = dict(zip(MASS_UNITS, (95.0, 166.0, 240.0, 20.1, 20.6, 35.15), strict=True))
    made = structure("axis-mass", ("per-direction",))
    file = write_made(tmp_path / "m.toml", values, ("per-direction",), structure="axis-mass", units=MASS_UNITS)
    model = run_model(read_model(file))
    t = np.arange(4000) * 1e-3
    u, x, positions = np.round(3.0 * np.sin(7.0 * t) + np.sin(2.0 * t), 2), model.initial_state, []
    for voltage in u.tolist():
        positions.append(x[0])
        x = model.advance(x, voltage, 1e-3, model.params)
    np.testing.assert_allclose(positions, made.respond(t, u, (0.0, 0.0), values), atol=1e-9)
    assert check_model_file(file).ok
    assert model.params["tau"] == pytest.approx(95.0 / 203.0) and model.params["K"] == pytest.approx(35150.0 / 203.0)
    assert any("differs by direction" in sentence for sentence in linear_axis_of(file).left_out)
    write_machine(tmp_path / "machine.toml", file, "mini-cnc", "X")
    assert "viscous_difference" in (tmp_path / "machine.toml").read_text()
    free = write_made(
        tmp_path / "f.toml", values | {"F_v_plus": 0.0}, ("per-direction",), structure="axis-mass", units=MASS_UNITS
    )
    with pytest.raises(InputError, match="F_v_plus and F_v_minus greater than 0"):
        run_model(read_model(free))


STUDENT = """\
params = {"tau": 0.01, "K": 1.0}
def derivatives(t, x, u, params):
    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]
"""


def test_a_student_s_structure_runs_with_what_was_fitted(tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    own.write_text(STUDENT)
    values = {"tau": 0.012, "K": 1.9}
    file = write_made(tmp_path / "x.toml", values, structure=str(own))
    assert np.array_equal(measured(str(file)), measured({"file": str(own), "params": values}))
    own.write_text(STUDENT + "# changed\n")
    with pytest.raises(InputError, match=r"own\.py has changed since it was fitted"):
        measured(str(file))


@pytest.mark.realtime
@pytest.mark.parametrize(("values", "options"), [(X, ()), (FULL, OPTIONS)], ids=["plain", "full"])
def test_emulation_is_the_simulation_bit_for_bit(alone: Path, values: dict[str, float], options: Any) -> None:
    write_made(alone / "x.toml", values, options)
    experiment = rds.Experiment(model="x.toml", **TRACKED)
    simulated, emulated = experiment.run(), experiment.run("emulation")
    for column in ("X_measured", "X_command", "X_voltage"):
        taken = emulated["time"]
        assert np.array_equal(emulated[column], simulated[column][np.rint(taken / 0.001).astype(int)])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[parameters.K]", "[parameters.Q]"), "must be that of"),
        (('unit = "s"', 'unit = "ms"'), "parameters.tau.unit = 'ms' must be 's'"),
        (('structure = "axis"', 'structure = "lathe"'), "no structure 'lathe'"),
        (("options = []", 'options = ["delay"]'), "parameter delay, which is missing"),
        (("value = 0.009943\n", "value = -0.009943\n"), "low"),
    ],
)
def test_what_is_not_the_structure_s_is_refused(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    file = write_made(tmp_path / "x.toml", X)
    file.write_text(file.read_text().replace(*change, 1))
    with pytest.raises(InputError) as caught:
        measured(str(file))
    assert said in str(caught.value) and "x.toml" in str(caught.value)


def test_models_are_for_their_kind_of_axis_and_their_key(tmp_path: Path) -> None:
    file = str(write_made(tmp_path / "x.toml", X))
    with pytest.raises(InputError, match="measured in rev/min"):
        measured(file, axis="spindle", controller="p")
    with pytest.raises(InputError, match="is no controller"):
        measured(None, controller=file)
    with pytest.raises(InputError, match="unknown key 'tau'"):
        measured({"file": file, "tau": 1.0})
    spindle = write_made(tmp_path / "s.toml", {"tau": 0.08, "K": 1000.0}, structure="spindle", units=UNITS)
    with pytest.raises(InputError, match=r"measured in mm|spindle"):
        measured(str(spindle))
