"""Two recorders of one motion: offset and drift between their clocks, with uncertainty, and one grid for both.

A column of each file saw the same motion. Cross-correlation finds the offset to a sample; then the times themselves are
fitted, `first(t) = gain * second(t') + bias` with `t = t' + offset + drift (t' - centre)`, by Gauss-Newton. The
uncertainty is that of a sandwich over blocks of time, so that residuals which are not white do not make it too small.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for

_LEAST_CORRELATION = 0.6
_RIVAL = 0.8  # of the peak: another as high, apart from it, and the offset is not told
_FLOOR = 1e-6  # of the variance: nothing is explained better than that by a grid of samples
_LEAST_OVERLAP = 0.3  # of the shorter log
_MOST = 1 << 20  # points in the coarse search
_BLOCKS = 32
_ROUNDS = 30


@dataclass(frozen=True)
class Alignment:
    """`first = second + offset + drift (second - centre)`, s; standard errors; correlation of what both have seen."""

    offset: float
    drift: float
    offset_error: float
    drift_error: float
    centre: float
    correlation: float

    def to_first(self, time: np.ndarray) -> np.ndarray:
        """Times of the second clock on the first."""
        return time + self.offset + self.drift * (time - self.centre)

    def uncertainty(self, time: float) -> float:
        """Of a time of the second clock made one of the first, s, one standard deviation."""
        return sqrt(self.offset_error**2 + (self.drift_error * (time - self.centre)) ** 2)


def align(
    first_time: np.ndarray,
    first: np.ndarray,
    second_time: np.ndarray,
    second: np.ndarray,
    relation: str = "same",
    window: float = inf,
) -> Alignment:
    """Offset and drift of the second clock. Times in s; the values may differ in unit, offset and sign.

    `relation` "rate": the slope of `second` follows `first`, as a position follows a command; the lag of the axis is
    then part of the offset. `window`: the largest offset that is looked for, s. InputError where the two do not look
    like one motion, or like it at several offsets (a periodic motion).
    """
    for name, values in (("first", first), ("second", second)):
        if len(values) == 0 or np.ptp(values) == 0.0:
            what = "is constant" if len(values) else "holds no numbers"
            raise InputError(f"the {name} file's column for the alignment {what}; choose one that moves")
    if relation == "rate":
        second = _slope(second_time, second)
    lag = _coarse(first_time, first, second_time, second, window)
    return _fine(first_time, first, second_time, second, lag)


def resample(time: np.ndarray, values: np.ndarray, grid: np.ndarray) -> tuple[np.ndarray, float]:
    """Values at the times of `grid` on straight lines between samples, and how far that may be off at most.

    The bound is |x''| h²/8 with the second differences of the samples themselves: it holds for a motion that the
    samples show, not for one between them. The grid must lie within `time`.
    """
    curvature = np.abs(np.diff(values, 2))
    return np.interp(grid, time, values), float(curvature.max(initial=0.0)) / 8.0


def hold(time: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """The last value at or before each time of `grid`; the first one before there is any."""
    return np.asarray(values[np.maximum(np.searchsorted(time, grid, side="right") - 1, 0)])


def _slope(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Smoothed slope, over about ten samples: that of an encoder's steps is noise."""
    width = min(11, len(values) // 4 * 2 + 1)
    weights = np.ones(width) / width
    padded = np.pad(values, width // 2, mode="edge")
    return np.asarray(np.gradient(np.convolve(padded, weights, mode="valid"), time))


def _coarse(t1: np.ndarray, x1: np.ndarray, t2: np.ndarray, x2: np.ndarray, window: float) -> float:
    """The offset at which the two correlate most, s, to a step of the coarser of the two."""
    with needed_for("aligning two recorders"):
        from scipy.signal import correlate, find_peaks

    longest = max(t1[-1] - t1[0], t2[-1] - t2[0])
    step = max(float(np.median(np.diff(t1))), float(np.median(np.diff(t2))), longest / _MOST)
    a, b = (_grid(t, x, step) for t, x in ((t1, x1), (t2, x2)))
    a, b = a - a.mean(), b - b.mean()
    raw = correlate(a, b, mode="full", method="fft")
    ones_a, ones_b = np.ones_like(a), np.ones_like(b)
    overlap = np.rint(correlate(ones_a, ones_b, mode="full", method="fft"))
    energy = correlate(a * a, ones_b, mode="full", method="fft") * correlate(ones_a, b * b, mode="full", method="fft")
    scale = np.sqrt(np.maximum(energy, 1e-12 * float(np.max(energy))))
    alike = np.minimum(np.abs(raw) / scale, 1.0)
    lags = np.arange(-(len(b) - 1), len(a)) * step + (t1[0] - t2[0])
    # how much a lag explains, in how many points: a short overlap that fits by chance is no rival of a long one
    height = -overlap * np.log(1.0 - alike * alike + _FLOOR)
    height[(overlap < _LEAST_OVERLAP * min(len(a), len(b))) | (np.abs(lags) > window)] = 0.0
    best = int(np.argmax(height))
    if alike[best] < _LEAST_CORRELATION or height[best] <= 0.0:
        raise InputError(
            f"the two columns do not look like one motion: their largest correlation is {alike[best]:.2f}, where "
            f"{_LEAST_CORRELATION} is needed; choose other columns, give window (s), or offset and drift as numbers"
        )
    peaks, _ = find_peaks(height, height=_RIVAL * height[best])
    apart = [int(p) for p in peaks if _is_apart(height, best, int(p))]
    if apart:
        raise InputError(
            f"offsets of {lags[best]:.6g} s and {lags[apart[0]]:.6g} s fit alike: the motion repeats itself; give "
            "window (s), the largest offset to look for"
        )
    return float(lags[best])


def _is_apart(height: np.ndarray, best: int, other: int) -> bool:
    """Whether there is a valley between two peaks: noise on one peak is no second one."""
    low, high = sorted((best, other))
    return other != best and float(height[low : high + 1].min()) < 0.9 * float(height[best])


def _grid(time: np.ndarray, values: np.ndarray, step: float) -> np.ndarray:
    return np.interp(np.arange(time[0], time[-1] + 0.5 * step, step), time, values)


def _fine(t1: np.ndarray, x1: np.ndarray, t2: np.ndarray, x2: np.ndarray, lag: float) -> Alignment:
    """Gauss-Newton on offset, drift, gain and bias, from a coarse offset."""
    with needed_for("aligning two recorders"):
        from scipy.interpolate import CubicSpline

    curve = CubicSpline(t2, x2)
    centre = 0.5 * (max(t1[0] - lag, t2[0]) + min(t1[-1] - lag, t2[-1]))
    p = np.array([lag, 0.0])
    margin = 2.0 * float(np.median(np.diff(t2)))
    for _ in range(_ROUNDS):
        inner = (t1 - p[0] + p[1] * centre) / (1.0 + p[1])  # the second clock at the first's times
        inside = (inner > t2[0] + margin) & (inner < t2[-1] - margin)
        at, measured = inner[inside], x1[inside]
        if len(at) < 8:
            raise InputError("the two recordings hardly overlap in time; check offset and files")
        shape, slope = curve(at), curve(at, 1)
        linear = np.column_stack([shape, np.ones_like(at)])
        (gain, bias), *_ = np.linalg.lstsq(linear, measured, rcond=None)
        residual = measured - gain * shape - bias
        rate = -gain * slope / (1.0 + p[1])  # by offset; by drift (at - centre) times as much
        jacobian = np.column_stack([rate, rate * (at - centre), shape, np.ones_like(at)])
        scales = np.linalg.norm(jacobian, axis=0)
        scales[scales == 0.0] = 1.0
        step, *_ = np.linalg.lstsq(jacobian / scales, residual, rcond=None)
        change = (step / scales)[:2]
        p = p + change
        p[1] = float(np.clip(p[1], -0.1, 0.1))
        span = max(float(at[-1] - at[0]), margin)
        if abs(change[0]) + abs(change[1]) * span < 1e-6 * margin:
            break
    else:
        raise InputError(
            "offset and drift of the two clocks could not be refined: the columns differ by more than time, gain and "
            "offset; choose columns that saw the same motion"
        )
    errors = _errors(jacobian / scales, residual) / scales
    correlation = float(np.corrcoef(shape, measured)[0, 1])
    return Alignment(float(p[0]), float(p[1]), float(errors[0]), float(errors[1]), float(centre), correlation)


def _errors(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Standard errors by a sandwich over blocks of time."""
    bread = np.linalg.pinv(jacobian.T @ jacobian)
    blocks = min(_BLOCKS, len(residual) // 4)
    scores = np.array([part.sum(axis=0) for part in np.array_split(jacobian * residual[:, None], blocks)])
    meat = scores.T @ scores * blocks / max(blocks - jacobian.shape[1], 1)
    return np.asarray(np.sqrt(np.maximum(np.diag(bread @ meat @ bread), 0.0)))
