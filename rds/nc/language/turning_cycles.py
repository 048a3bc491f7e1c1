"""G70 to G72 on a lathe: roughing (G71 along Z, G72 along X) and finishing (G70) along the contour of a subroutine.

The words mean what LinuxCNC documents. The cuts are our own: layers of I, each as far as the contour and its
allowance D let it, pockets after what lies before them, and at the end one cut along the contour, which takes the steps
away. Rapids stay where an earlier cut has been, or above the start.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise

from rds.nc.language.blocks import Block
from rds.nc.language.canon import ARC, FEED, TRAVERSE
from rds.nc.language.context import INCH, Context, check_feed
from rds.nc.language.expressions import Fault
from rds.nc.language.state import INVERSE_TIME, XZ
from rds.nc.language.turning_contour import (
    CHORD,
    Frame,
    Piece,
    Point,
    frame_of,
    profile,
    raised,
    without_needless,
    without_pockets,
)

_INCREMENT, _RETRACT = 1.0, 0.5  # I and R where the line leaves them out, as in LinuxCNC
_LAYERS_MOST = 10_000
_TINY = 1e-9


def turning_cycle(m: Context, block: Block, end: list[float]) -> None:
    """G70, G71, G71.1, G71.2, G72, G72.1, G72.2 with Q; `end` is where X and Z of the line lead to. Raises Fault."""
    code, words = block.motion, block.words
    key = f"g{code}"
    name = f"G{code / 10:g}"
    state = m.state
    _check(m, block, name, key)
    number = words["q"]
    if number < 0.0 or number != int(number):
        raise Fault(f"Q{number:g} is no subroutine's number; write that of the contour's: O100 SUB, Q100", "q")
    state.arc_allowed, state.motion = 1, 10
    if "x" in words or "z" in words:
        m.out.straight(TRAVERSE, tuple(end))  # type: ignore[arg-type]
        state.move_to(end)
    pieces = m.contour(str(int(number)))
    if not pieces:
        raise Fault(f"the contour {number:g} has no moves; write them as G0, G1, G2 and G3 in X and Z", "q")
    start = state.z, state.x
    try:
        if code == 700:
            _finish(m, words, pieces, start)
        else:
            _rough(m, words, pieces, start, code)
    except Fault as fault:
        fault.key = fault.key or key
        raise


def _check(m: Context, block: Block, name: str, key: str) -> None:
    state, words = m.state, block.words
    if "q" not in words:
        units = {"G70": "; where it says that lengths are in inches (Mach3), write G20"}
        units["G71"] = "; where it says that lengths are in mm (Mach3, Siemens), write G21"
        raise Fault(
            f"{name} without Q; write the number of the subroutine that holds the contour: O100 SUB, its moves, O100"
            f" ENDSUB, and {name} Q100{units.get(name, '')}",
            key,
        )
    if state.plane != XZ:
        raise Fault(f"{name} works in the plane of Z and X only; write G18 on a line before", key)
    if state.comp_side or m.out.compensation is not None or m.leaving is not None:
        raise Fault(f"{name} does not go with cutter compensation; write G40 and a move before", key)
    if state.feed_mode == INVERSE_TIME:
        raise Fault(f"{name} does not go with inverse time (G93); write G94 or G95, and F, before", key)
    check_feed(m, words, key)
    for letter in "abcy":
        if letter in words:
            raise Fault(f"{letter.upper()} does not go with {name}; move it on a line before", letter)
    for letter in "de":
        if words.get(letter, 0.0) < 0.0:
            raise Fault(f"a distance of {words[letter]:g} to the contour is negative; write one from 0", letter)
    if words.get("i", 1.0) <= 0.0:
        raise Fault("I, the depth of each cut, must be above 0", "i")
    if words.get("r", 0.0) < 0.0:
        raise Fault("R, the way back out of a cut, is negative; write one from 0", "r")
    passes = words.get("p", 1.0)
    if passes < 1.0 or passes != int(passes):
        raise Fault(f"P{passes:g} passes; write a whole number from 1", "p")


class _Tool:
    """Moves of the cycle, told in (u, v)."""

    def __init__(self, m: Context, frame: Frame):
        self._m, self._frame = m, frame
        self.at = frame.inside((m.state.z, m.state.x))

    def rapid(self, u: float, v: float) -> None:
        self._go(TRAVERSE, (u, v))

    def cut(self, u: float, v: float) -> None:
        self._go(FEED, (u, v))

    def along(self, points: list[Point]) -> None:
        for point in points:
            self._go(FEED, point)

    def follow(self, piece: Piece) -> None:
        """A piece of the contour itself, arcs as arcs; the tool is at its start."""
        state = self._m.state
        (z, x), centre = piece.end, piece.centre
        if centre is None:
            self._go(FEED, self._frame.inside(piece.end))
            return
        self._m.out.row(ARC, (z, x, *centre, float(piece.turns), state.y, state.a, state.b, state.c))
        state.z, state.x = z, x
        self.at = self._frame.inside(piece.end)

    def _go(self, kind: int, place: Point) -> None:
        if math.dist(place, self.at) <= _TINY:
            return
        self.at = place
        state = self._m.state
        state.z, state.x = self._frame.outside(place)
        self._m.out.straight(kind, (state.x, state.y, state.z, state.a, state.b, state.c))


# -- roughing ----------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class _Layer:
    """A cut: where material stands above the contour at height v, from u `begin` to `end`, and what lies below it."""

    v: float
    begin: float
    end: float
    outer: bool  # it is open towards the start
    below: list[_Layer] = field(default_factory=list)


def _rough(m: Context, words: dict[str, float], pieces: list[Piece], start: Point, code: int) -> None:
    along_z, way = code < 720, code % 10
    chord = _chord(m)
    frame = frame_of(pieces, start, along_z, chord)
    points = profile(pieces, frame, chord)
    (u_start, top), (first, height) = frame.inside(start), points[0]
    u_start = min(u_start, first)
    allowance = words.get("d", 0.0)
    closing = points[-1][1] < top - _TINY  # behind the contour's end the material stays
    points = [*([(u_start, height)] if u_start < first else []), *points, *([(points[-1][0], top)] if closing else [])]
    limit = _up_to(raised(points, allowance, chord), top)
    open_limit = without_pockets(limit)
    pockets = max(v for _, v in open_limit) > min(v for _, v in limit) and open_limit != without_needless(limit)
    used = open_limit if way == 1 else limit
    depth, back = words.get("i", _INCREMENT), words.get("r", _RETRACT)
    if (top - min(v for _, v in used)) / depth > _LAYERS_MOST:
        raise Fault(f"cuts of {depth:g} would be more than {_LAYERS_MOST:,}; write a larger I", "i")
    tool = _Tool(m, frame)
    layers = _layers(used, top, depth)
    if way == 2:
        _contour_cut(tool, open_limit, u_start, top, in_material=True)
        layers = _pockets(layers)
    for layer in layers:
        tool.rapid(tool.at[0], max(top, tool.at[1]))
        _cut(tool, layer, used, u_start, top, depth, back)
    tool.rapid(tool.at[0], max(top, tool.at[1]))
    if allowance or (way == 1 and pockets):
        _contour_cut(tool, used, u_start, top)
        return
    tool.rapid(u_start, max(top, tool.at[1]))
    tool.rapid(u_start, height)
    tool.cut(first, height)
    for piece in pieces:
        tool.follow(piece)
    if closing:
        tool.cut(tool.at[0], top)


def _contour_cut(tool: _Tool, points: list[Point], u_start: float, top: float, in_material: bool = False) -> None:
    """One cut along the chords, from the start of the cycle on; `in_material`: an earlier cycle's rest may be there."""
    tool.rapid(tool.at[0], max(top, tool.at[1]))
    tool.rapid(u_start, tool.at[1])
    (tool.cut if in_material else tool.rapid)(*points[0])
    tool.along(points[1:])


