"""Splines: G5 and G5.1, and the NURBS of G5.2 and G5.3."""

from __future__ import annotations

from rds.nc.language.blocks import Block
from rds.nc.language.context import Context, check_feed
from rds.nc.language.expressions import Fault
from rds.nc.language.state import INVERSE_TIME, NO_MOTION, XY
from rds.nc.language.targets import target


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
