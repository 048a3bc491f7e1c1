"""Times and speeds of moves, from a table of durations or from a bus log.

The time of a move is that from its command to the acknowledgement that it was carried out; the average speed is the
commanded distance over it. Source: table 18, figure 90 and table O35 of the thesis on the open architecture control
system (docs/thesis-reports.md).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.results.reports.bus_log import is_log, read_frames
from rds.results.reports.content import Report, Table
from rds.results.reports.dialects import OACS_MOVES
from rds.results.reports.pairing import exchanges, parse_pairs
from rds.results.reports.reading import columns_in, read_columns
from rds.results.reports.settings import Setting, pairs_of
from rds.results.reports.statistics import Summary, summary

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "distances": Setting(
        "commanded moves by axis, in mm or deg, as in 'X=80 mm, A=360 deg'; else those in the headings, as in "
        "x_80mm_cw_s",
        text=True,
    ),
    "minimum_speed": Setting("speeds asked for by axis, in mm/min or deg/min, as in 'X=100, A=360'", text=True),
    "pairs": Setting("in a bus log: a pair per direction; the modules are the axes", default=OACS_MOVES, text=True),
    "timeout": Setting("in a bus log: an acknowledgement later than this is none", "s", 600.0, more_than=0),
}

_HEADING = re.compile(r"(?P<axis>.+?)_(?P<distance>\d+(\.\d+)?)(?P<unit>mm|deg)_(?P<direction>[^_]+)")
_MOVE = re.compile(r"(?P<distance>\d+(\.\d*)?|\.\d+)\s*(?P<unit>mm|deg)")
_SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0}


@dataclass
class Timed:
    """Durations of one axis's moves in one direction."""

    axis: str
    direction: str
    times: list[float]  # s
    distance: float | None = None
    unit: str = ""  # mm or deg

    def speed(self) -> float | None:
        """The average speed, unit per minute."""
        return None if self.distance is None else 60.0 * self.distance / summary(self.times).mean


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Times and speeds, all files together. InputError for data or options that will not do."""
    sets: list[Timed] = []
    for path in files:
        sets += _from_log(path, settings) if is_log(path) else _from_table(path)
    axes = {timed.axis.lower() for timed in sets}
    for axis, (distance, unit) in _distances(settings["distances"], axes).items():
        for timed in sets:
            if timed.axis.lower() == axis:
                timed.distance, timed.unit = distance, unit
    asked = _speeds(settings["minimum_speed"], axes)
    return Report(
        "moves",
        "Move times and speeds",
        [path.name for path in files],
        settings,
        [_table(sets), *_ratios(sets)],
        {"Move times": lambda: picture(sets)},
        _findings(sets, asked),
    )


def _from_table(path: Path) -> list[Timed]:
    found = []
    for column in columns_in(path, read_columns(path), tuple(_SECONDS), "times of moves", "x_80mm_cw_s"):
        match = _HEADING.fullmatch(column.name)
        axis, _, direction = column.name.rpartition("_")
        timed = Timed(axis or column.name, direction if axis else "", [])
        if match:
            timed = Timed(match["axis"], match["direction"], [], float(match["distance"]), match["unit"])
        timed.axis = timed.axis.upper() if len(timed.axis) == 1 else timed.axis
        timed.times = [_SECONDS[column.unit] * value for value in column.numbers(blanks=True)]
        if min(timed.times) <= 0:
            line = next(line for line, cell in column.cells.items() if cell and float(cell.replace(",", ".")) <= 0)
            raise column.fault(line, f"{column.cells[line]!r} is no duration; a move takes more than 0 {column.unit}")
        found.append(timed)
    return found


def _from_log(path: Path, settings: Mapping[str, Any]) -> list[Timed]:
    found = exchanges(read_frames(path), parse_pairs(settings["pairs"]), settings["timeout"])
    if not found.times:
        raise InputError(
            f"it has {sum(found.requests.values())} commands to move ({settings['pairs']}) and no acknowledgement "
            f"within {settings['timeout']:g} s; give the pairs of the modules",
            str(path),
        )
    return [Timed(str(module), direction, times) for (direction, module), times in found.times.items()]


def _distances(text: str | None, axes: set[str]) -> dict[str, tuple[float, str]]:
    moves = {}
    for axis, move in pairs_of(text or "", "distances", "X=80 mm, A=360 deg").items():
        match = _MOVE.fullmatch(move)
        if match is None or not float(match["distance"]) > 0:
            raise InputError(f"distances: {axis} = {move!r} is not a move; write it as in '80 mm' or '360 deg'")
        moves[_known(axis, axes, "distances")] = float(match["distance"]), match["unit"]
    return moves


def _speeds(text: str | None, axes: set[str]) -> dict[str, float]:
    speeds = {}
    for axis, speed in pairs_of(text or "", "minimum_speed", "X=100, A=360").items():
        try:
            speeds[_known(axis, axes, "minimum_speed")] = float(speed)
        except ValueError:
            raise InputError(f"minimum_speed: {axis} = {speed!r} is not a number; give it per minute") from None
    return speeds


def _known(axis: str, axes: set[str], owner: str) -> str:
    if axis.lower() not in axes:
        raise InputError(f"{owner}: there is no axis {axis!r} in the data; it has {', '.join(sorted(axes))}")
    return axis.lower()


def _table(sets: Sequence[Timed]) -> Table:
    columns = ["axis", "direction", "moves", "mean [s]", "std [s]", "min [s]", "max [s]", "largest deviation [%]"]
    columns += ["move", "average speed", "speed in"]
    rows = []
    for timed in sets:
        s: Summary = summary(timed.times)
        move = None if timed.distance is None else f"{timed.distance:g} {timed.unit}"
        rows.append(
            [
                *(timed.axis, timed.direction, s.n, s.mean, s.std, s.low, s.high, 100 * s.worst / s.mean),
                *(move, timed.speed(), f"{timed.unit}/min" if timed.unit else None),
            ]
        )
    digits = {name: 3 for name in columns if "[s]" in name} | {"largest deviation [%]": 2, "average speed": 1}
    note = "The average speed is the commanded move over the mean time, starting and stopping included."
    return Table("Times and speeds", columns, rows, note, digits)


def _both(sets: Sequence[Timed]) -> list[tuple[str, float, float]]:
    """Axes that moved clockwise and counter-clockwise, with the mean time of each, s."""
    mean = {(timed.axis, timed.direction.lower()): summary(timed.times).mean for timed in sets}
    return [(axis, cw, mean[axis, "ccw"]) for (axis, way), cw in mean.items() if way == "cw" and (axis, "ccw") in mean]


def _ratios(sets: Sequence[Timed]) -> list[Table]:
    rows: list[list[Any]] = [[axis, 100 * ccw / cw] for axis, cw, ccw in _both(sets)]
    if len(rows) > 1:
        rows.append(["average", sum(row[1] for row in rows) / len(rows)])
    column = "ccw time / cw time [%]"
    return [Table("Directions compared", ["axis", column], rows, digits={column: 2})] if rows else []


def _findings(sets: Sequence[Timed], asked: Mapping[str, float]) -> list[str]:
    said = []
    for timed in sets:
        speed, least = timed.speed(), asked.get(timed.axis.lower())
        if speed is None:
            said.append(f"{timed.axis} {timed.direction}: no speed, for the commanded move is not known (distances).")
        else:
            unit = f"{timed.unit}/min"
            verdict = "" if least is None else f", {'meets' if speed >= least else 'misses'} the {least:g} asked for"
            said.append(f"{timed.axis} {timed.direction}: {speed:.1f} {unit}{verdict}.")
    return said


def picture(sets: Sequence[Timed]) -> Picture:
    """Mean time of each axis and direction as a bar, each move as a point."""
    from rds.core.figure import BLACK, CYCLE, Picture, dress, legend

    names = list(dict.fromkeys(timed.axis for timed in sets))
    ways = list(dict.fromkeys(timed.direction for timed in sets))
    width = 0.8 / len(ways)
    drawn = Picture(3.6)
    axes = drawn.subplots()
    for at, way in enumerate(ways):
        mine = [timed for timed in sets if timed.direction == way]
        places = [names.index(timed.axis) + (at - (len(ways) - 1) / 2) * width for timed in mine]
        means = [summary(timed.times).mean for timed in mine]
        hatch = ("", "//", "..", "xx")[at % 4]
        colour = CYCLE[at % len(CYCLE)]
        axes.bar(
            places, means, 0.92 * width, color=colour, alpha=0.6, hatch=hatch, edgecolor="white", label=way or None
        )
        for place, timed in zip(places, mine, strict=True):
            axes.plot([place] * len(timed.times), timed.times, "_", color=BLACK, markersize=14)
    dress(axes, "time of the move [s]", None)
    axes.grid(False, axis="x")
    axes.set_xticks(range(len(names)), names)
    axes.margins(x=0.04)
    legend(axes)
    return drawn
