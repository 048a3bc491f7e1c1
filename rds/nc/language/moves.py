"""G0 to G3, splines, threads, probing, G28 and G30: from axis words to canonical moves."""

from __future__ import annotations

import math
from collections.abc import Callable

from rds.nc.language.arcs import AXES_OF, by_centre, by_radius, centre_offsets, swept
from rds.nc.language.blocks import AXES, CYCLES, NON_MODAL, PROBES, TURNING, Block
from rds.nc.language.canon import ARC, FEED, TRAVERSE
from rds.nc.language.context import Context, check_feed, given, rotate
from rds.nc.language.cycles import cycle
from rds.nc.language.expressions import Fault
from rds.nc.language.offsets import home_of, in_machine, minus, plus
from rds.nc.language.parameters import PROBED
from rds.nc.language.state import INVERSE_TIME, NO_MOTION, PER_REVOLUTION, PLANES, XY, State
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
    if "@" in words or "^" in words:
        _polar(state, words, end)
    return end


def _polar(state: State, words: dict[str, float], end: list[float]) -> None:
    """@ (radius) and ^ (angle) about the origin of the coordinates instead of X and Y; in G91 both count from the
    tool's place. Raises Fault.
    """
    key = "@" if "@" in words else "^"
    x, y = end[0], end[1]
    if x == 0.0 and y == 0.0 and (not state.absolute or "^" not in words):
        raise Fault(f"{key} counts from the tool's place, which is the origin; write X and Y, or @ and ^", key)
    if state.absolute:
        radius = words["@"] if "@" in words else math.hypot(y, x)
        angle = words["^"] * math.pi / 180.0 if "^" in words else math.atan2(y, x)
        end[0], end[1] = radius * math.cos(angle), radius * math.sin(angle)
        return
    if "@" in words:
        angle, radius = math.atan2(y, x), math.hypot(y, x) + words["@"]
        x, y = radius * math.cos(angle), radius * math.sin(angle)
    if "^" in words:
        angle, radius = math.atan2(y, x) + words["^"] * math.pi / 180.0, math.hypot(y, x)
        x, y = radius * math.cos(angle), radius * math.sin(angle)
    end[0], end[1] = x, y


def in_machine_coordinates(m: Context, words: dict[str, float]) -> list[float]:
    """G53: the axis words are positions in the machine's coordinates; other axes stay where they are."""
    state = m.state
    for letter in "@^":
        if letter in words:
            raise Fault(f"{letter} does not go with G53; write X and Y", letter)
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


def spline(m: Context, block: Block) -> None:
    """G5 (cubic) and G5.1 (quadratic): a Bezier curve in the plane of X and Y; I J and P Q are its inner points."""
    state, words = m.state, block.words
    _check_spline(m, block)
    end = target(state, words)
    start = state.x, state.y
    goal = end[0], end[1]
    if block.motion == 51:
        if "i" not in words or "j" not in words:
            raise Fault("G5.1 needs I and J, the way from the start to the control point; add them", "g51")
        points = [start, (start[0] + words["i"], start[1] + words["j"]), goal]
    else:
        if ("i" in words) != ("j" in words):
            raise Fault("G5 needs both I and J, or (going on from a spline) neither", "g50")
        if "p" not in words or "q" not in words:
            raise Fault("G5 needs P and Q, the way from the end to the second control point; add them", "g50")
        i, j = words.get("i", state.cycle_i), words.get("j", state.cycle_j)
        inner = (start[0] + i, start[1] + j), (goal[0] + words["p"], goal[1] + words["q"])
        points = [start, *inner, goal]
        state.cycle_i, state.cycle_j = -words["p"], -words["q"]
    _curve(m, [(*point, 1.0) for point in points], len(points))
    state.x, state.y = goal
    # as in LinuxCNC, the motion in force before stays in force: each spline has its own word


def _check_spline(m: Context, block: Block) -> None:
    state, words = m.state, block.words
    key = f"g{block.motion}"
    if state.comp_side:
        raise Fault("splines do not go with cutter compensation; write G40 before", key)
    if state.plane != XY:
        raise Fault("splines lie in the plane of G17 only; write it before", key)
    for letter in "zabc":
        if letter in words:
            raise Fault("a spline moves X and Y alone; move the other axes on a line of their own", letter)
    if state.feed_mode == INVERSE_TIME:
        raise Fault("splines do not go with inverse time (G93) here; write G94 and F before", key)
    check_feed(m, words, key)


