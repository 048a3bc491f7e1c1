"""Model files for tests, written from made estimates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rds.identification.fit.estimate import Estimate, Parameter
from rds.identification.fit.model_file import write_model

UNITS = {
    "tau": "s",
    "K": "(mm/s)/V",
    "friction_plus": "mm/s",
    "friction_minus": "mm/s",
    "stribeck": "",
    "stribeck_velocity": "mm/s",
    "delay": "s",
    "backlash": "mm",
    "dead_zone": "V",
    "offset": "V",
    "friction": "mm/s",
}
X = {"tau": 9.943e-3, "K": 1.764, "friction_plus": 0.539, "friction_minus": -0.222}
Y = {"tau": 1.044e-2, "K": 1.882, "friction_plus": 0.631, "friction_minus": -0.325}


def write_made(
    path: Path,
    values: Mapping[str, float],
    options: tuple[str, ...] = (),
    share: float = 0.02,
    structure: str = "axis",
    units: Mapping[str, str] = UNITS,
    reach: float = 2.0,
) -> Path:
    """A model file with these values, each with a standard error of `share` of its size, correlated by a half.

    Intervals go `reach` standard errors to either side.
    """
    errors = {name: share * abs(value) for name, value in values.items()}
    scale = np.array(list(errors.values()))
    covariance = np.outer(scale, scale) * (0.5 + 0.5 * np.eye(len(scale)))
    parameters = {
        name: Parameter(value, errors[name], value - reach * errors[name], value + reach * errors[name], units[name])
        for name, value in values.items()
    }
    unit = "rev/min" if structure == "spindle" else "mm"
    made = Estimate(structure, options, "simulation", parameters, covariance, (), {}, {}, {}, (), output_unit=unit)
    return write_model(path, made)
