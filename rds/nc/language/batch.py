"""Moves and other calls together, as compiled code leaves them: rows of more kinds, and the text that they quote.

Compiled code writes all of them as text. Whoever wants them one by one gets moves in blocks, and calls between them.
"""

from __future__ import annotations

from collections.abc import Iterator

from rds.nc.language.canon import SPEED, Call, MotionBlock
from rds.nc.language.motion_rows import WIDTH, Columns

# Kinds of rows besides those of canon.py, and their values:
# COMMENT: where its text begins in `text`, and its bytes (ASCII). CALL: its place in CALLS. DWELL: seconds.
# PATH_MODE: its place in PATH_MODES; the tolerance of CONTINUOUS. COLLINEAR: the tolerance of SET_NAIVECAM_TOLERANCE.
COMMENT, CALL, DWELL, PATH_MODE, COLLINEAR = range(SPEED + 1, SPEED + 6)
PATH_MODES = ("EXACT_PATH", "EXACT_STOP", "CONTINUOUS")
CALLS: tuple[tuple[str, tuple[int | str, ...]], ...] = (
    ("START_SPINDLE_CLOCKWISE", (0,)),
    ("START_SPINDLE_COUNTERCLOCKWISE", (0,)),
    ("STOP_SPINDLE_TURNING", (0,)),
    ("MIST_ON", ()),
    ("FLOOD_ON", ()),
    ("MIST_OFF", ()),
    ("FLOOD_OFF", ()),
    ("COMMENT", ("interpreter: distance mode changed to absolute",)),
    ("COMMENT", ("interpreter: distance mode changed to incremental",)),
    ("COMMENT", ("interpreter: retract mode set to old_z",)),
    ("COMMENT", ("interpreter: retract mode set to r_plane",)),
    ("COMMENT", ("interpreter: motion mode set to none",)),
    ("DISABLE_FEED_OVERRIDE", ()),
    ("DISABLE_SPEED_OVERRIDE", (0,)),
    ("ENABLE_FEED_OVERRIDE", ()),
    ("ENABLE_SPEED_OVERRIDE", (0,)),
)
# What compiled code knows of the interpreter's state, by its place: floats behind the position, and modes.
RATE_NOW, SPEED_NOW, CYCLE_R, CYCLE_DEPTH, CYCLE_DWELL, CYCLE_PECK, CYCLE_START, TOLERANCE, JOINING = range(6, 15)
MOTION, ABSOLUTE, ARC_ABSOLUTE, PLANE, INCHES, IN_SERIES, RETRACT_HIGH, SPINDLE, MIST, FLOOD = range(10)
PATH, FEED_OVERRIDE, SPEED_OVERRIDE, TAKES_MODES = range(10, 14)  # only read; the last: lines that change modes
FLOATS, MODES = JOINING + 1, TAKES_MODES + 1
WORDS, FOUND = 15, 11  # room for what fast_lane_words.py finds in a line: values by letter, and all else


class Batch:
    """Rows of moves and calls in program order, all from one file."""

    __slots__ = ("columns", "file", "text")

    def __init__(self, columns: Columns, text: bytes, file: str = ""):
        self.columns = columns
        self.text = text
        self.file = file

    def __len__(self) -> int:
        return len(self.columns.kinds)

    def parts(self) -> Iterator[MotionBlock | Call]:
        """The moves in blocks, and the calls between them."""
        kinds = self.columns.kinds
        first = 0
        for row, kind in enumerate(kinds):
            if kind > SPEED:
                if first < row:
                    yield MotionBlock(self.columns.part(first, row), self.file)
                yield self._call(row, kind)
                first = row + 1
        if first < len(kinds):
            yield MotionBlock(self.columns.part(first, len(kinds)), self.file)

    def _call(self, row: int, kind: int) -> Call:
        columns = self.columns
        one, two = columns.values[WIDTH * row : WIDTH * row + 2]
        name: str
        args: tuple[int | float | str, ...]
        if kind == COMMENT:
            name, args = "COMMENT", (self.text[int(one) : int(one + two)].decode("ascii"),)
        elif kind == CALL:
            name, args = CALLS[int(one)]
        elif kind == DWELL:
            name, args = "DWELL", (one,)
        elif kind == COLLINEAR:
            name, args = "SET_NAIVECAM_TOLERANCE", (one,)
        else:
            mode = PATH_MODES[int(one)]
            name, args = "SET_MOTION_CONTROL_MODE", (mode, two) if mode == "CONTINUOUS" else (mode,)
        digits = columns.digits[row]
        return Call(name, args, columns.lines[row], str(columns.ns[row]).zfill(digits) if digits else "", self.file)
