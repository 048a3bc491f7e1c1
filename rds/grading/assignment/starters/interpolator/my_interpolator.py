"""Your interpolator. Try it with `rds grade self FOLDER my_interpolator.py`."""


def interpolate(segment, T, params):
    """Rows of (position, velocity, acceleration), one every T seconds, a value for each axis: mm, mm/s, mm/s².

    `segment` has start and end (mm) and feed_rate (mm/s).
    """
    still = [0.0] * len(segment.start)
    yield segment.start, still, still