def _up_to(points: list[Point], top: float) -> list[Point]:
    """The chords without what their end has above the height `top`."""
    last = max((k for k, point in enumerate(points) if point[1] < top - _TINY), default=len(points) - 1)
    kept = points[: last + 1]
    if last + 1 < len(points):
        left, right = points[last], points[last + 1]
        share = (top - left[1]) / (right[1] - left[1])
        kept.append((left[0] + share * (right[0] - left[0]), top))
    return kept


def _layers(points: list[Point], top: float, depth: float) -> list[_Layer]:
    """The cuts at top - depth, top - 2 depth..., each below the one that it lies in."""
    lowest = min(v for _, v in points)
    first: list[_Layer] = []
    above: list[_Layer] | None = None
    number = 1
    while (height := top - number * depth) > lowest + _TINY:
        here = _open_at(points, height)
        if above is None:
            first = here
        else:
            for layer in here:
                holder = next(
                    over for over in above if over.begin <= layer.begin + _TINY and layer.end <= over.end + _TINY
                )
                holder.below.append(layer)
        above = here
        number += 1
    return first


def _open_at(points: list[Point], height: float) -> list[_Layer]:
    """Where the chords lie below the height."""
    found: list[_Layer] = []
    begin = points[0][0] if points[0][1] < height - _TINY else None
    outer = begin is not None
    for (u, v), (to_u, to_v) in pairwise(points):
        is_open = to_v < height - _TINY
        if is_open == (begin is not None):
            continue
        crossing = u + (height - v) / (to_v - v) * (to_u - u)
        if begin is None:
            begin = crossing
        else:
            found.append(_Layer(height, begin, crossing, outer))
            begin, outer = None, False
    if begin is not None:
        found.append(_Layer(height, begin, points[-1][0], outer))
    return found


