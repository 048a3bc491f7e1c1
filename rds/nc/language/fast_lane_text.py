"""Rows of moves as the lines that `rs274 -g` prints, many at a time. Importing this needs numba.

A number is written as printf's %.4f does: rounded from its exact binary value, a tie to the even digit. Rows with a
number that is too large for that are left to Python.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from rds.nc.language.canon import ARC, FEED, RATE, SPEED, TRAVERSE

_LIMIT = 1e11  # ten thousand times this is below 2^53, where every whole number is a float
LONGEST = 256  # bytes of a line: 9 numbers of at most 18 with their commas, and what stands before them
_SPLIT = 134217729.0  # 2^27 + 1: cuts a float into two halves of 26 digits (Dekker 1971)
_NUMBERS = {TRAVERSE: 6, FEED: 6, ARC: 9, RATE: 1, SPEED: 1}
_NAMES = {
    TRAVERSE: b"STRAIGHT_TRAVERSE(",
    FEED: b"STRAIGHT_FEED(",
    ARC: b"ARC_FEED(",
    RATE: b"SET_FEED_RATE(",
    SPEED: b"SET_SPINDLE_SPEED(0, ",
}

_COUNTS = np.array([_NUMBERS[kind] for kind in sorted(_NUMBERS)])
_LENGTHS = np.array([len(_NAMES[kind]) for kind in sorted(_NAMES)])
_LETTERS = np.array([list(_NAMES[kind].ljust(24)) for kind in sorted(_NAMES)], np.uint8)


@njit(cache=True, error_model="numpy")
def _ten_thousandths(value):
    """The whole number nearest to 10000 · value, for 0 <= value < _LIMIT; a tie goes to the even one."""
    product = value * 10000.0
    # The rounding error of the product (Dekker): product + error = 10000 · value exactly. 10000 has one half only.
    cut = _SPLIT * value
    high = cut - (cut - value)
    low = value - high
    error = (high * 10000.0 - product) + low * 10000.0
    below = math.floor(product)
    beyond = (product - below) - 0.5
    found = int(below)
    if beyond > 0.0 or (beyond == 0.0 and (error > 0.0 or (error == 0.0 and found & 1))):
        found += 1
    return found


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def write_rows(number, kinds, digits, ns, values, out):
    """Write rows as lines, the first one with the running `number`, until `out` is full or a row is left to Python.

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
        for place in range(_LENGTHS[kind]):
            out[at] = _LETTERS[kind, place]
            at += 1
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
            if math.copysign(1.0, value) < 0.0:
                out[at] = 45
                at += 1
            found = _ten_thousandths(abs(value))
            at = _put_whole(out, at, found // 10000, 1, 48)
            out[at] = 46
            at = _put_whole(out, at + 1, found % 10000, 4, 48)
        out[at], out[at + 1] = 41, 10
        at += 2
    return len(kinds), at