def _curve(m: Context, points: list[tuple[float, float, float]], order: int) -> None:
    """A curve through control points (x, y, weight): the call has how many they are, then what they are."""
    state = m.state
    held = (state.z, state.a, state.b, state.c)
    m.out.call("NURBS_FEED", len(points), order, tuple(points), held)


def control_point(m: Context, block: Block) -> None:
    """G5.2: another control point of the NURBS that G5.3 draws; P is its weight, L the order."""
    state, words, points = m.state, block.words, m.control_points
    _check_spline(m, block)
    both, weight = "x" in words and "y" in words, words.get("p", -1.0)
    if not both and ("x" in words or "y" in words):
        raise Fault("a control point needs X and Y; add the other", "g52")
    if state.motion != 52:
        points.clear()
    if points and not both and weight > 0.0:
        raise Fault("P without X and Y is the weight of the first control point only; add X and Y", "p")
    if points and weight <= 0.0:
        raise Fault("every control point needs a weight P above 0; add it", "g52")
    if not points:
        points.append((state.x, state.y, weight if not both and weight > 0.0 else 1.0))
        m.order = 3
    m.order = int(words["l"]) if words.get("l", 0.0) > 3 else m.order
    if both:
        end = target(state, words)
        points.append((end[0], end[1], weight))
    state.motion = 52


def draw_points(m: Context, block: Block) -> None:
    """G5.3: the NURBS of the control points since G5.2."""
    state, points = m.state, m.control_points
    if block.motion not in (-1, 52):
        raise Fault("between G5.2 and G5.3 stand only lines of G5.2; write the move after G5.3", "g53")
    if state.motion != 52:
        raise Fault("G5.3 ends what G5.2 began, and nothing was; write G5.2 X Y P before", "g53")
    if len(points) < m.order:
        raise Fault(
            f"{len(points)} control points for an order of {m.order}; write as many at least, or a lower L", "g53"
        )
    if any(weight <= 0.0 for *_, weight in points):
        raise Fault("a control point has no weight; write P above 0 with each", "g53")
    _curve(m, list(points), m.order)
    state.x, state.y = points[-1][:2]
    points.clear()
    state.motion = NO_MOTION


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


def probe(m: Context, block: Block) -> None:
    """G38.2 to G38.5: toward a workpiece until contact, or away from it; #5061 to #5066 then tell where.

    Without a surface (option probe_surface) the contact is at the move's end, and the tool stands a little before it,
    as `rs274` has it.
    """
    state, words, out = m.state, block.words, m.out
    key = f"g{block.motion}"
    if state.comp_side:
        raise Fault("probing does not go with cutter compensation; write G40 before", key)
    check_feed(m, words, key)
    if state.feed_mode == PER_REVOLUTION:
        raise Fault("probing does not go with a feed per revolution (G95); write G94 and F before", key)
    start, end = state.position(), target(state, words)
    if block.motion in (382, 384) and start == end:
        raise Fault("the probe is where it is to go already; write a place away from it", key)
    found, touched = _contact(m, block.motion, start, end)
    out.call("TURN_PROBE_ON")
    out.call("STRAIGHT_PROBE", *end, *found)
    out.call("TURN_PROBE_OFF")
    state.motion = block.motion
    numbers = m.parameters.numbers
    numbers[PROBED : PROBED + 6] = found
    numbers[PROBED + 9] = float(touched)
    if m.dialect.probe_surface is None:
        way = math.dist(start[:3], end[:3])
        if way:
            back = 0.01 if state.inches else 0.254
            found = [there + back * ((begin - there) / way) for begin, there in zip(start[:3], end[:3], strict=True)]
            found += end[3:]
    state.move_to(list(found))


def _contact(m: Context, code: int, start: list[float], end: list[float]) -> tuple[list[float], bool]:
    """Where the probing move ends, and whether the probe touched (or left) the surface. Raises Fault."""
    surface = m.dialect.probe_surface
    if surface is None:
        return end, False
    high, low = (in_machine(m, place)[2] for place in (start, end))
    level = surface / (25.4 if m.state.inches else 1.0)
    toward = code in (382, 383)
    crosses = (high > level >= low) if toward else (high <= level < low)
    if not crosses:
        if code in (382, 384):
            what = "touch" if toward else "leave"
            raise Fault(
                f"the probe does not {what} the surface, which lies at Z {level:g} of the machine; move further, or"
                f" write G{(code + 1) / 10:g}, which lets that be",
                f"g{code}",
            )
        return end, False
    part = (high - level) / (high - low)
    return [begin + part * (there - begin) for begin, there in zip(start, end, strict=True)], True


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