def _pockets(layers: list[_Layer]) -> list[_Layer]:
    """The uppermost layers that are not open towards the start."""
    found: list[_Layer] = []
    waiting = layers[::-1]
    while waiting:
        layer = waiting.pop()
        if layer.outer:
            waiting += layer.below[::-1]
        else:
            found.append(layer)
    return found


def _cut(
    tool: _Tool, layer: _Layer, points: list[Point], u_start: float, top: float, depth: float, back: float
) -> None:
    """A layer and all below it; the tool is in the layer above it, or above the start."""
    waiting = [layer]
    while waiting:
        layer = waiting.pop()
        clear = min(layer.v + depth, top)  # what lies between this layer and the one above has been cut down to here
        tool.rapid(tool.at[0], max(clear, tool.at[1]))
        if layer.outer:
            tool.rapid(u_start, tool.at[1])
            tool.rapid(u_start, layer.v)
        else:
            flank = _flank(points, layer, clear)
            tool.rapid(flank[0][0], tool.at[1])
            tool.cut(*flank[0])
            tool.along(flank[1:])
        tool.cut(layer.end, layer.v)
        out = min(back, (layer.end - layer.begin) / 2.0)
        tool.rapid(layer.end - out, layer.v + out)
        waiting += layer.below[::-1]


def _flank(points: list[Point], layer: _Layer, clear: float) -> list[Point]:
    """The contour on its way down to where the layer begins, from the height `clear` or its last summit on."""
    found = [(layer.begin, layer.v)]
    reached = (k for k, (u, v) in enumerate(points) if u <= layer.begin + _TINY and v >= layer.v - _TINY)
    last = max(reached, default=-1)
    for k in range(last, -1, -1):
        u, v = points[k]
        if v < found[-1][1] - _TINY:
            break
        if v > clear:
            down = found[-1]
            share = (clear - down[1]) / (v - down[1])
            found.append((down[0] + share * (u - down[0]), clear))
            break
        found.append((u, v))
    return found[::-1]


# -- finishing ---------------------------------------------------------------------------------------------------------


def _finish(m: Context, words: dict[str, float], pieces: list[Piece], start: Point) -> None:
    """G70: P cuts along the contour, from D to E above it in equal steps."""
    count, first, last = int(words.get("p", 1.0)), words.get("d", 0.0), words.get("e", 0.0)
    distances = [(number - 1) * (first - last) / count + last for number in range(count, 0, -1)]
    chord = _chord(m)
    frame, points = _frame(pieces, start, chord)
    tool = _Tool(m, frame)
    begin = tool.at
    for number, distance in enumerate(distances):
        if number:
            tool.rapid(*begin)
        if distance == 0.0:
            tool.rapid(*frame.inside(pieces[0].start))
            for piece in pieces:
                tool.follow(piece)
        else:
            chords = raised(points, distance, chord)
            tool.rapid(*chords[0])
            tool.along(chords[1:])


def _frame(pieces: list[Piece], start: Point, chord: float) -> tuple[Frame, list[Point]]:
    """The frame of a finishing cut, along Z where the contour goes one way in Z, and its chords. Raises Fault."""
    for along_z in (True, False):
        with suppress(Fault):
            frame = frame_of(pieces, start, along_z, chord)
            return frame, profile(pieces, frame, chord)
    raise Fault(
        "the contour turns back along Z and along X, or the cycle starts within it; start it outside of the material,"
        " and split a contour that turns back"
    )


def _chord(m: Context) -> float:
    """How far chords may be from an arc, in the program's units."""
    return CHORD / (INCH if m.state.inches else 1.0)
