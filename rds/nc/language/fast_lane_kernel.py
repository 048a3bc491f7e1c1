"""The compiled reader of plain lines: N, G0 to G3, G90 and G91 that change nothing, X Y Z A B C, I J K, R, F, S.

What it accepts it reads, checks and works out with the interpreter's own arithmetic, operation by operation, so that
the rows are the same to the last bit. At the first line that has anything else in it, that is doubtful, or wrong, it
stops: the interpreter says what is the matter. Importing this needs numba.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from rds.nc.language.arcs import (
    QUARTER,
    QUARTER_REST,
    RADIUS_TOLERANCE,
    SEMICIRCLE,
    SPIRAL_MOST,
    SPIRAL_RELATIVE,
    SPIRAL_TOLERANCE,
)
from rds.nc.language.canon import ARC, FEED, RATE, SPEED, TRAVERSE
from rds.nc.language.source import LONGEST
from rds.nc.language.state import NO_MOTION, XY, XZ

# Where the words are put: the axes at 0 to 5, I J K at 6 to 8.
_R, _F, _S = 9, 10, 11
_AXES, _IJK = 0b000_111111, 0b111_000000
# What a byte is, when it is not a letter with a place.
_G, _N, _BLANK, _NEWLINE, _SEMICOLON, _OTHER = 20, 21, 30, 31, 32, -1
_EXACT = 1 << 53  # whole numbers up to here are floats, and up to 10^22 powers of ten: their quotient is rounded once
_DECIMALS = 22
_N_DIGITS = 9
_DOUBT = 1e-9  # of a tolerance: as near to it the interpreter decides
_LARGEST = 1e9  # of coordinates of arcs: beyond, squares may lose digits or overflow


def _byte_table() -> np.ndarray:
    table = np.full(256, _OTHER, np.int8)
    for letters in ("xyzabcijkrfs", "XYZABCIJKRFS"):
        for place, letter in enumerate(letters):
            table[ord(letter)] = place
    for character, meaning in (("gG", _G), ("nN", _N), (" \t\r", _BLANK), ("\n", _NEWLINE), (";", _SEMICOLON)):
        for byte in character.encode():
            table[byte] = meaning
    return table


_BYTES = _byte_table()
_POWERS = np.array([float(10**power) for power in range(_DECIMALS + 1)])
_RADIUS_TOLERANCE = np.array(RADIUS_TOLERANCE)
_SPIRAL_TOLERANCE = np.array(SPIRAL_TOLERANCE)


@njit(cache=True, error_model="numpy")
def _read_words(data, at, end, words):
    """The words of the line at `at`.

    Returns where the next line begins (-1: not a plain line), a bit for each word given, the G word of motion and that
    of distance (-1 without), the line number and its digits.
    """
    given, motion, distance, n, n_digits = 0, -1, -1, 0, 0
    bad = (-1, 0, 0, 0, 0, 0)
    limit = min(end, at + LONGEST + 1)
    first = True
    while at < limit:
        meaning = _BYTES[data[at]]
        at += 1
        if meaning == _BLANK:
            continue
        if meaning == _NEWLINE:
            return at, given, motion, distance, n, n_digits
        if meaning == _SEMICOLON:
            while at < limit:
                at += 1
                if data[at - 1] == 10:
                    return at, given, motion, distance, n, n_digits
            return bad
        if meaning < 0:
            return bad
        # a number
        mantissa, digits, decimals, point, sign = 0, 0, 0, False, 0
        while at < limit:
            byte = data[at]
            if 48 <= byte <= 57:
                mantissa = 10 * mantissa + (byte - 48)
                digits += 1
                if point:
                    decimals += 1
                if mantissa > _EXACT:
                    return bad
            elif byte == 46:
                if point:
                    return bad
                point = True
            elif byte == 43 or byte == 45:
                if sign or digits or point:
                    return bad
                sign = 1 if byte == 43 else -1
            elif _BYTES[byte] != _BLANK:
                break
            at += 1
        if digits == 0 or decimals > _DECIMALS:
            return bad
        if meaning == _N:
            if not first or sign or point or digits > _N_DIGITS:
                return bad
            n, n_digits = mantissa, digits
        else:
            value = mantissa / _POWERS[decimals]
            if meaning == _G:
                if sign:
                    return bad
                if value == 0.0 or value == 1.0 or value == 2.0 or value == 3.0:
                    if motion != -1:
                        return bad
                    motion = 10 * int(value)
                elif value == 90.0 or value == 91.0:
                    if distance != -1:
                        return bad
                    distance = 1 if value == 90.0 else 0
                else:
                    return bad
            else:
                bit = 1 << meaning
                if given & bit:
                    return bad
                given |= bit
                words[meaning] = -value if sign < 0 else value
        first = False
    return bad  # too long, or not read to its end yet


@njit(cache=True, error_model="numpy")
def _centre(words, given, first, second, third, clockwise, arc_absolute, inches, x0, y0, x1, y1):
    """The centre of an arc in its plane; the first value tells whether it is without doubt."""
    largest = max(max(abs(x0), abs(y0)), max(abs(x1), abs(y1)))
    if not largest < _LARGEST:
        return False, 0.0, 0.0
    smallest, spiral = _RADIUS_TOLERANCE[inches], _SPIRAL_TOLERANCE[inches]
    if given >> _R & 1:
        if given & _IJK or not (given >> first & 1 or given >> second & 1) or (x0 == x1 and y0 == y1):
            return False, 0.0, 0.0
        radius = words[_R]
        size = abs(radius)
        middle_x, middle_y = (x1 + x0) / 2.0, (y1 + y0) / 2.0
        way_x, way_y = middle_x - x1, middle_y - y1
        half = math.sqrt(way_x * way_x + way_y * way_y)
        if not (size < _LARGEST and size > 0.0 and half - size <= smallest * (1.0 - _DOUBT)):
            return False, 0.0, 0.0
        if half / size > 1 - SEMICIRCLE:
            half = size
        chord = math.atan2(y1 - y0, x1 - x0)
        side = -1.0 if clockwise == (radius > 0.0) else 1.0
        direction = chord + side * QUARTER + side * QUARTER_REST
        offset = size * math.cos(math.asin(half / size))
        return True, middle_x + offset * math.cos(direction), middle_y + offset * math.sin(direction)
    has_1, has_2 = given >> (6 + first) & 1, given >> (6 + second) & 1
    if given >> (6 + third) & 1 or not (has_1 or has_2) or (arc_absolute and not (has_1 and has_2)):
        return False, 0.0, 0.0
    centre_x = words[6 + first] if has_1 else 0.0
    centre_y = words[6 + second] if has_2 else 0.0
    if not arc_absolute:
        centre_x, centre_y = x0 + centre_x, y0 + centre_y
    radius = math.sqrt((centre_x - x0) * (centre_x - x0) + (centre_y - y0) * (centre_y - y0))
    end_radius = math.sqrt((centre_x - x1) * (centre_x - x1) + (centre_y - y1) * (centre_y - y1))
    most = max(radius, end_radius)
    if not (radius > smallest * (1.0 + _DOUBT) and end_radius > smallest * (1.0 + _DOUBT) and most < _LARGEST):
        return False, 0.0, 0.0
    error = abs(radius - end_radius) + _DOUBT * (1.0 + most)
    return error <= spiral or (error / most <= SPIRAL_RELATIVE and error <= spiral * SPIRAL_MOST), centre_x, centre_y


@njit(cache=True, error_model="numpy")
def read_lines(data, at, end, line, state, modes, words, target, kinds, digits, ns, lines, values):
    """Read and execute plain lines of `data` from `at` until one that is not plain, the end, or no room for rows.

    `line` is the line number at `at`; `state` holds the position (X Y Z A B C), the feed rate and the speed, `modes`
    the active motion, whether distances are absolute, centres are absolute, the plane, whether units are inches. Both
    are left as the last line that was read leaves them. `words` (12) and `target` (6) are room to work in. The other
    arrays, one element or row per row of MOTION, are filled. Returns bytes and lines read, and rows written.
    """
    begin, first_line, row, room = at, line, 0, len(kinds) - 2
    absolute, arc_absolute, plane, inches = modes[1], modes[2], modes[3], modes[4]
    if plane == XY:
        first, second, third = 0, 1, 2
    elif plane == XZ:
        first, second, third = 2, 0, 1
    else:
        first, second, third = 1, 2, 0
    while row < room and at < end:
        behind, given, motion, distance, n, n_digits = _read_words(data, at, end, words)
        if behind < 0 or (distance != -1 and distance != absolute):
            break
        modal = modes[0]
        if motion == -1:
            if given & _AXES:
                if modal == NO_MOTION:
                    break
                motion = modal
            elif (modal == 20 or modal == 30) and given & _IJK:
                motion = modal
        arc = motion == 20 or motion == 30
        if not arc and given & (_IJK | 1 << _R):
            break
        feed = state[6]
        if given >> _F & 1:
            feed = words[_F]
            if feed < 0.0:
                break
        if (motion > 0 and feed == 0.0) or (given >> _S & 1 and words[_S] < 0.0):
            break
        for axis in range(6):
            target[axis] = state[axis]
            if given >> axis & 1:
                target[axis] = words[axis] if absolute else state[axis] + words[axis]
        centre_x, centre_y = 0.0, 0.0
        if arc:
            sound, centre_x, centre_y = _centre(
                words,
                given,
                first,
                second,
                third,
                motion == 20,
                arc_absolute,
                inches,
                state[first],
                state[second],
                target[first],
                target[second],
            )
            if not sound:
                break
        # Nothing is wrong with the line: from here on it is executed.
        if given >> _F & 1:
            state[6] = feed
            kinds[row], digits[row], ns[row], lines[row] = RATE, n_digits, n, line
            values[row, 0] = feed
            values[row, 1:] = 0.0
            row += 1
        if given >> _S & 1:
            state[7] = words[_S]
            kinds[row], digits[row], ns[row], lines[row] = SPEED, n_digits, n, line
            values[row, 0] = words[_S]
            values[row, 1:] = 0.0
            row += 1
        if motion != -1:
            modes[0] = motion
            digits[row], ns[row], lines[row] = n_digits, n, line
            if arc:
                kinds[row] = ARC
                values[row, 0], values[row, 1] = target[first], target[second]
                values[row, 2], values[row, 3] = centre_x, centre_y
                values[row, 4] = -1.0 if motion == 20 else 1.0
                values[row, 5] = target[third]
                values[row, 6], values[row, 7], values[row, 8] = target[3], target[4], target[5]
            else:
                kinds[row] = FEED if motion == 10 else TRAVERSE
                for axis in range(6):
                    values[row, axis] = target[axis]
                values[row, 6:] = 0.0
            for axis in range(6):
                state[axis] = target[axis]
            row += 1
        at, line = behind, line + 1
    return at - begin, line - first_line, row
