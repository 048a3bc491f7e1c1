"""Which instant of its period a frame of a log belongs to, and how long it took from there, at least.

A log has the instants at which frames were over, not those at which they were released. What it allows to say:

- A message that another one releases belongs to the latest frame of that one before it. That frame was released at the
  latest when it started: the delay from its start is never more than the response time.
- The others come with a period whose phase nobody knows, by a clock that need not be the log's. No frame starts before
  its release. Of all grids of instants which that leaves, one has the least largest delay; the true grid is one of
  them, so its largest delay is at least as large. Another has the least mean: it follows what is usual, and the
  delays are its (S. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew from network delay
  measurements", INFOCOM 1999).

Where several frames would belong to one instant, the earlier ones belong to the instants before it that have none: they
had to wait. Times are s from the beginning of the log.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import floor

import numpy as np

PAUSE = 20  # periods without a frame, after which the phase may be another one, and an answer is none to that cycle
_STALL = 2.5  # periods, after which the same holds unless frames that waited come close behind
_ENOUGH = 10  # frames that tell a period
OTHER_PERIOD = 5e-3  # of the period: no clock of a computer is that wrong
_CLOCKS = 2e-4  # of the period: two clocks may differ by that
_USUAL = (0.5, 1.5)  # medians: gaps without a frame missing
_BEGIN = 50  # frames whose phases tell the first instant
_EARLY = (0.25, 0.05)  # periods that a frame may come before its instant, while instants are not known exactly
_CLEARLY = 0.05  # periods
_OTHER_PHASE = 0.1  # periods
_UP, _DOWN = 0.01, 0.3  # how much of a later, and of an earlier frame moves the instants
_ROUNDS = 40  # of the search for a grid: it ends within 1e-10 of a period


@dataclass(frozen=True)
class Paired:
    """The frames of one message: which of them have a delay (s, at least), and what does not go with the period."""

    places: np.ndarray  # of those frames, among the message's
    cycles: np.ndarray  # which instant each belongs to: for answers the number of the frame that released it
    delays: np.ndarray
    least: np.ndarray  # the same by the grid whose largest delay is the least
    missing: int = 0  # instants without a frame
    extra: int = 0  # frames without an instant
    pauses: int = 0  # after which the phase began anew, or where it did so without one
    period: float | None = None  # s, by the log's clock; None where the log does not tell


def from_releaser(starts: np.ndarray, released: np.ndarray, ends: np.ndarray, period: float, every: float) -> Paired:
    """Delays until `ends` from the `starts` of the frames that release the message, over at `released`.

    `every`: one in so many of them releases it.
    """
    cycles = np.searchsorted(released, ends, side="left") - 1
    places = np.flatnonzero(cycles >= 0)
    places = places[ends[places] - starts[cycles[places]] <= PAUSE * period]
    cycles, extra = _distinct(cycles[places])
    places, cycles = places[~extra], cycles[~extra]
    delays = ends[places] - starts[cycles]
    expected = round((cycles[-1] - cycles[0] + 1) / every) if len(cycles) else 0
    return Paired(places, cycles, delays, delays, max(0, expected - len(places)), len(ends) - len(places))


def from_grid(starts: np.ndarray, ends: np.ndarray, period: float) -> Paired:
    """Delays until `ends` from the instants of a period (s) that frames which begin at `starts` allow."""
    if len(starts) < 2:
        return Paired(np.arange(len(starts)), np.zeros(len(starts), int), *[ends - starts] * 2)
    gaps = np.diff(starts)
    own = _own_period(gaps, period)
    breaks = np.flatnonzero((gaps > PAUSE * own) | ((gaps > _STALL * own) & ~_caught_up(gaps, own))) + 1
    breaks = np.union1d(breaks, _new_phases(starts, own))
    runs = [part for part in np.split(np.arange(len(starts)), breaks) if len(part)]
    found = [_run(starts[part], ends[part], period, own) for part in runs]
    longest = max(found, key=lambda run: len(run.places))
    first = np.cumsum([0] + [int(run.cycles[-1]) + PAUSE for run in found])
    return Paired(
        np.concatenate([part[run.places] for part, run in zip(runs, found, strict=True)]),
        np.concatenate([run.cycles + at for run, at in zip(found, first, strict=False)]),
        np.concatenate([run.delays for run in found]),
        np.concatenate([run.least for run in found]),
        sum(run.missing for run in found),
        sum(run.extra for run in found),
        len(breaks),
        longest.period,
    )


def _own_period(gaps: np.ndarray, period: float) -> float:
    """The mean of the usual gaps; the schedule's period where few are usual, or where it is nearly that."""
    middle = float(np.median(gaps))
    usual = gaps[(gaps >= _USUAL[0] * middle) & (gaps <= _USUAL[1] * middle)]
    if middle <= 0.0 or 2 * len(usual) <= len(gaps):
        return period
    own, doubt = float(usual.mean()), float(np.ptp(usual)) / len(usual)
    return period if abs(own - period) <= OTHER_PERIOD * period + doubt else own


def _caught_up(gaps: np.ndarray, period: float) -> np.ndarray:
    """Whether frames come close behind the one after each gap: they waited, and the period went on."""
    return np.append(gaps[1:] < _USUAL[0] * period, False)


