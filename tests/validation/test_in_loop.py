"""A closed loop whose controller is known is simulated with the model: what feedback hides from a free run shows."""

from __future__ import annotations

from dataclasses import replace

import pytest

import rds
from rds.core.errors import InputError
from rds.core.types import Model
from rds.identification.validate.in_loop import in_loop
from rds.identification.validate.validate import validate
from rds.results import Result
from tests.validation.validation_logs import X, candidate, log


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
