"""The fields of the interpolator panel: path, methods with their options, feed, sample period, acceleration."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from rds.core.errors import InputError
from rds.core.geometry import PLANES
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.interpolators import DEFAULT, interpolator_module, interpolator_names
from rds.interpolators.acceleration import LIBRARY as FILTERS
from rds.interpolators.segment_rows import FEED_UNITS, segments_of
from rds.nc.bundled import bundled, bundled_paths
from rds.panels.session.email import check_addresses
from rds.panels.session.fields import Choice, Field, Flag, Number, Text, labels

USER = "user"
LINE, ARC = "line", "arc"
SINGLE, SEVERAL, BUNDLED, PROGRAM = "single", "several", "bundled", "program"
DEFAULT_PROGRAMS = {"linear": "square.ngc", "circular": "quadrants.ngc", "both": "pocket.ngc"}
NONE = "none"
ONLY = {LINE: "circular", ARC: "linear"}  # what a line's or an arc's method cannot be
_STRAIGHT = {"kind": LINE, "end": [30.0, 0.0]}
_HALF_CIRCLE = {"kind": ARC, "end": [30.0, 20.0], "centre": [30.0, 10.0]}
ROWS = {  # to begin with, by what is interpolated
    "linear": [_STRAIGHT, {"kind": LINE, "end": [30.0, 20.0]}],
    "circular": [{"kind": ARC, "end": [30.0, 0.0], "centre": [20.0, 0.0]}, _HALF_CIRCLE],
    "both": [_STRAIGHT, _HALF_CIRCLE],
}


_DECIMAL_COMMA = re.compile(r"\d,\d")


@dataclass(frozen=True)
class Rows(Field):
    """The rows of a path, as `rds.interpolators.segment_rows` has them."""

    start: tuple[float, ...] = (0.0, 0.0)

    def check(self, value: Any) -> list[dict[str, Any]]:
        """The rows; InputError naming the one that will not do. How many axes they have is seen with the start."""
        if not isinstance(value, Sequence) or not all(isinstance(row, dict) for row in value) or isinstance(value, str):
            raise InputError(f"{self.label} must be rows, each a line or an arc")
        axes = {len(row["end"]) for row in value if isinstance(row.get("end"), list | tuple)}
        segments_of([0.0] * (axes.pop() if len(axes) == 1 else len(self.start)), list(value), 1.0, "mm/s")
        return [dict(row) for row in value]


def fields() -> Iterable[Field]:
    """All of them but the methods' own options."""
    kinds = {"linear": "Linear", "circular": "Circular", "both": "Both"}
    yield Choice("kind", "Interpolation", "what is interpolated: straight moves, arcs, or both", "circular", kinds)
    given = {SINGLE: "Single segment", SEVERAL: "Several", BUNDLED: "Default G-code", PROGRAM: "Your G-code"}
    yield Choice("given", "Path", "one segment, a table of them, or a part program: of rds or yours", SINGLE, given)
    yield Choice("segment", "Segment", "a straight move, or an arc", ARC, {LINE: "Line", ARC: "Arc"})
    yield _point("start", "Start X, Y (, Z) [mm]", "where the path begins", "10, 0")
    yield _point("end", "End X, Y (, Z) [mm]", "where it ends; an arc that ends at its start is a full circle", "0, 10")
    yield _point("centre", "Centre X, Y (, Z) [mm]", "of the arc", "0, 0")
    ways = {"ccw": "Counter-clockwise", "cw": "Clockwise"}
    yield Choice("direction", "Direction", "of the arc, seen from the positive end of the third axis", "ccw", ways)
    yield Choice("plane", "Plane", "in which the arc lies", "XY", {name: name for name in PLANES})
    yield Choice("feed_unit", "Unit of the feed rate", "", "mm/min", {unit: unit for unit in FEED_UNITS})
    yield feed("mm/min", 600.0)
    # after the unit of their feeds, which others are in when it changes
    yield Rows("rows", "Segments", "each begins where the one before ends", [dict(row) for row in ROWS["circular"]])
    given_by_rds = {name: name for name, each in (bundled() | bundled_paths()).items() if each.machine == "mini-cnc"}
    tip = "a part program or a path that comes with rds"
    yield Choice("bundled", "Program", tip, DEFAULT_PROGRAMS["circular"], given_by_rds)
    yield Text("program", "Part program", "a file in your folder", "", "e.g. part.ngc")
    yield Number.of(SAMPLE_PERIOD, "period", "Sample period", 0.001)
    yield _method(LINE)
    yield Text("line_file", "File for lines", "a Python file with interpolate()", "", "e.g. my_interpolator.py")
    yield _method(ARC)
    yield Text("arc_file", "File for arcs", "a Python file with interpolate()", "", "e.g. my_interpolator.py")
    yield from filter_fields(NONE, 0.02)
    yield Text("file", "Save as", "a name that ends with .csv, .mat or .parquet", "interpolation.csv")
    tip, example = "addresses, separated by commas", "e.g. me@example.edu"
    yield Text("send_to", "E-mail to", tip, "", example, refuse=check_addresses)


