"""Which voltage acts when, with delays that may be longer than a sample: the chain of messages on their way.

A mode is what is on its way at a sampling instant: for each voltage that has been sent and has not arrived, its age in
samples and the delay that is left. With each sample a new delay is drawn, which tells at what times of the period which
voltages begin to act, and the mode at its end. A voltage that a later one overtakes is dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from rds.core.errors import InputError
from rds.core.extras import needed_for

Mode = tuple[tuple[int, float], ...]  # (age in samples, delay that is left in samples), the newest first
MOST_MODES = 3000
_DIGITS = 9


@dataclass(frozen=True)
class Step:
    """One sample from a mode to the next, with a delay of a given probability.

    `changes` are (time in the period, age of the voltage that acts from then on; 0 is this sample's own).
    """

    source: int
    target: int
    probability: float
    changes: tuple[tuple[float, int], ...]


def chain(delays: Sequence[float], probabilities: Sequence[float]) -> tuple[list[Mode], list[Step]]:
    """All modes that are reached, from nothing on its way, and all steps between them; delays in samples, inf: lost.

    InputError where there are more modes than can be analysed.
    """
    modes: list[Mode] = [()]
    number: dict[Mode, int] = {(): 0}
    steps: list[Step] = []
    for mode in modes:  # it grows meanwhile
        for delay, probability in zip(delays, probabilities, strict=True):
            if probability > 0.0:
                changes, following = _period(mode, delay)
                if following not in number:
                    if len(modes) == MOST_MODES:
                        raise InputError(
                            f"delays of up to {max(d for d in delays if d < inf):.2g} samples leave more than "
                            f"{MOST_MODES} combinations of voltages on their way; take fewer bins, or a longer period"
                        )
                    number[following] = len(modes)
                    modes.append(following)
                steps.append(Step(number[mode], number[following], probability, changes))
    return _recurrent(modes, steps)


def _recurrent(modes: list[Mode], steps: list[Step]) -> tuple[list[Mode], list[Step]]:
    """Only the modes that come again and again: those from which the way leads back."""
    with needed_for("the cost of a loop"):
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import connected_components
    ends = ([step.source for step in steps], [step.target for step in steps])
    graph = csr_array(([1] * len(steps), ends), shape=(len(modes), len(modes)))
    _, of = connected_components(graph, connection="strong")
    left_behind = {of[step.source] for step in steps if of[step.source] != of[step.target]}
    kept = [mode for mode in range(len(modes)) if of[mode] not in left_behind]
    order = {mode: number for number, mode in enumerate(kept)}
    inner = [
        Step(order[step.source], order[step.target], step.probability, step.changes)
        for step in steps
        if step.source in order
    ]
    return [modes[mode] for mode in kept], inner


def oldest(modes: Sequence[Mode]) -> int:
    """The greatest age of a voltage on its way at a sampling instant, samples; 0 where none is."""
    return max((age for mode in modes for age, _ in mode), default=0)


def _period(mode: Mode, delay: float) -> tuple[tuple[tuple[float, int], ...], Mode]:
    waiting = [*mode, *([(0, delay)] if delay < inf else [])]
    newest = None
    changes: list[tuple[float, int]] = []
    for left, age in sorted((left, age) for age, left in waiting if left < 1.0 - 10**-_DIGITS):
        if newest is None or age < newest:  # else a later one has overtaken it
            newest = age
            while changes and changes[-1][0] == left:
                changes.pop()
            changes.append((left, age))
    following = sorted(
        (age + 1, round(left - 1.0, _DIGITS))
        for age, left in waiting
        if left >= 1.0 - 10**-_DIGITS and (newest is None or age < newest)
    )
    # one that a later one will overtake on its way never acts
    kept = [
        (age, max(left, 0.0))
        for i, (age, left) in enumerate(following)
        if all(left < other for _, other in following[:i])
    ]
    return tuple(changes), tuple(kept)
