"""The options of the P and PID laws: LinuxCNC's names and meanings (pid component), one unit table for all.

"mm" stands for the axis's unit: degrees for a rotary axis, rev/min for a spindle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any

from rds.core.quantities import Quantity
from rds.core.types import Controller

GAINS = {
    "Pgain": Quantity("proportional gain", "V/mm", low=0.0),
    "Igain": Quantity("integral gain", "V/(mm s)", low=0.0),
    "Dgain": Quantity("derivative gain", "V/(mm/s)", low=0.0),
}
BIAS = {"bias": Quantity("constant added to the output", "V")}
FEEDFORWARD = {
    "FF0": Quantity("zeroth-order feedforward", "V per mm of reference"),
    "FF1": Quantity("first-order feedforward", "V per mm/s of reference"),
    "FF2": Quantity("second-order feedforward", "V per mm/s² of reference"),
    "FF3": Quantity("third-order feedforward, of the change of the acceleration", "V per mm/s³ of reference"),
}
COMMAND_LIMITS = {
    "maxcmdD": Quantity("limit of the velocity that is fed forward; 0 = no limit", "mm/s", low=0.0),
    "maxcmdDD": Quantity("limit of the acceleration that is fed forward; 0 = no limit", "mm/s²", low=0.0),
}
DEADBAND = {"deadband": Quantity("error that counts as none; 0 = none", "mm", low=0.0)}
ERROR_LIMITS = {
    "maxerror": Quantity("limit of the error; 0 = no limit", "mm", low=0.0),
    "maxerrorI": Quantity("limit of the error's integral; 0 = no limit", "mm s", low=0.0),
    "maxerrorD": Quantity("limit of the error's derivative; 0 = no limit", "mm/s", low=0.0),
}
OUTPUT_LIMIT = {"maxoutput": Quantity("limit of the output; 0 = the converter's range", "V", low=0.0)}
FILTER = {"derivative_filter": Quantity("time constant of the derivative's filter; 0 = none", "s", low=0.0)}


def limit_or_none(value: float) -> float:
    """A limit as laws compare with it: 0, which stands for "no limit", becomes infinity."""
    return value if value > 0.0 else inf


def output_limit(maxoutput: float, converter_range: float) -> float:
    """The voltage at which a law's output saturates: the converter's range, or less if `maxoutput` asks for less."""
    return min(limit_or_none(maxoutput), converter_range)


def integral_unit(unit: str) -> str:
    """The unit of the integral over time of what is in `unit`: mm·s, (rev/min)·s."""
    return f"({unit})·s" if "/" in unit else f"{unit}·s"


def retuned(
    make: Callable[..., Controller],
    axis_model: Mapping[str, Any],
    T: float,
    converter_range: float,
    unit: str,
    values: Mapping[str, float],
) -> Mapping[str, Any]:
    """The parameters of a law after its options were changed while it runs: those that `make` gives with `values`."""
    return make(axis_model, T, converter_range, unit=unit, **values).params
