"""Signals that hold many frequencies at once, or one after the other: for measuring a frequency response.

A multisine is a sum of sinusoids on whole multiples of its base frequency, all of one size. Schroeder's phases (1970)
keep its peak at less than twice its root mean square times √2, where equal phases would pile up. It repeats after one
base period, so that over whole periods nothing leaks from one frequency into another. With `lines = "odd"` only odd
multiples are there: what friction, an odd function of the velocity, adds then falls on odd lines too, and the even ones
show other nonlinearities. A chirp's frequency rises evenly, falls again, and so on.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import ceil, floor
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Choice, Declaration, Quantity, checked
from rds.references.signal import Motion, Signal

LINES = ("all", "odd")
_MOST_LINES = 2000
_HIGHEST = 1e6  # multiple: the peak is looked for in a whole base period, with some points for each oscillation
_PER_PERIOD = 16  # points of the fastest sinusoid's period at which the peak is looked for
_BESIDE = 0.98  # of the peak: what a point beside it has at least, cos(π/16)
_NEWTON = 4  # steps
OPTIONS: Mapping[str, Declaration] = {
    "amplitude": Quantity("middle to peak", "V or mm", low=0.0),
    "frequency": Quantity("the base frequency, of which all others are multiples", "Hz", above=0.0),
    "lowest": Quantity("frequency", "Hz", above=0.0),
    "highest": Quantity("frequency", "Hz", above=0.0),
    "sweep": Quantity("time from the lowest to the highest frequency", "s", above=0.0),
    "offset": Quantity("middle of the signal", "V or mm"),
    "lines": Choice("which multiples of the base frequency it has", LINES, "all"),
}


def multisine(
    amplitude: float, frequency: float, lowest: float, highest: float, lines: str = "all", offset: float = 0.0
) -> Signal:
    """Sinusoids of one size on the multiples of `frequency` from `lowest` to `highest`, `amplitude` at the peak.

    V or mm, Hz. `lines` is "all" or "odd" multiples. Derivatives are exact. Raises InputError for a value that will
    not do, or a band that holds no multiple.
    """
    settings = _checked(
        "multisine", amplitude=amplitude, frequency=frequency, lowest=lowest, highest=highest, offset=offset
    )
    checked(OPTIONS["lines"], lines, "lines", "multisine")
    base = settings["frequency"]
    if settings["highest"] / base > _HIGHEST:
        raise InputError(
            f"multisine: highest = {settings['highest']:g} Hz is more than {_HIGHEST:g} times frequency = {base:g} Hz; "
            "give a higher `frequency`"
        )
    first, last = max(ceil(settings["lowest"] / base - 1e-9), 1), floor(settings["highest"] / base + 1e-9)
    multiples = np.arange(first, last + 1) if lines == "all" else np.arange(first | 1, last + 1, 2)
    if not 1 <= len(multiples) <= _MOST_LINES:
        raise InputError(
            f"multisine: {len(multiples)} {lines if lines == 'odd' else ''} multiples of {base:g} Hz lie between "
            f"{settings['lowest']:g} and {settings['highest']:g} Hz; it takes 1 to {_MOST_LINES}: change `frequency`"
        )
    phases = -np.pi * np.arange(len(multiples)) * np.arange(1, len(multiples) + 1) / len(multiples)
    omegas = 2.0 * np.pi * base * multiples
    made: dict[str, Any] = {
        "size": settings["amplitude"] / _peak(omegas, phases, _PER_PERIOD * int(multiples[-1])),
        "omegas": omegas,
        "phases": phases,
        "offset": settings["offset"],
    }
    return Signal(
        "multisine",
        partial(_multisine, **made),
        1.0 / base,
        {**settings, "lines": lines},
        voltage=partial(_position, **made),
        fastest=float(multiples[-1] * base),
    )


def chirp(amplitude: float, lowest: float, highest: float, sweep: float, offset: float = 0.0) -> Signal:
    """A sinusoid whose frequency rises evenly from `lowest` to `highest` in `sweep` s, falls again, and so on.

    V or mm, Hz, s. Starts at the middle, upward; phase, and with it the derivatives' angle, never jumps. Raises
    InputError for a value that will not do.
    """
    settings = _checked("chirp", amplitude=amplitude, lowest=lowest, highest=highest, sweep=sweep, offset=offset)
    motion: Any = _chirp
    return Signal("chirp", partial(motion, **settings), None, settings, fastest=settings["highest"])


def _checked(kind: str, **given: Any) -> dict[str, float]:
    settings = {name: checked(OPTIONS[name], value, name, kind) for name, value in given.items()}
    if not settings["lowest"] <= settings["highest"]:
        raise InputError(
            f"{kind}: lowest = {settings['lowest']:g} Hz is above highest = {settings['highest']:g} Hz; exchange them"
        )
    return settings


def _sum(t: np.ndarray, omegas: np.ndarray, phases: np.ndarray, derivative: int) -> np.ndarray:
    total = np.zeros_like(t)
    for omega, phase in zip(omegas, phases, strict=True):  # not one table of all: samples times lines may be 10^8
        total += omega**derivative * np.sin(omega * t + phase + 0.5 * np.pi * derivative)
    return total


def _peak(omegas: np.ndarray, phases: np.ndarray, points: int) -> float:
    """The largest value of the sum in a period: Newton's method, from those of so many points that may be beside it."""
    step = 2.0 * np.pi / (_PER_PERIOD * omegas[-1])
    t = np.arange(points) * step
    values = np.abs(_sum(t, omegas, phases, 0))
    t = t[values >= _BESIDE * values.max()]
    for _ in range(_NEWTON):
        slope, bend = _sum(t, omegas, phases, 1), _sum(t, omegas, phases, 2)
        t = t - np.clip(slope / np.where(bend == 0.0, np.inf, bend), -step, step)
    return float(max(values.max(), np.abs(_sum(t, omegas, phases, 0)).max()))


def _position(t: np.ndarray, size: float, omegas: np.ndarray, phases: np.ndarray, offset: float) -> np.ndarray:
    """Of a multisine, without its derivatives: a third of the time."""
    return offset + size * _sum(t, omegas, phases, 0)


def _multisine(t: np.ndarray, size: float, omegas: np.ndarray, phases: np.ndarray, offset: float) -> Motion:
    position, velocity, acceleration = (size * _sum(t, omegas, phases, k) for k in range(3))
    return offset + position, velocity, acceleration


def _chirp(t: np.ndarray, amplitude: float, lowest: float, highest: float, sweep: float, offset: float) -> Motion:
    rate = (highest - lowest) / sweep  # Hz/s
    both = np.floor(t / (2.0 * sweep))
    since = t - 2.0 * sweep * both
    rising = since < sweep
    back = np.where(rising, 0.0, since - sweep)
    up = np.where(rising, since, sweep)
    frequency = lowest + rate * (up - back)
    cycles = both * (lowest + highest) * sweep
    cycles += lowest * up + 0.5 * rate * up**2 + highest * back - 0.5 * rate * back**2
    angle, omega = 2.0 * np.pi * cycles, 2.0 * np.pi * frequency
    slope = np.where(rising, 2.0 * np.pi * rate, -2.0 * np.pi * rate)
    swing = amplitude * np.sin(angle)
    return offset + swing, amplitude * omega * np.cos(angle), amplitude * slope * np.cos(angle) - omega**2 * swing
