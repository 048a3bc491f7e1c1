"""The signals that controllers told beside the voltage, found in a result by the names of its columns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.core.signals import TAKEN

if TYPE_CHECKING:
    from rds.results.result import Result

VELOCITY = "velocity"  # the signal that is held against the true velocity of the plant


def signals_of(result: Result, axis: str) -> list[str]:
    """The names of an axis's signals, in order: `velocity` for a column `X_velocity`."""
    others = tuple(f"{name}_" for name in result.axes if name != axis and name.startswith(f"{axis}_"))
    names = [
        column.removeprefix(f"{axis}_")
        for column in result
        if column.startswith(f"{axis}_") and not (others and column.startswith(others))
    ]
    endings = tuple(f"_{ending}" for ending in TAKEN)
    return [name for name in names if name.isidentifier() and name not in TAKEN and not name.endswith(endings)]


def true_velocity(result: Result, axis: str) -> np.ndarray | None:
    """The velocity of the simulated plant, in the unit of the signal `velocity`; None where there is none."""
    name, signal = f"{axis}_plant_velocity", f"{axis}_{VELOCITY}"
    if name not in result or (signal in result and result.units[signal] != result.units[name]):
        return None
    return result[name]


def estimate_error(result: Result, axis: str) -> np.ndarray | None:
    """The signal `velocity` less the true velocity, sample by sample; None where either is missing."""
    true, signal = true_velocity(result, axis), f"{axis}_{VELOCITY}"
    return None if true is None or signal not in result else np.asarray(result[signal] - true, dtype=float)
