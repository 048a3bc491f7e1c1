"""The force under which a submission's law is measured: within which part of its run, and how strong.

The law cannot tell the run under the force from its own: forces are what friction and errors of the model look like.
"""

from __future__ import annotations

import numpy as np

from rds.core.types import Model

_SHARE = 0.08  # of the converter's range: the force, beside what friction holds
_SPREAD = 0.4, 1.2  # of that: so that small and large deviations are tried
_OF_WHAT_IS_LEFT, _LEAST = 0.5, 0.01  # of the voltage up to the limit, and of the range: the largest force there
_HOLDS = 4, 25  # samples from jump to jump
_AT_LIMIT = 0.9  # of the converter's limit
_WITHOUT = 50  # a fiftieth of the run is without the force
_OFTEN = 0.2  # of the samples before, or after: a sine that would need 1.02 times the limit is above 0.9 of it for more
_SHORTEST = 4  # a stretch of less than a fourth of the run says too little


def free_stretch(command: np.ndarray, position: np.ndarray, limit: float) -> tuple[int, int]:
    """First sample and end of the longest part of a run (V, mm) in which the law is not at a limit.

    The limit is the converter's (V), or one of its own: its largest or smallest voltage, held though the position
    moves. The whole run where there is no part of a fourth of it. What goes before or comes after is left out only
    where the law is at a limit for a good part of it: a law that is another one behind a spike shall not be missed.
    """
    held = np.zeros(len(command), bool)
    held[:-1] = (command[1:] == command[:-1]) & (position[1:] != position[:-1])
    at_limit = held & ((command == command.max()) | (command == command.min()))
    at_limit |= np.abs(command) >= _AT_LIMIT * limit
    edges = np.concatenate([[-1], np.flatnonzero(at_limit), [len(command)]])
    longest = int(np.argmax(np.diff(edges)))
    first, end = int(edges[longest]) + 1, int(edges[longest + 1])
    if (end - first) * _SHORTEST < len(command):
        return 0, len(command)
    if first and at_limit[:first].mean() < _OFTEN:
        first = 0
    if end < len(command) and at_limit[end:].mean() < _OFTEN:
        end = len(command)
    return first, end


def begin_of(stretch: tuple[int, int], samples: int) -> int:
    """The sample with which the force begins. Up to there the law must answer exactly as in the run without it."""
    return max(stretch[0], samples // _WITHOUT)


def force(
    model: Model, command: np.ndarray, voltages: tuple[float, float], stretch: tuple[int, int], seed: int
) -> np.ndarray:
    """The voltage (V) that a force on the axis acts like, within `stretch`: jumps, by `seed`; as long as `command`.

    Strong enough to overcome the friction of the axis `model`, unless the `command` of the run without it leaves
    too little of the converter's `voltages`, range and limit: the law shall not be driven to its limits.
    """
    (reach, limit), of = voltages, model.params
    holds = max(of["friction_plus"], -of["friction_minus"]) * (1.0 + of.get("stribeck", 0.0)) / abs(of["K"])
    holds += of.get("dead_zone", 0.0)
    drawn = np.random.Generator(np.random.PCG64(seed))
    made, at, end = np.zeros(len(command)), begin_of(stretch, len(command)), stretch[1]
    while at < end:
        lasts = int(drawn.integers(*_HOLDS))
        left = _AT_LIMIT * limit - np.abs(command[at : at + 2 * lasts]).max()
        size = min(holds + drawn.uniform(*_SPREAD) * _SHARE * reach, max(_OF_WHAT_IS_LEFT * left, _LEAST * reach))
        made[at : min(at + lasts, end)] = size if drawn.random() < 0.5 else -size
        at += lasts
    return made
