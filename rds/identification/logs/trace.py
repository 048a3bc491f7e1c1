"""Whether two logs hold the same motion, though no number of the one is in the other.

A copy with a count of noise, resampled, or of every second sample shares no window with its original, so no fingerprint
knows it. But it passes through the same places at the same times. A trace is where a log was, relative to its mean, at
128 times equally far apart; another log is the same motion where its positions at these times are as near as noise
allows, from the time that both say or from the begin of both.
"""

from __future__ import annotations

import numpy as np

from rds.core.errors import InputError
from rds.identification.logs.log import Log
from rds.identification.logs.motion import noise

_POINTS = 128
_LEAST = 24  # points that both must have
_TIMES = 4.0  # times the noise: as near as that is the same
_SMALL = 0.05  # of the motion: noise that is larger hides what is the same
_AS_LONG = 0.02  # share by which the lengths of two logs may differ that begin at different times


def trace(log: Log) -> str:
    """Begin and length (s), and the positions at the points: numbers with blanks between them; "" for a log at rest."""
    begin, end = float(log.time[0]), float(log.time[-1])
    if len(log) < _POINTS or not np.ptp(log.position) > 0.0:
        return ""
    places = np.interp(np.linspace(begin, end, _POINTS), log.time, log.position)
    return f"{begin:.9g} {end - begin:.9g} " + " ".join(f"{p:.6g}" for p in places - places.mean())


def retraced(log: Log, known: str, resolution: float = 0.0) -> float:
    """The share (0 to 1) of the log that is the motion of the trace `known`, within the noise of the log.

    `resolution` is that of the trace's encoder: a filtered copy has no noise of its own, and is as far off as rounding.
    """
    begin, length, places = _read(known)
    own = float(log.time[-1] - log.time[0])
    allowed = _TIMES * max(noise(log.position), log.resolution or 0.0, resolution)
    times = begin + np.linspace(0.0, length, _POINTS)
    starts = [0.0]  # by the times themselves
    if abs(own / length - 1.0) < _AS_LONG:
        starts.append(float(log.time[0]) - begin)  # both from their begin
    share = 0.0
    for start in starts:
        at = times + start
        inside = (at >= log.time[0]) & (at <= log.time[-1])
        if inside.sum() < _LEAST:
            continue
        here, there = np.interp(at[inside], log.time, log.position), places[inside]
        off = (here - here.mean()) - (there - there.mean())
        size = float(there.std())
        if float(np.sqrt(np.mean(off**2))) <= min(allowed, _SMALL * size):
            share = max(share, min(float(np.ptp(at[inside])) / own, 1.0))
    return share


def _read(known: str) -> tuple[float, float, np.ndarray]:
    try:
        begin, length, *places = (float(word) for word in known.split())
    except ValueError:
        places = []
    if len(places) != _POINTS or not length > 0.0:
        raise InputError(
            f"trace = {known!r:.60} must be begin, length and {_POINTS} positions, with blanks between them"
        )
    return begin, length, np.array(places)
