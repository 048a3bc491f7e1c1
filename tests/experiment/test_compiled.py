"""Compiled simulations: the same numbers as in Python, or Python with a note."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import booleans, floats, sampled_from

import rds
from rds.core.extras import remedy
from rds.modes.experiment.compiled import obstacle, run_compiled
from rds.modes.experiment.outcome import bus_note
from rds.modes.process.host import run_plan

numba = pytest.importorskip("numba")

CONTROLLERS: list[dict[str, Any]] = [
    {"name": "p"},
    {"name": "pid"},
    {"name": "modified-pid"},
    {"name": "tracking", "gains": [1600.0, -36.6]},
]
REFERENCES = [rds.sinusoid(5.0, 2.0), rds.square(3.0, 4.0), rds.triangle(2.0, 1.0, phase=90.0)]
SLOW = rds.sinusoid(1.0, 1.0)  # within the converter's range


def assert_same(settings: dict[str, Any]) -> None:
    compiled = rds.Experiment(**settings, compiled=True).run()
    python = rds.Experiment(**settings).run()
    assert list(compiled.columns) == list(python.columns)
    assert compiled.units == python.units
    assert compiled.meta["notes"] == python.meta["notes"]  # none why it was not compiled
    different = [name for name in python.columns if (compiled[name] != python[name]).any()]
    assert not different


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda controller: controller["name"])
@pytest.mark.parametrize("interface", [True, False])
def test_the_same_to_the_bit(controller: dict[str, Any], interface: bool) -> None:
    assert_same(
        {
            "axis": ("X", "Y", "Z"),
            "duration": 0.5,
            "controller": controller,
            "reference": REFERENCES[0],
            "overrides": {"Y": {"reference": REFERENCES[1]}, "Z": {"reference": REFERENCES[2]}},
            "interface": {"saturation": interface, "quantization": interface},
        }
    )


@pytest.mark.parametrize("name", ["tracking", "pid", "modified-pid", "cascade"])
def test_signals_are_those_of_the_loop_to_the_last_bit(name: str) -> None:
    """Here, where their loops are compiled already."""
    plan = rds.Experiment(duration=0.5, controller={"name": name}, reference=REFERENCES[0]).plan("simulation")
    assert obstacle(plan) is None and plan.axes[0].controller is not None and plan.axes[0].controller.signals
    ours, loops = run_compiled(plan), run_plan(plan, None)
    assert ours is not None and ours.columns == loops.columns and ours.units == loops.units
    assert np.array_equal(ours.values, loops.values)


@settings(max_examples=25, deadline=None)
@given(
    controller=sampled_from(CONTROLLERS),
    reference=sampled_from(REFERENCES),
    saturation=booleans(),
    quantization=booleans(),
    friction=floats(0.0, 5.0),
    T=sampled_from([0.0005, 0.001, 0.002]),
)
def test_the_same_whatever_is_set(
    controller: dict[str, Any], reference: Any, saturation: bool, quantization: bool, friction: float, T: float
) -> None:
    assert_same(
        {
            "duration": 0.2,
            "sample_period": T,
            "controller": controller,
            "reference": reference,
            "model": {"name": "linear-axis", "friction_plus": friction, "friction_minus": -friction / 2},
            "interface": {"saturation": saturation, "quantization": quantization},
        }
    )


@pytest.mark.parametrize("signal", [rds.square(12.0, 5.0), rds.sinusoid(0.4, 3.0)])
def test_a_voltage_signal_as_well(signal: Any) -> None:
    assert_same({"duration": 0.5, "signal": signal})


def test_it_falls_back_with_a_note(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def control(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
        return 10.0 * (r.position - y), state

    def advance(x: Any, u: Any, T: float, params: Any) -> Any:
        return x[0] + u[0] * T, 0.0

    good = {"duration": 0.1, "reference": SLOW, "controller": "p"}
    for change, said in (
        ({"controller": control}, "only the library's controllers can be compiled"),
        ({"model": advance}, "only the library's linear-axis model can be compiled"),
        ({"axis": "spindle"}, "only the library's linear-axis model can be compiled"),
    ):
        own: dict[str, Any] = good | change
        result = rds.Experiment(**own, compiled=True).run()
        (note,) = result.meta["notes"]
        assert note.startswith("not compiled: axis ") and said in note
        python = rds.Experiment(**own).run()
        assert all((result[name] == python[name]).all() for name in python.columns)
    monkeypatch.setitem(sys.modules, "numba", None)
    (note,) = rds.Experiment(**good, compiled=True).run().meta["notes"]
    assert note == f"not compiled: numba is not installed; install it with: {remedy('fast')}"


@pytest.mark.parametrize("quantization", [True, False])
@pytest.mark.parametrize("gain", [1e5, 1e300])
def test_what_grows_beyond_all_numbers_is_told_as_by_the_loop(gain: float, quantization: bool) -> None:
    words = {
        "controller": {"name": "p", "Pgain": gain},
        "reference": REFERENCES[0],
        "interface": {"saturation": False, "quantization": quantization},
        "duration": 2.0,
    }
    said = []
    for compiled in (False, True):
        with pytest.raises(rds.ContractError) as error:
            rds.Experiment(**words, compiled=compiled).run()
        said.append(str(error.value))
    assert said[0] == said[1] and "at t = " in said[0]


@pytest.mark.realtime
def test_real_time_is_not_compiled_and_says_so(alone: Path) -> None:
    own = rds.Experiment(duration=0.2, reference=SLOW, controller="p", compiled=True)
    meta = own.run("emulation").meta
    late_bus = bus_note(meta["drivers"], meta["bus"])
    said = "not compiled: emulation runs in real time; only simulations can be compiled"
    assert meta["notes"] == [said, *([late_bus] if late_bus else [])]
