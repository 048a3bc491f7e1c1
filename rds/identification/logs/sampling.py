"""Whether a log is sampled so slowly that the axis is nearly at its speed within a sample, or repeats positions.

The mean velocity of a sample is a sum of the last commands, v = Σ h_i u_i + friction, and commands are known without
noise. Their mean lag Σ i h_i / Σ h_i, in samples, is τ/T of an axis with the time constant τ: a delay adds to it.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rds.identification.logs.log import Finding, Gravity, Log
from rds.machines.machine import Axis

_PERIODS = 2.0  # of the sample period: a time constant that is shorter is sampled too slowly
_ENOUGH = 0.2  # of a time constant: a sample period that tells it
_SHORTEST = 0.2  # of the sample period: what is shorter shows no more
_SURE = 4.0  # standard errors
_TAPS = 9  # commands
_LEAST = 60  # samples
_MOST = 50_000
_PLAIN = 3.0  # encoder steps in a sample: an axis that moves faster gives each sample a position of its own
_ROUNDED = 1e-6  # of the range: steps that rounding of floating-point numbers makes are less
_REPEATED = 0.15  # of the samples at such speeds: noise repeats fewer
_OFTEN = 20  # samples
_LONGEST = 20  # samples: an axis that has stood longer was at rest


def slow(log: Log, axis: Axis | None) -> list[Finding]:
    """A finding with the period that would do. None where that is not sure: in a closed loop, whose command holds the
    noise of the position, and where the command is a force.
    """
    if log.closed_loop or "reference" in log.extra or log.units.get("command", "V") != "V":
        return []
    if len(log) < _LEAST or np.ptp(log.command) == 0.0:
        return []
    lag = _most_lag(log.part(0, _MOST))
    if lag is None or lag >= _PERIODS:
        return []
    T = log.sample_period
    most = T * max(lag, _SHORTEST)
    what = (
        f"sampled too slowly: within its sample period of {1e3 * T:.3g} ms the axis is nearly at its speed. Its time "
        f"constant is below {1e3 * most:.3g} ms; a sample period of {1e3 * _ENOUGH * most:.2g} ms or less tells it"
    )
    return [Finding("sampling", what, Gravity.WARNING)]


def repeated(log: Log, axis: Axis | None) -> list[Finding]:
    """A finding where an axis that moves fast has the position of the sample before, again and again: it was measured
    more slowly than it was logged, so that a position is up to that time old. A speed may well stay the same.
    """
    if log.is_rate:
        return []
    steps = np.diff(log.position)
    at = np.flatnonzero(steps)
    if len(at) < _OFTEN or len(at) == len(steps):
        return []
    moved = steps[at]
    step = log.resolution or max(float(np.abs(moved).min()), _ROUNDED * float(np.ptp(log.position)))
    fast = np.abs(moved) > _PLAIN * step
    between = np.diff(at) - 1  # samples without a step, between two with one
    same = fast[:-1] & fast[1:] & (moved[:-1] * moved[1:] > 0.0) & (between <= _LONGEST)
    without, new = int(between[same].sum()), int(same.sum())
    if new < _OFTEN or without < _REPEATED * (without + new):
        return []
    every = (without + new) / new
    T = log.sample_period
    what = (
        f"the position is new in one of {every:.3g} samples only, and repeated between: it was measured each "
        f"{1e3 * every * T:.3g} ms and logged each {1e3 * T:.3g} ms. A time constant comes out too long by the age of "
        "what is repeated; log only the samples in which it is new"
    )
    first = int(at[:-1][same & (between > 0)][0]) + 2
    return [Finding("sampling", what, Gravity.WARNING, first)]


def _most_lag(part: Log) -> float | None:
    """The largest mean lag that the data allow, in samples; None where they tell none."""
    v = part.position if part.is_rate else np.diff(part.position) / np.diff(part.time)
    if part.is_rate:  # the command of a sample acts on the speed at the next
        v = v[1:]
    u = part.command[: len(v)]
    taps = np.lib.stride_tricks.sliding_window_view(u, _TAPS)[:, ::-1]  # (n, taps), the latest first
    v = v[_TAPS - 1 :]
    X = np.column_stack([taps, np.sign(taps.mean(axis=1)), np.ones(len(v))])
    scale = np.linalg.norm(X, axis=0)
    if len(v) < 4 * X.shape[1] or not (scale > 0.0).all():
        return None
    _, size, right = np.linalg.svd(np.linalg.qr(X / scale, mode="r"))
    if size[-1] < 1e-8 * size[0]:
        return None
    inverse = (right.T / size**2) @ right / np.outer(scale, scale)
    found = inverse @ (X.T @ v)
    error = v - X @ found
    covariance = inverse * float(error @ error) / (len(v) - X.shape[1])
    gain = float(found[:_TAPS].sum())
    if not abs(gain) > _SURE * sqrt(float(covariance[:_TAPS, :_TAPS].sum())):
        return None
    lag = float(np.arange(_TAPS) @ found[:_TAPS]) / gain
    by = np.append((np.arange(_TAPS) - lag) / gain, [0.0, 0.0])
    return lag + _SURE * sqrt(float(by @ covariance @ by))
