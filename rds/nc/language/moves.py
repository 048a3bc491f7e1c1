"""G0 to G3, threads, G28 and G30: from axis words to canonical moves; the rarer motions by their own files."""

from __future__ import annotations

import math
from collections.abc import Callable

from rds.nc.language.arcs import AXES_OF, by_centre, by_radius, centre_offsets, swept
from rds.nc.language.blocks import AXES, CYCLES, NON_MODAL, PROBES, TURNING, Block
from rds.nc.language.canon import ARC, FEED, TRAVERSE
from rds.nc.language.context import Context, check_feed
from rds.nc.language.cycles import cycle
from rds.nc.language.expressions import Fault
from rds.nc.language.offsets import home_of, minus
from rds.nc.language.probing import probe
from rds.nc.language.splines import control_point, spline
from rds.nc.language.state import INVERSE_TIME, NO_MOTION, PLANES
from rds.nc.language.targets import in_machine_coordinates, target
from rds.nc.language.threading_cycle import threading
from rds.nc.language.tool_centre import check_placed

STANDING = 1e-7  # a move shorter than this in X, Y and Z is one of the rotary axes
SLOWEST_INVERSE = 0.1  # units/min; LinuxCNC makes no slower move in inverse time


def move(m: Context, block: Block) -> None:
    """The block's motion. Raises Fault."""
    code = block.motion
    if m.state.unplaced:
        check_placed(m, block)
    if code in CYCLES:
        cycle(m, block)
        return
    m.state.cycle_series = 0
    if code == 10:
        feed(m, block)
    elif code == 0:
        traverse(m, block)
    elif code in (20, 30):
        arc(m, block, code)
    elif code == NO_MOTION:
        m.out.comment("interpreter: motion mode set to none")
        m.state.motion = NO_MOTION
    else:
        _RARE[code](m, block)


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

    # as in LinuxCNC, the motion in force before stays in force: each spline has its own word


def thread(m: Context, block: Block) -> None:
    """G33: a move synchronized with the spindle, K for each turn. G33.1: rigid tapping, and back."""
    state, words = m.state, block.words
    name = f"G{block.motion / 10:g}"
    key = f"g{block.motion}"
    _check_turning(m, block, name)
    if "k" not in words:
        raise Fault(f"{name} without K; write the way for each turn of the spindle", key)
    state.arc_allowed, state.motion = 1, block.motion
    end = target(state, words)
    m.out.call("START_SPEED_FEED_SYNC", words["k"], 0)
    if block.motion == 330:
        m.out.straight(FEED, tuple(end))  # type: ignore[arg-type]
        state.move_to(end)
    else:
        m.out.call("RIGID_TAP", *end[:3], max(1.0, words.get("i", 1.0)))
        state.a, state.b, state.c = end[3:]
    m.out.call("STOP_SPEED_FEED_SYNCH")


def _check_turning(m: Context, block: Block, name: str) -> None:
    if m.state.comp_side:
        raise Fault(f"{name} does not go with cutter compensation; write G40 before", f"g{block.motion}")
    if not m.state.spindle:
        raise Fault(f"the spindle stands still; {name} follows it: write S and M3 or M4 before", f"g{block.motion}")


def _turns(m: Context, block: Block) -> None:
    from rds.nc.language.turning_cycles import turning_cycle  # only lathe programs need it

    turning_cycle(m, block, target(m.state, block.words))


def _threads_of(m: Context, block: Block) -> None:
    threading(m, block, target(m.state, block.words))


_RARE: dict[int, Callable[[Context, Block], None]] = {
    50: spline,
    51: spline,
    52: control_point,
    330: thread,
    331: thread,
    760: _threads_of,
    **dict.fromkeys(PROBES, probe),
    **dict.fromkeys(TURNING, _turns),
}
