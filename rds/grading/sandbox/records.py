"""What crosses the sandbox's wall at every sample: records of fixed size, doubles and counters. Used on both sides.

A question is the sample's number and doubles; an answer is the number of the sample it belongs to, a code, and doubles.
After an answer whose code is FAULT comes one frame of text (`frames.py`).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

OK = 0
FAULT = 1  # the submission's code raised, or answered what no interface allows
END = 2  # an interpolator has no more rows

TOTAL = (1 << 64) - 1  # in place of a sample's number: the run is over, tell what was counted
ROWS = 64  # rows of an interpolator that are asked for at once


@dataclass(frozen=True)
class Layout:
    """Sizes of one run's records: `asks` doubles in a question, `answers` doubles in an answer."""

    asks: int
    answers: int

    @property
    def question(self) -> struct.Struct:
        """Sample number, doubles."""
        return struct.Struct(f"<Q{self.asks}d")

    @property
    def answer(self) -> struct.Struct:
        """Sample number, code, doubles."""
        return struct.Struct(f"<QQ{self.answers}d")


def control_layout(axes: int) -> Layout:
    """Asked: t, position, velocity and acceleration of each axis' reference, measured positions. Answered: voltages."""
    return Layout(1 + 4 * axes, axes)


MODEL = Layout(1, 1)  # asked: voltage in V; answered: the output


def rows_layout(axes: int) -> Layout:
    """Asked: nothing. Answered: how many rows, then rows of position, velocity and acceleration of each axis."""
    return Layout(0, 1 + ROWS * 3 * axes)
