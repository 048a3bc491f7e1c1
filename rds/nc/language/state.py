"""What the interpreter knows between two blocks."""

from __future__ import annotations

from typing import Any

XY, XZ, YZ = 0, 1, 2  # planes: G17, G18, G19
PLANES = ("XY", "XZ", "YZ")
PER_MINUTE, INVERSE_TIME, PER_REVOLUTION = 0, 1, 2  # feed modes: G94, G93, G95
NO_MOTION = 800  # G80


class State:
    """Modes and position, plain floats and ints: what a block leaves to the next.

    Positions and offsets are in program units (mm or inches) and degrees, in the order X Y Z A B C. While the cutter is
    compensated, the position is the programmed one. G words are ten times their number (`motion` = 20 is G2).
    """

    __slots__ = (
        "a",
        "absolute",
        "adaptive_feed",
        "arc_absolute",
        "arc_allowed",
        "axis_offset",
        "b",
        "c",
        "comp_side",
        "cycle_depth",
        "cycle_dwell",
        "cycle_i",
        "cycle_j",
        "cycle_k",
        "cycle_peck",
        "cycle_r",
        "cycle_series",
        "cycle_start",
        "diameter",
        "feed_hold",
        "feed_mode",
        "feed_override",
        "feed_rate",
        "flood",
        "inches",
        "mist",
        "motion",
        "origin",
        "origin_index",
        "path_collinear",
        "path_mode",
        "path_tolerance",
        "plane",
        "retract_high",
        "rotation",
        "speed",
        "speed_override",
        "spindle",
        "surface_speed",
        "tcp",
        "tool_offset",
        "unplaced",
        "x",
        "y",
        "z",
    )

    def __init__(self) -> None:
        self.x = self.y = self.z = self.a = self.b = self.c = 0.0
        self.plane = XY
        self.motion = NO_MOTION
        self.absolute = 1  # G90
        self.arc_absolute = 0  # G91.1
        self.feed_mode = PER_MINUTE
        self.feed_rate = 0.0
        self.speed = 0.0  # rev/min
        self.spindle = 0  # 1 clockwise, -1 counter-clockwise, 0 standing
        self.inches = 0  # G21
        self.comp_side = 0  # 1 left (G41), -1 right (G42)
        self.arc_allowed = 1  # 0 between G40 and the straight move after it
        self.mist = self.flood = 0
        self.feed_override = self.speed_override = self.feed_hold = 1
        self.adaptive_feed = 0
        self.origin_index = 1  # G54
        self.origin = [0.0] * 6
        self.axis_offset = [0.0] * 6  # G92
        self.rotation = 0.0  # degrees
        self.tool_offset = [0.0] * 6
        self.tcp = 0  # G43.4 is in force
        self.diameter = 0  # G7: X words are diameters
        self.surface_speed = 0  # G96
        self.path_mode = "CONTINUOUS"  # G64; EXACT_PATH, EXACT_STOP
        self.path_tolerance = self.path_collinear = 0.0  # P and Q of G64, mm
        self.retract_high = 0  # 1: G98, canned cycles go out to where they began; 0: G99, to R
        self.cycle_series = 0  # 1 from one canned cycle to the next, without another move between
        self.cycle_start = 0.0  # where the series began, along the plane's third axis
        # words of canned cycles (R, depth, P, Q, I J K), for the lines that leave them out; I and J also of splines
        self.cycle_r = self.cycle_depth = self.cycle_dwell = 0.0
        self.cycle_peck = self.cycle_i = self.cycle_j = self.cycle_k = 0.0
        self.unplaced = 0  # 1 between G43.4, or the G49 that ends it, and the move that names X, Y and Z

    def values(self) -> list[Any]:
        """All of it, to compare; vectors are copied."""
        found = (getattr(self, name) for name in self.__slots__)
        return [list(value) if isinstance(value, list) else value for value in found]

    def position(self) -> list[float]:
        return [self.x, self.y, self.z, self.a, self.b, self.c]

    def move_to(self, position: list[float]) -> None:
        self.x, self.y, self.z, self.a, self.b, self.c = position
