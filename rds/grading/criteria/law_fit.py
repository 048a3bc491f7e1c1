"""The linear law that answers as a submission did in its own run.

A case's run is done once more with a force on the axis; δu and δy are by how much voltage and measured position differ
from the run without it. What the law was given is known to the count, so a linear law is found without an error by
rounding, friction or saturation of the machine:

    a(z) δu = b(z) δy

by least squares over the samples, for growing orders until it is exact. A law that is not quite linear (it rounds, has
a dead band, compensates friction) is described by the linear law whose voltage is nearest to its own (Steiglitz and
McBride's iteration), for deviations of the size that the force makes: its describing function.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

# 0 first: of a law without memory that rounds, any pole would fit that a zero beside it takes back, unstable ones too
_ORDERS = (0, 1, 2, 3, 4, 6, 8)
_EXACT = 1e-6  # of the answer: what departs less is the law itself
_ROUNDS = 4  # of the iteration
_FEW = 5  # orders that are tried for an exact law
_PER_UNKNOWN = 4  # samples, at least
_BEFORE = 16  # samples before a part
_BETTER, _ENOUGH = 0.9, 2  # higher orders are tried until so many in a row do not depart less by a tenth
_RADIUS = 0.98  # of a pole of the prefilter that would let it grow


@dataclass(frozen=True)
class LawFit:
    """u[k] = b[0] y[k] + b[1] y[k-1] + ... - a[1] u[k-1] - ...; `departure` is by RMS, as a share of the answer."""

    a: np.ndarray
    b: np.ndarray
    departure: float

    @property
    def is_exact(self) -> bool:
        """Whether nothing is left over: the law is linear."""
        return self.departure <= _EXACT


def law_fits(
    voltage: np.ndarray, position: np.ndarray, part: slice = slice(None), exactly: bool = False
) -> Iterator[LawFit]:
    """Fits of growing order to a part of deviations of voltage (V) and position (mm); the last where it is exact.

    `exactly`: without those that are only near.
    """
    size = float(np.linalg.norm(voltage[part]))
    if not np.isfinite(size) or size == 0.0:
        return
    first = part.start or 0
    begin = max(first - _BEFORE, 0)  # what the law remembers when the part begins comes from before it
    part = slice(first - begin, None if part.stop is None else part.stop - begin)
    voltage, position = voltage[begin:], position[begin:]
    least, stands_still = np.inf, 0
    for order in _ORDERS[:_FEW] if exactly else _ORDERS:
        if _PER_UNKNOWN * (2 * order + 1) > len(voltage[part]):
            return
        best = min(
            _rounds(voltage, position, order, part, size, 1 if exactly else _ROUNDS),
            key=lambda fit: fit.departure,
            default=None,
        )
        if best is None:
            continue
        yield best
        stands_still = 0 if exactly else stands_still + 1 if best.departure > _BETTER * least else 0
        if best.is_exact or stands_still == _ENOUGH:
            return
        least = min(least, best.departure)


def departure(fit: LawFit, voltage: np.ndarray, position: np.ndarray, part: slice, parts: int) -> float:
    """By how much a law departs in the worst of `parts` of `part`: by RMS, as a share of the larger of the answers."""
    if parts == 1:
        return fit.departure
    from scipy.signal import lfilter

    answer = lfilter(fit.b, fit.a, position)[part]
    pairs = zip(np.array_split(answer, parts), np.array_split(voltage[part], parts), strict=True)
    return max(_share(own, other) for own, other in pairs)


def _share(found: np.ndarray, expected: np.ndarray) -> float:
    larger = max(np.linalg.norm(found), np.linalg.norm(expected))
    share = float(np.linalg.norm(found - expected)) / max(float(larger), 1e-300)
    return share if np.isfinite(share) else 1.0


def _rounds(
    voltage: np.ndarray, position: np.ndarray, order: int, part: slice, size: float, rounds: int
) -> Iterator[LawFit]:
    from scipy.signal import lfilter

    a = np.ones(1)
    for _ in range(rounds):
        u, y = lfilter([1.0], _bounded(a), np.stack([voltage, position]))
        columns = np.stack([*(-_late(u, k) for k in range(1, order + 1)), *(_late(y, k) for k in range(order + 1))], 1)[
            part
        ]
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        if not np.isfinite(scale).all():
            return
        found = np.linalg.lstsq(columns / scale, u[part], rcond=None)[0] / scale
        a, b = np.concatenate([[1.0], found[:order]]), found[order:]
        left = float(np.linalg.norm((_answer(a, b, voltage, position, part) - voltage)[part])) / size
        if np.isfinite(left):
            yield LawFit(a, b, left)
            if left <= _EXACT:
                return


def _answer(a: np.ndarray, b: np.ndarray, voltage: np.ndarray, position: np.ndarray, part: slice) -> np.ndarray:
    """The law's own voltages from the beginning of the part on; before it, those that were."""
    from scipy.signal import lfilter, lfiltic

    first = part.start or 0
    if not first:
        return np.asarray(lfilter(b, a, position))
    state = lfiltic(b, a, voltage[:first][::-1], position[:first][::-1])
    return np.concatenate([voltage[:first], lfilter(b, a, position[first:], zi=state)[0]])


def _late(samples: np.ndarray, by: int) -> np.ndarray:
    return samples if by == 0 else np.concatenate([np.zeros(by), samples[:-by]])


def _bounded(a: np.ndarray) -> np.ndarray:
    """The polynomial with its roots beyond the unit circle moved into it."""
    roots = np.roots(a)
    size = np.abs(roots)
    if not (size > 1.0).any():
        return a
    moved = np.where(size > 1.0, roots / np.maximum(size, 1e-300) * _RADIUS, roots)
    return np.asarray(np.real(np.poly(moved)))
