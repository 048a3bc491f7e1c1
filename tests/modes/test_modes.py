"""Every mode through the same suite: one loop, whatever it is built from."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lost_machines import unless_lost

import rds
from rds.core.types import Reference
from rds.results import Result

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("alone")]

TIMING = {"lateness", "io", "compute", "model", "taken"}
REFERENCES = {"reference", "reference_velocity", "reference_acceleration"}
CONTROLLED = REFERENCES | {"measured", "command", "voltage", "velocity"}  # the last is what the law's observer tells
COLUMNS = {
    "simulation": CONTROLLED | {"plant_velocity"},
    "emulation": CONTROLLED | {"plant_velocity"},
    "implementation": CONTROLLED | {"modelled", "simulated"},
    "system-test": {"measured", "command", "voltage"},
    "model-validation": {"measured", "command", "voltage", "modelled"},
}
UNITS = {
    "velocity": "mm/s",
    "plant_velocity": "mm/s",
    "reference_velocity": "mm/s",
    "reference_acceleration": "mm/s²",
    "command": "V",
    "voltage": "V",
}
TRACKING = {"name": "tracking", "gains": [1600.0, -36.6]}
PERIOD = 0.002  # s: with room for a busy computer


def experiment(mode: str, **options: Any) -> rds.Experiment:
    """Two axes: the one with a drive or a reference of its own."""
    own: dict[str, Any]
    if mode in ("system-test", "model-validation"):
        drive: dict[str, Any] = {"signal": rds.square(3.0, 2.0)}
        own = {"signal": rds.sinusoid(4.0, 5.0)}
    else:
        drive = {"reference": rds.sinusoid(2.0, 1.0), "controller": TRACKING}
        own = {"reference": rds.triangle(1.0, 2.0)}
    settings = {"axis": ("X", "Z"), "duration": 1.0, "sample_period": PERIOD, "overrides": {"Z": own}}
    return rds.Experiment(**(settings | drive | options), mode=mode)


@pytest.fixture(scope="module", params=list(COLUMNS))
def ran(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Result, Path]:
    folder = tmp_path_factory.mktemp("run") / "out"
    mode = request.param
    return mode, unless_lost(lambda: experiment(mode).run(out=folder)), folder


def test_columns_and_units(ran: tuple[str, Result, Path]) -> None:
    mode, result, _ = ran
    expected = {f"{axis}_{part}": UNITS.get(part, "mm") for axis in "XZ" for part in COLUMNS[mode]} | {"time": "s"}
    if mode not in ("simulation",):
        expected |= dict.fromkeys(TIMING, "µs")
    assert result.units == expected
    assert set(result.columns) == set(expected)


def test_time_is_counted_not_measured(ran: tuple[str, Result, Path]) -> None:
    mode, result, _ = ran
    samples = np.rint(result["time"] / PERIOD)
    assert (result["time"] == samples * PERIOD).all()
    if mode in ("simulation", "emulation"):
        assert samples.tolist() == list(range(500))
    else:  # discards periods that a busy computer took
        assert len(result) + result.meta["timing"]["discarded"] == 500


def test_metrics_are_sensible(ran: tuple[str, Result, Path]) -> None:
    mode, result, _ = ran
    if COLUMNS[mode] >= REFERENCES:
        for axis, largest in (("X", 1.0), ("Z", 0.6)):
            metrics = result.metrics[axis]
            assert 0 < metrics["mean_abs_error"] <= metrics["rms_error"] <= metrics["max_abs_error"] < largest
    if "modelled" in COLUMNS[mode]:
        fits = [values["fit_percent"] for values in result.metrics.values()]
        assert all(fit is not None and 50 < fit < 100 for fit in fits)  # the machine is not its model


def test_voltages_are_what_the_converter_makes_of_commands(ran: tuple[str, Result, Path]) -> None:
    mode, result, _ = ran
    convert = rds.load_machine("mini-cnc").converter
    step = 2 * convert.range / 2**convert.bits
    for axis in "XZ":
        levels = result[f"{axis}_voltage"] / step
        assert np.abs(levels - np.rint(levels)).max() < 1e-6
        if mode in ("simulation", "emulation"):  # there it acts at once
            limited = np.clip(result[f"{axis}_command"], -convert.range, convert.range - step)
            assert np.abs(result[f"{axis}_voltage"] - limited).max() <= step / 2 + 1e-12


def test_what_is_known_of_the_run(ran: tuple[str, Result, Path]) -> None:
    mode, result, folder = ran
    meta = result.meta
    assert (meta["mode"], meta["ending"], meta["axes"]) == (mode, "done", ["X", "Z"])
    assert meta["sample_period"] == PERIOD
    assert meta["duration"] == pytest.approx(1.0)
    if mode == "simulation":
        assert result.verdict is None
        return
    assert result.verdict in ("met", "void")
    assert set(meta["timing"]) >= {"lateness", "io", "compute", "late", "samples", "discarded", "longest_late_run"}
    assert meta["timing"]["samples"] == len(result)
    environment = meta["environment"]
    assert {"scheduler", "memory_locked", "cores", "governor", "rehearsal", "sentence", "priority"} <= set(environment)
    assert environment["threads"] == 0
    assert meta["drivers"]["ticks"] >= len(result)
    assert sorted(path.name for path in folder.iterdir() if path.suffix in (".rds", ".json")) == [
        "ending.json",
        "record.rds",
        "result.json",
    ]


def test_the_saved_result_and_the_raw_record_say_the_same(ran: tuple[str, Result, Path], tmp_path: Path) -> None:
    mode, result, folder = ran
    saved = rds.open_result(folder)
    assert all((saved[name] == result[name]).all() for name in result.columns)
    if mode == "simulation":
        return
    for name in ("record.rds", "ending.json"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    raw = rds.open_result(tmp_path)
    assert set(result.columns) - set(raw.columns) == {name for name in result.columns if name.endswith("_simulated")}
    known = set(raw.columns) - {"interpolate"}  # the raw record has it of every run, and there it is 0
    assert all((raw[name] == result[name]).all() for name in known) and not raw["interpolate"].any()
    assert {name: result.units[name] for name in known} == {name: raw.units[name] for name in known}
    assert raw.meta["ending"] == "done"


def test_emulation_repeats_simulation_to_the_bit() -> None:
    """X, Y and Z together, friction, converter and encoder: what a busy computer does to time is not in the data."""
    both = rds.Experiment(
        axis=("X", "Y", "Z"),
        duration=0.6,
        reference=rds.sinusoid(5.0, 1.0),
        controller=TRACKING,
        overrides={"Y": {"reference": rds.square(1.0, 3.0), "controller": {"name": "pid"}}},
    )
    assert_same(both.run(), both.run("emulation"))


NUMPY_STATE = """
import numpy as np
import helper

