"""What a law is tuned from: the axis's time constant and gain, the sample period and the converter's range."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.core.types import SPINDLE_UNIT


class AxisData(NamedTuple):
    """An axis as its controller sees it."""

    tau: float  # s
    K: float  # (mm/s)/V; (rev/min)/V for a spindle
    T: float  # s
    converter_range: float  # V, inf without a limit
    spindle: bool  # first order, its speed measured; else second order, its position measured


_MODEL = {
    "tau": Quantity("time constant of the axis", "s", above=0.0),
    "K": Quantity("gain of the axis; (rev/min)/V for a spindle", "(mm/s)/V", above=0.0),
}


LONGEST_DELAY = 200  # samples


def axis_data(axis_model: Mapping[str, Any], T: float, converter_range: float, unit: str, owner: str) -> AxisData:
    """The checked data of an axis; InputError if something is missing or impossible."""
    for name, option in _MODEL.items():
        if name not in axis_model:
            raise InputError(
                f"{owner} needs the axis's {name} ({option.described}), which its model does not give; "
                f"use the machine's axis model or give {name} among the model's params"
            )
    return AxisData(
        tau=_MODEL["tau"].check(axis_model["tau"], "tau", owner),
        K=_MODEL["K"].check(axis_model["K"], "K", owner),
        T=SAMPLE_PERIOD.check(T, "T", owner),
        converter_range=Quantity("range of the converter", "V", above=0.0, infinite=True).check(
            converter_range, "converter_range", owner
        ),
        spindle=unit == SPINDLE_UNIT,
    )


def check_delayed(axis: AxisData, delay: float, owner: str) -> None:
    """InputError for a spindle, and for a delay (s) of more samples than a law remembers voltages of."""
    if axis.spindle:
        raise InputError(f"{owner} drives position axes; use the controller 'pid' for a spindle")
    if delay > LONGEST_DELAY * axis.T:
        what = f"{owner}: delay = {delay:g} s is more than {LONGEST_DELAY} samples of {axis.T:g} s"
        raise InputError(f"{what}; choose a shorter delay or a longer sample period")
