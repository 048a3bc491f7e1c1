"""The samples of a chain of segments by an interpolator inside the loop: what makes them, and the program of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from rds.core.errors import InputError
from rds.core.geometry import length
from rds.core.types import ArcSegment, Segment
from rds.interpolators.acceleration import Acceleration, smooth_one_by_one
from rds.interpolators.interpolator import Interpolator, common_blu
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.segments import AXES
from rds.interpolators.path import check_chain
from rds.machines import Machine
from rds.modes.loop.interpolated import LEAST_AHEAD
from rds.modes.loop.program import InterpolatedProgram, ProgramEvent, Row, Stretch, dwell_samples
from rds.nc.run.path_segments import in_room

MOST_SAMPLES = 20_000_000


@dataclass(frozen=True)
class Method:
    """What makes the samples of a path: an interpolator, a filter on top of it, and how many rows ahead it works.

    `arcs` is another interpolator for the arcs, if there is one.
    """

    interpolator: Interpolator
    acceleration: Acceleration | None = None
    exact_stop: bool = False
    ahead: int = LEAST_AHEAD
    arcs: Interpolator | None = None

    @property
    def interpolators(self) -> tuple[Interpolator, ...]:
        """That of lines, and that of arcs where it is another one."""
        return (self.interpolator,) if self.arcs is None else (self.interpolator, self.arcs)


def program_of(
    name: str,
    segments: Sequence[Segment],
    lines: Sequence[int],
    due: Mapping[int, tuple[ProgramEvent, ...]],
    first: tuple[ProgramEvent, ...],
    method: Method,
    machine: Machine,
    axes: Sequence[str],
    T: float,
    spindle: bool = False,
) -> InterpolatedProgram:
    """The program of these segments; `due` says after which of them the axes rest, and what happens there."""
    check_chain(segments, T)
    path = in_room(segments, lines, machine, axes)
    weights = method.acceleration.weights(T) if method.acceleration else np.ones(1)
    lines_by, arcs_by = method.interpolator, method.arcs or method.interpolator
    blu = common_blu(method.interpolators)
    ends = set(due) | (set(range(len(segments))) if method.exact_stop else set()) | {len(segments) - 1}
    stretches, begin, samples = [], 0, 1
    for end in sorted(ends):
        part = tuple(segments[begin : end + 1])
        happens = tuple(due.get(end, ()))
        stretches.append(Stretch(_Rows(part, begin, lines_by, arcs_by, weights, blu, T), happens))
        samples += sum(ceil(length(each) / each.feed_rate / T - 1e-9) for each in part) + len(weights) - 1
        samples += sum(dwell_samples(each.value, T) for each in happens if each.kind == "dwell")
        begin = end + 1
    if samples > MOST_SAMPLES:
        raise InputError(f"the path takes {samples} samples of {T:g} s; a run takes at most {MOST_SAMPLES}", name)
    limits = Limits.of(machine)
    order = [AXES.index(each) for each in axes]
    turning = next((each.name for each in machine.axes.values() if each.unit == "rev/min"), None) if spindle else None
    filter_ = method.acceleration
    return InterpolatedProgram(
        axes=tuple(axes),
        spindle=turning,
        start=tuple(float(value) for value in segments[0].start),
        first=first,
        stretches=tuple(stretches),
        line=tuple(lines),
        feed=max(each.feed_rate for each in segments),
        ahead=method.ahead,
        samples=samples,
        home=(0.0,) * len(axes),
        limits=np.array([limits.velocity, limits.acceleration, limits.jerk])[:, order],
        travel=np.array([machine.axes[each].travel for each in axes], dtype=float),
        path=path,
        about={
            "interpolator": ", arcs by ".join(each.name for each in method.interpolators),
            "interpolator_params": dict(method.interpolator.params),
            **({} if method.arcs is None else {"arc_interpolator_params": dict(method.arcs.params)}),
            "acceleration": None if filter_ is None else {"name": filter_.name, **filter_.params},
            "exact_stop": method.exact_stop,
            "look_ahead": method.ahead,
        },
        name=name,
        blu=blu or 0.0,
    )


@dataclass(frozen=True)
class _Rows:
    """Makes the rows of segments that are passed without a rest. `first` is the number of the first segment."""

    segments: tuple[Segment, ...]
    first: int
    lines: Interpolator
    arcs: Interpolator
    weights: np.ndarray
    blu: float | None
    T: float

    def __call__(self) -> Iterator[Row]:
        number = self.first - 1

        def made() -> Iterator[np.ndarray]:
            nonlocal number
            for segment in self.segments:
                number += 1
                yield from (self.arcs if isinstance(segment, ArcSegment) else self.lines).each(segment, self.T)

        rows: Iterable[Sequence[np.ndarray]] = made()  # type: ignore[assignment]
        if len(self.weights) > 1:
            rows = smooth_one_by_one(rows, self.segments[0].start, self.weights, self.T)
        for position, velocity, acceleration in rows:
            at = position if self.blu is None else np.rint(position / self.blu) * self.blu
            yield at.tolist(), velocity.tolist(), acceleration.tolist(), number
