"""The options of the P and PID laws: LinuxCNC's names and meanings (pid component), one unit table for all.

"mm" stands for the axis's unit: degrees for a rotary axis, rev/min for a spindle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any

from rds.core.options import Option
from rds.core.types import Controller

GAINS = {
    "Pgain": Option("proportional gain, V/mm", at_least=0.0),
    "Igain": Option("integral gain, V/(mm s)", at_least=0.0),
    "Dgain": Option("derivative gain, V/(mm/s)", at_least=0.0),
}
BIAS = {"bias": Option("constant added to the output, V")}
FEEDFORWARD = {
    "FF0": Option("zeroth-order feedforward, V per mm of reference"),
    "FF1": Option("first-order feedforward, V per mm/s of reference"),
    "FF2": Option("second-order feedforward, V per mm/s² of reference"),
}
DEADBAND = {"deadband": Option("error that counts as none, mm; 0 = none", at_least=0.0)}
ERROR_LIMITS = {
    "maxerror": Option("limit of the error, mm; 0 = no limit", at_least=0.0),
    "maxerrorI": Option("limit of the error's integral, mm s; 0 = no limit", at_least=0.0),
    "maxerrorD": Option("limit of the error's derivative, mm/s; 0 = no limit", at_least=0.0),
}
OUTPUT_LIMIT = {"maxoutput": Option("limit of the output, V; 0 = the converter's range", at_least=0.0)}
FILTER = {"derivative_filter": Option("time constant of the derivative's filter, s; 0 = none", at_least=0.0)}


def limit_or_none(value: float) -> float:
    """A limit as laws compare with it: 0, which stands for "no limit", becomes infinity."""
    return value if value > 0.0 else inf


def output_limit(maxoutput: float, converter_range: float) -> float:
    """The voltage at which a law's output saturates: the converter's range, or less if `maxoutput` asks for less."""
    return min(limit_or_none(maxoutput), converter_range)


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
