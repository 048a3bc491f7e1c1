"""A run that a `for` loop takes sample by sample, in every mode: the same data as a controller in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rds
from rds.core.errors import ContractError, InputError


def control(t: float, r: rds.Reference, y: float, state: Any, params: Any) -> tuple[float, Any]:
    return 30.0 * (r.position - y) + 0.5 * r.velocity, state


def given(**more: Any) -> dict[str, Any]:
    return {"axis": "X", "duration": 0.3, "reference": rds.sinusoid(5.0, 2.0)} | more


def stepped(run: Any) -> rds.Result:
    for step in run:
        step.voltage = 30.0 * (step.reference.position - step.measured) + 0.5 * step.reference.velocity
    return run.result


def same(one: rds.Result, other: rds.Result, *columns: str) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in columns)


def test_the_loop_is_the_controller() -> None:
    wanted = rds.Experiment(**given(controller=control)).run()
    found = stepped(rds.steps(**given()))
    assert same(found, wanted, "time", "X_reference", "X_measured", "X_command")
    assert found.meta["controller"]["X"]["name"] == "a for loop"


def test_several_axes_are_arrays() -> None:
    found = stepped(rds.steps(**given(axis=["X", "Y"])))
    one = rds.Experiment(**given(controller=control)).run()
    assert np.array_equal(found["X_measured"], one["X_measured"])
    assert found["Y_command"].any()


@pytest.mark.realtime
@pytest.mark.parametrize("mode", ["emulation", "implementation"])
def test_against_the_clock(mode: str, alone: Path) -> None:
    """Emulation repeats simulation sample for sample; on the machine the loop's voltages are what was commanded."""
    told = given(sample_period=0.005)
    found = stepped(rds.steps(mode=mode, out="run", **told))
    if mode == "emulation":
        assert same(found, stepped(rds.steps(**told)), "X_measured", "X_command")
    voltages = 30.0 * (found["X_reference"] - found["X_measured"]) + 0.5 * found["X_reference_velocity"]
    assert np.array_equal(found["X_command"], voltages)
    assert found.verdict in ("met", "missed", "void")
    assert rds.open_result("run").meta["controller"]["X"]["name"] == "a for loop"


@pytest.mark.parametrize("voltage", [None, "a", "3", True, float("nan"), [1.0, 2.0]])
def test_what_is_no_voltage_is_told_with_its_time(voltage: Any) -> None:
    run = rds.steps(**given())
    first = next(run)
    first.voltage = voltage
    with pytest.raises(InputError, match=r"at t = 0.000 s step.voltage is .*set it to a finite number in V"):
        next(run)


def test_a_loop_that_is_left_ends_the_run_at_rest() -> None:
    run = rds.steps(**given())
    for step in run:
        step.voltage = 1.0
        if step.t >= 0.05:
            break
    result = run.result
    assert result.meta["ending"] == "stopped"
    assert 50 <= len(result["time"]) < 300
    assert not result["X_command"][50:].any()
    with pytest.raises(StopIteration):
        next(run)


def test_a_run_is_taken_once() -> None:
    run = rds.steps(**given())
    stepped(run)
    with pytest.raises(InputError, match=r"this run is over: .* call rds.steps again"):
        for _ in run:
            pass


@pytest.mark.parametrize("name", ["t", "reference", "measured", "volts"])
def test_a_loop_sets_the_voltage_and_nothing_else(name: str) -> None:
    with (
        rds.steps(**given()) as run,
        pytest.raises(AttributeError, match=f"step.{name} cannot be set: a loop sets step.v"),
    ):
        setattr(next(run), name, 1.0)


def test_a_loop_that_raises_ends_the_run_too() -> None:
    with pytest.raises(ZeroDivisionError), rds.steps(**given()) as run:
        for step in run:
            step.voltage = 1.0 / 0.0
    assert run.result.meta["ending"] == "stopped"


@pytest.mark.realtime
def test_a_loop_that_stands_still_is_not_waited_for(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.modes.experiment.steps.PATIENCE", 0.3)
    run = rds.steps(mode="emulation", **given(sample_period=0.005))
    next(run)
    with pytest.raises(ContractError, match=r"the for loop gave no voltage within 0.3 s at t = 0.000 s"):
        run._run.wait()
    run.stop()


def test_a_controller_beside_the_loop_is_refused() -> None:
    with pytest.raises(InputError, match="the for loop is the controller"):
        rds.steps(**given(controller=control))
