"""Motion that comes to rest at the end of each move: along its path by a law of one dimension.

What a move allows along its path (speed, acceleration, jerk) follows from the limits of each axis and the largest
derivatives of the path, as in the planner (speed.py). The laws are the trapezoidal profile (trapezoid.py), whose jerk
is not limited, and the jerk-limited one in the least time (point_to_point.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.pieces import (
    AXIS_1,
    AXIS_2,
    BEND,
    BENDING,
    CAP,
    CIRCULAR,
    DISTANCE,
    FEED,
    FLOATS,
    INTS,
    KIND,
    LENGTH,
    PUSH,
    RATIO,
    SHARE,
    SLOPE,
    STRAIGHT,
    TWIST,
    bound,
    evaluate,
    make_circular,
    make_straight,
)
from rds.interpolators.motion.planner import MARGIN
from rds.interpolators.motion.resting import Resting
from rds.interpolators.motion.samples import SampleBlock
from rds.interpolators.motion.segments import LINE, in_plane


class MoveSamples(NamedTuple):
    """Samples along one move, from its start on: way (mm, degrees), its first and second derivative by time."""

    way: np.ndarray
    speed: np.ndarray
    push: np.ndarray


# way, and the highest speed, acceleration and jerk along it -> samples T s apart, the last at rest on the end
Law = Callable[[float, float, float, float], MoveSamples]


def each_move(
    blocks: Iterable[Any], limits: Limits, T: float, law: Law, *, jerk_limited: bool, start: np.ndarray | None = None
) -> Iterator[SampleBlock]:
    """The samples of a program's motion, move by move; blocks and events as `rds.interpolators.motion.plan` takes them.

    Raises InputError, by line, for a segment that cannot be.
    """
    share = 1.0 - MARGIN
    jerk = limits.jerk * share if jerk_limited else np.full(6, np.inf)
    within = Limits(limits.velocity * share, limits.acceleration * share, jerk)
    axes = limits.present
    tau = float((limits.acceleration[axes] / limits.jerk[axes]).max()) if axes.any() else T
    out = Resting(limits, T, start)
    for block in blocks:
        for k, segment in out.segments(block):
            f, u, cap, push, most = _along(segment, within, tau)
            along = law(float(f[LENGTH]), cap, push, most)
            out.move(*_samples(f, u, along), np.full(len(along.way), k), along.way * float(f[RATIO]))
            yield from out.ready()
    yield from out.rest()


def _along(segment: np.ndarray, within: Limits, tau: float) -> tuple[np.ndarray, np.ndarray, float, float, float]:
    """A segment as a piece, and the highest speed, acceleration and jerk along it."""
    from rds.interpolators.motion.speed import piece_limits

    rows, u = np.zeros((1, FLOATS)), np.zeros(INTS, np.int64)
    f, drift = rows[0], 0.0
    length = float(segment["length"])
    if segment["plane"] == LINE:
        u[KIND] = STRAIGHT
        make_straight(f, segment["start"], segment["end"], length)
    else:
        u[KIND] = CIRCULAR
        u[AXIS_1], u[AXIS_2], _ = in_plane(int(segment["plane"]))
        centre, sweep = segment["centre"], float(segment["sweep"])
        drift = make_circular(f, segment["start"], segment["end"], centre, sweep, u[AXIS_1], u[AXIS_2], length)
    rate = np.inf if segment["rapid"] else float(segment["rate"])
    f[FEED] = rate * length / (f[RATIO] * (length + drift))
    f[DISTANCE], f[SHARE] = 0.0, BENDING
    work = np.empty((3, 6))
    bound(f, u[KIND], u[AXIS_1], u[AXIS_2], *work)
    piece_limits(rows, within.velocity, within.acceleration, within.jerk, tau)
    cap, push = float(f[CAP]), float(f[PUSH])
    slope, bend, twist = (f[first : first + 6] for first in (SLOPE, BEND, TWIST))
    moving = slope > 0.0
    left = within.jerk[moving] - cap**3 * twist[moving] - 3.0 * cap * push * bend[moving]
    with np.errstate(over="ignore"):  # of an axis that hardly moves
        return f, u, cap, push, float((left / slope[moving]).min())


def _samples(f: np.ndarray, u: np.ndarray, along: MoveSamples) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of the axes."""
    count = len(along.way)
    position, velocity, acceleration = (np.empty((count, 6)) for _ in range(3))
    p, dp, ddp = np.empty((3, 6))
    for k, (q, v, a) in enumerate(zip(*along, strict=True)):
        evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], q, p, dp, ddp)
        position[k], velocity[k], acceleration[k] = p, dp * v, ddp * v * v + dp * a
    return position, velocity, acceleration


def trapezoid_law(T: float) -> Law:
    """Constant acceleration, constant speed, constant deceleration."""
    from rds.interpolators.motion.trapezoid import trapezoid

    def law(way: float, speed: float, push: float, jerk: float) -> MoveSamples:
        found = trapezoid(way, speed, push, T)
        return MoveSamples(found.position[1:], found.velocity[1:], found.acceleration[1:])

    return law


def point_to_point_law(T: float) -> Law:
    """Within speed, acceleration and jerk, in the least time, by ruckig. RdsError where that is not installed."""
    from rds.interpolators.motion.point_to_point import point_to_point

    def law(way: float, speed: float, push: float, jerk: float) -> MoveSamples:
        found = point_to_point((0.0,), (way,), (speed,), (push,), (jerk,), T)
        return MoveSamples(found.position[1:, 0], found.velocity[1:, 0], found.acceleration[1:, 0])

    return law
