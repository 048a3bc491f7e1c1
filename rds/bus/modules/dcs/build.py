"""The units of a machine, and the line with them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rds.bus.hub.bus_settings import DEFAULT_BAUD, OF_OWN_LINE, serial_fault
from rds.bus.modules.dcs.frames import SLOTS, UNITS, byte_time
from rds.bus.modules.dcs.line import FieldLine
from rds.bus.modules.dcs.motors import make_motor
from rds.bus.modules.dcs.unit import GAP, Unit
from rds.bus.modules.drift import drift_by_axis
from rds.core.errors import InputError
from rds.machines.machine import Axis, Machine

OPTIONS = ("baud", *OF_OWN_LINE)


def make_units(machine: Machine, baud: float, start: float, drift: Mapping[str, float], gap: float) -> list[Unit]:
    """A unit for each axis. InputError for a machine that a line cannot have: more than six axes, units above 15."""
    if len(machine.axes) > SLOTS:
        raise InputError(f"{len(machine.axes)} axes; a frame has places for {SLOTS}; serve it on CAN", machine.path)
    units = []
    for slot, axis in enumerate(machine.axes.values()):
        if axis.node not in UNITS:
            raise InputError(
                f"axis {axis.name} has node {axis.node}; units on a serial line have {UNITS[0]} to {UNITS[-1]}",
                machine.path,
            )
        units.append(_make_unit(machine, axis, slot, baud, start, drift[axis.name] * 1e-6, gap))
    return units


def _make_unit(machine: Machine, axis: Axis, slot: int, baud: float, start: float, drift: float, gap: float) -> Unit:
    try:
        motor = make_motor(axis, start, machine.converter.range)
    except InputError as error:
        raise InputError(str(error), machine.path) from None
    return Unit(
        axis.name,
        axis.node,
        slot,
        motor,
        blu=axis.resolution,
        byte_time=byte_time(baud),
        start=float(axis.module.get("start", 0.0)),
        switch=axis.travel[0],
        drift=drift,
        gap=gap,
    )


def make_line(machine: Machine, start: float = 0.0, **options: Any) -> FieldLine:
    """The line of a machine, its units switched on at the instant `start`.

    Options: `baud` (bit/s), `noise` (share of bytes), `seed` of the noise, `drift` (ppm by axis, "X:50,Y:-30" or a
    table), `gap` (s of silence that ends half a frame). InputError for another one, or a value that cannot be.
    """
    unknown = sorted(set(options) - set(OPTIONS))
    if unknown:
        raise InputError(f"the serial line has no option {', '.join(unknown)}; it takes {', '.join(OPTIONS)}")
    if (fault := serial_fault(options)) is not None:
        raise InputError(f"{fault[0]} = {options[fault[0]]!r} {fault[1]}")
    baud = options.get("baud", DEFAULT_BAUD)
    noise: float = options.get("noise", 0.0)
    gap: float = options.get("gap", GAP)
    units = make_units(machine, baud, start, drift_by_axis(options.get("drift", {}), machine), gap)
    return FieldLine(units, baud, noise, options.get("seed", 1))
