"""How far segments reach along each axis: exactly, arcs and helices included."""

from __future__ import annotations

import numpy as np

from rds.interpolators.motion.segments import LINE, in_plane


def extents(segments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest position of each segment (dtype SEGMENT) along X Y Z A B C: two arrays n × 6.

    The path is that of `rds.interpolators.motion.segments.point_at`: what an arc's end is off its circle is spread
    along the arc.
    """
    low = np.minimum(segments["start"], segments["end"])
    high = np.maximum(segments["start"], segments["end"])
    for plane in range(3):
        arcs = np.flatnonzero(segments["plane"] == plane)
        if len(arcs):
            for axis, quarter in zip(in_plane(plane)[:2], (0.0, -0.5 * np.pi), strict=True):
                for value in _turning_points(segments[arcs], plane, axis, quarter):
                    low[arcs, axis] = np.fmin(low[arcs, axis], value)
                    high[arcs, axis] = np.fmax(high[arcs, axis], value)
    assert np.all(segments["plane"] >= LINE)
    return low, high


def _turning_points(arcs: np.ndarray, plane: int, axis: int, quarter: float) -> list[np.ndarray]:
    """Where arcs turn round along one axis: positions, nan where they do not.

    Along the first axis of the plane an arc is at c + r cos θ + drift·(θ − θ₀)/sweep, and along the second with sin θ,
    which is cos (θ − 90°). It turns round where sin θ = drift/(r·sweep), once on either side of each whole turn; of
    all turns the first and the last reach farthest, since the drift grows steadily.
    """
    first, second, _ = in_plane(plane)
    arm = arcs["start"][:, [first, second]] - arcs["centre"][:, [first, second]]
    radius = np.hypot(arm[:, 0], arm[:, 1])
    begin = np.arctan2(arm[:, 1], arm[:, 0]) + quarter
    sweep = arcs["sweep"]
    start, end, centre = (arcs[name][:, axis] for name in ("start", "end", "centre"))
    on_circle = radius * np.cos(begin)  # the start from the centre, along the axis
    drift = end - start - (radius * np.cos(begin + sweep) - on_circle)
    with np.errstate(invalid="ignore", divide="ignore"):
        tilt = np.arcsin(drift / (radius * sweep))
    found = []
    least, most = np.minimum(begin, begin + sweep), np.maximum(begin, begin + sweep)
    for angle in (tilt, np.pi - tilt):
        first_turn, last_turn = np.ceil((least - angle) / (2 * np.pi)), np.floor((most - angle) / (2 * np.pi))
        for turn in (first_turn, last_turn):
            at = angle + 2 * np.pi * turn
            value = centre + radius * np.cos(at) + drift * (at - begin) / sweep
            value += start - centre - on_circle  # rounding of the start
            found.append(np.where((at >= least) & (at <= most), value, np.nan))
    return found
