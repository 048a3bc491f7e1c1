"""Acceleration and deceleration by convolution, on top of any interpolator (oacs-thesis, eq. 7.50 to 7.53).

The increments ΔX(k) of each axis pass a filter with weights that sum up to 1:

    ΔX₀(k) = Σ Kᵢ ΔX(k - i) / Σ Kᵢ,  i = 0 ... n - 1

The total distance is that of the interpolator, and the motion takes n - 1 samples more. All axes pass the same filter:
a straight move stays straight, the radius of an arc becomes smaller, and a corner is rounded.

A module of a filter has `OPTIONS`, times in s as declarations of `rds.core.quantities`, with their `DEFAULTS`;
`weights(T, params)`, the Kᵢ for samples of `T` s; and `MULTIPLIERS`, whether a user may give the Kᵢ themselves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice, repeat
from numbers import Real
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.options import check_known, read_options
from rds.core.registry import Registry

LIBRARY = Registry(
    "acceleration",
    {
        "linear": "rds.interpolators.linear_acceleration",
        "exponential": "rds.interpolators.exponential_acceleration",
        "s-shape": "rds.interpolators.s_shape_acceleration",
    },
    own=False,
)
_BLOCK = 64  # rows that are convolved at once
_MOST = 100_000  # weights


@dataclass(frozen=True)
class Acceleration:
    """A filter by name; `multipliers` Kᵢ, one for each sample, instead of those that its options give."""

    name: str
    params: Mapping[str, float] = field(default_factory=dict)
    multipliers: tuple[float, ...] = ()

    def weights(self, T: float) -> np.ndarray:
        """Kᵢ / Σ Kᵢ for samples of `T` s; InputError for a filter out of all measure."""
        samples = len(self.multipliers) or max(self.params.values()) / T  # all options are times
        if samples <= _MOST:  # else they are not even made
            given = np.array(self.multipliers or LIBRARY.module(self.name).weights(T, self.params))
            if len(given) <= _MOST:
                return given / given.sum()
            samples = len(given)
        raise InputError(f"acceleration {self.name!r} takes {samples:.6g} samples of {T:g} s; give a shorter time")


def make_acceleration(name: str, *, multipliers: Sequence[float] = (), **options: Any) -> Acceleration:
    """The filter called `name`; InputError for an unknown name or option, or multipliers that won't do."""
    module = LIBRARY.module(name)
    owner = f"acceleration {name!r}"
    if multipliers:
        if not module.MULTIPLIERS:
            raise InputError(f"{owner} has no multipliers, it has {', '.join(module.OPTIONS)}; use s-shape")
        check_known(options, (), f"{owner} with multipliers")
        return Acceleration(name, {}, _multipliers(multipliers, owner))
    return Acceleration(name, module.DEFAULTS | read_options(options, module.OPTIONS, owner))


def smooth(
    rows: Iterable[Sequence[np.ndarray]], start: Sequence[float] | np.ndarray, weights: np.ndarray, T: float
) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows through the filter: a motion from rest at `start` (mm, per axis) to rest at the last position, exactly.

    Velocity and acceleration are the differences of position over `T` s.
    """
    n = len(weights)
    oldest_first = weights[::-1]
    window = np.tile(np.asarray(start, dtype=float), (n - 1, 1))
    last, velocity = np.array(start, dtype=float), np.zeros(len(start))
    for block, final in _blocks(_held(rows, n - 1)):
        window = np.vstack([window, block])
        windows = np.lib.stride_tricks.sliding_window_view(window - start, n, axis=0)
        positions = windows @ oldest_first + start
        if final:
            positions[-1] = block[-1]
        for position in positions:
            now = (position - last) / T
            yield position, now, (now - velocity) / T
            last, velocity = position, now
        window = window[len(block) :]


def smooth_one_by_one(
    rows: Iterable[Sequence[np.ndarray]], start: Sequence[float] | np.ndarray, weights: np.ndarray, T: float
) -> Iterator[tuple[np.ndarray, ...]]:
    """The rows of `smooth` to the last digits, each as soon as the rows before it and one after it are made."""
    n = len(weights)
    oldest_first = np.ascontiguousarray(weights[::-1])
    begin = np.array(start, dtype=float)
    window = np.zeros((2 * n, len(begin)))  # twice, so that the last n rows always lie together; from `begin`
    last, velocity = begin, np.zeros(len(begin))
    positions = _held(rows, n - 1)
    position, at = next(positions, None), 0
    while position is not None:
        following = next(positions, None)
        window[at] = window[at + n] = position - begin
        at = (at + 1) % n
        here = oldest_first @ window[at : at + n] + begin if following is not None else position
        now = (here - last) / T
        yield here, now, (now - velocity) / T
        last, velocity, position = here, now, following


def adder_output(pulses: Sequence[int] | np.ndarray, multipliers: Sequence[int]) -> np.ndarray:
    """Σ Kᵢ A(k - i) of figure 61 for input pulses A (zero before and after): exact, int64."""
    return np.convolve(np.asarray(pulses, np.int64), np.asarray(multipliers, np.int64))


def output_pulses(pulses: Sequence[int] | np.ndarray, multipliers: Sequence[int]) -> np.ndarray:
    """The same divided by Σ Kᵢ into whole pulses, the remainder carried: their sum is that of the input, exactly."""
    total, carry = sum(multipliers), 0
    out = []
    for value in adder_output(pulses, multipliers).tolist():
        pulse, carry = divmod(value + carry, total)
        out.append(pulse)
    return np.array(out, np.int64)


def _held(rows: Iterable[Sequence[np.ndarray]], more: int) -> Iterator[np.ndarray]:
    """The positions, the last one `more` times more."""
    position = None
    for position, *_ in rows:
        yield np.array(position, dtype=float, ndmin=1)
    if position is not None:
        yield from repeat(np.array(position, dtype=float, ndmin=1), more)


def _blocks(positions: Iterator[np.ndarray]) -> Iterator[tuple[np.ndarray, bool]]:
    """Positions in arrays of up to _BLOCK rows, and whether it is the last one."""
    block = list(islice(positions, _BLOCK))
    while block:
        following = next(positions, None)
        yield np.array(block), following is None
        block = [] if following is None else list(islice(chain([following], positions), _BLOCK))


def _multipliers(given: Sequence[float], owner: str) -> tuple[float, ...]:
    for value in given:
        if isinstance(value, bool) or not isinstance(value, Real) or not np.isfinite(value) or value < 0:
            raise InputError(f"{owner}: multiplier {value!r} must be a number of at least 0")
    if not sum(given) > 0:
        raise InputError(f"{owner}: the multipliers {tuple(given)} sum up to 0; one of them must be more")
    return tuple(float(value) for value in given)
