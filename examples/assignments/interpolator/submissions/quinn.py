# feed rates are in mm/min, as on the machine in the workshop
from math import ceil, dist

params = {"acceleration": 100.0}


def interpolate(segment, T, params):
    feed = segment.feed_rate / 60.0
    N = max(ceil(dist(segment.start, segment.end) / feed / T), 1)
    way = [e - s for s, e in zip(segment.start, segment.end)]
    for k in range(1, N + 1):
        yield [s + k / N * w for s, w in zip(segment.start, way)], [w / N / T for w in way], [0.0] * len(way)
