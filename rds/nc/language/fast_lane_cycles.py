"""Canned cycles in compiled code: those of cycles.py but G87 and G88, call for call. Importing this needs numba.

What cycles.py would fault is not begun: the interpreter says what is the matter.
"""

from __future__ import annotations

from numba import njit

from rds.nc.language.batch import (
    ABSOLUTE,
    CALL,
    COLLINEAR,
    CYCLE_DEPTH,
    CYCLE_DWELL,
    CYCLE_PECK,
    CYCLE_R,
    CYCLE_START,
    DWELL,
    FEED_OVERRIDE,
    IN_SERIES,
    INCHES,
    JOINING,
    MOTION,
    PATH,
    PATH_MODE,
    PATH_MODES,
    PLANE,
    RETRACT_HIGH,
    SPEED_OVERRIDE,
    SPINDLE,
    TOLERANCE,
)
from rds.nc.language.canon import FEED, TRAVERSE
from rds.nc.language.cycles import CLEARANCE
from rds.nc.language.fast_lane_rows import (
    FEED_FIXED,
    FEED_FREE,
    LINE_ROWS,
    SPEED_FIXED,
    SPEED_FREE,
    STOPPED,
    put,
    turned,
)
from rds.nc.language.fast_lane_words import L, P, Q, R

_HOLE_ROWS = 16  # of a hole at most, besides its pecks
_REPEATS_MOST = 1000.0
_EXACT, _CONTINUOUS = PATH_MODES.index("EXACT_PATH"), PATH_MODES.index("CONTINUOUS")


@njit(error_model="numpy")
def _go(kinds, values, row, kind, axes, first, second, third, state):
    kinds[row] = kind
    for axis in range(6):
        values[row, axis] = state[axis]
    values[row, axes], values[row, (axes + 1) % 3], values[row, (axes + 2) % 3] = first, second, third
    values[row, 6:] = 0.0
    return row + 1


@njit(error_model="numpy")
def is_sound(code, given, words, state, modes, spindle, deep):
    """Whether the cycle, down the axis `deep`, has all its words and no others."""
    began = modes[MOTION] != code
    pecks, dwells = code == 730 or code == 830, code == 820 or code == 860 or code == 890
    taps = code == 740 or code == 840
    if began and not (given >> R & 1 and given >> deep & 1):
        return False
    if given >> L & 1 and (code == 740 or not 1.0 <= words[L] <= _REPEATS_MOST):
        return False
    if (given >> Q & 1 and not pecks) or (given >> P & 1 and not (dwells or taps)):
        return False
    if began and ((pecks and not given >> Q & 1) or (dwells and not given >> P & 1)):
        return False
    peck = words[Q] if given >> Q & 1 else state[CYCLE_PECK]
    dwell = words[P] if given >> P & 1 else state[CYCLE_DWELL]
    if (pecks and not peck > 0.0) or ((dwells or taps) and not dwell >= 0.0):
        return False
    return not ((code == 840 and spindle != 1) or (code == 740 and spindle != -1) or (code == 860 and spindle == 0))


