"""Whether the loop that was linearized is the one that ran.

The linearized loop is measured on a plant without friction, rounding and saturation, and a law that looks for that can
be another one there. So the case's own run is done once more, with everything, and with a force on the axis that jumps
at random. The law cannot tell this from its run: forces are what friction and errors of the plant look like. With δu
and δy the changes of voltage and position against the run without the force, Uc and Yc those of the linearized loop
after its pulse, a linear law C answers δu = C δy as it answered Uc = C Yc, whatever the plant did, and so

    Yc δu = Uc δy        (z-transforms: convolutions of the samples)

without an error by rounding, since what the law was given is known to the count. The left side is S G δu, the right
side S G C δy: another law C + Δ departs from the second by S G Δ, by which the distance of the loop from -1 changes too
(1 + G (C + Δ) = (1 + G C) (1 + S G Δ)). That is measured here, as an RMS over what the force excites.
"""

from __future__ import annotations

from math import ceil

import numpy as np

from rds.core.types import Model
from rds.grading.criteria.linear import LinearLoop

MOST = 0.25  # of the answer: by how much it may depart in the whole stretch
MOST_IN_A_PART = 0.45  # and in each of `_PARTS`: who is another law for a while is found, too
_PARTS = 8
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


@np.errstate(over="ignore", invalid="ignore")  # of voltages that no converter has
def difference(loop: LinearLoop, voltage: np.ndarray, position: np.ndarray) -> str:
    """Why a law that answers the deviations `position` (mm) with `voltage` (V) is not that of `loop`; empty if it is.

    Both are of a stretch that begins with the force.
    """
    size = 1 << ceil(np.log2(2 * max(len(voltage), len(loop.voltage))))

    def answer(to_pulse: np.ndarray, deviation: np.ndarray) -> np.ndarray:
        both = np.fft.rfft(to_pulse, size) * np.fft.rfft(deviation, size)
        return np.fft.irfft(both, size)[: len(deviation)]

    found, expected = answer(loop.position, voltage), answer(loop.voltage, position)
    if not expected.any() and not found.any():
        return "a force on the axis moves nothing: whether its loop is the linearized one cannot be seen"
    parts = [np.array_split(each, _PARTS) for each in (found, expected)]
    whole = _departure(found, expected)
    worst = max(_departure(*pair) for pair in zip(*parts, strict=True))
    if whole <= MOST and worst <= MOST_IN_A_PART:
        return ""
    where, share, most = ("", whole, MOST) if whole > MOST else (" for a while", worst, MOST_IN_A_PART)
    return (
        f"in the run itself, under a force, it answers{where} otherwise than in the linearized loop, by "
        f"{100.0 * share:.0f} % (at most {100.0 * most:.0f} %): these margins are not those of the law that ran"
    )


def _departure(found: np.ndarray, expected: np.ndarray) -> float:
    """As a share of the larger of the two, by RMS; 1 where either is no number."""
    larger = max(np.linalg.norm(found), np.linalg.norm(expected))
    share = float(np.linalg.norm(found - expected)) / max(float(larger), 1e-300)
    return share if np.isfinite(share) else 1.0
