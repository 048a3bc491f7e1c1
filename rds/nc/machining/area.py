"""Areas of curves, and what a tool can reach of them: offsets by shapely."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import acos, ceil, pi
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.nc.shapes.curves import Curve

OFFSET_ERROR = 0.001  # mm: of the chords of rounded offsets


def area_of(curves: Iterable[Curve], owner: str) -> Any:
    """The area within the closed curves, even-odd: a curve within another is an island (a shapely geometry).

    InputError where a curve is open, or there is none.
    """
    with needed_for("offsets of a drawing"):
        from shapely import Polygon

    areas: list[Any] = []
    for curve in curves:
        if curve.circle is not None and curve.circle[2] == 0.0:
            continue
        if not curve.closed or len(curve.points) < 3:
            x, y = curve.points[0]
            raise InputError(
                f"{owner}: the curve that begins at X {x:.3f} Y {y:.3f} mm is open; close it, or engrave it"
            )
        polygon = Polygon(curve.points)
        areas.append(polygon if polygon.is_valid else polygon.buffer(0))
    while len(areas) > 1:  # in pairs: one after the other, each would go through all that came before it
        last = areas[len(areas) // 2 * 2 :]
        areas = [one.symmetric_difference(other) for one, other in zip(areas[::2], areas[1::2], strict=False)] + last
    area = areas[0] if areas else Polygon()
    if area.is_empty:
        raise InputError(f"{owner}: there is no closed curve here; draw one, or take another layer")
    return area


def offset(area: Any, distance: float) -> Any:
    """The area grown by `distance` mm, or shrunk where it is negative; corners rounded."""
    size = abs(distance)
    share = min(OFFSET_ERROR / size, 1.0) if size > 0.0 else 1.0
    return area.buffer(distance, quad_segs=max(ceil(pi / 2.0 / (2.0 * acos(1.0 - share))), 4))


def polygons(area: Any) -> list[Any]:
    """The polygons of an area."""
    return [part for part in getattr(area, "geoms", [area]) if part.geom_type == "Polygon" and not part.is_empty]


def rings(area: Any, wall_right: bool) -> list[np.ndarray]:
    """Its boundaries as closed rows (n × 2, first repeated): the outside of the area on the right of the way, or on
    the left."""
    found: list[np.ndarray] = []
    for polygon in polygons(area):
        for k, ring in enumerate((polygon.exterior, *polygon.interiors)):
            points = np.asarray(ring.coords)[:, :2]
            counter_clockwise = bool(ring.is_ccw)
            wanted = (k == 0) == wall_right
            found.append(points if counter_clockwise == wanted else points[::-1])
    return found


def pocket_rings(area: Any, radius: float, step: float, climb: bool, owner: str) -> tuple[list[np.ndarray], Any, float]:
    """The ways of a tool of `radius` that clears an area, from within to the wall, `step` mm apart (at most `radius`).

    Also where its centre may be, and how many mm² of the area it does not reach (corners, narrow places). InputError
    where it fits nowhere.
    """
    from shapely import LineString, unary_union

    allowed = offset(area, -radius)
    if allowed.is_empty:
        raise InputError(f"{owner}: a tool of {2 * radius:g} mm fits nowhere; take a thinner one")
    levels = [allowed]
    while not (inner := offset(allowed, -step * len(levels))).is_empty:
        levels.append(inner)
    ways = [ring for level in reversed(levels) for ring in rings(level, climb)]
    reachable = offset(allowed, radius)
    swept = unary_union([offset(LineString(way), radius) for way in ways])
    left = reachable.difference(offset(swept, 0.01))
    extra = [] if left.is_empty else rings(offset(left, 0.05).intersection(allowed), climb)
    return extra + ways, allowed, float(area.area - reachable.area)


def nearest_order(ends: Sequence[Sequence[float]]) -> list[int]:
    """An order in which points are visited, each the nearest of those left; the first is lowest at the left."""
    points = np.asarray(ends, dtype=float).reshape(-1, 2)
    if not len(points):
        return []
    here = int(np.lexsort((points[:, 1], points[:, 0]))[0])
    left = np.ones(len(points), bool)
    order = []
    for _ in range(len(points)):
        order.append(here)
        left[here] = False
        if left.any():
            away = np.hypot(*(points - points[here]).T)
            away[~left] = np.inf
            here = int(np.argmin(away))
    return order
