"""Your interpolator. Hand in this file, under this name."""

params = {
    "acceleration": 100.0,  # mm/s² along the path; the grader sets it
}


def interpolate(segment, T, params):
    """Rows of a segment every T s: (position, velocity, acceleration), a list of one value for each axis each."""
    still = [0.0] * len(segment.start)
    yield segment.start, still, still
