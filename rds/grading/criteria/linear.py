"""A submission's closed loop, linearized about its motion, from outside.

The controller is a black box, so its loop is measured. The same motion is run again with a short pulse of voltage at
the plant's input, and the first run is taken away: what is left is how the loop answers the pulse. With the pulse D,
the controller's answer Uc and the plant a linear one,

    L(z) = - Uc(z) / (Uc(z) + D(z)),    1 + L = 0 at the closed loop's poles.

The test is the case's own motion with a deviation of micrometres in it, so that a controller is about where it always
is. A pulse of another size must change the answer in proportion; where it does not there are no margins. A controller
can notice that the positions are not rounded: see `same_loop` for what is done about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rds.identification.robustness.margins import margins_of

PULSE = 1.0  # V, for one sample
IN_PROPORTION = 0.02  # of the largest answer: by how much the second may differ
_GONE = 1e-3  # of the largest deviation: what may be left of it at the end
_GRID = 1 << 16
_HANKEL = 300  # rows
_RANK = 1e-7  # of the largest singular value: what counts as a mode


@dataclass(frozen=True)
class LinearLoop:
    """The loop's answer to a pulse of `PULSE` V: deviations of voltage (V) and position (mm), every `T` s."""

    voltage: np.ndarray
    position: np.ndarray
    T: float

    @cached_property
    def margins(self) -> tuple[float, float, float]:
        """Gain margin (dB), phase margin (°), least distance of L from -1; inf where nothing crosses."""
        answer = np.fft.rfft(self.voltage, max(_GRID, 4 * len(self.voltage)))[1:]
        w = np.linspace(0.0, np.pi / self.T, len(answer) + 1)[1:]
        gain, phase, modulus = margins_of(w, (-answer / (answer + PULSE))[None])[0]
        return float(gain), float(phase), float(modulus)

    @cached_property
    def poles(self) -> np.ndarray:
        """The poles z that show in the position, largest first, by realization from its Hankel matrix (Ho and Kalman).

        Modes that the pulse hardly moves, or that have gone within a sample, are not found.
        """
        h = self.position[1:]
        rows = min(_HANKEL, len(h) // 2)
        hankel = np.lib.stride_tricks.sliding_window_view(h, rows)[: rows + 1].T
        left, sizes, _ = np.linalg.svd(hankel[:, :-1], full_matrices=False)
        rank = int(np.count_nonzero(sizes > _RANK * sizes[0]))
        seen = left[:, :rank] * np.sqrt(sizes[:rank])
        step = np.linalg.lstsq(seen[:-1], seen[1:], rcond=None)[0]
        poles = np.linalg.eigvals(step)
        return np.asarray(poles[np.argsort(-np.abs(poles), kind="stable")])

    @property
    def least_damping(self) -> float:
        """The least damping ratio ζ of its poles z = exp(s T), ζ = -Re s / |s|; 1 where none oscillates."""
        found = self.poles[np.abs(self.poles) > 1e-3]
        s = np.log(found.astype(complex)) / self.T
        ratios = -s.real / np.maximum(np.abs(s), 1e-300)
        swings = np.abs(s.imag) > 1e-6 * np.abs(s)
        return float(np.where(swings, ratios, 1.0).min(initial=1.0))


@np.errstate(over="ignore", invalid="ignore")  # of voltages that no converter has
def linear_loop(runs: Sequence[tuple[np.ndarray, np.ndarray]], T: float) -> LinearLoop | str:
    """From (command, position) of the run without a pulse, with `PULSE`, and with -2 `PULSE`; or why there is none."""
    (u0, y0), (u1, y1), (u2, _) = runs
    voltage, position = u1 - u0, y1 - y0
    size = np.abs(position).max(initial=0.0)
    if not np.isfinite(size) or size == 0.0:
        return "its answer to a pulse is no number"
    tail = max(len(position) // 20, 1)
    if np.abs(position[-tail:]).max() > _GONE * size:
        return (
            f"{len(position) * T:.3g} s after a pulse the loop has not come to rest: it is not stable, or only slowly"
        )
    largest = np.abs(voltage).max(initial=0.0)
    if largest == 0.0:
        return "its voltage does not depend on the measured position: there is no loop"
    if np.abs(voltage + 0.5 * (u2 - u0)).max() > IN_PROPORTION * largest:
        return "it does not answer in proportion about this motion: it has no linear loop"
    return LinearLoop(voltage, position, T)
