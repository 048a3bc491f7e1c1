"""The motion in a log over windows long enough that an encoder's steps do not matter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rds.identification.logs.log import Log

_WINDOW = 0.02  # s: a few time constants of a table-top axis
_MOST = 200_000  # windows
_EQUAL = 1e-12  # of the largest position: differences that differ by less are one


@dataclass(frozen=True)
class Motion:
    """Means over windows of `width` samples: command, speed (per s, in the position's unit), and where each begins."""

    width: int
    command: np.ndarray
    speed: np.ndarray
    noise: float  # of a speed, from the encoder's steps

    @property
    def moves(self) -> float:
        """The speed beyond which the axis is taken to move."""
        return max(3.0 * self.noise, 0.02 * float(np.abs(self.speed).max(initial=0.0)))


def motion(log: Log) -> Motion:
    """Window means of a log; a spindle's position is its speed already."""
    width = max(2, round(_WINDOW / log.sample_period), len(log) // _MOST)
    count = (len(log) - 1) // width
    if count < 2:
        width, count = 1, len(log) - 1
    ends = np.arange(count + 1) * width
    command = np.add.reduceat(log.command, ends[:-1])[:count]
    command[-1:] = log.command[ends[-2] : ends[-1]].sum()
    command = command / width
    spans = log.time[ends[1:]] - log.time[ends[:-1]]
    if log.is_rate:
        speed = np.add.reduceat(log.position, ends[:-1])[:count]
        speed[-1:] = log.position[ends[-2] : ends[-1]].sum()
        speed = speed / width
    else:
        speed = np.diff(log.position[ends]) / spans
    noise = (log.resolution or 0.0) / (1.0 if log.is_rate else float(np.median(spans)))
    return Motion(width, command, speed, noise)


def noise(values: np.ndarray) -> float:
    """The standard deviation of the noise on a smooth motion, quantization included; 0 for fewer than 8 values.

    From third differences, in which the motion leaves next to nothing; the median leaves out jolts.
    """
    if len(values) < 8:
        return 0.0
    third = np.diff(values, 3)  # 1, 3, 3, 1: the variance is 20 times the noise's
    robust = 1.4826 * _median(np.abs(third), _EQUAL * float(np.abs(values).max()))
    return (robust or float(np.sqrt(np.mean(third**2)))) / np.sqrt(20.0)


def _median(sizes: np.ndarray, equal: float) -> float:
    """The median of sizes that an encoder rounds: those that read alike, to `equal`, lie anywhere in their step.

    The plain median of so few different numbers is a third too large or too small (median of grouped data).
    """
    middle = float(np.median(sizes))
    below, above = sizes < middle - equal, sizes > middle + equal
    alike = len(sizes) - int(below.sum()) - int(above.sum())
    if middle <= equal or alike < 2:
        return middle
    low = 0.5 * (float(sizes[below].max(initial=0.0)) + middle)
    high = 0.5 * (float(sizes[above].min(initial=np.inf)) + middle) if above.any() else middle
    return low + (0.5 * len(sizes) - int(below.sum())) / alike * (high - low)


def travel(position: np.ndarray, way: float) -> float:
    """The farthest that a position moves forward (`way` = 1) or backward (-1), noise included."""
    y = way * position
    return float((y - np.minimum.accumulate(y)).max())


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Of two series, -1 to 1; 0 where one is constant."""
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / scale if scale > 0.0 else 0.0
