"""The segments that `rds interpolate` is given: words of the command line, or a part program."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import ceil, pi
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.types import ArcSegment, LineSegment, Segment

if TYPE_CHECKING:
    from rds.machines import Machine
    from rds.nc.toolpath import PathBlock

PLANES = {"XY": (0, 1), "ZX": (2, 0), "YZ": (1, 2)}
_PER_SECOND = {"mm/min": 1 / 60, "mm/s": 1.0, "m/min": 1000 / 60, "in/min": 25.4 / 60, "in/s": 25.4}  # mm/s
_FEED = re.compile(r"\s*([^\s/a-z]+)\s*([a-z/]*)\s*")
_RESTING = {"dwell": "dwell (G4)", "stop": "stop (M0, M1, M60)", "tool": "tool change (M6)"}
_TURN = 2 * pi * (1 + 1e-12)


class Programmed(NamedTuple):
    """A program's moves, after which of them the axes rest and for how long (s; -1: before the first), and notes."""

    segments: list[Segment]
    rests: dict[int, float]
    notes: list[str]


def feed_rate(text: str) -> float:
    """mm/s, from a number of mm/min or a number with its unit. InputError for anything else."""
    match = _FEED.fullmatch(text)
    unit = (match[2] or "mm/min") if match else ""
    try:
        value = float(match[1]) if match else 0.0
    except ValueError:
        value = 0.0
    if unit not in _PER_SECOND or not 0.0 < value < float("inf"):
        units = ", ".join(_PER_SECOND)
        raise InputError(f"--feed {text!r} must be a number above 0 with a unit: {units} (without one: mm/min)")
    return value * _PER_SECOND[unit]


def line(text: str, feed: float) -> list[Segment]:
    """Straight moves over points: "0,0:30,40:60,0", mm, one to three axes each; `feed` in mm/s."""
    points = _points(text, "--line")
    if len(points) < 2:
        raise InputError(f"--line {text!r} needs two points or more, as in --line 0,0:30,40")
    return [LineSegment(a, b, feed) for a, b in pairwise(points)]


def arc(text: str, feed: float, clockwise: bool, plane: str) -> list[Segment]:
    """An arc: "START:END:CENTRE", mm, two or three axes; `feed` in mm/s."""
    points = _points(text, "--arc")
    if len(points) != 3:
        raise InputError(f"--arc {text!r} needs start, end and centre, as in --arc 10,0:0,10:0,0")
    if plane.upper() not in PLANES:
        raise InputError(f"--plane {plane!r} must be one of {', '.join(PLANES)}")
    axes = PLANES[plane.upper()]
    if max(axes) >= len(points[0]):
        raise InputError(f"--arc {text!r}: its points need {max(axes) + 1} axes for the plane {plane.upper()}")
    return [ArcSegment(points[0], points[1], points[2], feed, clockwise, axes)]


def program(blocks: Iterator[PathBlock], machine: Machine, T: float, most: int) -> Programmed:
    """The moves of a checked program in machine coordinates, rapids at the speed of the slowest axis.

    Raises InputError for a program that moves rotary axes, moves nothing, or takes more than `most` samples of `T` s.
    """
    from rds.motion.limits import Limits

    fastest = Limits.of(machine).velocity
    segments: list[Segment] = []
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
                    "it moves a rotary axis; interpolators take X, Y and Z: `rds nc` plans all axes",
                    f"line {row['line']}",
                )
            rate = _rapid(row, fastest) if row["rapid"] else float(row["rate"])
            samples = _counted(samples + row["length"] / rate / T + 1.0, most, T)
            segments += _segments(row, rate)
            made.append(len(segments) - 1)
        for event in block.events:
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
    return Programmed(segments, rests, notes)


def _counted(samples: float, most: int, T: float) -> float:
    """The same count, unless it is too large: InputError."""
    if samples > most:
        raise InputError(
            f"the program takes more than {most} samples of {T:g} s, which are held in memory; "
            f"give a longer --period, or plan it with `rds nc`"
        )
    return samples


def _segments(row: np.ndarray, rate: float) -> list[Segment]:
    start, end = row["start"][:3], row["end"][:3]
    if row["plane"] < 0:
        return [LineSegment(tuple(start.tolist()), tuple(end.tolist()), rate)]
    plane = tuple(PLANES.values())[int(row["plane"])]
    count = max(1, ceil(abs(row["sweep"]) / _TURN))
    turns = count - 1  # whole turns first, each of them a segment of its own
    pieces: list[Segment] = []
    here = start
    for k in range(count):
        there = end.copy()
        if k < turns:
            there[:] = start + (end - start) * (2 * pi * (k + 1) / abs(row["sweep"]))
            there[list(plane)] = start[list(plane)]
        a, b, centre = (tuple(point.tolist()) for point in (here, there, row["centre"]))
        pieces.append(ArcSegment(a, b, centre, rate, bool(row["sweep"] < 0), plane))
        here = there
    return pieces


def _rapid(row: np.ndarray, fastest: np.ndarray) -> float:
    """mm/s: no axis faster than it can."""
    share = np.abs(row["end"] - row["start"])[:3] / row["length"]
    moving = share > 0.0
    return float((fastest[:3][moving] / share[moving]).min())


def _points(text: str, option: str) -> list[tuple[float, ...]]:
    try:
        points = [tuple(float(cell) for cell in point.split(",")) for point in text.split(":")]
    except ValueError as error:
        raise InputError(
            f"{option} {text!r}: {error}; write points in mm, a comma between axes and a colon between points"
        ) from error
    _check_axes(points, text, option)
    return points


def _check_axes(points: Sequence[tuple[float, ...]], text: str, option: str) -> None:
    counts = {len(point) for point in points}
    if len(counts) != 1 or not counts <= {1, 2, 3}:
        raise InputError(f"{option} {text!r}: give every point the same number of axes, one to three: X, Y, Z")
