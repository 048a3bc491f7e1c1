"""From the segments of a program to samples of all axes, within the limits: `plan`.

Our own, because `ruckig` plans single moves (and does, from point to point), `toppra` knows no limit of jerk, and
neither rounds corners within a tolerance.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import ceil, inf
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.interpolators.motion.checking import check_segments
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.samples import Rows, SampleBlock
from rds.interpolators.motion.segments import EXACT_STOP, LINE, SEGMENT

if TYPE_CHECKING:
    from rds.interpolators.motion.least_time import LeastTime

TOLERANCE = 0.05  # mm (degrees), of G64 without P; chosen
LONGEST_RAMP = 1000.0  # s, acceleration over jerk of an axis, over which the motion is averaged
MARGIN = 1e-3  # relative, kept off the limits for rounding
PASSING = ("coolant", "output")  # kinds of events for which the motion does not come to rest
NOT_BUILT = ("line", "rapid", "tip", "tool_length")  # columns of the segments that the pieces do not need
ENOUGH = 2048  # segments, or samples, that are gathered before they are handed on
MOST_HELD = 200_000  # samples of a short program, until it is known whether stopping after each move would be faster


def plan(
    blocks: Iterable[Any],
    limits: Limits,
    T: float,
    *,
    tolerance: float = TOLERANCE,
    start: np.ndarray | None = None,
    least_time: LeastTime | None = None,
) -> Iterator[SampleBlock]:
    """The samples of a program's motion, T s apart, in bounded memory; the same for the same segments.

    blocks: arrays of dtype SEGMENT, or objects with `.segments` and `.events` (each with `after`, `kind`, `value`,
    `line`: what happens after segment `after` of the block, −1 before the first). The motion comes to rest for each
    event but coolant and outputs, and stays there for the `value` s of a "dwell". tolerance: mm or degrees, of mode
    BLEND without one. start: where the axes are if events come before motion (6); default the first segment's start.
    least_time: is shown the path, and knows at the end how long it takes at the least.

    Each finite difference of the samples keeps to the velocity, acceleration and jerk of each axis; the speed along the
    path to the programmed rate. On exact paths all samples are on the path, and the motion slows down where direction
    or curvature jump, down to a stop. In mode BLEND corners are cut within the tolerance; where the path turns back by
    more than 150° it is stopped at. The last sample is at rest on the end. The motion of less than ENOUGH segments and
    MOST_HELD samples takes no longer than one that rests after each move: where it would, it is that one.

    Raises InputError, by line, for a segment that cannot be: a rate of 0, an axis without limits, a gap before it.
    """
    if isinstance(blocks, np.ndarray) and blocks.dtype == SEGMENT:
        raise InputError("the path is one block of several that a plan may take; hand it in as plan([path], limits, T)")
    if not isinstance(blocks, Iterable):
        raise InputError(f"blocks = {blocks!r:.60} is no path; hand it in as plan([path], limits, T)")
    if not isinstance(limits, Limits):
        raise InputError(f"limits = {limits!r:.60} must be Limits, as in Limits.of(load_machine('mini-cnc'))")
    if not (isinstance(T, Real) and T > 0.0):
        raise InputError(f"sample period T = {T!r} must be more than 0 s")
    shown = _Shown(least_time)
    planner = _Planner(limits, T, tolerance, start, shown)
    for block in blocks:
        planner.take(getattr(block, "segments", block), getattr(block, "events", ()))
        yield from planner.run(final=False)
        shown.hand_on()
    least = planner.least_stopping()
    if least <= MOST_HELD * T:
        stopping = _Planner(limits, T, tolerance, start, _Shown(least_time))
        found, shown = _shorter(planner, stopping, least)
        yield from found
    else:
        yield from planner.run(final=True)
    shown.hand_on()
    if least_time is not None:
        least_time.finish()


def _shorter(planner: _Planner, stopping: _Planner, least: float) -> tuple[list[SampleBlock], _Shown]:
    """The motion of a short program, or where that takes less time the one that rests after each of its moves, for
    which `stopping` is there and which takes `least` s at the least; and what it shows of its path.

    Where to stop is decided corner by corner (path.py), by an estimate that does not know what is near the corner.
    """
    segments, events = np.concatenate([np.empty(0, SEGMENT), *planner.waiting]), list(planner.events)
    found = list(planner.run(final=True))
    if predicted_time(found) <= least:
        return found, planner.shown
    segments["mode"] = EXACT_STOP
    stopping.take(segments, ())
    stopping.events = events
    stops = list(stopping.run(final=True))
    faster = predicted_time(stops) < predicted_time(found)
    return (stops, stopping.shown) if faster else (found, planner.shown)


class _Shown:
    """What a planner shows of its path, until it is known whether the motion takes it."""

    def __init__(self, to: LeastTime | None) -> None:
        self._to = to
        self._parts: list[tuple[np.ndarray, np.ndarray] | float] = []

    def extend(self, f: np.ndarray, u: np.ndarray) -> None:
        if self._to is not None:
            self._parts.append((f.copy(), u.copy()))

    def rest(self, seconds: float) -> None:
        self._parts.append(seconds)

    def hand_on(self) -> None:
        """It takes it."""
        parts, self._parts = self._parts, []
        if self._to is None:
            return
        for part in parts:
            if isinstance(part, tuple):
                self._to.extend(*part)
            else:
                self._to.rest(part)


def predicted_time(blocks: Iterable[SampleBlock]) -> float:
    """s: the number of samples times their period."""
    total = 0.0
    for block in blocks:
        total = (block.first + len(block)) * block.T
    return total


class _Planner:
    def __init__(self, limits: Limits, T: float, tolerance: float, start: np.ndarray | None, shown: _Shown):
        from rds.interpolators.motion.stretch import Stretch  # numba, where it is installed

        self.limits, self.T, self.tolerance = limits, T, tolerance
        share = 1.0 - MARGIN
        self.within = Limits(limits.velocity * share, limits.acceleration * share, limits.jerk * share)
        axes = limits.present
        self.tau = float((limits.acceleration[axes] / limits.jerk[axes]).max()) if axes.any() else T
        if self.tau > LONGEST_RAMP:
            raise InputError(
                f"an axis needs {self.tau:.3g} s to reach its acceleration at its jerk, more than {LONGEST_RAMP:g}; "
                "raise the jerk of [axis.NAME.limits], or lower the acceleration"
            )
        self.stretch = Stretch(self.within, self.tau, T)
        self.shown = shown
        self.state = np.array([0.0, 0.0, float(limits.velocity.max())])
        self.point = None if start is None else np.array(start, dtype=float)
        self.new = np.empty(0, SEGMENT)  # not yet handed to `build`, or not done with
        self.kept, self.kept_first = (
            np.empty(0, SEGMENT),
            0,
        )  # whose samples are not handed out yet, and their neighbours
        self.kept_at = np.empty(0)  # programmed distance of their starts
        self.taken, self.length = 0, 0.0  # segments, and their length
        self.waiting: list[np.ndarray] = []
        self.events: list[tuple[int, Any]] = []  # (segment after which, event)
        self.rested = -1  # the segment after which the motion last came to rest
        self.end: np.ndarray | None = None
        self.out = Rows(T)

    def take(self, segments: np.ndarray, events: Iterable[Any]) -> None:
        for event in events:
            self.events.append((self.taken + event.after, event))
        if not len(segments):
            return
        check_segments(segments, self.limits.present, self.end)
        self.end = segments["end"][-1].copy()
        self.waiting.append(segments)
        self.taken += len(segments)

    def least_stopping(self) -> float:
        """s, at the least, of a motion that rests after each move; inf if it has begun, or rests there anyway."""
        modes = np.concatenate([np.empty(0, np.int8), *(each["mode"] for each in self.waiting)])
        if len(self.kept) or (modes[:-1] == EXACT_STOP).all():
            return inf
        dwelling = sum(float(event.value) for _, event in self.events if event.kind == "dwell")
        return dwelling + sum(map(self._least, self.waiting))

    def _least(self, segments: np.ndarray) -> float:
        """The closed form of lines, in the least time within the limits; arcs at their rate."""
        way, rate = segments["length"], np.where(segments["rapid"], inf, segments["rate"])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            each = np.abs(segments["end"] - segments["start"]) / way[:, None]
            speed, push, jerk = (
                np.where(each > 0.0, limit / each, inf).min(axis=1)
                for limit in (self.within.velocity, self.within.acceleration, self.within.jerk)
            )
            speed = np.minimum(speed, rate)
            rise = push / jerk  # s, in which the acceleration is reached
            top = np.where(
                way >= 2.0 * push * rise**2,
                0.5 * push * (np.sqrt(rise**2 + 4.0 * way / push) - rise),
                np.cbrt(0.25 * way**2 * jerk),
            )
            top = np.minimum(top, speed)
            ramp = np.where(top >= push * rise, top / push + rise, 2.0 * np.sqrt(top / jerk))
            seconds = np.where(segments["plane"] == LINE, way / top + ramp, way / rate)
        return float(seconds[way > 0.0].sum())

    def run(self, final: bool) -> Iterator[SampleBlock]:
        if not final:
            if sum(map(len, self.waiting)) < ENOUGH:
                return
            from rds.core.compiling import compile_tiered  # numba, where it is installed

            compile_tiered()
        self._gather()
        if self.point is None:
            if not final and not len(self.new):
                return
            self.point = self.new["start"][0].copy() if len(self.new) else np.zeros(6)
        if self.out.total == 0 and (len(self.new) or self.events):
            self._stay(1, self.point)
        yield from self._rest_events(self.point)
        self._build(final)
        for (position, *samples), rest in self.stretch.run():
            self._add(position, *samples)
            if rest is not None:
                self.rested = rest
                yield from self._rest_events(position[-1])
            if len(self.out) >= ENOUGH:
                yield self._block()
        if final and len(self.out):
            yield self._block()

    def _gather(self) -> None:
        if not self.waiting:
            return
        fresh = np.concatenate(self.waiting)
        self.waiting = []
        starts = self.length + np.concatenate(([0.0], np.cumsum(fresh["length"])))
        self.length = float(starts[-1])
        self.kept_at = np.concatenate((self.kept_at, starts[:-1]))
        self.kept = np.concatenate((self.kept, fresh))
        self.new = np.concatenate((self.new, fresh))

    def _build(self, final: bool) -> None:
        from rds.interpolators.motion.path import build

        new, n = self.new, len(self.new)
        if not n:
            return
        first = self.kept_first + len(self.kept) - n  # number of the first segment in `new`
        rest = np.zeros(n, np.bool_)
        for after, event in self.events:
            if event.kind not in PASSING and first <= after < first + n:
                rest[after - first] = True
        path = {name: np.ascontiguousarray(new[name]) for name in SEGMENT.fields or () if name not in NOT_BUILT}
        path["rate"] = np.where(new["rapid"], inf, new["rate"])
        path["tolerance"] = np.where(np.isfinite(new["tolerance"]), new["tolerance"], self.tolerance)
        f, u, done = build(
            **path,
            rest=rest,
            point=self.point,
            final=final,
            state=self.state,
            tau=self.tau,
            T=self.T,
            acceleration=self.within.acceleration,
            jerk=self.within.jerk,
        )
        u[:, 1:3] += first
        self.stretch.extend(f, u)
        self.shown.extend(f, u)
        self.new = new[done:]

    def _add(self, position, velocity, acceleration, distance, first, last) -> None:
        at = np.searchsorted(self.kept_at, distance, side="right") - 1 + self.kept_first
        segment = np.clip(at, first, last)
        line = self.kept["line"][segment - self.kept_first]
        self._passing_events(segment)
        self.out.add(position, velocity, acceleration, line, segment, distance)

    def _passing_events(self, segment: np.ndarray) -> None:
        while self.events and self.events[0][1].kind in PASSING:
            after, event = self.events[0]
            row = int(np.searchsorted(segment, after, side="right"))
            if row == len(segment):
                return
            self.out.events.append((self.out.total + row, event))
            self.events.pop(0)

    def _rest_events(self, position: np.ndarray) -> Iterator[SampleBlock]:
        """What happens now that the motion rests after segment `rested`."""
        while self.events and self.events[0][0] <= self.rested:
            _, event = self.events.pop(0)
            self.out.events.append((self.out.total - 1, event))
            rows = ceil(event.value / self.T - 1e-9) if event.kind == "dwell" else 0
            self.shown.rest(rows * self.T)
            while rows > 0:
                part = min(rows, 16384)
                self._stay(part, position)
                rows -= part
                if len(self.out) >= ENOUGH:
                    yield self._block()

    def _stay(self, rows: int, position: np.ndarray) -> None:
        """Rows at rest; they count as part of the segment that has ended, or of the first."""
        segment = max(self.rested, 0)
        k = segment - self.kept_first
        line = int(self.kept["line"][k]) if 0 <= k < len(self.kept) else 0
        at = float(self.kept_at[k] + self.kept["length"][k] * (self.rested >= 0)) if 0 <= k < len(self.kept) else 0.0
        still = np.zeros((rows, 6))
        self.out.add(
            *(np.tile(position, (rows, 1)), still, still),
            *(np.full(rows, line, np.int32), np.full(rows, segment), np.full(rows, at)),
        )

    def _block(self) -> SampleBlock:
        segments = self.out.segments()
        low = max(int(segments[0]) - 2 - self.kept_first, 0)
        high = min(int(segments[1]) + 3 - self.kept_first, len(self.kept))
        block = self.out.block(
            self.kept[low:high].copy(), self.kept_first + low, float(self.kept_at[low]) if low < len(self.kept) else 0.0
        )
        oldest = self.stretch.oldest_segment
        unbuilt = self.kept_first + len(self.kept) - len(self.new)
        drop = min(max(self.rested, int(segments[1])), unbuilt if oldest is None else oldest, unbuilt) - 3
        drop -= self.kept_first
        if drop > 0:
            self.kept, self.kept_at = self.kept[drop:], self.kept_at[drop:]
            self.kept_first += drop
        return block