@njit(error_model="numpy")
def cycle(code, given, words, state, modes, kinds, values, row):
    """The holes of a line that is sound. Returns the row behind them; -1, and nothing changed but rows, where R is
    below the depth or there is no room for all of them.
    """
    plane = modes[PLANE]
    axes = 0 if plane == 0 else 2 if plane == 1 else 1  # the plane's first axis: X, Z, Y
    first, second, third = axes, (axes + 1) % 3, (axes + 2) % 3
    r = words[R] if given >> R & 1 else state[CYCLE_R]
    depth = words[third] if given >> third & 1 else state[CYCLE_DEPTH]
    here = state[third]
    began_at = state[CYCLE_START] if modes[IN_SERIES] else here
    start = began_at
    x, y, by_x, by_y = state[first], state[second], 0.0, 0.0
    if modes[ABSOLUTE]:
        x = words[first] if given >> first & 1 else x
        y = words[second] if given >> second & 1 else y
        retract, bottom = r, depth
    else:
        by_x = words[first] if given >> first & 1 else 0.0
        by_y = words[second] if given >> second & 1 else 0.0
        retract, bottom = r + start, r + start + depth
    if retract < bottom:
        return -1
    if start < retract:
        row = _go(kinds, values, row, TRAVERSE, axes, state[first], state[second], retract, state)
        start = here = retract
    clear = start if modes[RETRACT_HIGH] else retract
    if modes[PATH] != _EXACT:
        row = put(kinds, values, row, PATH_MODE, _EXACT, 0.0)
    peck = words[Q] if given >> Q & 1 else state[CYCLE_PECK]
    dwell = words[P] if given >> P & 1 else state[CYCLE_DWELL]
    spindle, room = modes[SPINDLE], len(kinds) - LINE_ROWS - _HOLE_ROWS
    back = CLEARANCE if modes[INCHES] else CLEARANCE * 25.4
    for hole in range(int(words[L]) if given >> L & 1 else 1):
        x, y = x + by_x, y + by_y
        if row > room:
            return -1
        if hole == 0 and here > retract:
            row = _go(kinds, values, row, TRAVERSE, axes, x, y, here, state)
            row = _go(kinds, values, row, TRAVERSE, axes, x, y, retract, state)
        else:
            row = _go(kinds, values, row, TRAVERSE, axes, x, y, clear, state)
            if clear > retract:
                row = _go(kinds, values, row, TRAVERSE, axes, x, y, retract, state)
        if code == 730 or code == 830:
            down = retract - peck
            while down > bottom:
                if row > room:
                    return -1
                row = _go(kinds, values, row, FEED, axes, x, y, down, state)
                if code == 830:
                    row = _go(kinds, values, row, TRAVERSE, axes, x, y, retract, state)
                row = _go(kinds, values, row, TRAVERSE, axes, x, y, down + back, state)
                down = down - peck
        if code == 740 or code == 840:
            row = put(kinds, values, row, CALL, FEED_FIXED, 0.0)
            row = put(kinds, values, row, CALL, SPEED_FIXED, 0.0)
        row = _go(kinds, values, row, FEED, axes, x, y, bottom, state)
        if code == 740 or code == 840:
            row = put(kinds, values, row, CALL, STOPPED, 0.0)
            row = put(kinds, values, row, CALL, turned(-spindle), 0.0)
        if code != 730 and code != 830 and code != 810 and code != 850:
            row = put(kinds, values, row, DWELL, dwell, 0.0)
        if code == 740 or code == 840:
            row = _go(kinds, values, row, FEED, axes, x, y, clear, state)
            row = put(kinds, values, row, CALL, STOPPED, 0.0)
            row = put(kinds, values, row, CALL, turned(spindle), 0.0)
            if modes[FEED_OVERRIDE]:
                row = put(kinds, values, row, CALL, FEED_FREE, 0.0)
            if modes[SPEED_OVERRIDE]:
                row = put(kinds, values, row, CALL, SPEED_FREE, 0.0)
        elif code == 850:
            row = _go(kinds, values, row, FEED, axes, x, y, retract, state)
            row = _go(kinds, values, row, TRAVERSE, axes, x, y, clear, state)
        elif code == 890:
            row = _go(kinds, values, row, FEED, axes, x, y, clear, state)
        elif code == 860:
            row = put(kinds, values, row, CALL, STOPPED, 0.0)
            row = _go(kinds, values, row, TRAVERSE, axes, x, y, clear, state)
            row = put(kinds, values, row, CALL, turned(spindle), 0.0)
        else:
            row = _go(kinds, values, row, TRAVERSE, axes, x, y, clear, state)
    if modes[PATH] != _EXACT:
        row = put(kinds, values, row, PATH_MODE, modes[PATH], state[TOLERANCE] if modes[PATH] == _CONTINUOUS else 0.0)
        row = put(kinds, values, row, COLLINEAR, state[JOINING], 0.0)
    state[first], state[second], state[third] = x, y, clear
    state[CYCLE_R], state[CYCLE_DEPTH], state[CYCLE_START] = r, depth, began_at
    state[CYCLE_PECK] = peck if code == 730 or code == 830 else state[CYCLE_PECK]
    state[CYCLE_DWELL] = dwell if not (code == 730 or code == 830 or code == 810 or code == 850) else state[CYCLE_DWELL]
    modes[MOTION], modes[IN_SERIES] = code, 1
    return row
