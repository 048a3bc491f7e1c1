"""A part program as segments for interpolators: the linear axes in machine coordinates, and where the axes rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, pi
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.geometry import PLANES
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

    Points have a position for each of `axes`, which are X, Y and Z, or those of them that the machine has.

    Raises InputError for a program that moves rotary axes, moves nothing, or takes more than `most` samples of `T` s.
    """
    from rds.interpolators.motion.limits import Limits
    from rds.interpolators.motion.planner import PASSING
    from rds.interpolators.motion.segments import AXES

    fastest = Limits.of(machine).velocity
    columns = [AXES.index(name) for name in axes]
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
            if np.any(row["start"][3:] != row["end"][3:]):
                raise InputError(
                    "it moves a rotary axis; interpolators take X, Y and Z: planned motion moves all axes",
                    f"line {row['line']}",
                )
            rate = _rapid(row, fastest) if row["rapid"] else float(row["rate"])
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
    start, end, middle = (row[name][columns] for name in ("start", "end", "centre"))
    if row["plane"] < 0:
        return [LineSegment(tuple(start.tolist()), tuple(end.tolist()), rate)]
    first, second = tuple(PLANES.values())[int(row["plane"])]  # both there, or the check has refused the arc
    plane = columns.index(first), columns.index(second)
    count = max(1, ceil(abs(row["sweep"]) / _TURN))
    turns = count - 1  # whole turns first, each of them a segment of its own
    pieces: list[Segment] = []
    here = start
    for k in range(count):
        there = end.copy()
        if k < turns:
            there[:] = start + (end - start) * (2 * pi * (k + 1) / abs(row["sweep"]))
            there[list(plane)] = start[list(plane)]
        a, b, centre = (tuple(point.tolist()) for point in (here, there, middle))
        pieces.append(ArcSegment(a, b, centre, rate, bool(row["sweep"] < 0), plane))
        here = there
    return pieces


def _rapid(row: np.ndarray, fastest: np.ndarray) -> float:
    """mm/s: no axis faster than it can."""
    share = np.abs(row["end"] - row["start"])[:3] / row["length"]
    moving = share > 0.0
    return float((fastest[:3][moving] / share[moving]).min())
