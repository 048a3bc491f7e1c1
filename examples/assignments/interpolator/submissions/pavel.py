# A velocity that is fed back from the distance left: it never quite arrives.
params = {"acceleration": 100.0}


def interpolate(segment, T, params):
    p = list(segment.start)
    v = [0.0] * len(p)
    for _ in range(100000):
        a = [(900.0 * (e - x) + 20.0 * w) for e, x, w in zip(segment.end, p, v)]  # + 20: damping, I think
        v = [w + T * b for w, b in zip(v, a)]
        p = [x + T * w for x, w in zip(p, v)]
        yield p, v, a
