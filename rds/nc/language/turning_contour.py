"""The contour of a turned part, from the moves of its subroutine: lines and arcs, and what lies an allowance above it.

Points are pairs (z, x) of the program's coordinates until `Frame` turns them into (u, v): u along the way that the
contour runs, v out of the material, towards the start of the cycle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rds.nc.language.arcs import swept
from rds.nc.language.expressions import Fault

CHORD = 0.0005  # mm; how far the chords that stand for an arc are from it
NEAR = 1e-9  # lengths that are none
_BACK = 2.0  # chords' distances that a contour may turn back by: 0.001 mm, as in LinuxCNC
_FINEST = 1e-6  # mm; how near two chords of an allowance meet
_CHORDS_LEAST = 8  # of an arc

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Piece:
    """A line or, with a centre, an arc of the contour. `turns`: 1 counter-clockwise from z to x (G3), -1 clockwise."""

    start: Point
    end: Point
    centre: Point | None = None
    turns: int = 0
    line: int = 0  # of the program

    def points(self, chord: float) -> list[Point]:
        """Points along the piece, its start left away, with chords within `chord` of it."""
        if self.centre is None:
            return [self.end]
        radius = math.dist(self.centre, self.start)
        sweep = swept(self.start, self.centre, self.turns, self.end)
        step = 2.0 * math.acos(max(0.0, 1.0 - chord / radius))
        count = max(_CHORDS_LEAST, math.ceil(abs(sweep) / step))
        first = math.atan2(self.start[1] - self.centre[1], self.start[0] - self.centre[0])
        angles = (first + sweep * k / count for k in range(1, count))
        on = [(self.centre[0] + radius * math.cos(a), self.centre[1] + radius * math.sin(a)) for a in angles]
        return [*on, self.end]


@dataclass(frozen=True, slots=True)
class Corner:
    """What a contour's word A (fillet) or C (chamfer) asks for at the end of a piece."""

    size: float
    round: bool


def with_corners(pieces: list[Piece], corners: dict[int, Corner]) -> list[Piece]:
    """The contour with fillets and chamfers put in behind the pieces of these indices. Raises Fault."""
    found: list[Piece] = []
    begins: Point | None = None
    for index, piece in enumerate(pieces):
        piece = piece if begins is None else replace(piece, start=begins)
        begins = None
        corner = corners.get(index)
        if corner is None:
            found.append(piece)
            continue
        following = pieces[index + 1] if index + 1 < len(pieces) else None
        if following is None or piece.centre is not None or following.centre is not None:
            raise Fault(
                f"line {piece.line} of the contour: A (fillet) and C (chamfer) stand between two straight moves; write"
                " the corner as a move of its own"
            )
        way, centre, turns = _fillet(piece, following, corner.size)
        here = piece.end
        back, on = _direction(piece.end, piece.start), _direction(following.start, following.end)
        leaves = (here[0] + way * back[0], here[1] + way * back[1])
        begins = (here[0] + way * on[0], here[1] + way * on[1])
        found.append(replace(piece, end=leaves))
        if corner.round:
            found.append(Piece(leaves, begins, centre, turns, piece.line))
        else:
            found.append(Piece(leaves, begins, line=piece.line))
    return found


def _direction(start: Point, end: Point) -> Point:
    length = math.dist(start, end)
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length


def _fillet(piece: Piece, following: Piece, radius: float) -> tuple[float, Point, int]:
    """How far from the corner a fillet begins and ends, its centre and its sense. Raises Fault."""
    where = f"line {piece.line} of the contour"
    if radius <= 0.0:
        raise Fault(f"{where}: a fillet or chamfer of {radius:g}; write A or C above 0")
    into, out = _direction(piece.start, piece.end), _direction(following.start, following.end)
    cross, along = into[0] * out[1] - into[1] * out[0], into[0] * out[0] + into[1] * out[1]
    if abs(cross) < 1e-6:
        raise Fault(f"{where}: no corner for A or C, since the moves lie in one direction; leave the word away")
    way = radius * math.tan(math.atan2(abs(cross), along) / 2.0)
    room = min(math.dist(piece.start, piece.end), math.dist(following.start, following.end))
    if way > room * (1.0 + NEAR):
        raise Fault(
            f"{where}: a corner of {radius:g} needs {way:.4g} of moves that are {room:.4g} long; make it smaller"
        )
    turns = 1 if cross > 0.0 else -1
    leaves = piece.end[0] - way * into[0], piece.end[1] - way * into[1]
    return way, (leaves[0] - turns * radius * into[1], leaves[1] + turns * radius * into[0]), turns


