"""Canonical calls as text: the lines that LinuxCNC's `rs274 -g` prints."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache

import numpy as np

from rds.nc.language.canon import ARC, FEED, RATE, SPEED, TRAVERSE, Call, MotionBlock

MANY = 1024  # rows that are worth writing by compiled code
LONG_TEXT = 200_000  # lines that Python writes in the time that numba takes to load

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
_UNWRITTEN = frozenset(("WAIT",))  # calls that `rs274 -g` does not print


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
    return f"{call.name}({pattern % args}{rest})"


_STRAIGHT = "(%.4f, %.4f, %.4f, %.4f, %.4f, %.4f)"
_ROW_FORMATS = {
    TRAVERSE: ("STRAIGHT_TRAVERSE" + _STRAIGHT, 6),
    FEED: ("STRAIGHT_FEED" + _STRAIGHT, 6),
    ARC: ("ARC_FEED(%.4f, %.4f, %.4f, %.4f, %d, %.4f, %.4f, %.4f, %.4f)", 9),
    RATE: ("SET_FEED_RATE(%.4f)", 1),
    SPEED: ("SET_SPINDLE_SPEED(0, %.4f)", 1),
}


def _row_texts(rows: np.ndarray) -> Iterator[tuple[str, str]]:
    columns = (rows[name].tolist() for name in ("kind", "digits", "n", "values"))
    for kind, digits, n, values in zip(*columns, strict=True):
        pattern, count = _ROW_FORMATS[kind]
        yield (str(n).zfill(digits) if digits else ""), pattern % tuple(values[:count])


def texts(items: Iterable[MotionBlock | Call]) -> Iterator[tuple[str, str]]:
    """Of each call, the digits of its line's word N ("" without) and its text: `SELECT_PLANE(CANON_PLANE_XY)`."""
    for item in items:
        if isinstance(item, Call):
            if item.name not in _UNWRITTEN:
                yield item.n, _call_text(item)
        else:
            yield from _row_texts(item.rows)


def text(items: Iterable[MotionBlock | Call]) -> Iterator[str]:
    """The lines that LinuxCNC's `rs274 -g` prints: running number, the program's line number (or N.....), the call.

    Of (PRINT, ...) it prints the text alone.
    """
    number = 1
    for item in items:
        if isinstance(item, MotionBlock) and len(item) >= MANY and (write := _writer(number)) is not None:
            first = 0
            for count, lines in write(item.rows, number):
                yield from lines or _numbered(_row_texts(item.rows[first : first + count]), number)
                first += count
                number += count
        elif isinstance(item, Call) and item.name == "PRINT":
            yield from item.args
        else:
            lines = list(_numbered(texts((item,)), number))
            yield from lines
            number += len(lines)


def _numbered(calls: Iterable[tuple[str, str]], first: int) -> Iterator[str]:
    for number, (n, call) in enumerate(calls, start=first):
        yield f"{number:5d} {f'N{n:<6s}' if n else 'N..... '}{call}"


def _writer(number: int) -> Callable[[np.ndarray, int], Iterator[tuple[int, list[str]]]] | None:
    """What writes many rows at once, when loading it is worth the time: it is loaded already, or the text is long."""
    if number > LONG_TEXT or "rds.nc.language.fast_lane_kernel" in sys.modules:
        return _compiled()
    return None


@cache
def _compiled() -> Callable[[np.ndarray, int], Iterator[tuple[int, list[str]]]] | None:
    """None without numba."""
    try:
        from rds.nc.language.fast_lane_text import written
    except ImportError:
        return None
    return written
