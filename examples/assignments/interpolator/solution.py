"""Lines and arcs with a trapezoidal speed, in a whole number of samples, exact at the end."""

from math import atan2, ceil, cos, hypot, pi, sin, sqrt

params = {"acceleration": 100.0}  # mm/s², along the path


def profile(length, feed, acceleration, T):
    """Samples, ramp time (s), cruising speed (mm/s): accelerate, cruise, slow down, on whole samples."""
    feed = min(feed, sqrt(acceleration * length))  # a short move does not reach the feed rate
    n = max(ceil(feed / acceleration / T - 1e-9), 1)  # samples of a ramp
    m = max(ceil(length / feed / T - 1e-9), n)  # samples at speed, were it reached at once
    return n, m, length / (m * T)


def travelled(k, n, m, speed, T):
    """Way (mm) and speed (mm/s) and acceleration (mm/s²) along the path after k of n + m samples."""
    a = speed / (n * T)
    if k <= n:
        return 0.5 * a * (k * T) ** 2, a * k * T, a
    if k < m:
        return speed * T * (k - 0.5 * n), speed, 0.0
    left = (n + m - k) * T
    return speed * m * T - 0.5 * a * left**2, a * left, -a


def interpolate(segment, T, params):
    if hasattr(segment, "centre"):
        yield from arc(segment, T, params)
        return
    way = [e - s for s, e in zip(segment.start, segment.end, strict=True)]
    length = hypot(*way)
    unit = [w / length for w in way]
    n, m, speed = profile(length, segment.feed_rate, params["acceleration"], T)
    for k in range(1, n + m):
        s, v, a = travelled(k, n, m, speed, T)
        position = [p + s * u for p, u in zip(segment.start, unit, strict=True)]
        yield position, [v * u for u in unit], [a * u for u in unit]
    still = [0.0] * len(unit)
    yield segment.end, still, still


def arc(segment, T, params):
    i, j = segment.plane
    ci, cj = segment.centre[i], segment.centre[j]
    radius = hypot(segment.start[i] - ci, segment.start[j] - cj)
    first = atan2(segment.start[j] - cj, segment.start[i] - ci)
    turn = (atan2(segment.end[j] - cj, segment.end[i] - ci) - first) % (2 * pi)
    if turn < 1e-12:
        turn = 2 * pi
    sign = 1.0
    if segment.clockwise:
        turn, sign = 2 * pi - turn % (2 * pi), -1.0
    # speed and change of speed share what acceleration there is
    feed = min(segment.feed_rate, sqrt(0.5 * params["acceleration"] * radius))
    n, m, speed = profile(turn * radius, feed, 0.8 * params["acceleration"], T)
    for k in range(1, n + m):
        s, v, a = travelled(k, n, m, speed, T)
        angle = first + sign * s / radius
        c, d = cos(angle), sin(angle)
        position, velocity, acceleration = list(segment.start), [0.0] * len(segment.start), [0.0] * len(segment.start)
        position[i], position[j] = ci + radius * c, cj + radius * d
        velocity[i], velocity[j] = -sign * v * d, sign * v * c
        acceleration[i] = -sign * a * d - v * v / radius * c
        acceleration[j] = sign * a * c - v * v / radius * d
        yield position, velocity, acceleration
    still = [0.0] * len(segment.start)
    yield segment.end, still, still
