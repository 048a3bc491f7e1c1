"""Where the position leaps: a slip of the encoder, a lost count, a jolt. Told from the log alone, with the time.

At a leap one step of the position is none of those beside it: it lies outside what the steps before and after span, by
far more than noise and the encoder's own steps do. A change of speed, however quick, has it between them. A slip that
is smaller than a few of these shows beside a model only (`fit/upsets.py`).
"""

from __future__ import annotations

import numpy as np

from rds.identification.logs.log import Finding, Gravity, Log
from rds.machines.machine import Axis

_CLEAR = 8.0  # robust standard deviations of what a step differs from its neighbours
_STEPS = 4.0  # encoder steps
_FAINT, _FAST = 0.05, 0.999  # of what the axis moves in a sample where it is fast: ripples of a filter are less
_BESIDE = 3.0  # times what the steps before and after differ by
_NEIGHBOURS = 4  # steps to each side
_FEW = 20  # leaps, beyond which it is noise of an odd kind
_TOLD = 3
_RARE = 0.005  # of the samples: those of spikes at either side
_ALONE = 8.0  # times the usual step of those that are none of 0
_QUIET = 0.2  # of the command's range: noise of a measured current
_LEAP = 0.25  # of the usual range of a speed, in one sample


def leaps(log: Log, axis: Axis | None) -> list[Finding]:
    """A finding with sample, time and size for the first leaps of the position; of a speed, for its spikes."""
    if len(log) < 50 * _NEIGHBOURS:
        return []
    if log.is_rate:
        return _spikes(log)
    rate = np.diff(log.position) / np.diff(log.time)
    curve = rate[1:-1] - 0.5 * (rate[:-2] + rate[2:])
    period = log.sample_period
    usual = 1.4826 * float(np.median(np.abs(curve))) if len(curve) else 0.0
    faint = _STEPS * log.resolution / period if log.resolution else _FAINT * float(np.quantile(np.abs(rate), _FAST))
    least = max(_CLEAR * usual, faint)
    candidates = np.flatnonzero(np.abs(curve) > least) + 1
    found = [(k, size) for k in candidates[: 50 * _FEW].tolist() if abs(size := _outside(rate, k)) > least]
    # a reading that is off by itself leaps there and back
    found = [(k, size) for k, size in found if not any(j in (k - 1, k + 1) for j, _ in found)]
    if not 0 < len(found) <= _FEW:
        return []
    unit = log.units.get("position", "mm")
    places = ", ".join(
        f"at {log.time[k + 1]:.4g} s by {size * (log.time[k + 1] - log.time[k]):+.3g} {unit}"
        for k, size in found[:_TOLD]
    )
    more = f" and {len(found) - _TOLD} times more" if len(found) > _TOLD else ""
    what = (
        f"the position leaps {places}{more}, in one sample and unlike the motion before and after: did the encoder "
        f"slip, or something jolt the axis?{late(log)} Split the log there, or leave that stretch out"
    )
    return [Finding("leap", what, Gravity.WARNING, found[0][0] + 1)]


def late(log: Log) -> str:
    """A question beside that for a slip, where a run says of its log that samples were late; "" elsewhere."""
    is_late = any(finding.kind == "clock" and "samples were late" in finding.what for finding in log.findings)
    return " Or was that sample late, as the run's timing says of some?" if is_late else ""


def _spikes(log: Log) -> list[Finding]:
    """A speed that leaves its range for few samples, by a leap in one of them, under a command within its own range; or
    that leaps within it for one sample, under a command that does not change.

    A drive's counter that wraps or loses counts makes such speeds, and a filter behind it draws them out.
    """
    speed, command = log.position, log.command
    low, high = np.quantile(speed, [_RARE, 1.0 - _RARE])
    range_ = float(high - low)
    off = np.maximum(speed - high, low - speed) > range_
    usual = (command >= np.quantile(command, _RARE)) & (command <= np.quantile(command, 1.0 - _RARE))
    least = max(_LEAP * range_, _STEPS * (log.resolution or 0.0))
    leaps = np.abs(np.diff(speed, prepend=speed[0])) > least
    starts = np.flatnonzero(off[1:] & ~off[:-1]) + 1
    found = {int(k) for k in starts if leaps[max(k - 1, 0) : k + 2].any() and usual[k]} | _alone(
        speed, command, 0.1 * range_
    )
    if abs(speed[0]) > max(abs(low), abs(high)) + range_ and leaps[1]:
        found.add(0)
    if range_ == 0.0 or not 0 < len(found) <= _RARE * len(log):
        return []
    unit = log.units.get("position", "rev/min")
    first = sorted(found)[:_TOLD]
    places = ", ".join(f"at {log.time[k]:.4g} s to {speed[k]:.4g}" for k in first)
    more = f" and {len(found) - _TOLD} times more" if len(found) > _TOLD else ""
    what = (
        f"the speed spikes {places} {unit}{more} (it is usually from {low:.4g} to {high:.4g} {unit}), with nothing in "
        "the command: did the encoder lose counts, or its counter begin again? Empty those cells, with "
        'blanks = "drop" and gaps = "split" in the map'
    )
    return [Finding("leap", what, Gravity.WARNING, first[0])]


def _alone(speed: np.ndarray, command: np.ndarray, least: float) -> set[int]:
    """Samples that are off by `least` both from the one before and the one after, which are near each other."""
    steps = np.diff(speed)
    if not steps.any():
        return set()
    there, back = steps[:-1], -steps[1:]
    size = np.where(there * back > 0.0, np.minimum(np.abs(there), np.abs(back)), 0.0)
    found = np.flatnonzero(
        (size > max(least, _ALONE * float(np.median(np.abs(steps[steps != 0.0])))))
        & (np.abs(there - back) < 0.25 * size)
    )
    still = _QUIET * float(np.ptp(command))
    return {int(k) + 1 for k in found if np.ptp(command[max(k - _NEIGHBOURS, 0) : k + 3]) <= still}


def _outside(rate: np.ndarray, k: int) -> float:
    """By how much the rate at `k` lies outside what those before and after span; 0 for within, or near."""
    before, after = rate[max(k - _NEIGHBOURS, 0) : k], rate[k + 1 : k + 1 + _NEIGHBOURS]
    if not len(before) or not len(after):
        return 0.0
    beside = np.concatenate([before, after])
    low, high = float(beside.min()), float(beside.max())
    off = float(rate[k]) - high if rate[k] > high else min(float(rate[k]) - low, 0.0)
    return off if abs(off) > _BESIDE * abs(float(np.median(after)) - float(np.median(before))) else 0.0
