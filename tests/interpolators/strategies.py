"""Random segments, for properties."""

from __future__ import annotations

from math import cos, pi, sin

from hypothesis import strategies as st

from rds.core.types import ArcSegment, LineSegment

positions = st.floats(-200.0, 200.0, allow_subnormal=False)
feeds = st.floats(1.0, 100.0)


@st.composite
def lines(draw: st.DrawFn, axes: int = 2) -> LineSegment:
    """At least 0.1 mm long."""
    start = tuple(draw(positions) for _ in range(axes))
    step = tuple(draw(st.floats(0.1, 50.0)) * draw(st.sampled_from((-1, 1))) for _ in range(axes))
    return LineSegment(start, tuple(a + b for a, b in zip(start, step, strict=True)), draw(feeds))


@st.composite
def arcs(draw: st.DrawFn, radii: st.SearchStrategy[float] | None = None, helix: bool = False) -> ArcSegment:
    """Of any radius, direction and angle, full circles among them."""
    radius = draw(radii or st.floats(0.5, 100.0))
    first, clockwise = draw(st.floats(-pi, pi)), draw(st.booleans())
    turn = draw(st.floats(0.05, 2 * pi - 0.05) | st.just(0.0))
    last = first + (-turn if clockwise else turn)
    centre = (draw(positions), draw(positions))
    points = [(centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)) for angle in (first, last)]
    start, end = points[0], points[1] if turn else points[0]
    if not helix:
        return ArcSegment(start, end, centre, draw(feeds), clockwise)
    rise = draw(st.floats(-20.0, 20.0))
    return ArcSegment((*start, 1.0), (*end, 1.0 + rise), (*centre, 0.0), draw(feeds), clockwise)
