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
        "arc_absolute",
        "arc_allowed",
        "axis_offset",
        "b",
        "c",
        "comp_side",
        "feed_mode",
        "feed_override",
        "feed_rate",
        "flood",
        "inches",
        "mist",
        "motion",
        "origin",
        "origin_index",
        "plane",
        "rotation",
        "speed",
        "spindle",
        "tool_offset",
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
        self.feed_override = 1
        self.origin_index = 1  # G54
        self.origin = [0.0] * 6
        self.axis_offset = [0.0] * 6  # G92
        self.rotation = 0.0  # degrees
        self.tool_offset = [0.0] * 6

    def values(self) -> list[Any]:
        """All of it, to compare; vectors are copied."""
        found = (getattr(self, name) for name in self.__slots__)
        return [list(value) if isinstance(value, list) else value for value in found]

    def position(self) -> list[float]:
        return [self.x, self.y, self.z, self.a, self.b, self.c]

    def move_to(self, position: list[float]) -> None:
        self.x, self.y, self.z, self.a, self.b, self.c = position
