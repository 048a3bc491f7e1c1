"""What a new file begins with: a controller, model or interpolator that works and explains itself."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Template(NamedTuple):
    """The first text of a file, the name that it gets, and the functions by which its role is known."""

    name: str
    text: str
    functions: tuple[str, ...]


_CONTROLLER = '''\
"""A controller: one voltage in each sample, from where the axis should be and where it is."""

# Numbers that you may change from the page, without touching the code. Their units stand beside them.
params = {
    "Kp": 25.0,  # V/mm, proportional gain
    "Kv": 0.5,  # V/(mm/s), feedforward of the velocity
}
initial_state = [0.0]  # what control() remembers from one sample to the next; here the error of the last one, mm


def control(t, r, y, state, params):
    """Called once in every sample period.

    t      time, s
    r      what the axis should do: r.position [mm], r.velocity [mm/s], r.acceleration [mm/s²]
    y      the measured position, mm
    state  what you returned last; at first initial_state
    """
    error = r.position - y  # mm
    voltage = params["Kp"] * error + params["Kv"] * r.velocity  # V; the converter limits it
    return voltage, [error]
'''

_MODEL = '''\
"""A model: how the axis answers a voltage. Simulation runs it in place of the machine, the other modes beside it."""

# The mini CNC's X axis without its friction. `rds fit` finds such numbers from a log.
params = {
    "K": 1.764,  # (mm/s)/V, velocity at one volt
    "tau": 0.009943,  # s, time constant of the drive
}
initial_state = [0.0, 0.0]  # position mm, velocity mm/s


def derivatives(t, x, u, params):
    """The rate of change of each state.

    t  time, s
    x  the state: x[0] position [mm], x[1] velocity [mm/s]
    u  the input: u[0] voltage [V]
    """
    velocity = x[1]
    acceleration = (params["K"] * u[0] - velocity) / params["tau"]  # mm/s²
    return [velocity, acceleration]


def output(t, x, u, params):
    """What the encoder sees, mm. You may leave this function out: then it is x[0]."""
    return x[0]
'''

_INTERPOLATOR = '''\
"""An interpolator: where the axes are in every sample on their way along a line or an arc."""

from math import atan2, ceil, cos, dist, pi, sin

from rds import LineSegment

params = {}


def interpolate(segment, T, params):
    """One row per sample: (positions, velocities, accelerations), each with one value per axis. The last is the end.

    segment  a LineSegment (start, end, feed_rate) or an ArcSegment (also centre, clockwise, plane)
    T        the sample period, s

    Positions are in mm, the feed rate in mm/s, one value per axis.
    """
    if isinstance(segment, LineSegment):
        yield from line(segment, T)
    else:
        yield from arc(segment, T)


def line(segment, T):
    """Straight on, at constant velocity."""
    way = [end - start for start, end in zip(segment.start, segment.end)]  # mm
    N = ceil(dist(segment.start, segment.end) / (segment.feed_rate * T) - 1e-9)  # samples on the way
    still = [0.0] * len(way)
    for k in range(1, N + 1):
        position = segment.end if k == N else [s + w * k / N for s, w in zip(segment.start, way)]
        yield position, [w / (N * T) for w in way], still


def arc(segment, T):
    """Around the centre, at constant angular velocity."""
    i, j = segment.plane  # the two axes of the arc's plane; all others move in proportion (a helix)
    (x, y), (cx, cy) = ((point[i], point[j]) for point in (segment.start, segment.centre))
    ex, ey = segment.end[i], segment.end[j]
    radius, first = dist((x, y), (cx, cy)), atan2(y - cy, x - cx)
    turn = (atan2(ey - cy, ex - cx) - first) % (2 * pi)  # counter-clockwise, 0 to 2π
    if segment.clockwise:
        turn -= 2 * pi
    if dist((x, y), (ex, ey)) < 1e-9:  # the end is the start: a full circle
        turn = -2 * pi if segment.clockwise else 2 * pi
    way = [end - start for start, end in zip(segment.start, segment.end)]  # mm
    rise = dist([w for k, w in enumerate(way) if k not in (i, j)], [0.0] * (len(way) - 2))
    N = ceil((abs(turn) * radius + rise) / (segment.feed_rate * T) - 1e-9)
    omega = turn / (N * T)  # rad/s
    for k in range(1, N + 1):
        angle = first + turn * k / N
        position = [s + w * k / N for s, w in zip(segment.start, way)]
        velocity = [w / (N * T) for w in way]  # mm/s
        acceleration = [0.0] * len(way)  # mm/s²
        position[i], position[j] = cx + radius * cos(angle), cy + radius * sin(angle)
        velocity[i], velocity[j] = -radius * omega * sin(angle), radius * omega * cos(angle)
        acceleration[i], acceleration[j] = -radius * omega**2 * cos(angle), -radius * omega**2 * sin(angle)
        yield segment.end if k == N else position, velocity, acceleration
'''

TEMPLATES: Mapping[str, Template] = MappingProxyType(
    {
        "controller": Template("my_controller.py", _CONTROLLER, ("control",)),
        "model": Template("my_model.py", _MODEL, ("derivatives", "advance")),
        "interpolator": Template("my_interpolator.py", _INTERPOLATOR, ("interpolate",)),
    }
)
