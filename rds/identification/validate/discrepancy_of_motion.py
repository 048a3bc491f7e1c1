"""What a model is off by, told from its motion beside the measured one, whatever the model is (see `discrepancy`)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import degrees, pi, sqrt

import numpy as np

from rds.identification.fit.residuals import effective_samples
from rds.identification.logs.excitation import has_one_level
from rds.identification.logs.log import Log
from rds.identification.validate.discrepancy import (
    EXPLAINED,
    LONGEST,
    Discrepancy,
    Off,
    by_chance,
    clear,
    error_of,
    stretches,
)


def as_motion(
    log: Log,
    first: int,
    modelled: np.ndarray,
    is_rate: bool,
    rates: Sequence[np.ndarray],
    frequency: float = 0.0,
    tau: float = 0.0,
    noise: float = 0.0,
) -> Discrepancy | None:
    """The measured motion over the modelled one, from sample `first` on; None where the model hardly moves.

    `rates` are the measured and the modelled velocity over blocks, whose ratio is the gain; `tau` the time constant of
    the model, where it has one by that name (else it is taken from how it moves), `noise` the measurement's.
    """
    T = log.sample_period
    t, y, u = log.time[first:][:LONGEST], log.position[first:][:LONGEST], log.command[first:][:LONGEST]
    x = modelled[:LONGEST]
    rate = x if is_rate else np.gradient(x, t)
    if not np.ptp(x) > 1e-6 * max(float(np.ptp(y)), 1e-300):
        return None
    K, tau_shown = _first_order(rate, np.gradient(rate, t), u, T)
    tau = max(tau, T) if tau > 0.0 else tau_shown
    f = frequency or 1.0 / (4.0 * pi * tau)
    change = _backward(x, T)
    is_one = has_one_level(log)
    ways = _ways(x if is_rate else change, is_one)
    columns = [x, -change, _backward(change, T), *(ways if is_rate else [np.cumsum(way) * T for way in ways])]
    parts = len(stretches(log.part(first, len(log)), tau)) if log.closed_loop else 1
    A = np.stack(columns, axis=1)
    residual = y.copy()
    ends = np.linspace(0, len(y), parts + 1).astype(int)
    for a, b in pairwise(ends):  # what each stretch has of its own is taken out
        own = np.stack([np.ones(b - a), t[a:b] - t[a]], axis=1)[:, : 2 if log.closed_loop else 1]
        both = np.column_stack([A[a:b], residual[a:b]])
        both -= own @ np.linalg.lstsq(own, both, rcond=None)[0]
        A[a:b], residual[a:b] = both[:, :-1], both[:, -1]
    scale = np.linalg.norm(A, axis=0)
    kept = np.array([k < 3 or scale[k] > 1e-9 * np.linalg.norm(column) for k, column in enumerate(columns)])
    A, scale = A[:, kept], scale[kept]
    if not (scale > 0.0).all():
        return None
    found = np.linalg.lstsq(A / scale, residual, rcond=1e-10)[0] / scale
    error = residual - A @ found
    gram = np.linalg.pinv((A / scale).T @ (A / scale), rcond=1e-14) / np.outer(scale, scale)
    worth, left = effective_samples(error), float(np.sum((residual - A[:, 0]) ** 2))
    covariance = gram * float(error @ error) / worth
    slope = (1.0 - np.exp(-2j * pi * f * T)) / T  # of the backward difference at f

    def phase(p: np.ndarray) -> float:
        return -degrees(float(np.angle(p[0] - p[1] * slope + p[2] * slope**2)))

    return Discrepancy(
        frequency=f,
        gain=Off(0.0, float("inf"), "%")
        if is_one
        else min((_gain(*rates), _gain_of_way(found, covariance)), key=lambda off: off.error),
        phase=Off(phase(found), error_of(phase, found, covariance), "°"),
        lag=Off(-float(found[1]), sqrt(max(float(covariance[1, 1]), 0.0)), "s"),
        friction=None if is_one else _friction_of_ways(found, covariance, kept, K, float(np.abs(u).max())),
        speed=_speed(*rates) if is_one else None,
        rmse=sqrt(left / len(y)),
        reached=float(np.sqrt(np.mean(error**2))),
        by_chance=left <= len(y) * (EXPLAINED * float(noise)) ** 2
        and by_chance(left, float(error @ error), worth, A.shape[1]),
    )


def _ways(rate: np.ndarray, is_one: bool) -> list[np.ndarray]:
    """What a velocity may have beside a gain: a constant of each direction, each (n,).

    Of one speed each way these constants are the gain; there the gain may differ by direction.
    """
    signs = _signs(rate)
    if is_one:
        return [np.abs(rate)] if all(sign.any() for sign in signs) else []
    return [sign.astype(float) for sign in signs]


def _friction_of_ways(
    found: np.ndarray, covariance: np.ndarray, kept: np.ndarray, K: float, largest: float
) -> Off | None:
    """What the velocities of each direction lack, as friction in % of the largest command; None where not known.

    With v = K u - F of the model and v' = g v + c of the log, c is g F - F', and (F/K - F'/(g K)) = c / (g K).
    """
    scale = float(found[0]) * K * largest / 100.0
    if not (kept[3:].all() and scale > 0.0):
        return None
    forward, backward = (
        Off(sign * float(found[at]) / scale, sqrt(max(float(covariance[at, at]), 0.0)) / scale, "%")
        for at, sign in ((3, 1.0), (4, -1.0))
    )
    return max(forward, backward, key=clear)


def _backward(x: np.ndarray, T: float) -> np.ndarray:
    """The backward difference over T. No later sample is in it: in a closed loop the command at a sample answers the
    noise that the encoder read there, and a central difference would explain that noise by itself.
    """
    return np.diff(x, prepend=2.0 * x[0] - x[1]) / T


def _gain_of_way(found: np.ndarray, covariance: np.ndarray) -> Off:
    """The same by the positions themselves, which tell more where noise hides the velocity."""
    if not found[0] > 0.0:
        return Off(0.0, float("inf"), "%")
    spread = sqrt(max(float(covariance[0, 0]), 0.0))
    return Off(100.0 * (1.0 / float(found[0]) - 1.0), 100.0 * spread / float(found[0]) ** 2, "%")


def _signs(rate: np.ndarray) -> list[np.ndarray]:
    """Where it is forward, and where backward, each (n,) of bool; at rest neither."""
    least = 1e-6 * float(np.abs(rate).max())
    return [rate > least, rate < -least]


def _gain(measured: np.ndarray, modelled: np.ndarray) -> Off:
    """By how many per cent the model's velocity is too large, friction of each direction apart."""
    ways = np.stack(_signs(modelled), axis=1).astype(float)
    own = modelled - ways @ np.linalg.lstsq(ways, modelled, rcond=None)[0]
    size = float(own @ own)
    if not size > 1e-12 * float(modelled @ modelled):
        return Off(0.0, float("inf"), "%")
    ratio = float(measured @ own) / size
    error = measured - ratio * own
    error -= ways @ np.linalg.lstsq(ways, error, rcond=None)[0]
    spread = sqrt(float(error @ error) / (size * max(effective_samples(error) / len(error), 1e-3)) / len(error))
    if not ratio > 0.0:
        return Off(float("inf"), 0.0, "%")
    return Off(100.0 * (1.0 / ratio - 1.0), 100.0 * spread / ratio**2, "%")


def _speed(measured: np.ndarray, modelled: np.ndarray) -> Off:
    """By how many per cent the model's speed is too large, of the direction where that is clearer.

    A lag has a column of its own: the model's changes from block to block.
    """
    columns = [np.where(way, modelled, 0.0) for way in _signs(modelled) if way.any()]
    if not columns:
        return Off(0.0, float("inf"), "%")
    A = np.stack([*columns, np.gradient(modelled)], axis=1)
    found = np.linalg.lstsq(A, measured, rcond=1e-10)[0]
    error = measured - A @ found
    covariance = np.linalg.pinv(A.T @ A) * float(error @ error) / effective_samples(error)
    return max((_gain_of_way(found[k:], covariance[k:, k:]) for k in range(len(columns))), key=clear)


def _first_order(rate: np.ndarray, change: np.ndarray, u: np.ndarray, T: float) -> tuple[float, float]:
    """Gain (unit/s per V) and time constant (s) of the model, by its own motion: rate = K u - τ change - friction."""
    A = np.stack([u, -change, -np.sign(rate), np.ones(len(u))], axis=1)
    K, tau = np.linalg.lstsq(A, rate, rcond=1e-9)[0][:2]
    return float(K), float(np.clip(tau, 2.0 * T, 10.0))
