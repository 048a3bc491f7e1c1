"""Curves on layers, in mm: what vector drawings and text are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import asin, ceil, pi, sqrt
from typing import NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import near

CHORD_ERROR = 0.002  # mm: of the chords that stand for curves, a tenth of what a mill of this class repeats
SAME = 0.01  # mm: ends nearer than this are joined
MOST_POINTS = 2_000_000  # of a drawing
_TWICE = 1e-5  # mm: curves nearer than this everywhere are one, drawn twice


@dataclass(frozen=True)
class Curve:
    """A polyline (n × 2, mm); `closed` without its first point repeated. `circle`: centre x, y and radius, of a circle,
    or of a point, whose radius is 0."""

    points: np.ndarray
    closed: bool
    layer: str = ""
    circle: tuple[float, float, float] | None = None


@dataclass
class Drawing:
    """The curves of a drawing; `notes` tell what of the file was passed over, and why."""

    curves: list[Curve]
    name: str
    notes: list[str] = field(default_factory=list)

    @property
    def layers(self) -> list[str]:
        """The layers, in the order in which they come."""
        return list(dict.fromkeys(curve.layer for curve in self.curves))

    def on(self, layer: str | None) -> list[Curve]:
        """The curves of a layer; of all where there is no name. InputError for a layer that there is not."""
        if layer is None:
            return self.curves
        if layer not in self.layers:
            known = ", ".join(map(repr, self.layers))
            raise InputError(f"{self.name} has no layer {layer!r}; it has {known}{near(layer, self.layers)}")
        return [curve for curve in self.curves if curve.layer == layer]


def steps_of(radius: float, sweep: float, chord_error: float = CHORD_ERROR) -> int:
    """How many chords an arc of `radius` (mm) and `sweep` (rad) is divided into, so that they keep within the error."""
    if radius <= chord_error:
        return 4
    count = abs(sweep) / (4.0 * asin(sqrt(chord_error / radius / 2.0)))  # acos(1 - error / radius) is 0 for large radii
    if not count <= MOST_POINTS:
        raise InputError(
            f"an arc of radius {radius:g} mm takes more than {MOST_POINTS} chords; correct it, or leave it out"
        )
    return max(ceil(count), 2)


def arc_points(x: float, y: float, radius: float, first: float, sweep: float) -> np.ndarray:
    """Points along an arc about (x, y), from the angle `first` (rad) on, both ends among them."""
    angle = first + np.linspace(0.0, sweep, steps_of(radius, sweep) + 1)
    return np.column_stack((x + radius * np.cos(angle), y + radius * np.sin(angle)))


def circle_curve(x: float, y: float, radius: float, layer: str) -> Curve:
    """A circle, or with radius 0 a point."""
    points = arc_points(x, y, radius, 0.0, 2.0 * pi)[:-1] if radius > 0.0 else np.array([[x, y]])
    return Curve(points, True, layer, (x, y, radius))


def polyline_curve(points: Sequence[Sequence[float]] | np.ndarray, closed: bool, layer: str) -> Curve | None:
    """A curve without points that repeat; None where nothing is left. One whose ends meet is closed."""
    rows = np.asarray(points, dtype=float).reshape(-1, 2)
    if len(rows) > 1:
        keep = np.ones(len(rows), bool)
        keep[1:] = np.hypot(*(rows[1:] - rows[:-1]).T) > 1e-9
        rows = rows[keep]
    if len(rows) > 2 and np.hypot(*(rows[0] - rows[-1])) <= SAME:
        rows, closed = rows[:-1], True
    if len(rows) < 2:
        return None
    return Curve(rows, closed and len(rows) > 2, layer)


def assembled(curves: Sequence[Curve], name: str, passed_over: dict[str, int]) -> Drawing:
    """A drawing of these curves: each of a layer once, however often it is drawn, and open ones joined where they meet.

    Drawn twice, two sides of a square would be a way there and back, and a closed curve an island in itself.
    """
    if not all(np.isfinite(curve.points).all() for curve in curves):  # such points have no neighbours to look for
        raise InputError("holds a number too large for a drawing; correct it, or save it again", name)
    once = distinct(curves)
    whole = distinct(joined(once.kept))
    passed_over = passed_over | {"curves that are drawn already, on the same layer": once.twice + whole.twice}
    notes = [f"passed over: {count} × {what}" for what, count in passed_over.items() if count]
    return Drawing(whole.kept, name, notes)


class Distinct(NamedTuple):
    """The curves of a layer each once, and how many there were besides."""

    kept: list[Curve]
    twice: int


def distinct(curves: Iterable[Curve]) -> Distinct:
    """The curves without those that run along the whole of an earlier one of their layer, in whichever direction."""
    found = Distinct([], 0)
    alike: dict[tuple[object, ...], list[Curve]] = {}  # by layer, centre and size
    for curve in curves:
        sort = (curve.layer, curve.closed, len(curve.points))
        # the size, too: of many squares around one centre each would be held against all others
        place = np.append(curve.points.mean(axis=0), np.ptp(curve.points, axis=0).sum() / 4.0) / (4.0 * _TWICE)
        near = {(*sort, *np.floor(place + step)) for step in product((-0.3, 0.3), repeat=3)}
        if any(_same(curve, other) for key in near for other in alike.get(key, ())):
            found = found._replace(twice=found.twice + 1)
            continue
        found.kept.append(curve)
        alike.setdefault((*sort, *np.floor(place)), []).append(curve)
    return found


def _same(one: Curve, other: Curve) -> bool:
    """Whether two curves of as many points are the same, wherever they begin and whichever way they go."""
    a = one.points
    for b in (other.points, other.points[::-1]):
        if one.closed:
            b = np.roll(b, -int(np.hypot(*(b - a[0]).T).argmin()), axis=0)
        if (abs(a - b) < _TWICE).all():
            return (one.circle is None) == (other.circle is None)
    return False


def joined(curves: Iterable[Curve]) -> list[Curve]:
    """Open curves of a layer whose ends meet (within 0.01 mm), as one each: lines and arcs of a CAD drawing."""
    whole: list[Curve] = []
    ends: dict[str, list[Curve]] = {}
    for curve in curves:
        (whole if curve.closed or curve.circle else ends.setdefault(curve.layer, [])).append(curve)
    for layer, loose in ends.items():
        whole += _chained([curve.points for curve in loose], layer)
    return whole


def _chained(loose: list[np.ndarray], layer: str) -> list[Curve]:
    by_end: dict[tuple[int, int], list[int]] = {}
    for k, points in enumerate(loose):
        for end in (points[0], points[-1]):
            by_end.setdefault(_cell(end), []).append(k)
    used = [False] * len(loose)
    found: list[Curve] = []

    def next_of(end: np.ndarray) -> int:
        i, j = _cell(end)
        for cell in ((i + a, j + b) for a in (0, -1, 1) for b in (0, -1, 1)):
            for k in by_end.get(cell, ()):
                if not used[k] and min(np.hypot(*(loose[k][e] - end)) for e in (0, -1)) <= SAME:
                    return k
        return -1

    for first in range(len(loose)):
        if used[first]:
            continue
        used[first] = True
        chain = [loose[first]]
        for forwards in (True, False):
            while (k := next_of(chain[-1][-1] if forwards else chain[0][0])) >= 0:
                used[k] = True
                points = loose[k]
                if forwards:
                    chain.append(points if np.hypot(*(points[0] - chain[-1][-1])) <= SAME else points[::-1])
                else:
                    chain.insert(0, points if np.hypot(*(points[-1] - chain[0][0])) <= SAME else points[::-1])
        curve = polyline_curve(np.concatenate([chain[0], *(part[1:] for part in chain[1:])]), False, layer)
        if curve is not None:
            found.append(curve)
    return found


def _cell(point: np.ndarray) -> tuple[int, int]:
    return int(np.floor(point[0] / (2 * SAME))), int(np.floor(point[1] / (2 * SAME)))


def checked(drawing: Drawing) -> Drawing:
    """The drawing, if there is something in it and not too much. InputError."""
    if not drawing.curves:
        passed = f" ({'; '.join(drawing.notes)})" if drawing.notes else ""
        raise InputError(f"has no curves to machine{passed}; draw lines, arcs or paths", drawing.name)
    count = sum(len(curve.points) for curve in drawing.curves)
    if count > MOST_POINTS:
        raise InputError(f"has {count} points; at most {MOST_POINTS} are taken: is its unit mm?", drawing.name)
    if not all(np.isfinite(curve.points).all() and (abs(curve.points) < 1e5).all() for curve in drawing.curves):
        is_dxf = drawing.name.lower().endswith(".dxf")
        remedy = "is its header's unit right? give another (unit: mm, cm, m or in)" if is_dxf else "is its size right?"
        raise InputError(f"has points beyond 100 m; {remedy}", drawing.name)
    return drawing