params = {"gain": 30.0}
initial_state = np.zeros(2)

def control(t, r, y, state, params):
    state = 0.9 * state + 0.1 * np.array([r.position - y, helper.half(r.velocity)])
    return params["gain"] * state[0] + 0.1 * state[1:2], state
"""
DERIVATIVES = """
import numpy as np
from math import tanh

params = {"tau": 0.01, "K": 1.7, "F": 0.5}
initial_state = [0.0, 0.0, 0.0]

def friction(v, F):
    return F * tanh(v / 0.05)

def derivatives(t, x, u, params):
    return [x[1], (params["K"] * u[0] - friction(x[1], params["F"]) - x[1]) / params["tau"], x[0]]

def output(t, x, u, params):
    return x[0] + 0.001 * np.sin(100 * x[0])
"""


def test_a_student_s_files_run_the_same_in_real_time(alone: Path) -> None:
    (alone / "helper.py").write_text("def half(x):\n    return x / 2\n")
    (alone / "law.py").write_text(NUMPY_STATE)
    (alone / "axis.py").write_text(DERIVATIVES)
    own = rds.Experiment(
        duration=0.5,
        sample_period=PERIOD,
        reference=rds.sinusoid(3.0, 2.0),
        controller={"file": "law.py", "params": {"gain": 25.0}},
        model={"file": "axis.py", "substeps": 4},
    )
    simulated = own.run()
    assert_same(simulated, own.run("emulation"))
    assert simulated["X_measured"].any()
    assert simulated.meta["controller"]["X"]["sha256"] == own.run().meta["controller"]["X"]["sha256"]


def test_functions_of_a_notebook_run_the_same_in_real_time() -> None:
    cell: dict[str, Any] = {"__name__": "__main__"}
    exec(
        "import numpy as np\n"
        "gain = 20.0\n"
        "def helper(e):\n    return gain * e\n"
        "def control(t, r, y, state, params):\n    return helper(r.position - y), (state[0] + 1,)\n"
        "initial_state = (0,)\n"
        "def advance(x, u, T, params):\n    return x[0] + x[1] * T, 0.9 * x[1] + 0.1 * 1.7 * u[0]\n",
        cell,
    )
    gain = 15.0
    own = rds.Experiment(
        axis=("X", "Y", "Z"),
        duration=0.2,
        sample_period=PERIOD,
        reference=rds.sinusoid(1.0, 5.0),
        controller=cell,
        overrides={
            "Y": {"controller": rds.Controller(cell["control"], (0,)), "model": cell["advance"]},
            "Z": {"controller": lambda t, r, y, state, params: (gain * (r.position - y), state)},
        },
    )
    simulated = own.run()
    assert_same(simulated, own.run("emulation"))
    gains = {name: simulated[f"{name}_command"][1] / simulated[f"{name}_reference"][1] for name in "XYZ"}
    assert gains == pytest.approx({"X": 20.0, "Y": 20.0, "Z": 15.0}, rel=0.2)  # each its own


def contour(t: float, r: Reference, y: np.ndarray, state: Any, params: Any) -> tuple[np.ndarray, Any]:
    """Coupled: each axis helps with the other's error."""
    assert isinstance(y, np.ndarray) and y.shape == (2,) and r.position.shape == (2,)
    e = r.position - y
    return np.array([[30.0, 2.0], [2.0, 30.0]]) @ e + r.velocity / 1.7, state + e


