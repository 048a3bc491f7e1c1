"""Whether columns, signs and units can be what the map says: a motion that follows its command, at a credible size."""

from __future__ import annotations

from math import log10

import numpy as np

from rds.identification.logs.log import Finding, Gravity, Log
from rds.identification.logs.motion import Motion, correlation, motion
from rds.machines.machine import Axis

_LAGS = 10  # windows by which a motion may follow its command
_CLEAR, _FAINT = 0.5, 0.15  # correlations
_STILL = 0.1  # of the motion's range: that of a reference which does not make it
_BRAKED = 0.1  # of the energy that a force could give: what noise, gravity and the ends of a log may take
_NEAR = 0.7  # of the largest correlation: a peak as good as it
_JUMP, _SMOOTH = 0.3, 0.1  # of the range, in one sample: what a command may do, and a position does not
_LEAP = 0.8  # of the range of a position, in one sample: no axis does that
_FACTOR = 30.0  # of the expected size: beyond it a unit is wrong, not an axis
_DRIVEN = 3.0  # times the voltage that overcomes friction
_FASTEST, _LONGEST = 20e3, 100e3  # mm/s, mm
_FINEST, _COARSEST = 1e-7, 0.5  # mm: steps of an encoder
_SPINDLE = 500e3  # rev/min
_SLOWEST = 0.2  # s, sample period
_VOLTS = 1e3
_TRACKED = 0.1  # standard deviation of the error over that of the reference: no voltage finds the way so well by itself
_LOOP_UNKNOWN = "whether a controller was closing the loop is not known; state closed_loop in the map"


def direction(log: Log, axis: Axis | None) -> list[Finding]:
    """Whether the motion follows the command, against it, or the two columns are swapped."""
    if np.ptp(log.command) == 0.0 or np.ptp(log.position) == 0.0:
        return []
    if around := _wraps(log):
        return [around]
    jump = {name: float(np.abs(np.diff(v)).max() / np.ptp(v)) for name, v in _both(log).items()}
    seen = motion(log)
    if jump["position"] > _JUMP and jump["command"] < _SMOOTH and not log.is_rate and not _noisy_or_led(log, seen):
        what = (
            f"the position jumps by {100 * jump['position']:.0f} % of its range in a sample, and the command by "
            f"{100 * jump['command']:.2g} %: they are swapped, as it seems"
        )
        return [Finding("columns", what, Gravity.FAULT)]
    if log.units.get("command", "V") != "V":
        return _driven(seen)
    follows = _follows(seen)
    if (only_held := held(log, follows)) is not None:
        return [only_held]
    if follows < -_CLEAR:
        what = (
            f"the axis moves against its command (correlation {follows:.2f}): give one of them sign = -1 in the map, "
            "or they are swapped"
        )
        return [Finding("sign", what, Gravity.FAULT)]
    if follows < _FAINT and len(seen.speed) > 5 * _LAGS:
        what = f"the motion hardly follows the command (correlation {follows:.2f} at best): "
        one_sign = log.command.min() >= 0.0 or log.command.max() <= 0.0
        if one_sign and seen.speed.min() < -seen.moves and seen.speed.max() > seen.moves:
            what += "the axis moves both ways, and the command has one sign: is it a magnitude? Take one with its sign"
        else:
            what += "is the position of this axis, and of this time?"
        return [Finding("columns", what, Gravity.WARNING)]
    return []


def held(log: Log, follows: float | None = None) -> Finding | None:
    """Whether a controller seems to do nothing but hold the axis where it is, against disturbances; None if not.

    By a reference that stands still beside the motion; without one, by a motion that hardly follows the command.
    `follows` is their correlation, where it is known.
    """
    if not log.closed_loop or log.units.get("command", "V") != "V":
        return None
    if np.ptp(log.command) == 0.0 or np.ptp(log.position) == 0.0:
        return None
    follows = _follows(motion(log)) if follows is None else follows
    reference = log.extra.get("reference")
    if follows >= _FAINT or (reference is None and follows <= -_CLEAR):
        return None
    if reference is not None and float(np.ptp(reference)) >= _STILL * float(np.ptp(log.position)):
        return None
    what = (
        f"in a closed loop, the motion does not follow the command (correlation {follows:.2f} at best): what moves the "
        "axis are disturbances, which the command answers, so how the axis answers the command does not show; log a "
        "motion whose reference changes"
    )
    return Finding("disturbed", what, Gravity.WARNING)


