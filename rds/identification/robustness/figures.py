"""What is measured of each closed loop, in the order of a row."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np

from rds.machines.converter import Limits, limits
from rds.results.metrics import error_metrics

# name: (meaning, unit ("" for that of the axis), whether more is worse)
TRACKING = {
    "max_error": ("largest tracking error", "", True),
    "rms_error": ("RMS tracking error", "", True),
    "peak_voltage": ("largest voltage asked for", "V", True),
    "saturated": ("time in saturation", "s", True),
}
MARGINS = {
    "gain_margin": ("gain margin of the linearized loop", "dB", False),
    "phase_margin": ("phase margin", "°", False),
    "modulus_margin": ("least distance to -1", "1", False),
    "pole_radius": ("largest pole of the sampled loop, |z|", "1", True),
}
FIGURES = TRACKING | MARGINS


def first_counted(period: float | None, T: float, samples: int) -> int:
    """The first sample that errors count from: as in a result's metrics, the first period is left out."""
    if not period:
        return 0
    first = ceil(period / T - 0.5 - 1e-9)
    return first if first < samples else 0


def voltage_limits(plan: Any) -> Limits:
    """The converter's lowest and highest voltage, and its step (0 without quantization), V."""
    board = plan.machine.converter
    return limits(board.range, board.bits, saturation=plan.saturation, quantization=plan.quantization)


def tracking_row(error: np.ndarray, command: np.ndarray, first: int, limits: Limits, T: float) -> Any:
    """The figures of `TRACKING` from a run's samples: reference - measured, and the command voltage."""
    found = error_metrics(error[first:])
    low, high, _ = limits
    saturated = T * float(np.count_nonzero((command <= low) | (command >= high)))
    worst, rms = found["max_abs_error"], found["rms_error"]
    return (
        np.inf if worst is None else worst,
        np.inf if rms is None else rms,
        float(np.abs(command).max()),
        saturated,
    )
