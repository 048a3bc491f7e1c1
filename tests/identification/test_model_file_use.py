"""What a model file is for: a check, a controller in one call, a machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import rds
from rds.checks import check_file
from rds.cli.main import app
from rds.core.errors import InputError
from rds.core.load import load_student
from rds.identification.fit.design import (
    design_tracking,
    linear_axis_of,
    linear_axis_of_machine,
    tracking_system,
    write_tracking,
)
from rds.identification.fit.machine_file import write_machine
from rds.machines import load_machine
from tests.identification.model_files import X, write_made

FULL = X | {"stribeck": 0.1, "stribeck_velocity": 0.8, "delay": 0.0017, "backlash": 0.003}
OPTIONS = ("stribeck", "delay", "backlash")


def tracked(controller: Any, model: str, **more: Any) -> rds.Result:
    given: dict[str, Any] = {"axis": "X", "duration": 0.6, "reference": rds.sinusoid(3.0, 2.0)}
    return rds.Experiment(controller=controller, model=model, **(given | more)).run()


def test_the_design_is_the_library_s_and_the_file_s_to_the_bit(tmp_path: Path) -> None:
    model = str(write_made(tmp_path / "x.toml", FULL | {"tau": 0.012}, OPTIONS))
    own = write_tracking(tmp_path / "own.py", model)
    designed = tracked(design_tracking(model), model)["X_command"]
    assert np.array_equal(designed, tracked("tracking", model)["X_command"])
    assert np.array_equal(designed, tracked(str(own), model)["X_command"])
    assert check_file(own).ok and np.abs(designed).max() > 1.0


def test_the_design_tracks_the_axis_that_it_was_made_for(tmp_path: Path) -> None:
    model = str(write_made(tmp_path / "x.toml", X | {"friction_plus": 0.0, "friction_minus": 0.0, "K": 3.1}))
    slow = {"reference": rds.sinusoid(1.0, 2.0), "interface": {"quantization": False, "saturation": False}}
    exact = tracked(design_tracking(model), model, **slow)
    assert exact.metrics["X"]["max_abs_error"] < 0.01  # of 12.6 mm/s half a sample is 0.0063 mm
    other = tracked(rds.Experiment(axis="X", **slow, controller="tracking").plan().axes[0].controller, model, **slow)
    assert other.metrics["X"]["max_abs_error"] > 10.0 * exact.metrics["X"]["max_abs_error"]


def test_periods_poles_and_limits_are_taken(tmp_path: Path) -> None:
    model = write_made(tmp_path / "x.toml", X)
    made = design_tracking(model, sample_period=0.002, poles=[-40.0, -50.0], observer_pole=-200.0, voltage_range=5.0)
    assert made.params["g1"] == pytest.approx(2000.0) and made.params["coefficients"][-1] == 5.0
    text = write_tracking(tmp_path / "own.py", model, sample_period=0.002, voltage_range=5.0).read_text()
    assert "sampled every 0.002 s" in text and '"limit": 5.0' in text


@pytest.mark.parametrize("limit", [np.inf, np.float64(5.0)])
def test_the_file_is_python_whatever_numbers_it_was_made_with(tmp_path: Path, limit: float) -> None:
    axis = linear_axis_of_machine(load_machine("mini-cnc"), "X")
    own = write_tracking(tmp_path / "own.py", axis, sample_period=np.float64(0.002), voltage_range=limit)
    assert load_student(own).controller().params["limit"] == limit


def test_a_law_for_an_axis_that_turns_is_in_degrees(tmp_path: Path) -> None:
    axis = linear_axis_of_machine(load_machine("mrm-lathe"), "C")
    text = write_tracking(tmp_path / "own.py", axis).read_text()
    assert "(deg/s)/V" in text and "mm" not in text


def test_viscous_friction_is_part_of_the_design_and_the_rest_is_named(tmp_path: Path) -> None:
    from tests.identification import model_files

    units = model_files.UNITS | {"viscous": ""}
    file = write_made(tmp_path / "x.toml", FULL | {"viscous": 0.25}, ("viscous", *OPTIONS), units=units)
    axis = linear_axis_of(file)
    assert (axis.tau, axis.K) == (pytest.approx(X["tau"] / 1.25), pytest.approx(X["K"] / 1.25))
    assert [sentence.split()[0] for sentence in axis.left_out] == ["Coulomb", "Stribeck", "play:", "the"]


def test_as_a_system_of_python_control(tmp_path: Path) -> None:
    system = tracking_system(write_made(tmp_path / "x.toml", X), sample_period=0.001)
    assert system.dt == 0.001 and system.noutputs == 1 and system.ninputs == 4


def test_what_cannot_be_tracked_with_is_said(tmp_path: Path) -> None:
    spindle = {"tau": 0.08, "K": 1000.0}
    units = {"tau": "s", "K": "(rev/min)/V"}
    file = write_made(tmp_path / "s.toml", spindle, structure="spindle", units=units)
    with pytest.raises(InputError, match=r"s\.toml: a spindle has its speed measured"):
        design_tracking(file)
    own = tmp_path / "own.py"
    own.write_text('params = {"mass": 1.0}\ndef derivatives(t, x, u, params):\n    return [x[1], u[0]]\n')
    with pytest.raises(InputError, match="needs tau"):
        design_tracking(write_made(tmp_path / "o.toml", {"mass": 1.0}, structure=str(own), units={"mass": "kg"}))
    with pytest.raises(InputError, match=r"ends in \.py"):
        write_tracking(tmp_path / "c.toml", file)


def test_a_machine_with_the_estimated_axis(tmp_path: Path) -> None:
    model = write_made(tmp_path / "x.toml", FULL, OPTIONS)
    machine, base = (
        load_machine(str(write_machine(tmp_path / "m.toml", model, "mini-cnc", "X").path)),
        load_machine("mini-cnc"),
    )
    assert machine.axis("X").model == {"name": "machine-axis", **FULL} and machine.axis("X").machine == FULL
    assert machine.axis("Y") == base.axis("Y") and machine.axis("X").limits == base.axis("X").limits
    run = {"machine": str(tmp_path / "m.toml"), "controller": "tracking"}
    of_machine = rds.Experiment(axis="X", duration=0.2, reference=rds.sinusoid(3.0, 2.0), **run).run()
    assert np.array_equal(of_machine["X_measured"], tracked("tracking", str(model), duration=0.2)["X_measured"])


@pytest.mark.parametrize(("axis", "said"), [("Q", "has no axis 'Q'"), ("spindle", "this axis is measured in rev/min")])
def test_machines_that_do_not_fit_are_refused(tmp_path: Path, axis: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        write_machine(tmp_path / "m.toml", write_made(tmp_path / "x.toml", X), "mini-cnc", axis)
    assert not (tmp_path / "m.toml").exists()


def test_the_commands(tmp_path: Path) -> None:
    runner, model = CliRunner(), str(write_made(tmp_path / "x.toml", FULL, OPTIONS))

    def said(*words: str, code: int = 0) -> str:
        done = runner.invoke(app, [*words])
        assert done.exit_code == code, done.output
        return done.output

    assert "x.toml: the model keeps its interface" in said("check", model)
    assert "not in the design: play" in said("design", "tracking", model, "-o", str(tmp_path / "c.py"))
    assert "keeps its interface" in said("check", str(tmp_path / "c.py"))
    machine = str(tmp_path / "m.toml")
    assert "axis X as in" in said("machine", "from", model, "--axis", "X", "-o", machine)
    wrong = ["design", "tracking", model, "-o", str(tmp_path / "d.py"), "--poles"]
    assert "must be two poles" in said(*wrong, "a,b", code=2) and "not stable" in said(*wrong, "4,-5", code=2)
    endless = said("design", "tracking", model, "-o", str(tmp_path / "d.py"), "--voltage-range", "inf", code=2)
    assert "--voltage-range = inf V must be a finite number" in endless
    assert not (tmp_path / "d.py").exists()
    (tmp_path / "bad.toml").write_text("x = [")
    assert "not valid TOML" in said("check", str(tmp_path / "bad.toml"), code=2)