@dataclass(frozen=True, slots=True)
class Frame:
    """From (z, x) to (u, v) and back: u along Z (turning) or along X (facing), and the signs of both."""

    along_z: bool
    u_sign: float
    v_sign: float

    def inside(self, point: Point) -> Point:
        z, x = point
        return (self.u_sign * z, self.v_sign * x) if self.along_z else (self.u_sign * x, self.v_sign * z)

    def outside(self, point: Point) -> Point:
        u, v = self.u_sign * point[0], self.v_sign * point[1]
        return (u, v) if self.along_z else (v, u)


def frame_of(pieces: list[Piece], start: Point, along_z: bool, chord: float) -> Frame:
    """The frame in which the contour runs towards +u and the start lies at its top. Raises Fault."""
    u, v = (0, 1) if along_z else (1, 0)
    way = pieces[-1].end[u] - pieces[0].start[u]
    heights = [end[v] for piece in pieces for end in (piece.start, *piece.points(chord))]
    slack = 1e-6 * (1.0 + abs(start[v]))
    if start[v] >= max(heights) - slack:
        side = 1.0
    elif start[v] <= min(heights) + slack:
        side = -1.0
    else:
        letter = "X" if along_z else "Z"
        raise Fault(
            f"the cycle starts at {letter}{start[v]:g} (X as a radius) between the contour's ends, {min(heights):g} and"
            f" {max(heights):g}; start it outside of the material, by {letter} on the line or a move before"
        )
    return Frame(along_z, 1.0 if way >= 0.0 else -1.0, side)


def profile(pieces: list[Piece], frame: Frame, chord: float) -> list[Point]:
    """The contour as chords in (u, v), u never falling. Raises Fault where it turns back."""
    found = [frame.inside(pieces[0].start)]
    for piece in pieces:
        for point in map(frame.inside, piece.points(chord)):
            if point[0] < found[-1][0] - _BACK * chord:
                axis, cycle = ("Z", "G71") if frame.along_z else ("X", "G72")
                raise Fault(
                    f"line {piece.line} of the contour turns back along {axis}, by {found[-1][0] - point[0]:.4g};"
                    f" {cycle} cuts contours whose {axis} goes one way: split it into two, each with its own cycle"
                )
            found.append((max(point[0], found[-1][0]), point[1]))
    return found


def raised(points: list[Point], distance: float, chord: float) -> list[Point]:
    """What keeps `distance` from everything at and below the chords `points`, from their first u to their last.

    The upper edge of the discs of that radius around the points of the contour: parallels of its chords, and arcs round
    its corners, themselves as chords.
    """
    if distance == 0.0 or len(points) < 2:
        return list(points)
    edge = _Edge(np.array(points), distance, chord)
    places = edge.places()
    found: list[Point] = []
    for left, right in pairwise(places):
        a, b = left + edge.small, right - edge.small
        if b <= a:
            continue
        found += [(left, edge.height(a)[0]), *edge.between(a, b), (right, edge.height(b)[0])]
    return without_needless(found)


