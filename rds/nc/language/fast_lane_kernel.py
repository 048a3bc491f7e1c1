"""The compiled reader of plain lines.

N, G0 to G4, G80, G90, G91, G98, G99, canned cycles but G87 and G88; X Y Z A B C, I J K, R P Q L, F, S;
M3 to M5, M7 to M9; comments.

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
from rds.nc.language.batch import (
    ABSOLUTE,
    ARC_ABSOLUTE,
    CALL,
    COMMENT,
    DWELL,
    FLOOD,
    IN_SERIES,
    INCHES,
    MIST,
    MOTION,
    PLANE,
    RATE_NOW,
    RETRACT_HIGH,
    SPEED_NOW,
    SPINDLE,
    TAKES_MODES,
)
from rds.nc.language.canon import ARC, FEED, RATE, SPEED, TRAVERSE
from rds.nc.language.fast_lane_cycles import cycle, is_sound
from rds.nc.language.fast_lane_rows import (
    FLOOD_OFF,
    FLOOD_ON,
    LINE_ROWS,
    MIST_OFF,
    MIST_ON,
    NO_MODE,
    NOW_ABSOLUTE,
    NOW_INCREMENTAL,
    TO_R,
    TO_START,
    put,
    turned,
)
from rds.nc.language.fast_lane_words import (
    AXES,
    COOLANT_WORD,
    DIGITS,
    DISTANCE,
    DWELLS,
    GIVEN,
    IJK,
    MOVE,
    RETRACT,
    SAID,
    SAID_SIZE,
    SPINDLE_WORD,
    F,
    L,
    N,
    P,
    Q,
    R,
    S,
    read_words,
)
from rds.nc.language.state import NO_MOTION, XY, XZ

_DOUBT = 1e-9  # of a tolerance: as near to it the interpreter decides
_LARGEST = 1e9  # of coordinates of arcs: beyond, squares may lose digits or overflow
_ROTARY = AXES & ~0b111
_RADIUS_TOLERANCE = np.array(RADIUS_TOLERANCE)
_SPIRAL_TOLERANCE = np.array(SPIRAL_TOLERANCE)


@njit(error_model="numpy")
def _centre(words, given, first, second, third, clockwise, arc_absolute, inches, x0, y0, x1, y1):
    """The centre of an arc in its plane; the first value tells whether it is without doubt."""
    largest = max(max(abs(x0), abs(y0)), max(abs(x1), abs(y1)))
    if not largest < _LARGEST:
        return False, 0.0, 0.0
    smallest, spiral = _RADIUS_TOLERANCE[inches], _SPIRAL_TOLERANCE[inches]
    if given >> R & 1:
        if given & IJK or not (given >> first & 1 or given >> second & 1) or (x0 == x1 and y0 == y1):
            return False, 0.0, 0.0
        radius = words[R]
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


@njit(error_model="numpy")
def _turning(word):
    return 1 if word == 3 else -1 if word == 4 else 0


@njit(error_model="numpy")
def _settings(found, words, state, modes, kinds, values, row):
    """What a line does before it moves, in the order of modes.py. Returns the row behind."""
    given = found[GIVEN]
    if found[SAID] != -1:
        row = put(kinds, values, row, COMMENT, found[SAID], found[SAID_SIZE])
    if given >> F & 1:
        state[RATE_NOW] = words[F]
        row = put(kinds, values, row, RATE, words[F], 0.0)
    if given >> S & 1:
        state[SPEED_NOW] = words[S]
        row = put(kinds, values, row, SPEED, words[S], 0.0)
    if found[SPINDLE_WORD] != -1:
        modes[SPINDLE] = _turning(found[SPINDLE_WORD])
        row = put(kinds, values, row, CALL, turned(modes[SPINDLE]), 0.0)
    coolant = found[COOLANT_WORD]
    if coolant == 7:
        modes[MIST] = 1
        row = put(kinds, values, row, CALL, MIST_ON, 0.0)
    elif coolant == 8:
        modes[FLOOD] = 1
        row = put(kinds, values, row, CALL, FLOOD_ON, 0.0)
    elif coolant == 9:
        modes[MIST] = modes[FLOOD] = 0
        row = put(kinds, values, row, CALL, MIST_OFF, 0.0)
        row = put(kinds, values, row, CALL, FLOOD_OFF, 0.0)
    if found[DWELLS] != -1:
        row = put(kinds, values, row, DWELL, words[P], 0.0)
    if found[DISTANCE] != -1 and found[DISTANCE] != modes[ABSOLUTE]:
        modes[ABSOLUTE] = found[DISTANCE]
        row = put(kinds, values, row, CALL, NOW_ABSOLUTE if found[DISTANCE] else NOW_INCREMENTAL, 0.0)
    if found[RETRACT] != -1:
        modes[RETRACT_HIGH] = found[RETRACT]
        row = put(kinds, values, row, CALL, TO_START if found[RETRACT] else TO_R, 0.0)
    return row


@njit(error_model="numpy")
def _motion(found, modes):
    """The motion of a line, -1 for none; -2 where the interpreter is to decide."""
    given, motion, modal = found[GIVEN], found[MOVE], modes[MOTION]
    if found[DWELLS] != -1:
        return -1 if motion == -1 and not given & (AXES | IJK) and modes[TAKES_MODES] else -2
    if motion == -1:
        if given & AXES:
            motion = -2 if modal == NO_MOTION else modal
        elif (modal == 20 or modal == 30) and given & IJK:
            motion = modal
    elif (motion == NO_MOTION and given & AXES) or (motion > 30 and motion != NO_MOTION and not given & AXES):
        return -2
    changes = motion > 30 or found[RETRACT] != -1 or found[SPINDLE_WORD] != -1 or found[COOLANT_WORD] != -1
    changes = changes or (found[DISTANCE] != -1 and found[DISTANCE] != modes[ABSOLUTE])
    return motion if modes[TAKES_MODES] or not changes else -2


@njit(error_model="numpy")
def read_lines(data, at, end, line, state, modes, words, target, found, kinds, digits, ns, lines, values):
    """Read and execute plain lines of `data` from `at` until one that is not plain, the end, or no room for rows.

    `line` is the line number at `at`; `state` and `modes` hold what fast_lane_cycles.py numbers. Both are left as the
    last line that was read leaves them. `words`, `target` (6) and `found` are room to work in. The other arrays, one
    element or row per row of a batch, are filled. Returns bytes and lines read, and rows written, and of them calls.
    """
    begin, first_line, row, room, calls = at, line, 0, len(kinds) - LINE_ROWS, 0
    arc_absolute, plane, inches = modes[ARC_ABSOLUTE], modes[PLANE], modes[INCHES]
    if plane == XY:
        first, second, third = 0, 1, 2
    elif plane == XZ:
        first, second, third = 2, 0, 1
    else:
        first, second, third = 1, 2, 0
    while row < room and at < end:
        behind = read_words(data, at, end, words, found)
        if behind < 0:
            break
        given, motion = found[GIVEN], _motion(found, modes)
        arc, canned = motion == 20 or motion == 30, motion > 30 and motion != NO_MOTION
        if (
            motion == -2
            or (not arc and given & IJK)
            or (given >> R & 1 and not (arc or canned))
            or (given >> P & 1 and not (canned or found[DWELLS] != -1))
            or (given & (1 << Q | 1 << L) and not canned)
        ):
            break
        feed = words[F] if given >> F & 1 else state[RATE_NOW]
        if feed < 0.0 or ((motion == 10 or arc or canned) and feed == 0.0) or (given >> S & 1 and words[S] < 0.0):
            break
        if found[DWELLS] != -1 and not (given >> P & 1 and words[P] >= 0.0):
            break
        if canned:
            spindle = modes[SPINDLE] if found[SPINDLE_WORD] == -1 else _turning(found[SPINDLE_WORD])
            if given & _ROTARY or not is_sound(motion, given, words, state, modes, spindle, third):
                break
        absolute = modes[ABSOLUTE] if found[DISTANCE] == -1 else found[DISTANCE]
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
        # Nothing is wrong with the line, unless R is below the depth: from here on it is executed.
        start = row
        before = (state[RATE_NOW], state[SPEED_NOW])
        modes_before = (modes[ABSOLUTE], modes[RETRACT_HIGH], modes[SPINDLE], modes[MIST], modes[FLOOD])
        row = _settings(found, words, state, modes, kinds, values, row)
        if canned:
            behind_holes = cycle(motion, given, words, state, modes, kinds, values, row)
            if behind_holes < 0:
                state[RATE_NOW], state[SPEED_NOW] = before
                modes[ABSOLUTE], modes[RETRACT_HIGH], modes[SPINDLE], modes[MIST], modes[FLOOD] = modes_before
                row = start
                break
            row = behind_holes
        elif motion != -1:
            modes[MOTION], modes[IN_SERIES] = motion, 0
            if motion == NO_MOTION:
                row = put(kinds, values, row, CALL, NO_MODE, 0.0)
            elif arc:
                kinds[row] = ARC
                values[row, 0], values[row, 1] = target[first], target[second]
                values[row, 2], values[row, 3] = centre_x, centre_y
                values[row, 4] = -1.0 if motion == 20 else 1.0
                values[row, 5] = target[third]
                values[row, 6], values[row, 7], values[row, 8] = target[3], target[4], target[5]
                row += 1
            else:
                kinds[row] = FEED if motion == 10 else TRAVERSE
                for axis in range(6):
                    values[row, axis] = target[axis]
                values[row, 6:] = 0.0
                row += 1
            if motion != NO_MOTION:
                for axis in range(6):
                    state[axis] = target[axis]
        for place in range(start, row):
            digits[place], ns[place], lines[place] = found[DIGITS], found[N], line
            if kinds[place] > SPEED:
                calls += 1
        at, line = behind, line + 1
    return at - begin, line - first_line, row, calls
