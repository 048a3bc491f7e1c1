"""A file of points: x, y and perhaps z, with their unit; and the path through them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.types import Segment
from rds.nc.paths.arc_fit import fit
from rds.nc.paths.lines import polyline
from rds.nc.paths.measure import without_repeats
from rds.nc.paths.numbers import COORDINATE, FARTHEST, FEED_RATE, number

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3, "\u03bcm": 1e-3, "in": 25.4, "inch": 25.4}
TOLERANCE = Quantity("how far arcs may be from the lines between the points", "mm", above=0.0)
MOST_POINTS = 2_000_000
_LONGEST_LINE = 1000  # characters
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_DECIMAL_COMMAS = re.compile(r"[+-]?\d+,\d+(,?[ \t]+[+-]?\d+,\d+)+", re.ASCII)
_HEADING = re.compile(r"\s*([A-Za-z]\w*?)(?:_(\w+)|\s*[\[(]\s*([^\])]*?)\s*[\])])?\s*(?:[,;\s]|$)")
_UNITS_COMMENT = re.compile(r"#\s*units?\s*[:=]?\s*(\S+)\s*", re.IGNORECASE)


@dataclass(frozen=True)
class PointFile:
    """The points of a file: `pieces` of shape (n, 3) in mm (z is 0 where the file has none)."""

    pieces: list[np.ndarray]
    has_z: bool
    unit: str
    first_lines: list[int]  # where each piece begins in the file, from 1
    repeated: int = 0  # points that were the same as the one before, and are left out
    source: str = field(default="", compare=False)


def read_points(file: str | PathLike[str], unit: str | None = None) -> PointFile:
    """The points of a text file with one point a line: x, y or x, y, z, between commas, semicolons or blanks.

    The unit stands in the header (`x [mm], y [mm]`, `x_mm y_mm`), in a comment (`# units: mm`), or is given as `unit`:
    mm, cm, m, um or in. Columns may come in any order if a header names them. Text after # is a comment. An empty line
    ends a piece of the path: the tool lifts there.

    InputError names the file and the line for what is no number, too few or too many of them, an unknown column or
    unit, a piece of a single point, and a file without a unit.
    """
    path = Path(file)
    reader = _Reader(str(path), unit)
    try:
        with open(path, encoding="utf-8-sig", newline=None) as stream:
            line = 0
            while text := stream.readline(_LONGEST_LINE):
                line += 1
                if len(text) == _LONGEST_LINE:
                    raise reader.fault(line, f"more than {_LONGEST_LINE} characters; give one point a line")
                reader.take(line, text)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}; name a file of points", str(path)) from error
    except UnicodeDecodeError as error:
        raise InputError("is not text in UTF-8; save the points as CSV", str(path)) from error
    return reader.finish()


class _Reader:
    """Takes a file line by line."""

    def __init__(self, source: str, unit: str | None):
        self.source = source
        self.unit = unit
        if unit is not None:
            self._scale(unit, 0)
        self.columns: list[str] = []
        self.rows: list[list[tuple[int, list[float]]]] = [[]]
        self.count = 0

    def fault(self, line: int, message: str) -> InputError:
        return InputError(message, f"{self.source}:{line}" if line else self.source)

    def take(self, line: int, text: str) -> None:
        if comment := _UNITS_COMMENT.fullmatch(text.strip()):
            self._set_unit(line, comment[1])
            return
        body, mark, _ = text.partition("#")
        body = body.strip()
        if not body:
            if not mark and self.rows[-1]:  # a line of comment alone ends nothing
                self.rows.append([])
            return
        if not self.columns and not self.count and re.match(r"[A-Za-z\"']", body):
            self._header(line, body)
            return
        self._point(line, body)

    def finish(self) -> PointFile:
        pieces = [piece for piece in self.rows if piece]
        if not pieces:
            raise self.fault(0, "has no points; give one a line: x, y or x, y, z")
        if self.unit is None:
            raise self.fault(
                pieces[0][0][0], "no unit is given; begin with a header such as 'x [mm], y [mm]', or name it (mm, in)"
            )
        scale, order = self._scale(self.unit, 0), [self.columns.index(c) for c in "xyz" if c in self.columns]
        arrays, repeated = [], 0
        for piece in pieces:
            values = np.array([row for _, row in piece])[:, order] * scale
            self._check_size(piece, values)
            points = np.zeros((len(values), 3))
            points[:, : values.shape[1]] = values
            kept = without_repeats(points)
            repeated += len(points) - len(kept)
            if len(kept) < 2:
                raise self.fault(piece[0][0], "a single point makes no path; an empty line ends a piece of it")
            arrays.append(kept)
        lines = [piece[0][0] for piece in pieces]
        return PointFile(arrays, "z" in self.columns, self.unit, lines, repeated, self.source)

    def _check_size(self, piece: Sequence[tuple[int, list[float]]], values: np.ndarray) -> None:
        far = np.flatnonzero(np.any(np.abs(values) > FARTHEST, axis=1))
        if far.size:
            raise self.fault(piece[far[0]][0], f"a coordinate beyond {FARTHEST:g} mm; is the unit {self.unit!r} right?")

    def _header(self, line: int, body: str) -> None:
        found = list(_headings(body.replace('"', "").replace("'", "")))
        if None in found or not any(match[0] in ("x", "y") for match in found if match):
            raise self.fault(line, f"{body!r} is no point and no header; write x, y and perhaps z, with their unit")
        for name, unit in filter(None, found):
            if name not in ("x", "y", "z"):
                raise self.fault(line, f"column {name!r} is none of x, y, z; leave it out of the file")
            if name in self.columns:
                raise self.fault(line, f"column {name!r} is there twice; leave one out")
            self.columns.append(name)
            if unit is not None:
                self._set_unit(line, unit)
        if not {"x", "y"} <= set(self.columns):
            raise self.fault(line, f"the header {body!r} does not name both x and y; write x, y and perhaps z")

    def _point(self, line: int, body: str) -> None:
        separator = ";" if ";" in body else "," if "," in body else None
        if _DECIMAL_COMMAS.fullmatch(body):
            raise self.fault(line, f"{body!r} has decimal commas; write decimals with a point")
        fields = [word.strip() for word in body.split(separator)]
        if not self.columns:
            if len(fields) not in (2, 3):
                raise self.fault(line, f"{_numbers(fields)} in {body!r}; a point has 2 (x, y) or 3 (x, y, z)")
            self.columns = list("xyz"[: len(fields)])
        if len(fields) != len(self.columns):
            names = ", ".join(self.columns)
            raise self.fault(line, f"{_numbers(fields)} in {body!r} instead of {len(self.columns)} ({names})")
        row = []
        for name, word in zip(self.columns, fields, strict=True):
            if not _NUMBER.fullmatch(word):
                remedy = "write decimals with a point" if re.fullmatch(r"[+-]?\d+,\d+", word) else "write it in digits"
                raise self.fault(line, f"{name} = {word!r} is not a number; {remedy}")
            row.append(float(word))
        self.count += 1
        if self.count > MOST_POINTS:
            raise self.fault(line, f"more than {MOST_POINTS} points; split the file")
        self.rows[-1].append((line, row))

    def _set_unit(self, line: int, unit: str) -> None:
        self._scale(unit, line)
        if self.unit is not None and UNITS[self.unit] != UNITS[unit]:
            raise self.fault(line, f"unit {unit!r}, where {self.unit!r} is given already; use one unit for all")
        self.unit = self.unit or unit

    def _scale(self, unit: str, line: int) -> float:
        if unit not in UNITS:
            raise self.fault(line, f"unit {unit!r} is not known; known units: {', '.join(UNITS)}")
        return UNITS[unit]


def _numbers(fields: Sequence[str]) -> str:
    return f"{len(fields)} number{'s' if len(fields) != 1 else ''}"


def _headings(text: str) -> Iterator[tuple[str, str | None] | None]:
    """Name and unit of each heading; None for what is no heading."""
    at = 0
    while at < len(text.rstrip()):
        match = _HEADING.match(text, at)
        if match is None:
            yield None
            return
        yield match[1].lower(), match[2] or match[3]
        at = match.end()


def _pieces(points: Any) -> list[np.ndarray]:
    try:
        alone = np.asarray(points, dtype=float)
    except (TypeError, ValueError):  # pieces of different lengths, or what is no number
        alone = np.empty(0)
    try:
        pieces = [alone] if alone.ndim == 2 else [np.asarray(piece, dtype=float) for piece in points]
    except (TypeError, ValueError) as error:
        raise InputError(f"points must be numbers in mm: {error}; read_points reads a file") from error
    for piece in pieces:
        if piece.ndim != 2 or piece.shape[1] not in (2, 3):
            raise InputError(f"points of shape {piece.shape}; give x, y or x, y, z of each in a row, mm")
    return pieces


def path_of_points(
    points: PointFile | Sequence[np.ndarray],
    feed_rate: float,
    *,
    depth: float | None = None,
    closed: bool = False,
    tolerance: float | None = None,
) -> tuple[list[Segment], float]:
    """The path through points, and how far it is at most from the lines between them, mm (0 for lines).

    `points`: a `PointFile`, or an array of shape (n, 2) or (n, 3) in mm, or several of them, the pieces. `depth` (mm)
    puts points without z at z = -depth; `closed` leads each piece back to its first point; with `tolerance` (mm) lines
    and arcs that stand for several points are fitted (see `arc_fit.fit`). `feed_rate` in mm/s. InputError where depth
    is given beside z.
    """
    arrays = points.pieces if isinstance(points, PointFile) else _pieces(points)
    has_z = points.has_z if isinstance(points, PointFile) else any(array.shape[1] == 3 for array in arrays)
    if has_z and depth is not None:
        raise InputError("points: their z and a depth are both given; leave the depth out, or the column z")
    feed = number(feed_rate, "feed rate", "points", FEED_RATE)
    z = 0.0 if depth is None else 0.0 - number(depth, "depth", "points", COORDINATE)
    allowed = None if tolerance is None else number(tolerance, "tolerance", "points", TOLERANCE)
    segments: list[Segment] = []
    worst = 0.0
    for array in arrays:
        rows = array if has_z else np.column_stack([array[:, :2], np.full(len(array), z)])
        if closed and np.any(rows[0] != rows[-1]):
            rows = np.vstack([rows, rows[:1]])
        if allowed is None:
            segments += polyline([tuple(row) for row in rows.tolist()], feed, owner="points")
        else:
            more, deviation = fit(rows, allowed, feed)
            segments += more
            worst = max(worst, deviation)
    return segments, worst
