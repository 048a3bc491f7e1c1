# lines only, and the last row is wherever the last whole step ends
params = {"acceleration": 100.0}


def interpolate(segment, T, params):
    way = [e - s for s, e in zip(segment.start, segment.end)]
    length = sum(w * w for w in way) ** 0.5
    still = [0.0] * len(way)
    if length == 0:
        length = 1.0
    step = segment.feed_rate * T / length
    done = step
    while done <= 1.0 - step:
        yield [s + done * w for s, w in zip(segment.start, way)], [segment.feed_rate * w / length for w in way], still
        done += step
    yield [s + done * w for s, w in zip(segment.start, way)], still, still
