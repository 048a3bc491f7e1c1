"""Cutter radius compensation (G41, G42, G41.1, G42.1) as a pure machine: programmed moves in, moves of the cutter out.

The moves of one stretch from G41 or G42 to G40 go in one by one; what is certain comes out. A move is held back until
the next one is known, because an inside corner shortens both. What happens is what LinuxCNC does (user manual, "Cutter
Compensation"; its `rs274 -g` is what the tests compare with):

- entry: the first move ends beside the programmed point, one radius off at right angles;
- outside corner: an arc around the programmed corner joins the offset moves (before a G0 a straight traverse does);
- inside corner: both moves are cut off where their offsets cross;
- corners within 0.05 rad of straight on are left as they are;
- a move too short for what its corners take from it would run backward and gouge: refused.

It refuses more than LinuxCNC does, which takes these and gouges:

- a move cut off by more than its length just before an outside corner into an arc, or a move straight on;
- an inside corner right after a stop (M0, M1, M60): the cutter has already stopped in the corner, too deep;
- an entry arc that the cutter could follow only backward;
- a move after G40 that is not longer, in the plane, than the cutter's radius (the manual asks for the diameter).
"""

from __future__ import annotations

import math

from rds.nc.compensation.geometry import (
    Point,
    along,
    arc_arc,
    arc_line,
    entry_centre,
    line_arc,
    line_line,
    sweep,
    unit,
)
from rds.nc.compensation.moves import IN_ORDER, XZ, Element, HeldMoves, Item, Move, Stretch, no_room
from rds.nc.language.canon import ARC, FEED, TRAVERSE, Call
from rds.nc.language.errors import ProgramError

LEFT, RIGHT = 1, -1
STRAIGHT_ON = 0.05  # rad; a corner flatter than this is taken as none
RIGHT_ANGLE = 1e-4  # cosine of the angle between an entry arc's radius and chord below which it has no centre
# Where the centre of the nose stands from the controlled point of a lathe tool, by its orientation: signs of (Z, X).
NOSE = {1: (1, -1), 2: (-1, -1), 3: (-1, 1), 4: (1, 1), 5: (1, 0), 6: (0, -1), 7: (-1, 0), 8: (0, 1)}

Triple = tuple[float, float, float]


