"""A sampled loop in a few lines, and the machines' numbers, for the tests of the control laws."""

from __future__ import annotations

import numpy as np

from rds.core.types import Controller, Model, Reference
from rds.machines import load_machine
from rds.models import library_model

T = 1e-3
RANGE = 10.0
POLES = [[-32, 24], [-32, -24]]


def axis_model(name: str, friction: bool = True) -> dict[str, float]:
    """The axis's parameters from mini-cnc.toml."""
    model = dict(load_machine("mini-cnc").axis(name).model)
    del model["name"]
    return model if friction else {"tau": model["tau"], "K": model["K"]}


def plant(name: str, friction: bool = True) -> Model:
    return library_model("spindle" if name == "spindle" else "linear-axis", **axis_model(name, friction))


def run(controller: Controller, model: Model, reference: Reference, T: float = T, delay: int = 0):
    """Measured positions and voltages of a loop, as arrays; the voltage acts `delay` samples late."""
    motion, state = model.motion(model, T), controller.initial_state
    measured, voltages, waiting = [], [], [0.0] * delay
    for k, r in enumerate(zip(*(part.tolist() for part in reference), strict=True)):
        y = motion.read()
        u, state = controller.control(k * T, Reference(*r), y, state, controller.params)
        waiting.append(u)
        motion.write(waiting.pop(0))
        measured.append(y)
        voltages.append(u)
    return np.array(measured), np.array(voltages)


def ramp(speed: float, samples: int, T: float = T) -> Reference:
    t = np.arange(samples) * T
    return Reference(speed * t, np.full(samples, speed), np.zeros(samples))


def step(height: float, samples: int) -> Reference:
    return Reference(np.full(samples, height), np.zeros(samples), np.zeros(samples))
