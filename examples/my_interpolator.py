"""An interpolator for lines and arcs: along the path the speed rises and falls smoothly, so that no filter is needed.

A segment of length L is passed as s = L (q - sin(2πq)/2π) for q from 0 to 1: it begins and ends at rest, is fastest at
half the way, and takes twice as long as at the feed rate all along.
"""

from math import atan2, ceil, cos, dist, hypot, pi, sin

params = {"slowest": 0.02}  # s that the shortest segment takes


def interpolate(segment, T, params):
    place = around(segment) if hasattr(segment, "centre") else straight(segment)
    length = place.length
    samples = max(1, ceil(max(2 * length / segment.feed_rate, params["slowest"]) / T - 1e-9))
    for k in range(1, samples + 1):
        q, per_second = k / samples, 1 / (samples * T)
        way = q - sin(2 * pi * q) / (2 * pi)  # share of the length
        speed = length * per_second * (1 - cos(2 * pi * q))  # mm/s
        push = length * per_second**2 * 2 * pi * sin(2 * pi * q)  # mm/s²
        yield place(way, speed, push)


class straight:
    """Place on a line: position, velocity and acceleration, one value per axis each."""

    def __init__(self, segment):
        self.start, self.length = segment.start, dist(segment.start, segment.end)
        ends = zip(segment.start, segment.end, strict=True)
        self.unit = [(b - a) / (self.length or 1.0) for a, b in ends]

    def __call__(self, way, speed, push):
        along = way * self.length
        position = [a + along * unit for a, unit in zip(self.start, self.unit, strict=True)]
        return position, [speed * unit for unit in self.unit], [push * unit for unit in self.unit]


class around:
    """Place on an arc or a helix."""

    def __init__(self, segment):
        self.i, self.j = segment.plane
        self.start, self.centre = segment.start, segment.centre
        x, y = (segment.start[k] - segment.centre[k] for k in segment.plane)
        self.radius, self.first = hypot(x, y), atan2(y, x)
        last = atan2(*(segment.end[k] - segment.centre[k] for k in (self.j, self.i)))
        turn = (last - self.first) % (2 * pi) or 2 * pi  # counter-clockwise; 0 is a full circle
        if segment.clockwise:
            turn = turn - 2 * pi if turn < 2 * pi else -turn
        self.turn = turn
        ends = zip(segment.start, segment.end, strict=True)
        self.rise = [0.0 if k in segment.plane else b - a for k, (a, b) in enumerate(ends)]
        self.length = hypot(self.radius * turn, *self.rise)

    def __call__(self, way, speed, push):
        i, j, per_length = self.i, self.j, 1 / self.length
        position = [a + way * rise for a, rise in zip(self.start, self.rise, strict=True)]
        velocity = [speed * per_length * rise for rise in self.rise]
        acceleration = [push * per_length * rise for rise in self.rise]
        angle = self.first + way * self.turn
        omega, alpha = speed * per_length * self.turn, push * per_length * self.turn  # rad/s, rad/s²
        x, y = self.radius * cos(angle), self.radius * sin(angle)
        position[i], position[j] = self.centre[i] + x, self.centre[j] + y
        velocity[i], velocity[j] = -y * omega, x * omega
        acceleration[i], acceleration[j] = -y * alpha - x * omega**2, x * alpha - y * omega**2
        return position, velocity, acceleration
