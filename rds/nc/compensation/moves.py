"""Moves of the cutter's centre, held back until the next corner is known, and the record of a compensated stretch."""

from __future__ import annotations

import math
from typing import NamedTuple

from rds.nc.compensation.geometry import Point, sweep
from rds.nc.language.canon import ARC, FEED, TRAVERSE, Call
from rds.nc.language.errors import ProgramError

XY, XZ = "XY", "XZ"
CENTRE_TOLERANCE = 0.01  # program units; by so much the radii at both ends of a shortened arc may differ
SWEEP_TOLERANCE = {"MM": 0.0254, "INCHES": 0.001}  # rad; by so much an arc may grow when its end is moved
DEPTH = 0.0025  # of the radius; twice as deep as a corner may gouge that is taken as straight on
# Calls that keep their place among the held moves; all others are made at once, as LinuxCNC does.
IN_ORDER = frozenset(
    (
        *("DWELL", "SET_FEED_MODE", "COMMENT", "MIST_ON", "MIST_OFF", "FLOOD_ON", "FLOOD_OFF"),
        *("START_SPINDLE_CLOCKWISE", "START_SPINDLE_COUNTERCLOCKWISE", "STOP_SPINDLE_TURNING"),
        *("SET_SPINDLE_MODE", "ORIENT_SPINDLE", "WAIT_SPINDLE_ORIENT_COMPLETE"),
    )
)

Row = tuple[int, int, int, int, tuple[float, ...]]  # as a row of dtype MOTION
Item = Row | Call


class Element(NamedTuple):
    """One line or arc in the plane, programmed or made by the cutter's centre. Lengths in program units."""

    role: str  # entry, contour, corner, level (no motion in the plane), exit
    kind: int  # TRAVERSE, FEED, ARC
    line: int
    start: Point
    end: Point
    centre: Point = (0.0, 0.0)
    turn: int = 0  # + counter-clockwise; one more for each full circle
    height: float = 0.0  # third coordinate at its end


class Stretch:
    """What was programmed from G41 or G42 on, and what the cutter's centre did, the exit move included."""

    def __init__(self, side: int, radius: float, plane: str, units: str):
        self.side, self.radius, self.plane, self.units = side, radius, plane, units
        self.programmed: list[Element] = []
        self.cut: list[Element] = []


class Move:
    """A move of the cutter's centre; what is shortened later is its end."""

    __slots__ = ("centre", "direction", "end", "height", "kind", "line", "role", "rotary", "sweep", "turn")

    def __init__(self, role: str, kind: int, line: int, end: Point, height: float, rotary: tuple[float, float, float]):
        self.role, self.kind, self.line, self.end, self.height, self.rotary = role, kind, line, end, height, rotary
        self.direction: Point = (0.0, 0.0)  # of the programmed line; (0, 0): may be shortened at will
        self.centre: Point = (0.0, 0.0)
        self.turn = 0
        self.sweep = 0.0  # of the programmed arc, rad


