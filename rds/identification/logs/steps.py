"""Steps and ends of the values in a log: the encoder's resolution, the converter's limits, the ends of the travel."""

from __future__ import annotations

import numpy as np

from rds.identification.logs.log import Finding, Gravity, Log
from rds.machines.machine import Axis

BEYOND_MEASURE = 1e15  # nothing that was measured is larger, in whatever unit; squares and sums of less stay finite
_LOOKED_AT = 200_000  # samples
_CHUNKS = 20
_ULPS = 8.0  # of the largest value: what rounding makes of a difference
_OFF = 0.05  # of a step: what is nearer to a multiple is one
_TRIED = 2_000  # distinct differences
_NOTED, _MANY = 1e-3, 0.01  # of the samples
_HELD = 20  # samples in a row
_LEVELS = 20  # distinct values: fewer are a signal of steps, whose extremes are meant


def step_of(values: np.ndarray) -> float | None:
    """The step of which all differences are multiples, in the values' unit; None where there is none to be seen.

    The greatest common divisor of the differences, to within rounding; then fitted to all of them.
    """
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest > BEYOND_MEASURE:
        return None
    differences = np.abs(np.concatenate([np.diff(chunk) for chunk in _chunks(values)]))
    single = bool(np.all(values[:1000] == values[:1000].astype(np.float32)))
    rounding = _ULPS * float(np.spacing(np.float32(largest)) if single else np.spacing(largest))
    differences = differences[differences > rounding]
    if len(differences) < 4:
        return None
    distinct = np.unique(np.rint(differences / rounding))[:_TRIED] * rounding
    step = float(distinct[0])
    for difference in distinct[1:].tolist():
        rest = abs(difference - round(difference / step) * step)
        while rest > max(_OFF * step, 4.0 * rounding):  # Euclid: the step is finer than it looked
            step, rest = rest, abs(step - round(step / rest) * rest)
            if step < 16.0 * rounding:
                return None
        step = difference / round(difference / step)  # the larger the difference, the better it tells the step
    turns = np.rint(differences / step)
    step = float(differences @ turns / (turns @ turns))
    off = np.abs(differences - turns * step)
    return float(f"{step:.9g}") if float(off.max()) < _OFF * step else None


def quantization(log: Log, axis: Axis | None) -> list[Finding]:
    """The steps of position and command, and whether the position's is the one that was stated."""
    found = []
    unit = log.units.get("position", "mm")
    measured = "speed" if log.is_rate else "position"
    step = step_of(log.position)
    stated = axis.resolution if axis is not None and axis.unit == unit else log.resolution
    if step is not None:
        what = f"{measured} comes in steps of {step:.6g} {unit}"
        if stated is not None and not 0.99 < step / stated < 1.01:
            multiple = step / stated
            if 0.99 < multiple / round(multiple) < 1.01 if multiple > 1.0 else False:
                what += (
                    f", {multiple:.0f} of the stated resolution ({stated:.6g} {unit}); was it rounded when it was kept?"
                )
            else:
                what += f", where the resolution is stated as {stated:.6g} {unit}; check resolution and unit"
            found.append(Finding("quantization", what, Gravity.WARNING))
        else:
            found.append(Finding("quantization", what))
    elif stated is not None:
        what = f"no steps are seen in the {measured}, where the resolution is stated as {stated:.6g} {unit}"
        found.append(Finding("quantization", f"{what}: it was filtered, interpolated or simulated"))
    volts = step_of(log.command)
    if volts is not None and len(np.unique(log.command[:_LOOKED_AT])) > _LEVELS:
        found.append(Finding("quantization", f"command comes in steps of {volts:.6g} {log.units.get('command', 'V')}"))
    return found


def saturation(log: Log, axis: Axis | None) -> list[Finding]:
    """Commands at the converter's limits, and positions at the ends of the travel."""
    found = []
    command, unit = log.command, log.units.get("command", "V")
    low, high = float(command.min()), float(command.max())
    if log.voltage_range is not None:
        slack = 1e-3 * (log.voltage_range[1] - log.voltage_range[0])
        at = (command <= log.voltage_range[0] + slack) | (command >= log.voltage_range[1] - slack)
        share = float(at.mean())
        if share > _NOTED:
            what = (
                f"command is at its limits ({log.voltage_range[0]:g} and {log.voltage_range[1]:g} {unit}) in "
                f"{100 * share:.3g} % of the samples: what acted is known only if it was logged behind the limit"
            )
            gravity = Gravity.WARNING if share > _MANY else Gravity.NOTE
            found.append(Finding("saturation", what, gravity, int(np.argmax(at))))
    elif len(np.unique(command[:_LOOKED_AT])) > _LEVELS:
        usual = _usual_run(command)
        for value in (low, high):
            if value == 0.0:  # of commands one way: the axis was left alone
                continue
            at = command == value
            if usual >= _HELD and np.count_nonzero(np.diff(at, prepend=False) & at) == 1 and _longest(at) <= 2 * usual:
                continue  # of levels that are each held, the highest is held as well
            if at.mean() > _MANY and _longest(at) >= _HELD:
                share = 100 * float(at.mean())
                what = f"command stays at {value:g} {unit}, its extreme, in {share:.3g} % of the samples: limited?"
                found.append(
                    Finding("saturation", f"{what} State voltage_range in the map", Gravity.WARNING, int(np.argmax(at)))
                )
    return found + _ends(log, axis)


def _ends(log: Log, axis: Axis | None) -> list[Finding]:
    unit = log.units.get("position", "mm")
    if log.is_rate:
        return []
    if axis is not None and axis.unit == unit:
        out = (log.position <= axis.travel[0]) | (log.position >= axis.travel[1])
        if out.any():
            k = int(np.argmax(out))
            ends = f"{axis.travel[0]:g} to {axis.travel[1]:g} {unit}"
            what = f"position reaches the end of the travel ({ends}) at sample {k}"
            return [Finding("saturation", f"{what}: from there on it is not the axis that answers", Gravity.WARNING, k)]
        return []
    strong = 0.5 * float(np.abs(log.command).max())
    for value, sign in ((float(log.position.min()), -1.0), (float(log.position.max()), 1.0)):
        pushed = (log.position == value) & (sign * log.command > strong)
        if strong > 0.0 and _longest(pushed) >= 5 * _HELD:
            k = int(np.argmax(pushed))
            what = f"position stays at {value:g} {unit}, its extreme, against the command from sample {k}: an end stop?"
            return [Finding("saturation", what, Gravity.WARNING, k)]
    return []


def _usual_run(values: np.ndarray) -> float:
    """The median length of the runs of one value."""
    edges = np.flatnonzero(np.diff(values))
    return float(np.median(np.diff(np.concatenate([[-1], edges, [len(values) - 1]]))))


def _longest(mask: np.ndarray) -> int:
    """The length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _chunks(values: np.ndarray) -> list[np.ndarray]:
    """All values, or as many as are looked at, in stretches spread over the log."""
    if len(values) <= _LOOKED_AT:
        return [values]
    length = _LOOKED_AT // _CHUNKS
    return [values[a : a + length] for a in np.linspace(0, len(values) - length, _CHUNKS).astype(int)]
