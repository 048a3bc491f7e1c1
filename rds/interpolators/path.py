"""A path of segments through interpolators: each dispatched to the method for its kind, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from rds.core.errors import InputError
from rds.core.types import ArcSegment, Segment
from rds.interpolators.acceleration import Acceleration, smooth
from rds.interpolators.deviation import path_distances
from rds.interpolators.interpolator import Interpolator, from_library
from rds.interpolators.reference_pulse import pulses
from rds.interpolators.result import Interpolation
from rds.interpolators.segment import checked

_GAP = 1e-6  # mm, between the end of a segment and the start of the next


def interpolate(
    segments: Sequence[Segment],
    T: float,
    method: Interpolator | None = None,
    *,
    lines: Interpolator | None = None,
    arcs: Interpolator | None = None,
    acceleration: Acceleration | None = None,
    exact_stop: bool = False,
    axes: Sequence[str] | None = None,
) -> Interpolation:
    """The whole path sampled every `T` s, from rest at its start.

    `method` (default: constant velocity) interpolates it, `lines` and `arcs` in its stead what they are for.
    `acceleration` filters the motion as one stream, so that corners are rounded; with `exact_stop` each segment by
    itself, so that the axes come to rest at its end. `axes` are their names (default X, Y, Z, A, B, C).
    Positions are in whole BLU where one of the methods says so. Raises InputError for segments that don't follow each
    other or that a method doesn't take, ContractError for a user's method that breaks its interface.
    """
    base = method or from_library("constant-velocity", {})
    pair = (lines or base, arcs or base)
    names = _names(axes, segments)
    _check_chain(segments, T)
    chosen = [pair[isinstance(segment, ArcSegment)] for segment in segments]
    parts = [each.rows(segment, T) for each, segment in zip(chosen, segments, strict=True)]
    weights = acceleration.weights(T) if acceleration else np.ones(1)
    index = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    if not len(index):
        raise InputError("the path has no length: each of its segments ends where it starts; give another end")
    if acceleration is None:
        rows = np.concatenate(parts)
        first = last = index
    else:
        streams = parts if exact_stop else [np.concatenate(parts)]
        rows = np.array([row for rows in _smoothed(streams, segments, weights, T) for row in rows])
        held = len(weights) - 1
        if exact_stop:
            index = np.repeat(np.arange(len(parts)), [len(part) + held if len(part) else 0 for part in parts])
            first = last = index
        else:
            last = np.concatenate([index, np.full(held, index[-1])])
            first = np.concatenate([np.full(held, index[0]), index])  # what is still in the filter
    start = np.zeros((1, 3, len(names)))
    start[0, 0] = segments[0].start
    rows = np.concatenate([start, rows])
    first, last = (np.concatenate([each[:1], each]) for each in (first, last))
    blu = next((each.blu for each in chosen if each.blu is not None), None)
    theory = rows[:, 0]
    position = theory if blu is None else np.rint(theory / blu) * blu
    middles = path_distances(segments, (position[1:] + position[:-1]) / 2.0, first[1:], last[1:])
    return Interpolation(
        T=T,
        axes=names,
        segments=tuple(segments),
        methods=(pair[0].name, pair[1].name),
        acceleration=acceleration,
        position=position,
        velocity=rows[:, 1],
        acceleration_rows=rows[:, 2],
        segment=last,
        path_error=path_distances(segments, position, first, last),
        chord_error=np.concatenate([[0.0], middles]),
        steps=tuple(each.steps(segment, T) for each, segment in zip(chosen, segments, strict=True)),
        blu=blu,
        theory=theory,
        pulses=None if blu is None else pulses(theory, blu),
    )


def _smoothed(
    streams: Sequence[np.ndarray], segments: Sequence[Segment], weights: np.ndarray, T: float
) -> Iterator[Iterator[np.ndarray]]:
    start = np.array(segments[0].start, dtype=float)
    for stream in streams:
        yield (np.array(row) for row in smooth(stream, start, weights, T))
        if len(stream):
            start = stream[-1, 0]


def _names(axes: Sequence[str] | None, segments: Sequence[Segment]) -> tuple[str, ...]:
    if not segments:
        raise InputError("there is no segment to interpolate; give a line or an arc")
    count = len(segments[0].start)
    names = tuple(axes or "XYZABC"[:count])
    if len(names) != count:
        raise InputError(f"{count} axes move, and there are {len(names)} names for them ({', '.join(names)})")
    return names


def _check_chain(segments: Sequence[Segment], T: float) -> None:
    for number, segment in enumerate(segments, start=1):
        checked(segment, T)
        if number > 1:
            end, start = segments[number - 2].end, segment.start
            if len(end) != len(start) or max(abs(a - b) for a, b in zip(end, start, strict=True)) > _GAP:
                raise InputError(
                    f"segment {number} starts at {tuple(start)} and the one before ends at {tuple(end)}; "
                    f"start each where the one before ends"
                )
