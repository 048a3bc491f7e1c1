"""Canonical calls as text: the lines that LinuxCNC's `rs274 -g` prints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from rds.nc.language.canon import ARC, FEED, RATE, SPEED, TRAVERSE, Call, MotionBlock
from rds.nc.language.fast_lane import is_loaded, kernel, stored

if TYPE_CHECKING:
    from rds.nc.language.fast_lane_native import Kernels
    from rds.nc.language.motion_rows import Columns

MANY = 1024  # rows that are worth writing by compiled code
LONG_TEXT = 20_000  # lines that Python writes in the time that compiled code takes to load

# How each call is written; others are written with %.4f for floats and %s for the rest, separated by commas.
_FORMATS = {
    "USE_LENGTH_UNITS": "CANON_UNITS_%s",  # MM, INCHES
    "SELECT_PLANE": "CANON_PLANE_%s",  # XY, XZ, YZ
    "SET_FEED_REFERENCE": "%s",
    "COMMENT": '"%s"',
    "MESSAGE": '"%s"',
    "PRINT": '"%s"',
    "SET_MOTION_CONTROL_MODE": "CANON_%s",  # EXACT_PATH, EXACT_STOP, CONTINUOUS (with its tolerance)
    "USE_TOOL_LENGTH_OFFSET": "%.4f %.4f %.4f, %.4f %.4f %.4f, %.4f %.4f %.4f",
    "SET_SPINDLE_MODE": "%d %.4f",
    "START_SPEED_FEED_SYNC": "%f,%d",
    "SET_MOTION_OUTPUT_VALUE": "%d,%f",
    "SET_AUX_OUTPUT_VALUE": "%d,%f",
    "SET_TOOL_TABLE_ENTRY": "%d, %d, %.4f %.4f %.4f %.4f %.4f %.4f %.4f %.4f %.4f, %.4f, %.4f, %d",
    "LOG": '"%s"',
    "LOGOPEN": '"%s"',
    "LOGAPPEND": '"%s"',
}
# Calls of which only the first arguments are written, and what stands behind them.
_SHORTENED = {
    "NURBS_FEED": (1, ", ..."),
    "STRAIGHT_PROBE": (6, ""),
    "RIGID_TAP": (3, ""),
    "CHANGE_TOOL_NUMBER": (1, ""),
}
_RENAMED = {"WAIT_SPINDLE_ORIENT_COMPLETE": "SPINDLE.0.WAIT_ORIENT_COMPLETE"}
_UNWRITTEN = frozenset(("WAIT", "RETRACT_BY_HAND"))  # calls that `rs274 -g` does not print


def _call_text(call: Call) -> str:
    if call.name == "SET_MOTION_CONTROL_MODE" and len(call.args) == 2:
        return f"{call.name}(CANON_{call.args[0]}, {call.args[1]:f})"
    pattern = _FORMATS.get(call.name)
    args, rest = call.args, ""
    if call.name in _SHORTENED:
        count, rest = _SHORTENED[call.name]
        args = args[:count]
    if pattern is None:
        pattern = ", ".join("%.4f" if isinstance(value, float) else "%s" for value in args)
    return f"{_RENAMED.get(call.name, call.name)}({pattern % args}{rest})"


_STRAIGHT = "(%.4f, %.4f, %.4f, %.4f, %.4f, %.4f)"
_ROW_FORMATS = {
    TRAVERSE: ("STRAIGHT_TRAVERSE" + _STRAIGHT, 6),
    FEED: ("STRAIGHT_FEED" + _STRAIGHT, 6),
    ARC: ("ARC_FEED(%.4f, %.4f, %.4f, %.4f, %d, %.4f, %.4f, %.4f, %.4f)", 9),
    RATE: ("SET_FEED_RATE(%.4f)", 1),
    SPEED: ("SET_SPINDLE_SPEED(0, %.4f)", 1),
}
_LINE_FORMATS = {kind: (f"%5d N..... {pattern}", count) for kind, (pattern, count) in _ROW_FORMATS.items()}


def _row_texts(columns: Columns) -> Iterator[tuple[str, str]]:
    rows = zip(columns.kinds, columns.digits, columns.ns, columns.value_rows(), strict=True)
    for kind, digits, n, values in rows:
        pattern, count = _ROW_FORMATS[kind]
        yield (str(n).zfill(digits) if digits else ""), pattern % tuple(values[:count])


def texts(items: Iterable[MotionBlock | Call]) -> Iterator[tuple[str, str]]:
    """Of each call, the digits of its line's word N ("" without) and its text: `SELECT_PLANE(CANON_PLANE_XY)`."""
    for item in items:
        if isinstance(item, Call):
            if item.name not in _UNWRITTEN:
                yield item.n, _call_text(item)
        else:
            yield from _row_texts(item.columns)


def text(items: Iterable[MotionBlock | Call]) -> Iterator[str]:
    """The lines that LinuxCNC's `rs274 -g` prints: running number, the program's line number (or N.....), the call.

    Of (PRINT, ...) it prints the text alone.
    """
    number = 1
    for item in items:
        if isinstance(item, Call):
            if item.name == "PRINT":
                yield from item.args
            elif item.name not in _UNWRITTEN:
                yield _line(number, item.n, _call_text(item))
                number += 1
        elif (compiled := _compiled(number, len(item))) is not None:
            first, columns = 0, item.columns
            for count, written in compiled.written(columns, number):
                yield from written.splitlines() or _lines_of(columns.part(first, first + 1), number)
                first += count
                number += count
        else:
            yield from _lines_of(item.columns, number)
            number += len(item)


def _compiled(number: int, rows: int) -> Kernels | None:
    """What writes many rows at once, when loading it is worth the time: it is loaded already, or the text is long."""
    if rows < MANY:
        return None
    return kernel() if is_loaded() else stored() if number + rows > LONG_TEXT else None


def _lines_of(columns: Columns, number: int) -> Iterator[str]:
    """The lines of rows, numbered from `number`; of those without a word N, which most are, by one format each."""
    if any(columns.digits):
        for at, (n, row) in enumerate(_row_texts(columns), start=number):
            yield _line(at, n, row)
        return
    for kind, values in zip(columns.kinds, columns.value_rows(), strict=True):
        pattern, count = _LINE_FORMATS[kind]
        yield pattern % (number, *values[:count])
        number += 1


def _line(number: int, n: str, call: str) -> str:
    return f"{number:5d} {f'N{n:<6s}' if n else 'N..... '}{call}"
