"""The active modes of a program line by line, and where its work coordinates lie in the machine's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Any

from rds.nc.language.canon import Call
from rds.nc.language.context import INCH
from rds.nc.language.frame import SYSTEMS
from rds.nc.language.interpreter import Interpreter
from rds.nc.language.state import INVERSE_TIME, NO_MOTION, PER_REVOLUTION, State

_PLANES = ("G17", "G18", "G19")
_PATH = {"EXACT_PATH": "G61", "EXACT_STOP": "G61.1", "CONTINUOUS": "G64"}
_FEED_MODES = {INVERSE_TIME: "G93", PER_REVOLUTION: "G95"}
_MODAL = tuple(name for name in State.__slots__ if name not in "xyzabc")
_SIDES = {0: "G40", 1: "G41", -1: "G42"}


@dataclass(frozen=True)
class Modes:
    """What is in force after a block: words as `G1 G17`, tool, feed as programmed, spindle speed, and the offsets.

    `origin`, `g92`, `tool_offset`: X Y Z, mm; `rotation` of the coordinate system about Z, degrees.
    """

    words: tuple[str, ...]
    tool: int
    feed: float  # in the unit of the words: mm or inches per minute (G94) or revolution (G95), or 1/min (G93)
    speed: float  # rev/min
    origin: tuple[float, ...] = (0.0, 0.0, 0.0)
    g92: tuple[float, ...] = (0.0, 0.0, 0.0)
    tool_offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    rotation: float = 0.0

    def work(self, position: Mapping[str, float]) -> dict[str, float]:
        """A position of the machine (mm, by axis; missing ones count as 0) in work coordinates: X, Y and Z."""
        x, y, z = (
            position.get(axis, 0.0) - origin - tool
            for axis, origin, tool in zip("XYZ", self.origin, self.tool_offset, strict=True)
        )
        c, s = cos(radians(self.rotation)), sin(radians(self.rotation))
        turned = (x * c + y * s, y * c - x * s, z)
        return {axis: value - g92 for axis, value, g92 in zip("XYZ", turned, self.g92, strict=True)}

    def machine(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """The position of the machine where work coordinates are these, mm."""
        x, y, z = (value + g92 for value, g92 in zip((x, y, z), self.g92, strict=True))
        c, s = cos(radians(self.rotation)), sin(radians(self.rotation))
        turned = (x * c - y * s, x * s + y * c, z)
        at = [sum(each) for each in zip(turned, self.origin, self.tool_offset, strict=True)]
        return at[0], at[1], at[2]


class Follower(Interpreter):
    """An interpreter that keeps the modes after each line of the program's own file, as its last run left them.

    `between` is called after each line, and may raise to end it all. `modes` is by line number; lines of plain moves
    that are read many at once have no entry of their own: see `modes_at`.
    """

    def __init__(self, *given: Any, between: Callable[[], None] = lambda: None, **options: Any):
        super().__init__(*given, **options)
        self.by_line, self.lane.takes_modes = True, False
        self._between = between
        self.modes: dict[int, Modes] = {}
        self._path = "G64"
        self._seen: list[Any] = []
        self._latest = self._modes(self.context.state)

    def _line(self, raw: bytes) -> bool:
        ended = super()._line(raw)
        self._between()
        for item in self.out.items:
            if isinstance(item, Call) and item.name == "SET_MOTION_CONTROL_MODE":
                self._path = _PATH[str(item.args[0])]
        if self.control.source is self.source:
            state = self.context.state
            now = [self._path, self.context.tools.spindle.number, *map(state.__getattribute__, _MODAL)]
            if now != self._seen:
                self._seen = [list(value) if isinstance(value, list) else value for value in now]
                self._latest = self._modes(state)
            self.modes[self.source.line] = self._latest
        return ended

    def _modes(self, state: State) -> Modes:
        unit = INCH if state.inches else 1.0
        coolant = [word for word, on in (("M7", state.mist), ("M8", state.flood)) if on] or ["M9"]
        words = (
            "G80" if state.motion == NO_MOTION else f"G{state.motion / 10:g}",
            _PLANES[state.plane],
            "G90" if state.absolute else "G91",
            "G20" if state.inches else "G21",
            _FEED_MODES.get(state.feed_mode, "G94"),
            _SIDES[state.comp_side],
            SYSTEMS[state.origin_index],
            self._path,
            {1: "M3", -1: "M4"}.get(state.spindle, "M5"),
            *coolant,
        )
        origin, g92, tool = (
            tuple(float(value) * unit for value in vector[:3])
            for vector in (state.origin, state.axis_offset, state.tool_offset)
        )
        number = self.context.tools.spindle.number
        return Modes(words, number, state.feed_rate, state.speed, origin, g92, tool, state.rotation)


def modes_at(modes: Mapping[int, Modes], line: int) -> Modes | None:
    """The modes at a line: those after it, or after the nearest line above that has them; None where there is none."""
    for number in range(line, 0, -1):
        if number in modes:
            return modes[number]
    return None
