"""G0, G1, G2, G3, G28 and G30: from axis words to canonical moves."""

from __future__ import annotations

import math

from rds.nc.language.arcs import AXES_OF, by_centre, by_radius, centre_offsets, swept
from rds.nc.language.blocks import AXES, NON_MODAL, Block
from rds.nc.language.canon import ARC, FEED, TRAVERSE
from rds.nc.language.context import Context, given, rotate
from rds.nc.language.expressions import Fault
from rds.nc.language.offsets import home_of, minus, plus
from rds.nc.language.state import INVERSE_TIME, NO_MOTION, PER_MINUTE, PER_REVOLUTION, PLANES, State

STANDING = 1e-7  # a move shorter than this in X, Y and Z is one of the rotary axes
SLOWEST_INVERSE = 0.1  # units/min; LinuxCNC makes no slower move in inverse time


def move(m: Context, block: Block) -> None:
    """The block's motion. Raises Fault."""
    code = block.motion
    if code == 10:
        feed(m, block)
    elif code == 0:
        traverse(m, block)
    elif code == NO_MOTION:
        m.out.comment("interpreter: motion mode set to none")
        m.state.motion = NO_MOTION
    else:
        arc(m, block, code)


def target(state: State, words: dict[str, float]) -> list[float]:
    """Where the axis words lead to from the present position."""
    end = [state.x, state.y, state.z, state.a, state.b, state.c]
    if state.absolute:
        for index, letter in enumerate(AXES):
            if letter in words:
                end[index] = words[letter]
    else:
        for index, letter in enumerate(AXES):
            if letter in words:
                end[index] += words[letter]
    return end


def in_machine_coordinates(m: Context, words: dict[str, float]) -> list[float]:
    """G53: the axis words are positions in the machine's coordinates; other axes stay where they are."""
    state = m.state
    end = plus(state.position(), state.axis_offset)
    rotate(end, state.rotation)
    for index, value in given(words):
        tool = state.tool_offset[index] if index < 3 else 0.0
        end[index] = value - state.origin[index] - tool
    rotate(end, -state.rotation)
    end = minus(end, state.axis_offset)
    for index, value in enumerate(state.position()):
        if index > 1 and AXES[index] not in words:
            end[index] = value
    return end


def check_feed(m: Context, words: dict[str, float], key: str) -> None:
    """Raises Fault when a move by feed has no feed rate, and the machine's default is not to be taken."""
    state = m.state
    if state.feed_mode == INVERSE_TIME:
        if "f" not in words:
            raise Fault("in inverse time (G93) every move by feed needs F on its line, 1/minutes; add it", key)
    elif state.feed_rate == 0.0:
        if m.dialect.default_feed and state.feed_mode == PER_MINUTE:
            return
        unit = "units per revolution" if state.feed_mode == PER_REVOLUTION else "units per minute"
        raise Fault(f"no feed rate is set; write F, in {unit}", key)
    elif state.feed_mode == PER_REVOLUTION and state.speed == 0.0:
        raise Fault("a feed per revolution (G95) and the spindle's speed is 0; write S", key)


def _end(m: Context, block: Block) -> list[float]:
    if block.g.get(NON_MODAL) == 530:
        if m.out.compensation is not None:
            raise Fault("G53 while the cutter is compensated; write it after G40", "g530")
        return in_machine_coordinates(m, block.words)
    return target(m.state, block.words)


def traverse(m: Context, block: Block) -> None:
    """G0."""
    state = m.state
    state.motion = 0
    end = _end(m, block) if block.g else target(state, block.words)
    if m.out.compensation is None and m.leaving is None:
        m.out.straight(TRAVERSE, tuple(end))  # type: ignore[arg-type]
    else:
        _compensated(m, True, end)
    state.arc_allowed = 1
    state.x, state.y, state.z, state.a, state.b, state.c = end


def feed(m: Context, block: Block) -> None:
    """G1."""
    state = m.state
    check_feed(m, block.words, "g10")
    state.motion = 10
    end = _end(m, block) if block.g else target(state, block.words)
    if state.feed_mode == INVERSE_TIME:
        _set_inverse(m, _length(state.position(), end), block.words["f"])
    if m.out.compensation is None and m.leaving is None:
        m.out.straight(FEED, tuple(end))  # type: ignore[arg-type]
    else:
        _compensated(m, False, end)
    state.arc_allowed = 1
    state.x, state.y, state.z, state.a, state.b, state.c = end


