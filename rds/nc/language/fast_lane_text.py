"""Rows of moves as the lines that `rs274 -g` prints, many at a time. Importing this needs numba.

A number is written as printf's %.4f does: rounded from its exact binary value, a tie to the even digit. Rows with a
number that is too large for that are left to Python.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from rds.nc.language.batch import CALL, CALLS, COLLINEAR, COMMENT, DWELL, PATH_MODE, PATH_MODES
from rds.nc.language.call_text import call_text
from rds.nc.language.canon import ARC, FEED, RATE, SPEED, TRAVERSE, Call

_LIMIT = 1e11  # ten thousand times this is below 2^53, where every whole number is a float
_LIMIT_OF_SIX = 1e9  # the same for six decimals
LONGEST = 640  # bytes of a line: what stands before, and 9 numbers of at most 18 with their commas, or a comment
_SPLIT = 134217729.0  # 2^27 + 1: cuts a float into two halves of 26 digits (Dekker 1971)
# Of each kind of row, the text before its numbers, and how many there are.
_ROWS: dict[int, tuple[str, int]] = {
    TRAVERSE: ("STRAIGHT_TRAVERSE(", 6),
    FEED: ("STRAIGHT_FEED(", 6),
    ARC: ("ARC_FEED(", 9),
    RATE: ("SET_FEED_RATE(", 1),
    SPEED: ("SET_SPINDLE_SPEED(0, ", 1),
    COMMENT: ('COMMENT("', 0),
    CALL: ("", 0),
    DWELL: ("DWELL(", 1),
    PATH_MODE: ("", 0),
    COLLINEAR: ("SET_NAIVECAM_TOLERANCE(", 1),
}


def _table(texts: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Texts of compiled code: their bytes, a row each, and their lengths."""
    lengths = np.array([len(text) for text in texts])
    return np.array([list(text.encode().ljust(lengths.max())) for text in texts], np.uint8), lengths


_COUNTS = np.array([_ROWS[kind][1] for kind in sorted(_ROWS)])
_LETTERS, _LENGTHS = _table([_ROWS[kind][0] for kind in sorted(_ROWS)])
_CALLS, _CALL_LENGTHS = _table([call_text(Call(name, args))[:-1] for name, args in CALLS])
_PATHS, _PATH_LENGTHS = _table([f"SET_MOTION_CONTROL_MODE(CANON_{mode}" for mode in PATH_MODES])
_CONTINUOUS = PATH_MODES.index("CONTINUOUS")


@njit(error_model="numpy")
def _parts(value, scale):
    """The whole number nearest to scale · value, for 0 <= value below the limit; a tie goes to the even one."""
    product = value * scale
    # The rounding error of the product (Dekker): product + error = scale · value exactly. The scale has one half only.
    cut = _SPLIT * value
    high = cut - (cut - value)
    low = value - high
    error = (high * scale - product) + low * scale
    below = math.floor(product)
    beyond = (product - below) - 0.5
    found = int(below)
    if beyond > 0.0 or (beyond == 0.0 and (error > 0.0 or (error == 0.0 and found & 1))):
        found += 1
    return found


@njit(error_model="numpy")
def _put_whole(out, at, value, width, fill):
    """Write a whole number, with `fill` before it up to `width`. Returns where it ends."""
    size, rest = 1, value // 10
    while rest:
        size += 1
        rest //= 10
    while size < width:
        out[at] = fill
        at += 1
        width -= 1
    end = at + size
    for place in range(end - 1, at - 1, -1):
        out[place] = 48 + value % 10
        value //= 10
    return end


@njit(error_model="numpy")
def _put_number(out, at, value, places, scale):
    """Write a number with so many decimals; `scale` is 10 to their power. Returns where it ends."""
    if math.copysign(1.0, value) < 0.0:
        out[at] = 45
        at += 1
    found = _parts(abs(value), float(scale))
    at = _put_whole(out, at, found // scale, 1, 48)
    out[at] = 46
    return _put_whole(out, at + 1, found % scale, places, 48)


@njit(error_model="numpy")
def _put_text(out, at, text, first, size):
    for place in range(first, first + size):
        out[at] = text[place]
        at += 1
    return at


@njit(error_model="numpy")
def write_rows(number, kinds, digits, ns, values, text, out):
    """Write rows as lines, the first one with the running `number`, until `out` is full or a row is left to Python.
    `text` is what comments quote.

    Returns rows and bytes written.
    """
    at, room = 0, len(out) - LONGEST
    for row in range(len(kinds)):
        kind = kinds[row]
        if at > room:
            return row, at
        for place in range(_COUNTS[kind]):
            if not abs(values[row, place]) < _LIMIT:
                return row, at
        if kind == PATH_MODE and not abs(values[row, 1]) < _LIMIT_OF_SIX:
            return row, at
        at = _put_whole(out, at, number + row, 5, 32)
        out[at], out[at + 1] = 32, 78
        at += 2
        if digits[row]:
            end = _put_whole(out, at, ns[row], digits[row], 48)
            while end < at + 6:
                out[end] = 32
                end += 1
            at = end
        else:
            for _ in range(5):
                out[at] = 46
                at += 1
            out[at] = 32
            at += 1
        at = _put_text(out, at, _LETTERS[kind], 0, _LENGTHS[kind])
        for place in range(_COUNTS[kind]):
            if place:
                out[at], out[at + 1] = 44, 32
                at += 2
            value = values[row, place]
            if kind == ARC and place == 4:
                if value < 0.0:
                    out[at] = 45
                    at += 1
                at = _put_whole(out, at, int(abs(value)), 1, 48)
                continue
            at = _put_number(out, at, value, 4, 10000)
        which = int(values[row, 0])
        if kind == COMMENT:
            at = _put_text(out, at, text, which, int(values[row, 1]))
            out[at] = 34
            at += 1
        elif kind == CALL:
            at = _put_text(out, at, _CALLS[which], 0, _CALL_LENGTHS[which])
        elif kind == PATH_MODE:
            at = _put_text(out, at, _PATHS[which], 0, _PATH_LENGTHS[which])
            if which == _CONTINUOUS:
                out[at], out[at + 1] = 44, 32
                at = _put_number(out, at + 2, values[row, 1], 6, 1000000)
        out[at], out[at + 1] = 41, 10
        at += 2
    return len(kinds), at
