"""Made logs and candidates for the tests of validation: the X axis of the mini CNC behind a 1 µm encoder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rds.identification.fit.estimate import Parameter
from rds.identification.logs.log import Log
from rds.identification.structures.structures import structure
from rds.identification.validate.candidate import Candidate
from rds.models.linear_axis import coefficients, respond

X = {"tau": 9.943e-3, "K": 1.764, "friction_plus": 0.539, "friction_minus": -0.222}
STEP = 1e-3  # mm, of the encoder
T = 1e-3  # s


def square(seconds: float = 8.0, amplitude: float = 3.0, frequency: float = 1.0) -> np.ndarray:
    """A square voltage of slowly changing amplitude, V."""
    t = np.arange(round(seconds / T)) * T
    return np.where(np.sin(2 * np.pi * frequency * t) >= 0, 1, -1) * amplitude * (1 - 0.4 * np.cos(0.9 * t))


def moved(u: np.ndarray, values: Mapping[str, float] = X, step: float | None = STEP, start: float = 0.7) -> np.ndarray:
    """The positions that the encoder reads, mm, from rest at `start`."""
    constants = coefficients(values, T)
    x, v, y = start, 0.0, []
    for voltage in u.tolist():
        y.append(x)
        x, v = respond(x, v, voltage, *constants)
    position = np.array(y)
    return position if step is None else np.rint(position / step) * step


def log(u: np.ndarray, y: np.ndarray | None = None, name: str = "log", **known: Any) -> Log:
    """A log of the command `u` and the position, by default that of the axis X."""
    given = {"resolution": STEP, "units": {"position": "mm", "command": "V"}, "closed_loop": False} | known
    return Log(name, np.arange(len(u)) * T, u, moved(u) if y is None else y, **given)


def candidate(
    values: Mapping[str, float] = X, name: str = "model", share: float | None = None, **record: Any
) -> Candidate:
    """The axis with these values; with `share`, estimated with standard errors of that share of each."""
    made = structure("axis")
    parameters, covariance = {}, None
    if share is not None:
        errors = [share * abs(value) for value in values.values()]
        covariance = np.diag(np.square(errors))
        parameters = {
            key: Parameter(value, error, value - 2 * error, value + 2 * error, made.units[key])
            for (key, value), error in zip(values.items(), errors, strict=True)
        }
    return Candidate(name, made, values, parameters, covariance, **record)
