"""A closed loop whose controller is known is simulated with the model: what feedback hides from a free run shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rds
from rds.core.errors import InputError
from rds.core.load import load_student
from rds.core.types import Model
from rds.identification.logs.read_log import read_log
from rds.identification.validate.candidate import as_candidate
from rds.identification.validate.in_loop import in_loop
from rds.identification.validate.own_loop import OwnLoop, own_loop
from rds.identification.validate.validate import validate
from rds.models.student import student_model
from rds.results import Result
from tests.validation.validation_logs import STEP, T, X, candidate, log


def simulate(model: Model) -> Result:
    reference = rds.sinusoid(amplitude=4.0, frequency=0.8)
    controller = {"name": "pid", "Pgain": 20.0}
    return rds.Experiment(axis="X", duration=4.0, reference=reference, controller=controller, model=model).run()


def test_a_model_three_times_off_does_not_hide_in_its_own_loop() -> None:
    run = simulate(rds.library_model("linear-axis", **X))
    data = replace(log(run["X_voltage"], run["X_measured"], closed_loop=True), extra={"reference": run["X_reference"]})
    right, wrong = candidate(), candidate(X | {"tau": 3.0 * X["tau"]})
    assert in_loop(right, data, simulate).rmse < 1e-3
    found = validate(right, data, loop=simulate)
    assert found.verdict.ok and any(r.kind == "loop" and r.side == "for" for r in found.verdict.reasons)
    found = validate(wrong, data, loop=simulate)
    assert not found.verdict.ok
    assert any(r.kind == "loop" and "simulated in the loop itself" in r.what for r in found.verdict.reasons)
    with pytest.raises(InputError, match=r"the experiment has a sample period of 0\.001 s, and the log one of 0\.002"):
        in_loop(right, replace(data, time=2.0 * data.time), simulate)
    with pytest.raises(InputError, match="the experiment has 4000 samples, and the log begins at its sample 5000"):
        in_loop(right, replace(data, first=5000), simulate)


def test_a_model_is_simulated_as_it_was_given(tmp_path: Path) -> None:
    run = simulate(rds.library_model("linear-axis", **X))
    data, given = log(run["X_voltage"], run["X_measured"], closed_loop=True), list[Model]()

    def seen(model: Model) -> Result:
        given.append(model)
        return run

    (tmp_path / "own.py").write_text(
        'params = {"K": 1.0}\ndef derivatives(t, x, u, params):\n    return [x[1], params["K"] * u[0] - x[1]]\n'
    )
    own = student_model(load_student(tmp_path / "own.py"), {"K": 2.0})
    for model in (
        own,
        rds.library_model("directional-axis", **X, viscous_plus=0.1),
        rds.library_model("spindle", tau=0.08, K=1000.0),
    ):
        in_loop(as_candidate(model), data, seen)
        assert given[-1] is model


@pytest.mark.parametrize("name", ["pid", "tracking", "cascade"])
def test_the_loop_of_a_result_is_known_from_the_result(name: str, tmp_path: Path) -> None:
    reference = rds.sinusoid(amplitude=4.0, frequency=0.8)
    rds.Experiment(axis="X", duration=2.0, reference=reference, controller={"name": name}).run(out=tmp_path / "run")
    (data,) = read_log(tmp_path / "run")
    known = own_loop(data)
    assert isinstance(known, OwnLoop) and known.late == 0
    assert in_loop(candidate(), data, known.simulate).rmse < 2e-3
    assert in_loop(candidate(), data.part(1200, 2000), known.simulate).rmse < 2e-3
    if name == "pid":
        found = validate(candidate(X | {"tau": 3.0 * X["tau"]}), data)
        assert any(r.kind == "loop" and r.side == "against" for r in found.verdict.reasons)


def test_a_loop_that_the_result_does_not_tell_is_not_simulated(tmp_path: Path) -> None:
    law = tmp_path / "mine.py"
    law.write_text("def control(t, r, y, state, params):\n    return 20.0 * (r.position - y), state\n")
    reference = rds.sinusoid(amplitude=4.0, frequency=0.8)
    run = rds.Experiment(axis="X", duration=2.0, reference=reference, controller=str(law)).run(out=tmp_path / "run")
    (data,) = read_log(tmp_path / "run")
    assert "give --loop EXPERIMENT.toml" in str(own_loop(data))
    other = log(run["X_voltage"], run["X_measured"], closed_loop=True)
    assert own_loop(other) is None


def test_without_its_controller_a_closed_loop_is_judged_by_forces() -> None:
    rng = np.random.default_rng(4)
    t = np.arange(8000) * T
    wanted = 5.0 * np.sin(2 * np.pi * 0.7 * t) + 0.5 * np.sin(2 * np.pi * 6.0 * t)
    x, u, y = (0.0, 0.0), np.zeros(len(t)), np.zeros(len(t))
    model = rds.library_model("linear-axis", **X)
    for k in range(len(t)):
        y[k] = np.rint((x[0] + 1e-4 * rng.standard_normal()) / STEP) * STEP
        u[k] = np.clip(20.0 * (wanted[k] - y[k]), -10.0, 10.0)
        x = model.advance(x, u[k], T, X)
    data = log(u, y, closed_loop=True)
    sides = {}
    for factor in (1.0, 3.0):
        found = validate(candidate(X | {"tau": factor * X["tau"]}), data)
        (sides[factor],) = [r.side for r in found.verdict.reasons if r.kind == "forces"]
    assert sides == {1.0: "for", 3.0: "against"}


def test_a_load_that_the_loop_makes_up_for_does_not_pass_for_a_gain() -> None:
    """A right model drifts from the log for want of the load; what it says of forces stands, and a wrong gain shows."""
    rng = np.random.default_rng(4)
    axis = X | {"tau": 0.5, "K": 30.0, "friction_plus": 0.3, "friction_minus": -0.3}
    model = rds.library_model("linear-axis", **axis)
    t = np.arange(8000) * T
    wanted = 5.0 * np.sin(2 * np.pi * 0.7 * t) + 0.5 * np.sin(2 * np.pi * 6.0 * t)
    x, u, y = (0.0, 0.0), np.zeros(len(t)), np.zeros(len(t))
    for k in range(len(t)):
        y[k] = np.rint((x[0] + 1e-4 * rng.standard_normal()) / STEP) * STEP
        u[k] = np.clip(20.0 * (wanted[k] - x[0]) - 0.3 * x[1], -10.0, 10.0)
        x = model.advance(x, u[k] + 0.09, T, axis)
    data = log(u, y, closed_loop=True)
    right, wrong = (validate(candidate(values), data) for values in (axis, axis | {"K": 36.0}))
    assert right.verdict.purpose == "foretelling the force of a motion in a closed loop such as this"
    (gain,) = [reason for reason in right.verdict.reasons if reason.kind == "gain"]
    assert gain.side == "for" and float(gain.what.split()[3]) < 0.1  # %; the standard error is 0.002
    assert wrong.verdict.word == "not valid" and "its gain is 20 % too high" in wrong.verdict.sentence
