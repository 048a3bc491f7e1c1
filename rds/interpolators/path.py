"""A path of segments through interpolators: each dispatched to the method for its kind, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from math import ceil, inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.interpolators import DEFAULT
from rds.interpolators.acceleration import Acceleration, make_acceleration, smooth
from rds.interpolators.deviation import path_distances
from rds.interpolators.interpolator import Interpolator, as_interpolator, common_blu
from rds.interpolators.reference_pulse import pulses
from rds.interpolators.result import Interpolation
from rds.interpolators.segment import checked

_GAP = 1e-6  # mm, between the end of a segment and the start of the next


def interpolate(
    segments: Sequence[Segment],
    T: float,
    method: Interpolator | str | Path | Callable[..., Any] | None = None,
    *,
    lines: Interpolator | str | Path | Callable[..., Any] | None = None,
    arcs: Interpolator | str | Path | Callable[..., Any] | None = None,
    acceleration: Acceleration | str | None = None,
    exact_stop: bool = False,
    axes: Sequence[str] | None = None,
    rests: Mapping[int, float] | None = None,
) -> Interpolation:
    """The whole path sampled every `T` s, from rest at its start.

    `method` (default: constant velocity) interpolates it, `lines` and `arcs` in its stead what they are for: names of
    the library, paths of .py files, functions, or interpolators with options of their own (`rds.interpolator`).
    `acceleration`, a filter or its name, filters the motion as one stream, so that corners are rounded; with
    `exact_stop` each segment by itself, so that the axes come to rest at its end. `axes` are their names (default X,
    Y, Z, A, B, C). `rests` says after which segments (by index; -1: before the first) the axes rest, and for how many
    s at least, a dwell's.
    Positions are in whole BLU where one of the methods says so. Raises InputError for segments that don't follow each
    other or that a method doesn't take, ContractError for a user's method that breaks its interface.
    """
    segments = list(segments) if isinstance(segments, Iterable) and not isinstance(segments, str) else [segments]
    base = as_interpolator(DEFAULT if method is None else method)
    pair = (base if lines is None else as_interpolator(lines), base if arcs is None else as_interpolator(arcs))
    try:
        segments = [_of_tuples(segment) for segment in segments]
        names = _names(axes, segments)
        check_chain(segments, T)
    except TypeError as error:
        raise InputError(f"positions (mm), one for each axis, feed rates and T must be numbers: {error}") from None
    chosen = [pair[isinstance(segment, ArcSegment)] for segment in segments]
    blu = common_blu(chosen)
    _check_rests(rests or {}, len(segments))
    acceleration = make_acceleration(acceleration) if isinstance(acceleration, str) else acceleration
    parts = [each.rows(segment, T) for each, segment in zip(chosen, segments, strict=True)]
    weights = acceleration.weights(T) if acceleration else np.ones(1)
    if not any(map(len, parts)):
        raise InputError("the path has no length: each of its segments ends where it starts; give another end")
    ends = range(len(parts)) if exact_stop and acceleration is not None else ()
    rows, first, last = _streams(parts, np.array(segments[0].start, dtype=float), weights, T, dict(rests or {}), ends)
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


def _streams(
    parts: Sequence[np.ndarray],
    start: np.ndarray,
    weights: np.ndarray,
    T: float,
    rests: dict[int, float],
    ends: Iterable[int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows (samples + 1, 3, axes) of the whole motion; the first and the last segment that each sample is made of.

    Filtered stream by stream: one ends after each of the segments `ends` and those after which the axes rest.
    """
    held = len(weights) - 1
    here = start
    rows: list[np.ndarray] = []
    first: list[np.ndarray] = []
    last: list[np.ndarray] = []

    def stay(count: int, segment: int) -> None:
        still = np.zeros((count, 3, len(start)))
        still[:, 0] = here
        rows.append(still)
        first.append(np.full(count, max(segment, 0)))
        last.append(first[-1])

    stay(1 + ceil(rests.get(-1, 0.0) / T - 1e-9), -1)
    begin = 0
    for end in sorted({*ends, *(k for k in rests if k >= 0), len(parts) - 1}):
        stream = np.concatenate(parts[begin : end + 1])
        index = np.repeat(np.arange(begin, end + 1), [len(part) for part in parts[begin : end + 1]])
        if len(stream):
            rows.append(stream if not held else np.array(list(smooth(stream, here, weights, T))))
            first.append(np.concatenate([np.full(held, index[0]), index]))  # what is still in the filter
            last.append(np.concatenate([index, np.full(held, index[-1])]))
            here = stream[-1, 0]
        stay(ceil(rests.get(end, 0.0) / T - 1e-9), end)
        begin = end + 1
    return np.concatenate(rows), np.concatenate(first), np.concatenate(last)


def _check_rests(rests: Mapping[int, float], count: int) -> None:
    """InputError for a rest after a segment that there is not, and for one that is no time."""
    for after, seconds in rests.items():
        if after not in range(-1, count):
            raise InputError(f"rests: there is no segment {after!r} to rest after; -1 (before all) to {count - 1}")
        if not 0.0 <= seconds < inf:
            raise InputError(f"rests: after segment {after}, {seconds!r} must be a finite number of s from 0")


def _of_tuples(segment: Segment) -> Segment:
    """With points as the methods compare them: of an array, a list and a tuple no two are equal."""
    points = [name for name in ("start", "end", "centre") if not isinstance(getattr(segment, name, ()), tuple)]
    given = {name: getattr(segment, name) for name in points}
    made: dict[str, Any] = {
        name: tuple(point.tolist() if hasattr(point, "tolist") else point) for name, point in given.items()
    }
    return replace(segment, **made) if made else segment


def _names(axes: Sequence[str] | None, segments: Sequence[Segment]) -> tuple[str, ...]:
    if not segments:
        raise InputError("there is no segment to interpolate; give a line or an arc")
    if (other := next((each for each in segments if not isinstance(each, LineSegment | ArcSegment)), None)) is not None:
        raise InputError(f"{other!r:.60} is no LineSegment and no ArcSegment; rds.PartProgram runs a part program")
    count = len(segments[0].start)
    names = tuple(axes or "XYZABC"[:count])
    if len(names) != count:
        raise InputError(f"{count} axes move, and there are {len(names)} names for them ({', '.join(names)})")
    return names


def check_chain(segments: Sequence[Segment], T: float) -> None:
    """InputError for a segment that can't be interpolated, or that does not start where the one before ended."""
    for number, segment in enumerate(segments, start=1):
        try:
            checked(segment, T)
        except InputError as error:
            raise InputError(f"segment {number}: {error}") if len(segments) > 1 else error from None
        if number > 1:
            end, start = segments[number - 2].end, segment.start
            if len(end) != len(start) or max(abs(a - b) for a, b in zip(end, start, strict=True)) > _GAP:
                raise InputError(
                    f"segment {number} starts at {tuple(start)} and the one before ends at {tuple(end)}; "
                    f"start each where the one before ends"
                )
