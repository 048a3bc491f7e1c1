"""A part program as segments for interpolators: axes in machine coordinates, and where they rest.

A segment's feed rate is that of all its axes together, degrees counted as mm: where rotary axes move along with X, Y
and Z, it is so much higher than the programmed one that X, Y and Z keep to that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil, pi
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.geometry import PLANES, length, sweep
from rds.core.types import ArcSegment, LineSegment, Segment

if TYPE_CHECKING:
    from rds.machines import Machine
    from rds.nc.path_block import Event, PathBlock

MOST = 2_000_000  # samples of a program, which are held in memory
_RESTING = {"dwell": "dwell (G4)", "stop": "stop (M0, M1, M60)", "tool": "tool change (M6)"}
_TURN = 2 * pi * (1 + 1e-12)


class Programmed(NamedTuple):
    """A program's moves, after which of them the axes rest and for how long (s; -1: before the first), and notes.

    `lines` has the program line of each move; `events` what happens where the axes rest, after which move.
    """

    segments: list[Segment]
    rests: dict[int, float]
    notes: list[str]
    lines: list[int]
    events: list[tuple[int, Event]]


def program(
    blocks: Iterator[PathBlock], machine: Machine, T: float, most: int, axes: Sequence[str] = ("X", "Y", "Z")
) -> Programmed:
    """The moves of a checked program in machine coordinates, rapids at the speed of the slowest axis.

    Points have a position for each of `axes`, in the order of AXES.

    Raises InputError for a program that moves another axis or the tool's tip, moves nothing, or takes more than `most`
    samples of `T` s.
    """
    from rds.interpolators.motion.limits import Limits
    from rds.interpolators.motion.planner import PASSING
    from rds.interpolators.motion.segments import AXES, JOINTS

    columns = [AXES.index(name) for name in axes]
    others = [k for k in range(len(AXES)) if k not in columns]
    fastest = Limits.of(machine).velocity[columns]
    segments: list[Segment] = []
    lines: list[int] = []
    events: list[tuple[int, Event]] = []
    rests: dict[int, float] = {}
    counts: dict[str, int] = {}
    samples = 0.0
    for block in blocks:
        made = [len(segments) - 1]  # the segment made of the last row before each row
        for row in block.segments:
            if row["length"] <= 0.0:
                made.append(len(segments) - 1)
                continue
            if row["tip"] != JOINTS:
                raise InputError(
                    "G43.4 moves the tool's tip, and an interpolator moves axes; use planned motion",
                    f"line {row['line']}",
                )
            if np.any(row["start"][others] != row["end"][others]):
                moved, taken = next(AXES[k] for k in others if row["start"][k] != row["end"][k]), ", ".join(axes)
                raise InputError(
                    f"it moves {moved}, and here an interpolator takes {taken}; planned motion moves all axes",
                    f"line {row['line']}",
                )
            rate = _rapid(row, columns, fastest) if row["rapid"] else float(row["rate"])
            samples = _counted(samples + row["length"] / rate / T + 1.0, most, T)
            segments += _segments(row, rate, columns)
            lines += [int(row["line"])] * (len(segments) - len(lines))
            made.append(len(segments) - 1)
        for event in block.events:
            if event.kind not in PASSING:
                events.append((made[event.after + 1], event))
            if event.kind in _RESTING:
                seconds = float(event.value) if event.kind == "dwell" else 0.0
                after = made[event.after + 1]
                rests[after] = rests.get(after, 0.0) + seconds
                counts[event.kind] = counts.get(event.kind, 0) + 1
                samples = _counted(samples + seconds / T, most, T)
    if not segments:
        raise InputError("the program moves nothing; there is nothing to interpolate")
    said = [f"{count} × {_RESTING[kind]}" for kind, count in counts.items() if kind != "dwell"]
    notes = [f"{' and '.join(said)}: the axes rest, and it goes on at once"] if said else []
    if seconds := sum(rests.values()):
        notes.append(f"{counts['dwell']} × {_RESTING['dwell']}: the axes rest for {seconds:g} s in all")
    return Programmed(segments, rests, notes, lines, events)


def _counted(samples: float, most: int, T: float) -> float:
    """The same count, unless it is too large: InputError."""
    if samples > most:
        raise InputError(
            f"the program takes more than {most} samples of {T:g} s, which are held in memory; "
            f"give a longer sample period, or plan it with `rds nc`"
        )
    return samples


def _segments(row: np.ndarray, rate: float, columns: list[int]) -> list[Segment]:
    """The segments of a move at `rate` along its length: of X, Y, Z where they move, else of the rotary axes."""
    start, end = (tuple(row[name][columns].tolist()) for name in ("start", "end"))
    way = row["end"] - row["start"]
    both = bool(way[:3].any() or row["plane"] >= 0) and bool(way[3:].any())
    if row["plane"] < 0:
        straight = LineSegment(start, end, rate)
        return [_lasting(straight, float(row["length"] / rate)) if both else straight]
    first, second = tuple(PLANES.values())[int(row["plane"])]  # both there, or the check has refused the arc
    plane = columns.index(first), columns.index(second)
    middle = tuple(float(row["centre"][k]) if k < len(row["centre"]) else 0.0 for k in columns)
    count = max(1, ceil(abs(row["sweep"]) / _TURN))
    turns = count - 1  # whole turns first, each of them a segment of its own
    pieces: list[Segment] = []
    here = start
    for k in range(count):
        part = 2 * pi * (k + 1) / abs(row["sweep"])
        there = end if k == turns else tuple(a + (b - a) * part for a, b in zip(start, end, strict=True))
        if k < turns:
            there = tuple(start[i] if i in plane else value for i, value in enumerate(there))
        piece = ArcSegment(here, there, middle, rate, bool(row["sweep"] < 0), plane)
        share = abs(sweep(piece) / row["sweep"])
        pieces.append(_lasting(piece, float(share * row["length"] / rate)) if both else piece)
        here = there
    return pieces


def _lasting(segment: Segment, seconds: float) -> Segment:
    """The segment at the feed rate at which it takes so long."""
    return replace(segment, feed_rate=length(segment) / seconds)


def _rapid(row: np.ndarray, columns: list[int], fastest: np.ndarray) -> float:
    """The rate along the move's length at which no axis is faster than it can."""
    share = np.abs(row["end"] - row["start"])[columns] / row["length"]
    moving = share > 0.0
    return float((fastest[moving] / share[moving]).min())