def _new_phases(starts: np.ndarray, period: float) -> np.ndarray:
    """The frames from which on all keep to another phase than those before: the sender has begun again."""
    late = starts - period * _distinct(_counted(starts, period, _EARLY[0]))[0]
    found: list[tuple[int, float]] = []
    for place in (np.flatnonzero(np.abs(np.diff(late)) > _OTHER_PHASE * period) + 1).tolist():
        before, after = late[max(0, place - PAUSE) : place], late[place : place + PAUSE]
        if min(len(before), len(after)) < _ENOUGH:
            continue
        step = abs(float(after.min() - before.min()))
        usual = max(float(np.median(part) - part.min()) for part in (before, after))
        if step <= _OTHER_PHASE * period + 2.0 * usual:
            continue
        if found and place - found[-1][0] < PAUSE:  # of neighbours the clearest
            if step <= found[-1][1]:
                continue
            found.pop()
        found.append((place, step))
    return np.array([place for place, _ in found], int)


def _run(starts: np.ndarray, ends: np.ndarray, period: float, own: float) -> Paired:
    """The delays of frames without a pause, counted so that the largest is the least."""
    counted = [_counted(starts, own, early) for early in _EARLY]
    counted.append(np.arange(len(starts)))  # none is missing: then frames may be late by nearly a period
    found = [_delays(starts, ends, *_distinct(cycles), period, own) for cycles in counted]
    return min(found, key=lambda each: (len(each.least) < len(found[0].least), float(each.least.max())))


def _delays(
    starts: np.ndarray, ends: np.ndarray, cycles: np.ndarray, extra: np.ndarray, period: float, own: float
) -> Paired:
    """The delays of frames whose instants are counted."""
    extra |= _out_of_turn(starts, cycles, own)
    places = np.flatnonzero(~extra)
    starts, ends, cycles = starts[places], ends[places], cycles[~extra]

    def delays(each: float) -> np.ndarray:
        found: np.ndarray = ends - each * cycles - (starts - each * cycles).min()
        return found

    possible = _possible(starts, cycles, period, own)
    usual = _least(lambda each: float(delays(each).mean()), *possible)
    narrowest = _least(lambda each: float(delays(each).max()), *possible)
    missing = int(cycles[-1] - cycles[0]) + 1 - len(cycles)
    return Paired(places, cycles - cycles[0], delays(usual), delays(narrowest), missing, int(extra.sum()), 0, usual)


def _out_of_turn(starts: np.ndarray, cycles: np.ndarray, period: float) -> np.ndarray:
    """The few frames that come clearly before all others in their period: sent beside it, as a last command is.

    Without them the instants are later, and the delays shorter.
    """
    beside = np.zeros(len(starts), bool)
    if len(starts) < _ENOUGH or not np.ptp(cycles):
        return beside
    slope, _ = np.polyfit(cycles, starts, 1)
    phases = starts - slope * cycles
    order = np.argsort(phases)
    few = max(3, len(starts) // 200)
    steps = np.flatnonzero(np.diff(phases[order][: few + 1]) > _CLEARLY * period)
    if len(steps):
        beside[order[: steps[-1] + 1]] = True
    return beside


def _least(cost: Callable[[float], float], low: float, high: float) -> float:
    """Where between `low` and `high` a convex function is least."""
    for _ in range(_ROUNDS):
        third = (high - low) / 3.0
        low, high = (low, high - third) if cost(low + third) <= cost(high - third) else (low + third, high)
    return 0.5 * (low + high)


def _possible(starts: np.ndarray, cycles: np.ndarray, period: float, own: float) -> tuple[float, float]:
    """The least and the largest period, s, that the sender may have by the log's clock."""
    low = high = own
    if len(starts) >= _ENOUGH:
        slope, offset = np.polyfit(cycles, starts, 1)
        doubt = float(np.ptp(starts - slope * cycles - offset)) / float(np.ptp(cycles))
        if abs(slope - own) > _CLOCKS * own + doubt:
            low, high = (slope, slope) if own != period else (min(slope, own), max(slope, own))
    return low * (1.0 - _CLOCKS), high * (1.0 + _CLOCKS)


def _counted(starts: np.ndarray, period: float, early: float) -> np.ndarray:
    """The number of the instant before each frame; the instants follow the earliest frames.

    A frame is late more often than early: but for `early` periods, all of the period is taken for lateness.
    """
    cycles = np.zeros(len(starts), int)
    phase, count = _first_instant(starts[:_BEGIN], period), 0
    for place, start in enumerate(starts.tolist()):
        steps = floor((start - phase) / period + early)
        count += max(0, steps)
        phase += max(0, steps) * period
        late = start - phase
        phase += (_UP if late > 0.0 else _DOWN) * late
        cycles[place] = count
    return cycles


def _first_instant(starts: np.ndarray, period: float) -> float:
    """An instant up to a period before the first frame: where phases begin again after their widest gap."""
    phases = np.sort(starts % period)
    gaps = np.diff(np.append(phases, phases[0] + period))
    low = float(phases[(int(gaps.argmax()) + 1) % len(phases)])
    return float(starts[0]) - (float(starts[0]) - low) % period


def _distinct(cycles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each instant for one frame: frames move to instants before theirs that have none; who finds none is extra."""
    numbers = cycles.tolist()
    extra = np.zeros(len(numbers), bool)
    taken: list[int] = []  # places that have an instant, in order
    for place, number in enumerate(numbers):
        if taken and number <= numbers[taken[-1]]:
            at = len(taken) - 1
            while at > 0 and len(taken) - at < PAUSE and numbers[taken[at]] - numbers[taken[at - 1]] == 1:
                at -= 1
            if at == 0 or numbers[taken[at]] - numbers[taken[at - 1]] == 1:
                extra[place] = True
                continue
            for earlier in taken[at:]:
                numbers[earlier] -= 1
            numbers[place] = numbers[taken[-1]] + 1
        taken.append(place)
    return np.array(numbers, int), extra
