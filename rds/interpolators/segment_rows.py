"""A path written down row by row: each a line or an arc from where the one before ended.

A row is a mapping: `kind` ("line" or "arc"), `end` (mm per axis), of an arc `centre` (mm per axis), `clockwise` (false)
and `plane` ("XY"); `feed` where it is not that of the path. It is the form of a table on a page and of a TOML file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.geometry import PLANES
from rds.core.options import check_known
from rds.core.quantities import Choice, Declaration, Flag, Items, Parts, Quantity, Table, Tables
from rds.core.toml_table import TomlTable
from rds.core.types import ArcSegment, LineSegment, Segment

FEED_UNITS = {"mm/min": 1 / 60, "mm/s": 1.0, "m/min": 1000 / 60, "in/min": 25.4 / 60, "in/s": 25.4}  # mm/s
_MOST_AXES = 6
_BEYOND = 1e300  # of a position; also what no float can be
_POINT = Items(
    "one position for each axis, mm, of rotary axes degrees",
    Quantity("position", "mm"),
    "one to six positions: mm of X, Y, Z, degrees of A, B, C",
    least=1,
)
_FEED = Quantity("feed along the path, in the unit of the path", above=0.0)
_LINE: Mapping[str, Declaration] = {"end": _POINT, "feed": _FEED}
_ARC: Mapping[str, Declaration] = {
    "end": _POINT,
    "centre": _POINT,
    "clockwise": Flag("which way round the arc goes", False),
    "plane": Choice("plane of the arc", tuple(PLANES), "XY"),
    "feed": _FEED,
}
_ROWS = {
    "line": Table("a line", _LINE, needed=("end",)),
    "arc": Table("an arc", _ARC, needed=("end", "centre")),
}
SEGMENTS = Table(
    "A path: lines and arcs, each from where the one before ended.",
    {
        "start": _POINT,
        "feed": _FEED,
        "feed_unit": Choice("unit of all feeds", tuple(FEED_UNITS), "mm/min"),
        "segment": Tables(
            "its segments",
            Table(
                "a line or an arc",
                chosen_by="kind",
                parts=Parts(lambda: list(_ROWS), lambda kind: _ROWS[kind]),
            ),
            least=1,
        ),
    },
    needed=("start", "feed", "segment"),
)


def segments_of(start: Sequence[float], rows: Sequence[Mapping[str, Any]], feed: float, unit: str) -> list[Segment]:
    """The path from `start` (mm per axis) over `rows`, at `feed` in `unit` where a row has no feed of its own.

    InputError naming the row and what it must be. Whether an arc closes is checked when it is interpolated.
    """
    if unit not in FEED_UNITS:
        raise InputError(f"feed unit {unit!r} must be one of {', '.join(FEED_UNITS)}")
    if not rows:
        raise InputError("there is no segment to interpolate; give a line or an arc")
    here = point(start, "start", None)
    made: list[Segment] = []
    for number, row in enumerate(rows, start=1):
        made.append(_segment(here, row, f"segment {number}", feed, unit))
        here = made[-1].end
    return made


def point(value: Any, what: str, axes: int | None) -> tuple[float, ...]:
    """A position, mm per axis, from a list of numbers; InputError for anything else, or another number of axes."""
    said = f"{what} = {value!r:.60}"
    numbers = isinstance(value, list | tuple) and all(
        isinstance(each, int | float) and not isinstance(each, bool) and abs(each) < _BEYOND for each in value
    )
    if not numbers or not 1 <= len(value) <= _MOST_AXES:
        raise InputError(f"{said} must be one to six positions: mm of X, Y, Z, degrees of A, B, C")
    if axes is not None and len(value) != axes:
        raise InputError(f"{said} must have {axes} position{'s' if axes > 1 else ''}, as the start has")
    return tuple(float(each) for each in value)


def read_segments(path: str | Path) -> list[Segment]:
    """The path that a TOML file gives: `start`, `feed`, `feed_unit` (mm/min) and `[[segment]]` rows. InputError."""
    words = TomlTable.open(path, SEGMENTS)
    check_known(words.table, ("start", "feed", "feed_unit", "segment"), str(path))
    for key in ("start", "feed"):
        if key not in words:
            raise InputError(
                f"{key} is missing; as in `{key} = {'[0.0, 0.0]' if key == 'start' else '600'}`", words.place()
            )
    start, feed = words.any("start"), words.any("feed")
    unit = words.read("feed_unit")
    rows = [dict(table.table) for table in words.tables("segment")]
    try:
        return segments_of(start, rows, _feed(feed, "feed"), unit)
    except InputError as error:
        raise InputError(str(error), words.place()) from error


def _segment(here: tuple[float, ...], row: Mapping[str, Any], name: str, feed: float, unit: str) -> Segment:
    kind = row.get("kind")
    if kind not in _ROWS:
        raise InputError(f"{name}: kind = {kind!r} must be line or arc")
    check_known(row, ("kind", *_ROWS[kind].keys), f"{name} ({kind})")
    end = point(row.get("end"), f"{name}: end", len(here))
    rate = FEED_UNITS[unit] * _feed(feed if row.get("feed") is None else row["feed"], f"{name}: feed")
    if kind == "line":
        return LineSegment(here, end, rate)
    centre = point(row.get("centre"), f"{name}: centre", len(here))
    clockwise, plane = row.get("clockwise", False), row.get("plane", "XY")
    if not isinstance(clockwise, bool):
        raise InputError(f"{name}: clockwise = {clockwise!r} must be true or false")
    if plane not in PLANES or max(PLANES[plane]) >= len(here):
        fitting = ", ".join(each for each, axes in PLANES.items() if max(axes) < len(here)) or "none, of one axis"
        raise InputError(f"{name}: plane = {plane!r} must be one of {fitting}")
    return ArcSegment(here, end, centre, rate, clockwise, PLANES[plane])


def _feed(value: Any, what: str) -> float:
    return float(_FEED.check(value, what))