@pytest.mark.parametrize("mode", ["simulation", "emulation", "implementation"])
def test_one_controller_over_two_axes(mode: str) -> None:
    run = partial(
        rds.Experiment,
        axis=("Y", "X"),
        duration=0.4,
        sample_period=PERIOD,
        reference=rds.sinusoid(1.0, 2.5),
        overrides={"Y": {"reference": rds.sinusoid(1.0, 2.5, phase=90.0)}},
    )
    coupled = run(controller=rds.Controller(contour, np.zeros(2), coupled=True))
    result = unless_lost(lambda: coupled.run(mode))
    assert result.axes == ["Y", "X"]
    errors = np.array([result[f"{axis}_reference"] - result[f"{axis}_measured"] for axis in ("Y", "X")])
    assert np.abs(errors[:, 100:]).max() < 0.3
    if mode == "emulation":
        assert_same(coupled.run("simulation"), result)


@pytest.mark.parametrize("T", [0.0005, 0.01])
def test_other_sample_periods(T: float) -> None:
    own = rds.Experiment(
        duration=50 * T, sample_period=T, reference=rds.sinusoid(0.2, 0.1 / T), controller={"name": "p", "Pgain": 10.0}
    )
    simulated, emulated = own.run(), own.run("emulation")
    assert_same(simulated, emulated)
    implemented = unless_lost(lambda: own.run("implementation"))
    assert implemented.meta["drivers"]["ticks"] >= len(implemented) > 0
    assert (simulated["time"] == np.arange(50) * T).all()


def test_without_saturation_and_quantization() -> None:
    ideal = rds.Experiment(
        duration=0.1,
        sample_period=PERIOD,
        reference=rds.square(20.0, 5.0),
        controller={"name": "p", "Pgain": 50.0},
        interface={"saturation": False, "quantization": False},
    )
    result = ideal.run()
    assert (result["X_voltage"] == result["X_command"]).all()
    assert np.abs(result["X_voltage"]).max() > 100.0
    assert_same(result, ideal.run("emulation"))


def assert_same(simulated: Result, emulated: Result) -> None:
    """Equal to the bit in all that a simulation has; a computer so busy that the machine gets lost ends it early."""
    assert len(simulated) == len(emulated) or emulated.meta["ending"] == "machine lost"
    different = [name for name in simulated.columns if (simulated[name][: len(emulated)] != emulated[name]).any()]
    assert not different
