params = {"acceleration": 100.0}


def interpolate(segment, T, params):
	way = [e - s for s, e in zip(segment.start, segment.end)]
    for k in range(1, 101):
        yield [s + k / 100 * w for s, w in zip(segment.start, way)], way, way
