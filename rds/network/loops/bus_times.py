"""Delays of both directions from the host's times and the time stamps of frames on the bus.

The stamps are of another clock (a hub's, an adapter's). A frame cannot be on the bus before the host sent it, and the
host cannot have an answer before it was on the bus: with s and r the host's times of a sample, c and a the stamps of
its command and its last answer, the stamps' clock is ahead of the host's by some o with

    max (a - r)  <=  o  <=  min (c - s)

over all samples (the bound of Cristian's clock synchronization). The middle is taken, and half the width is how far it
can be wrong. Where nothing on the bus can be stamped, each direction is taken to be half of the round trip.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

Frame = tuple[float, int]  # time stamp, s; identifier


@dataclass(frozen=True)
class Directions:
    """Delays (s) of each sample, NaN where a frame was lost, and how far `split` between them can be wrong, s."""

    sensor: np.ndarray
    actuator: np.ndarray
    split_error: float


def directions(sent: np.ndarray, received: np.ndarray, frames: Sequence[Sequence[Frame]], answers: int) -> Directions:
    """The delays of each sample from the host's times `sent` and `received` (s), and the frames in its period.

    The command is the identifier that most samples begin with: an answer to the sample before may come ahead of it. A
    sample with fewer than `answers` frames after its command lost one: its measurement (or, without a command on the
    bus, the command) is NaN.
    """
    first = Counter(heard[0][1] for heard in frames if heard)
    command = first.most_common(1)[0][0] if first else None
    stamps = [_from_command(heard, command) for heard in frames]
    c = np.array([of[0] if of else nan for of in stamps])
    a = np.array([of[answers] if len(of) > answers else nan for of in stamps])
    whole = np.isfinite(a)
    if not whole.any():
        half = 0.5 * (received - sent)
        return Directions(half, half.copy(), float(half.max()))
    low, high = np.max((a - received)[whole]), np.min((c - sent)[np.isfinite(c)])
    offset = 0.5 * (low + high)
    actuator = np.maximum(c - offset - sent, 0.0)
    sensor = np.where(whole, np.maximum(received - (c - offset), 0.0), nan)
    return Directions(sensor, actuator, 0.5 * abs(high - low))


def _from_command(heard: Sequence[Frame], command: int | None) -> list[float]:
    """The stamps of the command and the frames after it."""
    at = next((i for i, (_, identifier) in enumerate(heard) if identifier == command), len(heard))
    return [stamp for stamp, _ in heard[at:]]