class HeldMoves:
    """The queue: one move in the plane, moves up and down at its end, and the calls among them.

    `tool` is the cutter's centre once all is made, `made` where it is now, `begin` where the held move in the plane
    starts (None: not known to lie on its offset, so that nothing can be said of its length).
    """

    def __init__(self, stretch: Stretch, start: Point, nose: Point, recording: bool):
        self.stretch = stretch
        self.tool = start
        self.made = start
        self.begin: Point | None = None
        self._sharp = 0.0  # where `begin` is a cut-off inside corner, the sine of its angle
        self.units = stretch.units
        self.radius = stretch.radius
        self.mark = (0, 0)  # digits and number of the word N of the block being executed
        self.out: list[Item] = []
        self._nose = nose
        self._recording = recording
        self._held: list[Move | Item] = []

    def __bool__(self) -> bool:
        return bool(self._held)

    @property
    def first(self) -> Move | None:
        """The held move in the plane."""
        return self._held[0] if self._held and isinstance(self._held[0], Move) else None

    def hold(self, move: Move) -> None:
        """Hold a move back."""
        self._held.append(move)
        self.tool = move.end

    def keep(self, item: Item) -> None:
        """Keep the place of a call or feed rate among held moves."""
        self._held.append(item)

    def take(self) -> list[Item]:
        """What is certain, in order; once."""
        out, self.out = self.out, []
        return out

    def trim(self, point: Point, angle: float) -> None:
        """All held moves end at `point` and are made: besides the first these are moves up and down in the corner.

        `angle`: by how much the path turns there, rad.
        """
        self._check(point, wide=False)
        for item in self._held:
            if isinstance(item, Move):
                item.end = point
        self._flush()
        self.tool = self.made = point
        self.begin = point
        self._sharp = abs(math.sin(angle)) if math.cos(angle) > 0 else 1.0

    def finish(self, wide: bool = False) -> None:
        """The held moves are made as they are.

        `wide`: LinuxCNC looks for no gouge here. Then lines are refused only when they run back into the side of a
        sharp corner: in a contour of very short moves, rounded to a few decimals, flat corners push the cutter about.
        """
        self._check(self.tool, wide)
        self._flush()
        self.begin = self.tool
        self._sharp = 0.0

    def beside(self, point: Point) -> Point:
        """From `point` to the tool where it is now (with a nose, to its controlled point)."""
        u, v = self._nose[0] * self.radius, self._nose[1] * self.radius
        return self.made[0] + u - point[0], self.made[1] + v - point[1]

    def make(self, move: Move) -> None:
        """A move that is not held back."""
        if self._recording:
            self.stretch.cut.append(
                Element(move.role, move.kind, move.line, self.made, move.end, move.centre, move.turn, move.height)
            )
        self.made = self.tool = move.end
        u, v = self._nose[0] * self.radius, self._nose[1] * self.radius
        first, second = move.end[0] + u, move.end[1] + v
        values: tuple[float, ...]
        if move.kind == ARC:
            centre = (move.centre[0] + u, move.centre[1] + v)
            values = (first, second, *centre, float(move.turn), move.height, *move.rotary)
        elif self.stretch.plane == XY:
            values = (first, second, move.height, *move.rotary, 0.0, 0.0, 0.0)
        else:
            values = (second, move.height, first, *move.rotary, 0.0, 0.0, 0.0)
        self.out.append((move.kind, *self.mark, move.line, values))

    def scale(self, factor: float, units: str) -> None:
        """Everything in other length units."""

        def scaled(point: Point) -> Point:
            return (point[0] * factor, point[1] * factor)

        self.units = units
        self.radius *= factor
        self.tool, self.made = scaled(self.tool), scaled(self.made)
        self.begin = None if self.begin is None else scaled(self.begin)
        for move in self._held:
            if isinstance(move, Move):
                move.end, move.centre, move.height = scaled(move.end), scaled(move.centre), move.height * factor

    def _check(self, point: Point, wide: bool) -> None:
        """Held moves that end at `point` must not run backward for it."""
        for move in self._held:
            if not isinstance(move, Move):
                continue
            if move.kind == ARC:
                if abs(math.dist(move.centre, move.end) - math.dist(move.centre, point)) > CENTRE_TOLERANCE:
                    raise no_room(self.radius, move)
                if self.begin is None:
                    continue
                grown = abs(sweep(self.begin, move.centre, move.turn, point)) - abs(move.sweep)
                if grown > (math.pi / 2 if wide else SWEEP_TOLERANCE[self.units]):
                    raise _gouges(self.radius, move)
            elif self.begin is not None:
                made = (point[0] - self.begin[0], point[1] - self.begin[1])
                forward = move.direction[0] * made[0] + move.direction[1] * made[1]
                if -forward * self._sharp > DEPTH * self.radius if wide else forward < 0:
                    raise _gouges(self.radius, move)

    def _flush(self) -> None:
        held, self._held = self._held, []
        digits, n = self.mark
        for item in held:
            if isinstance(item, Move):
                self.make(item)
            elif isinstance(item, Call):
                self.out.append(
                    Call(item.name, item.args, item.line, str(n).zfill(digits) if digits else "", item.file)
                )
            else:
                self.out.append((item[0], digits, n, *item[3:]))


def no_room(radius: float, before: Move) -> ProgramError:
    """The refusal of an inside corner that the cutter does not fit into."""
    return ProgramError(
        f"the cutter (radius {radius:.4f}) does not fit into the inside corner after line {before.line}"
        " without gouging; take a smaller cutter or a rounder corner"
    )


def _gouges(radius: float, move: Move) -> ProgramError:
    what = {TRAVERSE: "straight traverse", FEED: "straight move", ARC: "arc"}[move.kind]
    return ProgramError(
        f"the {what} of line {move.line} is too short for the cutter (radius {radius:.4f}): inside corners take more"
        " than its length, and the cutter would gouge; take a smaller cutter or a wider contour"
    )
