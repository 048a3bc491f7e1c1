"""The fast lane: plain lines (moves, cycles, comments, feeds, spindle) are read by compiled code, many at a time.

Other lines go the usual way. It gives the same items as the interpreter without it, bit for bit.
Without numba (extra `fast`) it stays closed.
"""

from __future__ import annotations

import os
from array import array
from functools import cache
from typing import TYPE_CHECKING

from rds.nc.language.batch import FLOATS, MODES, PATH_MODES
from rds.nc.language.blocks import CYCLES
from rds.nc.language.context import INCH
from rds.nc.language.state import NO_MOTION, PER_MINUTE

if TYPE_CHECKING:
    from rds.nc.language.context import Context
    from rds.nc.language.control import Control
    from rds.nc.language.fast_lane_native import Kernels, LineReader
    from rds.nc.language.source import Source

# Loading the kernels takes the time of some thousand lines in Python, or of a hundred from a shared library, and
# compiling them that of a million: each is done for programs that are certain to be long, and for others (of unknown
# length, or with loops) once they have turned out to be.
WORTH_LOADING, WORTH_LOADING_SHARED = 1 << 17, 1 << 12  # bytes
OPENS_AFTER, OPENS_AFTER_SHARED = 5_000, 200  # lines
LONG_TEXT, LONG_TEXT_SHARED = 20_000, 500  # calls that Python writes in the time that loading takes
LONG_PROGRAM = 1 << 21  # bytes; worth compiling
COMPILES_AFTER = 50_000  # lines
ROWS = 16384  # at once
FEW_LINES = 4  # less in one go are not worth the way
LONGEST_PAUSE = 63  # lines until the next attempt
NEVER = 1 << 62
# Motions that a line without a G word may go on with.
_FOLDER = os.path.join(os.path.dirname(__file__), "__pycache__")
_PLAIN = frozenset((0, 10, 20, 30, NO_MOTION, *(CYCLES - {870, 880})))


@cache
def _kept() -> frozenset[str]:
    """The endings of the compiled files that there are."""
    try:
        names = os.listdir(_FOLDER)
    except OSError:
        return frozenset()
    return frozenset(name[-2:] for name in names if name.startswith("fast_lane.") and name[-2:] in ("so", ".o"))


def worth(usual: int, shared: int) -> int:
    """From where on loading is worth its time: `usual`, or `shared` where there is a shared library."""
    return 0 if is_loaded() else shared if "so" in _kept() else usual


@cache
def stored() -> Kernels | None:
    """The compiled kernels, if they have been compiled before; loading takes the time of some thousand lines."""
    if not _kept():
        return None  # before ctypes is imported for them
    try:
        from rds.nc.language.fast_lane_native import stored_kernels
    except ImportError:
        return None
    return stored_kernels()


@cache
def kernel() -> Kernels | None:
    """The compiled kernels, compiled now if need be (some 15 s); None without numba."""
    found = stored()
    if found is None:
        try:
            from rds.nc.language.fast_lane_native import compile_kernels
        except ImportError:
            return None
        found = compile_kernels()
    return found


def is_loaded() -> bool:
    return any(loaded.cache_info().currsize and loaded() is not None for loaded in (stored, kernel))


class FastLane:
    """Of one run of a program. `take` may be called before any block is read, first after `wait` lines."""

    def __init__(self, context: Context, source: Source):
        self._context = context
        if context.dialect.program_numbers:
            self.wait = NEVER
        elif source.size() >= worth(WORTH_LOADING, WORTH_LOADING_SHARED):
            self.wait = 0
        else:
            self.wait = worth(OPENS_AFTER, OPENS_AFTER_SHARED)
        self._pause = 0
        self.takes_modes = True  # lines that change modes besides the motion, or drill
        self._is_long = source.size() >= LONG_PROGRAM
        self._reader: LineReader | None = None
        self._state = array("d", bytes(8 * FLOATS))
        self._modes = array("q", bytes(8 * MODES))

    def take(self, control: Control) -> int:
        """Read and execute the lines that come next, as far as they are plain and already in the source's buffer.

        Returns how many lines to read the usual way before the next attempt, besides the one that was not plain.
        """
        kernels = kernel() if self._is_long or is_loaded() else stored()
        if kernels is None:
            wait = NEVER if self._is_long else COMPILES_AFTER
            self._is_long = True
            return wait
        if self._reader is None:
            self._reader = kernels.reader(self._state, self._modes, ROWS)
        taken = self._read(self._reader, control.source) if self._open(control) else 0
        self._pause = 0 if taken >= FEW_LINES else min(2 * self._pause + 1, LONGEST_PAUSE)
        return self._pause

    def _open(self, control: Control) -> bool:
        """Whether plain lines mean nothing but moves, feed rates and speeds now."""
        m = self._context
        state = m.state
        return (
            not control.skipping
            and m.out.compensation is None
            and m.leaving is None
            and not state.comp_side
            and state.feed_mode == PER_MINUTE
            and state.arc_allowed == 1
            and not state.unplaced
            and not state.diameter
            and state.motion in _PLAIN
        )

    def _read(self, read: LineReader, source: Source) -> int:
        """Lines taken."""
        state, out = self._context.state, self._context.out
        values, modes = self._state, self._modes
        unit = INCH if state.inches else 1.0
        values[:] = array(
            "d",
            (
                *(state.x, state.y, state.z, state.a, state.b, state.c, state.feed_rate, state.speed),
                *(state.cycle_r, state.cycle_depth, state.cycle_dwell, state.cycle_peck, state.cycle_start),
                *(state.path_tolerance / unit, state.path_collinear / unit),
            ),
        )
        modes[:] = array(
            "q",
            (
                *(state.motion, state.absolute, state.arc_absolute, state.plane, state.inches, state.cycle_series),
                *(state.retract_high, state.spindle, state.mist, state.flood, PATH_MODES.index(state.path_mode)),
                *(state.feed_override, state.speed_override, self.takes_modes and not state.tcp),
            ),
        )
        size, lines, rows, calls = read(source.buffer, source.at, source.next_line)
        if lines:
            state.x, state.y, state.z, state.a, state.b, state.c, state.feed_rate, state.speed = values[:8]
            state.cycle_r, state.cycle_depth, state.cycle_dwell, state.cycle_peck, state.cycle_start = values[8:13]
            state.motion, state.absolute = modes[:2]
            state.cycle_series, state.retract_high, state.spindle, state.mist, state.flood = modes[5:10]
            out.file = source.name
            if calls:
                out.batch(read.rows(rows), source.buffer)
            else:
                out.rows(read.rows(rows))
            source.skip(size, lines)
        return lines