def filter_fields(name: str, seconds: float) -> Iterable[Field]:
    """The acceleration filter on top of an interpolator, by default `name` with `seconds`."""
    filters = {NONE: "None"} | labels(FILTERS.names(), {"s-shape": "S-shape"})
    tip = "how long the velocity rises"
    yield Choice("acceleration", "Acceleration", "a filter on top of the motion", name, filters)
    yield Number("acceleration_time", "Time of it", tip, seconds, unit="s", above=0.0, high=10.0)
    yield Flag("exact_stop", "Exact stop", "come to rest at the end of each segment", False)


def filter_words(chosen: Mapping[str, Any]) -> dict[str, Any] | None:
    """The name and time of the filter that is chosen, as a table of words; None for none."""
    name = chosen["acceleration"]
    if name == NONE:
        return None
    return {"name": name, "time_constant" if name == "exponential" else "time": chosen["acceleration_time"]}


def feed(unit: str, value: float) -> Number:
    """The feed rate in one of the units."""
    return Number("feed", "Feed rate", "along the path", value, unit=unit, above=0.0, high=6e4 / 60 / FEED_UNITS[unit])


def option_fields(role: str, method: str) -> Iterable[Field]:
    """The options of a method of the library, for lines or for arcs; a user's file has its own."""
    if method == USER:
        return
    module = interpolator_module(method)
    for name, option in module.OPTIONS.items():
        yield Number(
            f"{role}.{name}",
            f"{name} ({role}s)",
            option.meaning,
            module.DEFAULTS[name],
            unit=option.unit,
            low=option.low,
            above=option.above,
            whole=option.whole,
        )


def read_point(text: str) -> list[float]:
    """mm per axis from "10, 0" or "10 0"; InputError for anything else."""
    try:
        values = [float(cell) for cell in text.replace(",", " ").split()]
    except ValueError:
        values = []
    if len(text.split()) > 1 and _DECIMAL_COMMA.search(text):
        raise InputError(f"write decimals with a point, as in 10.5, 0: {text!r:.60} may be two positions or three")
    if not 2 <= len(values) <= 3 or not all(map(isfinite, values)) or "_" in text:
        raise InputError(
            f"write two or three positions in mm with a comma between them, such as 10, 0; not {text!r:.60}"
        )
    return values


def _point(name: str, label: str, tip: str, default: str) -> Text:
    def refuse(text: str) -> None:
        read_point(text)

    return Text(name, label, tip, default, default, refuse=refuse, longest=200, needed=True)


def _method(role: str) -> Choice:
    names = [name for name in interpolator_names() if name != ONLY[role]]
    options = {name: name.replace("-", " ") for name in names} | {USER: "user-defined"}
    return Choice(f"{role}_method", f"Method for {role}s", "of the library, or a file of your own", DEFAULT, options)
