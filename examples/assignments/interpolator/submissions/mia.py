"""Trapezoid on whole samples. One function of the way for lines and arcs alike."""

import math

params = {"acceleration": 100.0}


def shape(segment):
    """Length, and a function from the way along the path to the point, its tangent and its curvature vector."""
    start = segment.start
    if not hasattr(segment, "centre"):
        length = math.dist(start, segment.end)
        tangent = [(e - s) / length for s, e in zip(start, segment.end, strict=True)]
        zero = [0.0] * len(start)
        return length, lambda s: ([p + s * t for p, t in zip(start, tangent, strict=True)], tangent, zero)
    a, b = segment.plane
    x0, y0 = segment.centre[a], segment.centre[b]
    R = math.hypot(start[a] - x0, start[b] - y0)
    begin = math.atan2(start[b] - y0, start[a] - x0)
    end = math.atan2(segment.end[b] - y0, segment.end[a] - x0)
    way = -1 if segment.clockwise else 1
    turn = (way * (end - begin)) % (2 * math.pi) or 2 * math.pi

    def at(s):
        angle = begin + way * s / R
        point, tangent, bend = list(start), [0.0] * len(start), [0.0] * len(start)
        point[a], point[b] = x0 + R * math.cos(angle), y0 + R * math.sin(angle)
        tangent[a], tangent[b] = -way * math.sin(angle), way * math.cos(angle)
        bend[a], bend[b] = -math.cos(angle) / R, -math.sin(angle) / R
        return point, tangent, bend

    return turn * R, at


def interpolate(segment, T, params):
    length, at = shape(segment)
    limit = 0.9 * params["acceleration"]
    top = min(segment.feed_rate, math.sqrt(limit * length))
    ramp = math.ceil(top / limit / T)
    both = max(ramp, math.ceil(length / top / T))
    v = length / both / T
    a = v / ramp / T
    total = ramp + both
    for k in range(1, total):
        if k < ramp:
            s, ds, dds = a * (k * T) ** 2 / 2, a * k * T, a
        elif k <= both:
            s, ds, dds = v * (k - ramp / 2) * T, v, 0.0
        else:
            rest = (total - k) * T
            s, ds, dds = length - a * rest**2 / 2, a * rest, -a
        point, tangent, bend = at(s)
        yield point, [t * ds for t in tangent], [t * dds + c * ds * ds for t, c in zip(tangent, bend, strict=True)]
    zero = [0.0] * len(segment.start)
    yield segment.end, zero, zero