def _noisy_or_led(log: Log, seen: Motion) -> bool:
    """Whether a position that jumps is one all the same: noise jumps all the time, and a slip leaves the rest to follow
    its command.
    """
    jumps = np.abs(np.diff(log.position))
    return float(np.median(jumps)) > _SMOOTH * float(jumps.max()) or _follows(seen) > _CLEAR


def _driven(seen: Motion) -> list[Finding]:
    """Whether a force, torque or current drives the axis: over a log it gives what friction takes, and never less.

    An inertia stores what it was given and gives it back; so the speed need not follow the command.
    """
    size = float(np.sqrt((seen.command @ seen.command) * (seen.speed @ seen.speed)))
    share = float(seen.command @ seen.speed) / size if size > 0.0 else 0.0
    if share >= -_BRAKED:
        return []
    what = (
        f"the command takes more energy out of the axis than it gives ({100.0 * share:.0f} % of what it could give): "
        "give command or position sign = -1 in the map, or one of them is another column"
    )
    return [Finding("sign", what, Gravity.FAULT)]


def magnitudes(log: Log, axis: Axis | None) -> list[Finding]:
    """Whether the sizes are credible: against the machine's travel, gain and range, else against any machine's."""
    unit = log.units.get("position", "mm")
    found = []
    if log.units.get("command", "V") == "V":
        top = float(np.abs(log.command).max())
        reach = max(map(abs, log.voltage_range)) if log.voltage_range else None
        if reach is not None and top > 1.02 * reach:
            what = f"the command reaches {top:.4g} V, and the converter gives {reach:g} V at most: mV, or scaled?"
            found.append(Finding("units", what, Gravity.FAULT))
        elif reach is not None and 0.0 < top < reach / 1000.0:
            what = f"the command reaches {top:.4g} V of {reach:g} V only: is it in kV, or scaled?"
            found.append(Finding("units", what, Gravity.WARNING))
        elif reach is None and top > _VOLTS:
            found.append(Finding("units", f"the command reaches {top:.4g} V: is it in mV?", Gravity.WARNING))
    if log.sample_period > _SLOWEST:
        what = f"the sample period is {log.sample_period:.4g} s: is the time in ms?"
        found.append(Finding("units", what, Gravity.WARNING))
    if axis is not None and axis.unit == unit:
        return found + _against_machine(log, axis)
    return found + _against_any(log, unit)


