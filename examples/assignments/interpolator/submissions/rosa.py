# Exercise 3, Rosa

import math

params = {"acceleration": 100.0}


def geometry(segment):
    # geometry first
    origin = segment.start
    if not hasattr(segment, "centre"):
        distance = math.dist(origin, segment.end)
        direction = [(e - s) / distance for s, e in zip(origin, segment.end, strict=True)]
        none = [0.0] * len(origin)
        return distance, lambda s: ([p + s * t for p, t in zip(origin, direction, strict=True)], direction, none)
    a, b = segment.plane
    x0, y0 = segment.centre[a], segment.centre[b]
    R = math.hypot(origin[a] - x0, origin[b] - y0)
    phi0 = math.atan2(origin[b] - y0, origin[a] - x0)
    end = math.atan2(segment.end[b] - y0, segment.end[a] - x0)
    side = -1 if segment.clockwise else 1
    sweep = (side * (end - phi0)) % (2 * math.pi) or 2 * math.pi

    def at(s):
        phi = phi0 + side * s / R
        where, direction, inward = list(origin), [0.0] * len(origin), [0.0] * len(origin)
        where[a], where[b] = x0 + R * math.cos(phi), y0 + R * math.sin(phi)
        direction[a], direction[b] = -side * math.sin(phi), side * math.cos(phi)
        inward[a], inward[b] = -math.cos(phi) / R, -math.sin(phi) / R
        return where, direction, inward

    return sweep * R, at


def interpolate(segment, T, params):
    distance, at = geometry(segment)
    amax = 0.9 * params["acceleration"]
    vmax = min(segment.feed_rate, math.sqrt(amax * distance))
    n_up = math.ceil(vmax / amax / T)
    n_rest = max(n_up, math.ceil(distance / vmax / T))
    v = distance / n_rest / T
    a = v / n_up / T
    n_all = n_up + n_rest
    for k in range(1, n_all):
        if k < n_up:
            s, vel, acc = a * (k * T) ** 2 / 2, a * k * T, a
        elif k <= n_rest:
            s, vel, acc = v * (k - n_up / 2) * T, v, 0.0
        else:
            togo = (n_all - k) * T
            s, vel, acc = distance - a * togo**2 / 2, a * togo, -a
        where, direction, inward = at(s)
        yield where, [t * vel for t in direction], [t * acc + c * vel * vel for t, c in zip(direction, inward, strict=True)]
    none = [0.0] * len(segment.start)
    yield segment.end, none, none
