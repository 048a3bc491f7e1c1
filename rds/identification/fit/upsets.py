"""Where in time a log does something else than before and after: a slip of the encoder, a leap, another regime.

What a model leaves of a log is smooth noise, or drifts by what the model is wrong in. At a slip it steps, within a
block of samples, by far more than from any other block to the next; over a stretch of another regime (another load, a
rub, a drive that is off) it wanders several times as much as elsewhere. Both are found by robust measures, which a
model that is wrong throughout does not set off.
"""

from __future__ import annotations

import numpy as np

from rds.identification.logs.log import RATES

_BLOCKS = 200  # that a log is cut into, at most
_LEAST = 20  # blocks; samples of one
_STEP = 12.0  # robust standard deviations of the steps between blocks, and times the noise
_OTHER = 3.0  # times the usual size of steps
_RUN = 4  # blocks of a regime, at least
_MOST, _TOGETHER = 0.4, 0.25  # of the log: a regime is the exception, and so are both together, where there are two
_TOLD = 3  # leaps
_WITHIN, _SUDDEN = 4, 0.5  # samples to either side, within which a leap makes so much of its way
_ALL = 0.8  # of the squares of a model's accelerations


def upsets(
    time: np.ndarray,
    error: np.ndarray,
    noise: float,
    unit: str,
    modelled: np.ndarray,
    resolution: float | None = None,
    late: str = "",
) -> list[str]:
    """Sentences on where `error` (samples,), measured minus `modelled`, steps or wanders; `noise` is its floor.

    `late` is added to that of a step: what to ask of a log whose samples were late.

    Where the axis is slow, rounding by an encoder of `resolution` moves a block's median by up to a step of it, and
    hardly elsewhere: what changes by no more is no regime.

    A stretch that holds nearly all accelerations of the model is none of another regime: elsewhere it has nothing to be
    wrong in.
    """
    width = max(len(error) // _BLOCKS, _LEAST)
    count = len(error) // width
    if count < _LEAST or not np.isfinite(error).all():
        return []
    blocks = error[: count * width].reshape(count, width)
    means = np.median(blocks, axis=1)
    starts = time[: count * width : width]
    steps = np.diff(means)
    usual = max(1.4826 * float(np.median(np.abs(steps - np.median(steps)))), noise / np.sqrt(width))
    if usual == 0.0:
        return []
    size = np.abs(steps - np.median(steps))
    found = [
        regime
        for regime in _regimes(size, usual, resolution or 0.0, starts, unit)
        if not _holds_all(modelled[: count * width].reshape(count, width).mean(axis=1), regime, unit)
    ]
    if len(found) > 2 or (len(found) == 2 and sum(end - first for first, end, _ in found) > _TOGETHER * len(steps)):
        found = []  # that is how the model is wrong, not where the log is
    inside = np.zeros(len(steps), dtype=bool)
    for first, end, _ in found:
        inside[first:end] = True
    leaps = np.flatnonzero((size > _STEP * usual) & (np.abs(steps) > _STEP * noise) & ~inside)
    leaps = leaps[leaps > 1]  # at the begin, the initial state makes up for what it can
    leaps = leaps[np.diff(leaps, prepend=-9) > 1]  # a step in a block's middle counts once
    told = [_leap(time, error, int(k), width, unit, modelled) for k in leaps] if len(leaps) <= count // 20 else []
    said = [sentence + late for sentence in told if sentence][:_TOLD]
    return [*said, *(sentence for _, _, sentence in found)]


def _holds_all(modelled: np.ndarray, regime: tuple[int, int, str], unit: str) -> bool:
    """Whether the model's accelerations, by means over blocks, are nearly all within a regime, or next to it."""
    speed = modelled if unit in RATES else np.diff(modelled, prepend=modelled[0])
    changes = np.diff(speed) ** 2
    first, end, _ = regime
    return float(changes[max(first - 2, 0) : end + 2].sum()) > _ALL * float(changes.sum())


def _leap(time: np.ndarray, error: np.ndarray, block: int, width: int, unit: str, modelled: np.ndarray) -> str:
    """The sentence on a leap; "" where the error goes there by degrees, as beside a model that is late or too slow, or
    where a speed is to leap, or changes by so much that a model a few samples late makes the error.
    """
    part = slice(block * width, min((block + 2) * width, len(error)))
    jumps = np.abs(np.diff(error[part]))
    at = part.start + 1 + int(np.argmax(jumps))
    before, after = error[max(at - width, 0) : at], error[at : at + width]
    size = float(np.median(after) - np.median(before))
    first, last = max(at - 1 - _WITHIN, 0), min(at + _WITHIN, len(error) - 1)
    if abs(float(error[last] - error[first])) < _SUDDEN * abs(size):
        return ""
    if unit in RATES and abs(float(modelled[last] - modelled[first])) > _SUDDEN * abs(size):
        return ""
    paces = np.diff(modelled[max(first - _WITHIN, 0) : last + 1])
    if unit not in RATES and 2 * _WITHIN * float(np.ptp(paces)) > _SUDDEN * abs(size):
        return ""
    return (
        f"at {time[at]:.4g} s the measurement leaps by {size:+.3g} {unit} beside the "
        "model: did the encoder slip, or something jolt the axis?"
    )


def _regimes(
    size: np.ndarray, usual: float, rounded: float, starts: np.ndarray, unit: str
) -> list[tuple[int, int, str]]:
    """Stretches whose steps are several times as large as usual, and more than what is `rounded`: first and end as
    numbers of steps, and a sentence.
    """
    least = max(_OTHER * usual, rounded)
    wide = np.convolve(size, np.ones(_RUN) / _RUN, "same") > least
    edges = np.flatnonzero(np.diff(np.concatenate([[0], wide.astype(np.int8), [0]])))
    for calm_from, calm_to in zip(edges[1:-1:2].tolist(), edges[2::2].tolist(), strict=True):
        if calm_to - calm_from <= 3 * _RUN:  # a pause of one regime, as where the axis rests
            wide[calm_from:calm_to] = True
    edges = np.flatnonzero(np.diff(np.concatenate([[0], wide.astype(np.int8), [0]])))
    found = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        large = size[first:end] > least
        if int(large.sum()) < _RUN or end - first > _MOST * len(size):
            continue
        where = first + np.flatnonzero(large)
        begin, stop = float(starts[where[0]]), float(starts[min(where[-1] + 1, len(starts) - 1)])
        what = (
            f"from {begin:.4g} to {stop:.4g} s the log may be of another regime: there, measured minus modelled "
            f"changes {float(np.median(size[where])) / usual:.2g} times as much as elsewhere ({unit}). Find what was "
            "different (load, friction, a drive that was off; speeds at which the structure lacks something) before "
            "you leave that stretch out"
        )
        found.append((int(where[0]), int(where[-1]) + 1, what))
    return found
