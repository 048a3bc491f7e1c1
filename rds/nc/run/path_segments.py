"""The segments of a path and the axes of a machine: which of them move, whether there is room, and rows of SEGMENT."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rds.core.errors import InputError
from rds.core.geometry import PLANES, length
from rds.core.types import ArcSegment, Segment
from rds.interpolators.motion.segments import AXES, arc, line
from rds.machines import Machine
from rds.nc.extent import extents

_LINEAR = AXES[:3]


def without_idle(axes: Sequence[str], segments: Sequence[Segment]) -> tuple[list[str], list[Segment]]:
    """The axes, and the segments with positions of these alone, without the rotary axes that none of them moves.

    Of the linear ones all stay: what an arc's plane refers to.
    """
    ends = np.array([segment.end for segment in segments])
    moves = np.ptp(np.vstack([segments[0].start, ends]), axis=0) > 0.0
    kept = [i for i, name in enumerate(axes) if name in _LINEAR or moves[i]]
    if len(kept) == len(axes):
        return list(axes), list(segments)

    def only(point: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(point[i] for i in kept)

    found: list[Segment] = []
    for segment in segments:
        start, end = only(segment.start), only(segment.end)
        if isinstance(segment, ArcSegment):  # its plane is of linear axes, which come first
            found.append(replace(segment, start=start, end=end, centre=only(segment.centre)))
        else:
            found.append(replace(segment, start=start, end=end))
    return [axes[i] for i in kept], found


def in_room(segments: Sequence[Segment], lines: Sequence[int], machine: Machine, axes: Sequence[str]) -> np.ndarray:
    """The segments as rows of SEGMENT. InputError for axes that no path moves, an arc of a rotary axis, or a path that
    leaves the travel of an axis.
    """
    if list(axes) != [name for name in AXES if name in axes]:
        raise InputError(
            f"a path moves {', '.join(AXES)}, in that order, and the run has {', '.join(axes)}; change axes"
        )
    for segment, number in zip(segments, lines, strict=True):
        if isinstance(segment, ArcSegment) and (turning := [axes[i] for i in segment.plane if axes[i] not in _LINEAR]):
            raise InputError(f"segment {number} is an arc in which {turning[0]} takes part; arcs are of X, Y and Z")
    rows = _in_machine_axes(segments, lines, [AXES.index(name) for name in axes])
    least, most = extents(rows)
    for name in axes:
        k, (low, high), unit = AXES.index(name), machine.axes[name].travel, machine.axes[name].unit
        beyond = (least[:, k] < low - 1e-9) | (most[:, k] > high + 1e-9)
        if beyond.any():
            at = int(beyond.argmax())
            raise InputError(
                f"segment {lines[at]} takes {name} from {least[at, k]:g} to {most[at, k]:g} {unit}; "
                f"it travels from {low:g} to {high:g} {unit}; move the path into that range"
            )
    return rows


def _in_machine_axes(segments: Sequence[Segment], lines: Sequence[int], order: Sequence[int]) -> np.ndarray:
    """The segments as rows of SEGMENT; `order` has the index in AXES of each position."""
    planes = list(PLANES.values())
    rows = []
    for segment, number in zip(segments, lines, strict=True):
        start, end = _in_space(segment.start, order), _in_space(segment.end, order)
        if isinstance(segment, ArcSegment):
            plane = order[segment.plane[0]], order[segment.plane[1]]
            is_seen_from_behind = plane not in planes
            row = arc(
                start,
                end,
                _in_space(segment.centre, order)[: len(_LINEAR)],
                segment.feed_rate,
                clockwise=segment.clockwise != is_seen_from_behind,
                plane=planes.index(plane[::-1] if is_seen_from_behind else plane),
                program_line=number,
            )
        else:
            row = line(start, end, segment.feed_rate, program_line=number)
        if any(k >= len(_LINEAR) for k in order) and (whole := length(segment)) > 0.0:
            row["rate"] *= row["length"] / whole  # of the row: along X, Y, Z; of the segment: of all axes together
        rows.append(row)
    return np.concatenate(rows)


def _in_space(point: Sequence[float], order: Sequence[int]) -> list[float]:
    whole = [0.0] * len(AXES)
    for i, value in zip(order, point, strict=True):
        whole[i] = float(value)
    return whole