def loop(log: Log, axis: Axis | None) -> list[Finding]:
    """Whether the command answers to the position: then noise goes round, and least squares may be biased."""
    told = "closed loop: the command answers to the position, so noise in the position is in the command as well"
    if log.closed_loop:
        return [Finding("closed-loop", told)]
    reference = log.extra.get("reference")
    if reference is None or np.ptp(log.command) == 0.0 or len(log) < 50:
        if log.closed_loop is None:
            return [Finding("loop", _LOOP_UNKNOWN)]
        return []
    stride = max(1, len(log) // 200_000)
    error, command = (reference - log.position)[::stride], log.command[::stride]
    ahead = np.gradient(reference, log.time)[::stride]
    alone = _unexplained(command, [ahead, np.gradient(ahead)])
    # not the error's slope: it holds the speed, which follows the command in an open loop as well
    with_error = _unexplained(command, [ahead, np.gradient(ahead), error])
    if with_error < 0.5 * alone:
        what = f"{told} (the error explains {100 * (1 - with_error / alone):.0f} % of what the reference leaves)"
        if log.closed_loop is False:
            what += "; the log is stated to be open loop"
        return [Finding("closed-loop", what, Gravity.WARNING)]
    if log.closed_loop is None:
        off, way = float(np.std(reference - log.position)), float(np.std(reference))
        if off < _TRACKED * way:
            what = (
                f"{told} (the position follows its reference to {100 * off / way:.2g} % of the way, which only a "
                "controller does); if none did, state closed_loop = false in the map"
            )
            return [Finding("closed-loop", what, Gravity.WARNING)]
        return [Finding("loop", _LOOP_UNKNOWN)]
    return []


def _wraps(log: Log) -> Finding | None:
    """A position that leaps by nearly its whole range, always as far, and creeps between: a counter begins again."""
    steps = np.diff(log.position)
    leaps = np.flatnonzero(np.abs(steps) > _LEAP * np.ptp(log.position))
    others = np.delete(np.abs(steps), leaps)
    if log.is_rate or not len(leaps) or not len(others) or others.max() == 0.0:
        return None
    size = np.abs(steps[leaps])
    if np.ptp(size) > 2.0 * others.max() or others.max() > _SMOOTH * size.min():
        return None
    unit = log.units.get("position", "mm")
    what = (
        f"the position leaps by {size.mean():.4g} {unit} {len(leaps)} times, first before sample {leaps[0] + 1}, and "
        f"moves by {others.max():.3g} {unit} at most else: a counter that begins again? Say in the map at which number "
        "of the column, as in position = { column = ..., wrap = 65536 }"
    )
    return Finding("wrap", what, Gravity.FAULT, int(leaps[0]) + 1)


def _both(log: Log) -> dict[str, np.ndarray]:
    return {"command": log.command, "position": log.position}


def _follows(seen: Motion) -> float:
    """The largest correlation of speed with command over the lags that an axis may have, with the sign of the first
    peak that comes near it.

    An axis follows a sine by less than a quarter of its period and its delay, so the peak of its own sign comes first;
    half a period later stands one of the other, and noise makes it the higher one as often as not.
    """
    most = min(_LAGS, len(seen.speed) // 4)
    values = [correlation(seen.command[: len(seen.command) - lag], seen.speed[lag:]) for lag in range(most + 1)]
    largest = max(map(abs, values))
    for value, following in zip(values, [*values[1:], 0.0], strict=True):
        if abs(value) > _NEAR * largest and (abs(following) < abs(value) or following * value < 0.0):
            return float(np.copysign(largest, value))
    return largest  # all are 0


def _against_machine(log: Log, axis: Axis) -> list[Finding]:
    unit = axis.unit
    travel, span = float(np.ptp(log.position)), axis.travel[1] - axis.travel[0]
    if travel > 1.5 * span:
        what = f"the position ranges over {travel:.4g} {unit}, and the travel is {span:g} {unit}: its unit is wrong"
        return [Finding("units", what, Gravity.FAULT)]
    gain, seen = axis.model.get("K"), motion(log)
    power = float(seen.command @ seen.command)
    if isinstance(gain, int | float) and gain and power > 0.0 and log.units.get("command") == "V":
        ratio = abs(float(seen.command @ seen.speed)) / power / gain
        friction = max(abs(float(axis.model.get(name, 0.0))) for name in ("friction_plus", "friction_minus"))
        is_driven = gain * float(np.abs(seen.command).max()) > _DRIVEN * friction  # else it may well stand still
        if ratio > _FACTOR or (is_driven and 0.0 < ratio < 1.0 / _FACTOR):
            what = (
                f"the axis moves {ratio:.2g} times as far as this machine's does for the same voltage (K = {gain:g}): "
                f"a unit is off, by a factor of about 10^{round(log10(ratio))}"
            )
            return [Finding("units", what, Gravity.FAULT)]
    top = float(np.abs(seen.speed).max())
    if axis.limits is not None and top > 5.0 * axis.limits.velocity:
        what = (
            f"the speed reaches {top:.4g} {unit}/s, and the axis is made for {axis.limits.velocity:g}: check the units"
        )
        return [Finding("units", what, Gravity.WARNING)]
    return []


def _against_any(log: Log, unit: str) -> list[Finding]:
    top = float(np.abs(motion(log).speed).max())
    if unit == "rev/min":
        what = f"the speed reaches {top:.4g} rev/min: check its unit"
        return [Finding("units", what, Gravity.WARNING)] if top > _SPINDLE else []
    if unit != "mm":
        return []
    travel, step = float(np.ptp(log.position)), log.resolution
    doubts = []
    if top > _FASTEST:
        doubts.append(f"the speed reaches {top:.4g} mm/s, more than machine axes do")
    if travel > _LONGEST:
        doubts.append(f"the axis travels {travel:.4g} mm")
    if step is not None and step < _FINEST:
        doubts.append(f"the position comes in steps of {step:.2g} mm, finer than encoders are")
    if step is not None and step > _COARSEST:
        doubts.append(f"the position comes in steps of {step:.4g} mm, coarser than encoders are (are they counts?)")
    what = f"{' and '.join(doubts)}: check the unit of the position"
    return [Finding("units", what, Gravity.WARNING)] if doubts else []


def _unexplained(values: np.ndarray, by: list[np.ndarray]) -> float:
    """The part of the variance of `values` that a linear combination leaves."""
    table = np.column_stack([*by, np.ones_like(values)])
    scales = np.linalg.norm(table, axis=0)
    scales[scales == 0.0] = 1.0
    solution, *_ = np.linalg.lstsq(table / scales, values, rcond=None)
    total = float(np.var(values))
    return float(np.var(values - table / scales @ solution)) / total if total > 0.0 else 1.0
