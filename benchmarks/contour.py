"""The contour error of a circle under every law of the library, on a machine with everything wrong in it.

A circle of 10 mm, twice around, by X and Y of the mini CNC: simulated as the machine behind the bus is, with
friction, its Stribeck part, play, the amplifier's offset, gains that are not those of the model, and the loop's
sample of delay. Each law is designed for table 1. The error is the distance of the measured position from the circle,
in the second time around.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import rds
from benchmarks.figures import Figure
from rds.controllers import controller_names, library_controller
from rds.core.errors import InputError
from rds.modes.experiment.learning import learn

FEEDS = (200.0, 400.0, 700.0)  # mm/min
RADIUS = 5.0  # mm
AXES = ("X", "Y")
TRIALS = 10
# what a law is told beside the axis: the play that its machine has, and the loop's sample of delay
DELAY = 0.001  # s, the loop's sample
TOLD: dict[str, dict[str, Any]] = {
    "feedforward": {"backlash": 0.003},
    "zero-phase": {"backlash": 0.003, "lead": 1},
    "lqg": {"delay": DELAY},
    "smith": {"delay": DELAY},
}
COUPLED = Path(__file__).parents[1] / "examples" / "cross_coupled.py"


def run() -> list[Figure]:
    """The RMS of the contour error in µm, for each law and feed; the note has the largest."""
    found = []
    for name, errors in table().items():
        for feed, (rms, most) in zip(FEEDS, errors, strict=True):
            found.append(Figure(f"{name}, {feed:g} mm/min", "µm RMS", (rms,), note=f"largest {most:.1f} µm"))
    return found


def table(feeds: tuple[float, ...] = FEEDS) -> dict[str, list[tuple[float, float]]]:
    """RMS and largest contour error, µm, by law and feed."""
    laws: dict[str, Callable[[float], tuple[float, float]]] = {}
    for name in controller_names():
        try:
            library = {axis: _designed(name, axis) for axis in AXES}
        except InputError:  # not for a position axis, or it needs a design of its own
            continue
        laws[name] = lambda feed, library=library: _errors(_circle(feed, _overrides(library)))
    laws["two axes, position gain 25 1/s"] = lambda feed: _errors(_circle(feed, _overrides(), _coupled(W=0.0, Wi=0.0)))
    laws["the same, cross-coupled"] = lambda feed: _errors(_circle(feed, _overrides(), _coupled()))
    laws[f"tracking, {TRIALS} trials of learning"] = _learned
    return {name: [law(feed) for feed in feeds] for name, law in laws.items()}


def _designed(name: str, axis: str) -> rds.Controller:
    machine = rds.load_machine("mini-cnc")
    model, T = machine.axis(axis).model, machine.sample_period
    return library_controller(name, model, T, machine.converter.range, **TOLD.get(name, {}))


def _overrides(laws: dict[str, Any] | None = None) -> dict[str, Any]:
    """The machine's own axes, with the loop's sample of delay; and laws, where they are of single axes."""
    machine = rds.load_machine("mini-cnc")
    tables: dict[str, Any] = {}
    for axis in AXES:
        own = dict(machine.axis(axis).machine)
        tables[axis] = {"model": {"name": "machine-axis", **own, "delay": own["delay"] + machine.sample_period}}
        if laws is not None:
            tables[axis]["controller"] = laws[axis]
    return tables


def _circle(feed: float, overrides: dict[str, Any], controller: Any = None) -> rds.Experiment:
    lap = {"kind": "arc", "end": [0.0, 0.0], "centre": [RADIUS, 0.0]}
    reference = {
        "kind": "path",
        "interpolator": "tustin",
        "acceleration": {"name": "s-shape", "time": 0.1},
        "start": [0.0, 0.0],
        "feed": feed,
        "segment": [lap, lap],
    }
    words = {"machine": "mini-cnc", "axes": list(AXES), "reference": reference, "axis": overrides}
    return rds.Experiment.from_table(words | ({} if controller is None else {"controller": controller}))


def _coupled(**params: float) -> dict[str, Any]:
    return {"file": str(COUPLED), "coupled": True} | ({"params": params} if params else {})


def _errors(experiment: rds.Experiment) -> tuple[float, float]:
    return _off_circle(experiment.run("simulation"))


def _off_circle(result: rds.Result) -> tuple[float, float]:
    x, y = result["X_measured"], result["Y_measured"]
    second = slice(len(x) // 2, None)
    off = 1e3 * np.abs(np.hypot(x - RADIUS, y) - RADIUS)[second]
    return float(np.sqrt(np.mean(off**2))), float(off.max())


def _learned(feed: float) -> tuple[float, float]:
    """The circle's samples as signals, since learning needs references that are known before the run."""
    way = _circle(feed, _overrides({axis: _designed("tracking", axis) for axis in AXES})).run("simulation")
    tables = _overrides({axis: _designed("tracking", axis) for axis in AXES})
    for axis in AXES:
        tables[axis]["reference"] = _samples(way["time"], way[f"{axis}_reference"])
    words = {"machine": "mini-cnc", "axes": list(AXES), "axis": tables, "duration": float(way["time"][-1])}
    learned = learn(rds.Experiment.from_table(words), TRIALS)
    return _off_circle(learned.results[-1])


def _samples(time: np.ndarray, position: np.ndarray) -> Callable[[Any], Any]:
    return lambda t: np.interp(t, time, position)


if __name__ == "__main__":
    for law, errors in table().items():
        print(f"| {law} | " + " | ".join(f"{rms:.1f} / {most:.1f}" for rms, most in errors) + " |")