def _compensated(m: Context, rapid: bool, end: list[float]) -> None:
    """A straight move while the cutter is compensated, or the first one after."""
    state, out = m.state, m.out
    first, second, third = AXES_OF[state.plane]
    ordered = end[first], end[second], end[third]
    if out.compensation is not None:
        rotary = end[3], end[4], end[5]
        out.put(out.compensation.straight(rapid, ordered, rotary, out.line, (out.digits, out.n)))
        return
    if m.leaving is not None:
        _leave(m, rapid, end)
    out.straight(TRAVERSE if rapid else FEED, tuple(end))  # type: ignore[arg-type]


def _leave(m: Context, rapid: bool, end: list[float]) -> None:
    """The first move after G40 must get the cutter away from the contour. Raises ProgramError."""
    compensation, m.leaving = m.leaving, None
    if compensation is not None:
        start = m.state.position()
        first, second, third = AXES_OF[PLANES.index(compensation.plane)]
        goal = end[first], end[second], end[third]
        compensation.leave(rapid, (start[first], start[second]), goal, m.out.line, m.dialect.any_exit)


def _length(start: list[float], end: list[float]) -> float:
    """Of a straight move: in X Y Z, or, when these stand still, in A B C."""
    ways = minus(end, start)
    if any(abs(way) > STANDING for way in ways[:3]):
        return math.sqrt(ways[0] ** 2 + ways[1] ** 2 + ways[2] ** 2)
    return math.sqrt(ways[3] ** 2 + ways[4] ** 2 + ways[5] ** 2)


def _set_inverse(m: Context, length: float, inverse: float) -> None:
    m.state.feed_rate = max(SLOWEST_INVERSE, length * inverse)
    m.out.rate(m.state.feed_rate)


def arc(m: Context, block: Block, code: int) -> None:
    """G2 (20), G3 (30)."""
    state, out, words = m.state, m.out, block.words
    key = f"g{code}"
    if not state.arc_allowed:
        raise Fault("the move after G40 must be straight; write G0 or G1 before the arc", key)
    offsets = centre_offsets(words, state, key)
    check_feed(m, words, key)
    end = target(state, words)
    state.motion = code
    first, second, third = AXES_OF[state.plane]
    start = state.position()
    begin, goal = (start[first], start[second]), (end[first], end[second])
    clockwise = code == 20
    if offsets is None:
        centre = by_radius(begin, goal, words["r"], clockwise, state)
    else:
        try:
            centre = by_centre(begin, goal, offsets, state)
        except Fault as fault:
            fault.key = next(letter for letter in words if letter in "ijk")
            raise
    turns = round(words.get("p", 1.0))
    if clockwise:
        turns = -turns
    if state.feed_mode == INVERSE_TIME:
        flat = math.hypot(centre[0] - begin[0], centre[1] - begin[1]) * swept(begin, centre, turns, goal)
        rise = end[third] - start[third]
        _set_inverse(m, math.hypot(flat, rise) if rise else abs(flat), words["f"])
    rotary = end[3], end[4], end[5]
    if out.compensation is None:
        out.row(ARC, (*goal, *centre, float(turns), end[third], *rotary))
    else:
        ordered = end[first], end[second], end[third]
        out.put(out.compensation.arc(ordered, centre, turns, rotary, out.line, (out.digits, out.n)))
    state.x, state.y, state.z, state.a, state.b, state.c = end


def home(m: Context, block: Block, code: int) -> None:
    """G28, G30: by the point given to the reference point, with the axes given (all, when none is)."""
    state, words = m.state, block.words
    if state.comp_side:
        raise Fault("it cannot be used while the cutter is compensated; write it after G40", f"g{code}")
    end = target(state, words)
    _leave(m, True, end)
    m.out.straight(TRAVERSE, tuple(end))  # type: ignore[arg-type]
    state.move_to(end)
    goal = home_of(m, code)
    if any(letter in words for letter in AXES):
        goal = [goal[index] if letter in words else end[index] for index, letter in enumerate(AXES)]
    m.out.straight(TRAVERSE, tuple(goal))  # type: ignore[arg-type]
    state.move_to(goal)