class Compensation:
    """The machine: `side` LEFT or RIGHT of the contour, `radius` > 0, `plane` "XY" or "XZ", `start` where the tool is.

    Points are in the plane's order, which is that of canonical arcs: X, Y and Z third in G17; Z, X and Y third in G18.
    Every method returns the rows (tuples of dtype MOTION) and calls that are certain now, in order; `mark` = (digits,
    n) is the word N of the block being executed, which all calls made meanwhile bear, as in LinuxCNC. Raises
    ProgramError without a place. `units`: "MM" or "INCHES". `record`, when given, gets a Stretch with what was
    programmed and what was made of it.
    """

    def __init__(
        self,
        side: int,
        radius: float,
        plane: str,
        start: Triple,
        *,
        units: str = "MM",
        orientation: int = 0,
        record: list[Stretch] | None = None,
    ):
        self.side = side if radius >= 0 else -side  # a negative radius: the other side of the contour
        self.radius = abs(radius)
        self.plane = plane
        self.programmed: Point = start[:2]
        self.height = start[2]
        self.entered = False
        self._line = 0
        self._stopped = False
        self._over = False  # G40 has come
        self._stretch = Stretch(self.side, self.radius, plane, units)
        self._nose = NOSE.get(orientation, (0, 0)) if plane == XZ else (0, 0)
        self._recording = record is not None
        self._queue = HeldMoves(self._stretch, start[:2], self._nose, self._recording)
        if record is not None:
            record.append(self._stretch)

    # -- what the interpreter calls ------------------------------------------------------------------------------------

    def straight(
        self, rapid: bool, end: Triple, rotary: Triple, line: int = 0, mark: tuple[int, int] = (0, 0)
    ) -> list[Item]:
        """G0 or G1 to `end`; `rotary` the ends of A, B, C."""
        self._begin(line, mark)
        kind = TRAVERSE if rapid else FEED
        goal = end[:2]
        if not self.entered:
            self._enter_straight(kind, goal, end[2], rotary)
        elif goal == self.programmed:
            self._programmed("level", kind, goal, end[2])
            self._queue.hold(Move("level", kind, line, self._queue.tool, end[2], rotary))
        else:
            self._straight(kind, goal, end[2], rotary)
        return self._done(end)

    def arc(
        self, end: Triple, centre: Point, turn: int, rotary: Triple, line: int = 0, mark: tuple[int, int] = (0, 0)
    ) -> list[Item]:
        """G2 or G3 to `end` around `centre` (absolute); `turn` + counter-clockwise, one more for each full circle."""
        self._begin(line, mark)
        if self.entered:
            self._arc(end[:2], centre, turn, end[2], rotary)
        else:
            self._enter_arc(end[:2], centre, turn, end[2], rotary)
        return self._done(end)

    def other(self, item: Item) -> list[Item]:
        """A feed rate or speed (row) or a call: passed on at once unless it must keep its place behind held moves."""
        if not self._queue or (isinstance(item, Call) and item.name not in IN_ORDER):
            return [item]
        self._queue.keep(item)
        return []

    def stop(self, line: int = 0, mark: tuple[int, int] = (0, 0)) -> list[Item]:
        """M0, M1, M60, M2, M30: what is held back is made as it is."""
        self._begin(line, mark)
        self._queue.finish()
        self._queue.begin = None
        self._stopped = True
        return self._queue.take()

    def off(self, line: int = 0, mark: tuple[int, int] = (0, 0)) -> list[Item]:
        """G40: what is held back is made. When `entered`, the next motion is to be given to `leave`."""
        items = self.stop(line, mark)
        self._over = True
        return items

    def beside(self) -> Point:
        """How far from the programmed point the tool is that the last move took to it, along the plane's axes."""
        return self._queue.beside(self.programmed)

    def leave(self, rapid: bool, start: Point, end: Triple, line: int = 0, any_exit: bool = False) -> None:
        """Check the first motion after G40, straight from the programmed point `start` to `end`, both in the units and
        offsets of now. With `any_exit` it may be short. The interpreter refuses an arc, as LinuxCNC does.
        """
        goal = end[:2]
        length = math.dist(start, goal)
        if length <= self.radius and not any_exit:
            raise ProgramError(
                f"the exit move is {length:.4f} long in the {self.plane} plane, not longer than the cutter's radius"
                f" {self.radius:.4f}, and would take the cutter's centre back to the contour; after G40 leave it"
                " by a straight move longer than that, before going up"
            )
        if self._recording and start == self.programmed:
            kind = TRAVERSE if rapid else FEED
            self._stretch.cut.append(Element("exit", kind, line, self._queue.made, goal, height=end[2]))

    def scale(self, factor: float, units: str) -> None:
        """G20 or G21 while on: everything in the new units, which are `factor` to an old one."""
        if self._over:
            self._recording = False  # an exit in other units is not recorded
        elif self._recording:
            raise ProgramError("the proof needs one length unit from G41 or G42 to G40; change units before or after")
        self.radius *= factor
        self.height *= factor
        self.programmed = (self.programmed[0] * factor, self.programmed[1] * factor)
        self._queue.scale(factor, units)

    # -- entry ---------------------------------------------------------------------------------------------------------

    def _enter_straight(self, kind: int, goal: Point, height: float, rotary: Triple) -> None:
        start = self._queue.tool
        length = math.dist(start, goal)
        if length <= self.radius:
            raise ProgramError(
                f"the entry move is {length:.4f} long in the {self.plane} plane, not longer than the cutter's radius"
                f" {self.radius:.4f}; start it farther away from the contour"
            )
        self._programmed("entry", kind, goal, height)
        end = along(goal, self._normal(unit(start, goal)), self.radius)
        self._queue.begin = start
        self._queue.hold(Move("entry", kind, self._line, end, height, rotary))
        self.entered = True

    def _enter_arc(self, goal: Point, centre: Point, turn: int, height: float, rotary: Triple) -> None:
        start = self._queue.tool
        chord = math.dist(start, goal)
        if chord <= self.radius:
            raise ProgramError(
                f"the entry arc's ends are {chord:.4f} apart, not more than the cutter's radius {self.radius:.4f};"
                " start it farther away from the contour"
            )
        self._fits(math.dist(centre, start), turn)
        self._programmed("entry", ARC, goal, height, centre, turn)
        end = along(goal, unit(centre, goal), -self.radius if self._inside(turn) else self.radius)
        made, cosine = entry_centre(start, end, unit(end, centre))
        if cosine < RIGHT_ANGLE or made is None:
            raise ProgramError(
                "the cutter could follow this entry arc only backward; take a longer arc, a larger one, or a smaller"
                f" cutter (its radius is {self.radius:.4f})"
            )
        if self._nose != (0, 0):  # the nose's centre moves over the start first, or the arc were none
            self._queue.hold(Move("entry", FEED, self._line, start, self.height, rotary))
            self._queue.begin = start
        move = Move("entry", ARC, self._line, end, height, rotary)
        move.centre, move.turn = made, turn
        move.sweep = sweep(start, made, turn, end)
        self._queue.hold(move)
        self.entered = True

    # -- moves after the entry -----------------------------------------------------------------------------------------

    def _straight(self, kind: int, goal: Point, height: float, rotary: Triple) -> None:
        corner, direction = self.programmed, unit(self.programmed, goal)
        normal = self._normal(direction)
        angle = self._turns_away(direction)
        first = self._queue.first
        around = first is not None and first.kind == ARC and not self._inside(first.turn)
        begin = along(corner, normal, self.radius)
        if angle < -STRAIGHT_ON or angle > math.pi + (-STRAIGHT_ON if around else STRAIGHT_ON):
            self._queue.trim(self._crossing_straight(self._before_corner(), direction, begin), angle)
        elif angle <= STRAIGHT_ON:
            self._queue.finish(wide=True)
        else:
            self._queue.finish()
            if kind == FEED:
                self._around(begin, rotary)
            else:
                self._queue.make(Move("corner", TRAVERSE, self._line, begin, self.height, rotary))
            self._queue.begin = begin
        self._programmed("contour", kind, goal, height)
        move = Move("contour", kind, self._line, along(goal, normal, self.radius), height, rotary)
        move.direction = direction
        self._queue.hold(move)
        self._stopped = False

    def _arc(self, goal: Point, centre: Point, turn: int, height: float, rotary: Triple) -> None:
        corner, inside = self.programmed, self._inside(turn)
        radius = math.dist(centre, goal)
        self._fits(radius, turn)
        outward = unit(centre, corner)
        angle = self._turns_away((-outward[1], outward[0]) if turn > 0 else (outward[1], -outward[0]))
        offset = -self.radius if inside else self.radius
        if angle < -STRAIGHT_ON or angle > math.pi + (STRAIGHT_ON if inside else -STRAIGHT_ON):
            self._queue.trim(self._crossing_arc(self._before_corner(), centre, radius + offset, outward, turn), angle)
        elif angle <= STRAIGHT_ON:
            self._queue.finish(wide=True)
        else:
            self._queue.finish(wide=True)
            begin = along(corner, outward, offset)
            self._around(begin, rotary)
            self._queue.begin = begin
        self._programmed("contour", ARC, goal, height, centre, turn)
        move = Move("contour", ARC, self._line, along(goal, unit(centre, goal), offset), height, rotary)
        move.centre, move.turn = centre, turn
        move.sweep = sweep(corner, centre, turn, goal)
        self._queue.hold(move)
        self._stopped = False

    def _around(self, end: Point, rotary: Triple) -> None:
        """The arc that joins two moves at an outside corner; the rotary axes make their whole way on it."""
        move = Move("corner", ARC, self._line, end, self.height, rotary)
        move.centre, move.turn = self.programmed, -self.side
        self._queue.make(move)

    # -- inside corners ------------------------------------------------------------------------------------------------

    def _before_corner(self) -> Move:
        first = self._queue.first
        if self._stopped or first is None:
            raise ProgramError(
                "the program stopped at this inside corner, where the cutter was already too deep;"
                " stop somewhere else, or round the corner with an arc larger than the cutter"
            )
        return first

    def _crossing_straight(self, before: Move, direction: Point, begin: Point) -> Point:
        if before.kind == ARC:
            radius = math.dist(before.centre, before.end)
            crossing = arc_line(before.centre, radius, begin, direction, self._inside(before.turn))
        else:
            crossing = line_line(self._queue.tool, self._coming(), begin, direction)
        if crossing is None:
            raise no_room(self.radius, before)
        return crossing

    def _crossing_arc(self, before: Move, centre: Point, radius: float, outward: Point, turn: int) -> Point:
        """`radius` is that of the offset arc at its end, `outward` the direction from the centre to the corner."""
        if before.kind == ARC:
            old = math.dist(before.centre, before.end)
            if old == 0 or before.centre == centre:
                raise ProgramError("two arcs around one centre meet at an inside corner; make them one arc")
            crossing = arc_arc(before.centre, old, centre, radius, self._inside(before.turn) == (turn > 0))
        else:
            # As in LinuxCNC, an arc whose end is off its circle draws the line with it onto the circle of its end.
            programmed = radius + (self.radius if self._inside(turn) else -self.radius)
            aside = programmed - math.dist(centre, self.programmed)
            coming_from = along(self._queue.tool, outward, aside)
            crossing = line_arc(coming_from, self._coming(), centre, radius, self._inside(turn))
        if crossing is None:
            raise no_room(self.radius, before)
        return crossing

    # -- small things --------------------------------------------------------------------------------------------------

    def _coming(self) -> Point:
        """The direction in which the cutter comes to the programmed corner."""
        off = unit(self.programmed, self._queue.tool)
        return (off[1] * self.side, -off[0] * self.side)

    def _turns_away(self, direction: Point) -> float:
        """By how much the path turns away from the cutter, rad in [-π/2, 3π/2): + outside corner, - inside corner."""
        coming = self._coming()
        turned = math.atan2(coming[1], coming[0]) - math.atan2(direction[1], direction[0])
        return (turned * self.side + math.pi / 2) % (2 * math.pi) - math.pi / 2

    def _normal(self, direction: Point) -> Point:
        return (-direction[1] * self.side, direction[0] * self.side)

    def _inside(self, turn: int) -> bool:
        """Is the cutter inside an arc that turns so?"""
        return (turn > 0) == (self.side == LEFT)

    def _fits(self, radius: float, turn: int) -> None:
        if self._inside(turn) and radius <= self.radius:
            raise ProgramError(
                f"the cutter's radius {self.radius:.4f} is not less than the arc's radius {radius:.4f};"
                " take a smaller cutter or a larger arc"
            )

    def _begin(self, line: int, mark: tuple[int, int]) -> None:
        self._line = line
        self._queue.mark = mark

    def _done(self, end: Triple) -> list[Item]:
        self.programmed, self.height = end[:2], end[2]
        return self._queue.take()

    def _programmed(
        self, role: str, kind: int, goal: Point, height: float, centre: Point = (0.0, 0.0), turn: int = 0
    ) -> None:
        if self._recording:
            element = Element(role, kind, self._line, self.programmed, goal, centre, turn, height)
            self._stretch.programmed.append(element)
