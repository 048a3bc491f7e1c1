"""How the kernels of the fast lane write a row. Importing this needs numba."""

from __future__ import annotations

from numba import njit

from rds.nc.language.batch import CALLS

# Places in CALLS.
CLOCKWISE, COUNTERCLOCKWISE, STOPPED, MIST_ON, FLOOD_ON, MIST_OFF, FLOOD_OFF = range(7)
NOW_ABSOLUTE, NOW_INCREMENTAL, TO_START, TO_R, NO_MODE = range(7, 12)
FEED_FIXED, SPEED_FIXED, FEED_FREE, SPEED_FREE = range(12, len(CALLS))
LINE_ROWS = 16  # of a line at most, besides holes and pecks


@njit(error_model="numpy")
def put(kinds, values, row, kind, one, two):
    """A row that has at most two values. Returns where the next one goes, as all of these do."""
    kinds[row] = kind
    values[row, 0], values[row, 1] = one, two
    values[row, 2:] = 0.0
    return row + 1


@njit(error_model="numpy")
def turned(spindle):
    """The call that turns the spindle so: 1 clockwise, -1 counter-clockwise, 0 not at all."""
    return CLOCKWISE if spindle > 0 else COUNTERCLOCKWISE if spindle < 0 else STOPPED