class _Edge:
    """The upper edge of a contour thickened by `distance`, as a function of u."""

    def __init__(self, points: np.ndarray, distance: float, chord: float):
        start, end = points[:-1], points[1:]
        way = end - start
        length = np.hypot(way[:, 0], way[:, 1])
        slanted = way[:, 0] > NEAR
        normal = np.stack([-way[slanted, 1], way[slanted, 0]], axis=1) / length[slanted, None] * distance
        self.start, self.end = start[slanted] + normal, end[slanted] + normal  # the parallels
        self.corners, self.distance = points, distance
        self.first, self.last = points[0, 0], points[-1, 0]
        self.chord, self.small = chord, 1e-7

    def places(self) -> list[float]:
        """Where the edge may have a corner or a step, ascending."""
        step = 2.0 * math.acos(max(0.0, 1.0 - self.chord / self.distance))
        count = max(_CHORDS_LEAST, math.ceil(math.pi / step))
        round_it = self.distance * np.cos(np.pi * np.arange(count + 1) / count)
        turn = np.diff(self.corners, axis=0)
        heading = np.unwrap(np.arctan2(turn[:, 1], turn[:, 0]))
        sharp = np.concatenate([[True], np.abs(np.diff(heading)) > step, [True]])
        corners = (self.corners[sharp, 0][:, None] + round_it[None, :]).ravel()
        sides = [self.corners[:, 0] - self.distance, self.corners[:, 0] + self.distance]  # where walls have their own
        all_of = np.concatenate([self.start[:, 0], self.end[:, 0], corners, *sides, [self.first, self.last]])
        kept = np.unique(all_of[(all_of >= self.first) & (all_of <= self.last)])
        return kept[np.concatenate([[True], np.diff(kept) > 4.0 * self.small])].tolist()

    def height(self, u: float) -> tuple[float, int]:
        """The edge at u, and which parallel or corner makes it."""
        over = np.where((self.start[:, 0] <= u) & (u <= self.end[:, 0]))[0]
        best, which = -math.inf, -1
        if len(over):
            share = (u - self.start[over, 0]) / (self.end[over, 0] - self.start[over, 0])
            heights = self.start[over, 1] + share * (self.end[over, 1] - self.start[over, 1])
            best, which = float(heights.max()), int(over[heights.argmax()])
        beside = self.corners[:, 0] - u
        near = np.where(np.abs(beside) <= self.distance)[0]
        if len(near):
            heights = self.corners[near, 1] + np.sqrt(self.distance**2 - beside[near] ** 2)
            if heights.max() > best:
                best, which = float(heights.max()), -2 - int(near[heights.argmax()])
        return best, which

    def between(self, left: float, right: float) -> list[Point]:
        """Points between two places, where one parallel or corner takes over from another."""
        (low, one), (high, other) = self.height(left), self.height(right)
        if one == other or right - left < _FINEST:
            return []
        middle = (left + right) / 2.0
        at, _ = self.height(middle)
        if abs(at - (low + high) / 2.0) < self.chord / 10.0:
            return []
        return [*self.between(left, middle), (middle, at), *self.between(middle, right)]


def without_needless(points: list[Point], off: float = 1e-7) -> list[Point]:
    """The chords without points that lie, within `off`, on the line between their neighbours."""
    found: list[Point] = []
    for point in points:
        if found and math.dist(found[-1], point) <= off:
            continue
        while len(found) > 1 and _beside(found[-2], found[-1], point) <= off:
            found.pop()
        found.append(point)
    return found


def _beside(start: Point, middle: Point, end: Point) -> float:
    way = end[0] - start[0], end[1] - start[1]
    length = math.hypot(*way)
    return abs(way[0] * (middle[1] - start[1]) - way[1] * (middle[0] - start[0])) / length if length else 0.0


def without_pockets(points: list[Point]) -> list[Point]:
    """The chords with everything filled that lies behind something higher, seen from the start."""
    found = [points[0]]
    for left, right in pairwise(points):
        top = found[-1][1]
        if right[1] <= top:
            found.append((right[0], top))
        else:
            if left[1] < top:
                share = (top - left[1]) / (right[1] - left[1])
                found.append((left[0] + share * (right[0] - left[0]), top))
            found.append(right)
    return without_needless(found)
