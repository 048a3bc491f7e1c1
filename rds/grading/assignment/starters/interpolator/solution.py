"""Samples of a line at constant speed; the last one is its end."""

from math import ceil, dist


def interpolate(segment, T, params):
    length = dist(segment.start, segment.end)
    count = max(1, ceil(length / segment.feed_rate / T - 1e-9))
    change = [b - a for a, b in zip(segment.start, segment.end, strict=True)]
    velocity = [c / (count * T) for c in change]
    still = [0.0 for _ in change]
    for k in range(count + 1):
        share = k / count
        position = [a + share * c for a, c in zip(segment.start, change, strict=True)]
        yield (list(segment.end) if k == count else position), velocity, still
