"""Whether a log is sampled so slowly that the axis is nearly at its speed within a sample.

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
