"""Distances between the cutter and a contour of lines and arcs, exact: no polygons. Points are (u, v), in the plane."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rds.nc.compensation.geometry import Point, sweep, unit

_NEAR = 16  # pieces of an equal division that are looked at besides the exact candidates
_REFINEMENTS = 50  # of the golden section: 0.618^50 of a sixteenth
_CONSTANT = 1e-9  # program units; distances that differ by less have no extremes between


class Curve(NamedTuple):
    """A line (`turn` 0) or an arc."""

    start: Point
    end: Point
    centre: Point = (0.0, 0.0)
    turn: int = 0

    @property
    def sweep(self) -> float:
        """Of an arc, rad, + counter-clockwise."""
        return sweep(self.start, self.centre, self.turn, self.end) if self.turn else 0.0

    @property
    def radius(self) -> float:
        """Of an arc, at its end."""
        return math.dist(self.centre, self.end)

    @property
    def length(self) -> float:
        """In the plane."""
        return abs(self.sweep) * self.radius if self.turn else math.dist(self.start, self.end)

    def at(self, fraction: float | np.ndarray) -> np.ndarray:
        """Points at fractions of the length, shape (..., 2). The radius of an arc goes linearly from start to end."""
        t = np.asarray(fraction, dtype=float)[..., None]
        start, end = np.array(self.start), np.array(self.end)
        if not self.turn:
            return start + t * (end - start)
        first = math.atan2(self.start[1] - self.centre[1], self.start[0] - self.centre[0])
        angle = first + t * self.sweep
        radius = math.dist(self.centre, self.start) * (1 - t) + self.radius * t
        return np.array(self.centre) + radius * np.concatenate([np.cos(angle), np.sin(angle)], axis=-1)

    def direction(self, fraction: float) -> Point:
        """Along the curve, of length 1."""
        if not self.turn:
            return unit(self.start, self.end)
        u, v = self.at(fraction) - np.array(self.centre)
        sign = math.copysign(1.0, self.turn) / math.hypot(u, v)
        return (-v * sign, u * sign)

    def part(self, first: float, last: float) -> Curve:
        """From one fraction to another; less than a full circle."""
        begin, end = self.at(first), self.at(last)
        start_point = self.start if first <= 0 else (float(begin[0]), float(begin[1]))
        end_point = self.end if last >= 1 else (float(end[0]), float(end[1]))
        if not self.turn or (first <= 0 and last >= 1):
            return Curve(start_point, end_point, self.centre, self.turn)
        turns = max(1, math.ceil(abs(self.sweep) * (last - first) / (2 * math.pi) - 1e-12))
        return Curve(start_point, end_point, self.centre, turns if self.turn > 0 else -turns)

    def fraction(self, point: Point) -> float:
        """Where the foot of a point lies; beyond an end of a line below 0 or above 1, of an arc in [0, 1] or nan."""
        if not self.turn:
            along = (self.end[0] - self.start[0], self.end[1] - self.start[1])
            off = (point[0] - self.start[0], point[1] - self.start[1])
            return (along[0] * off[0] + along[1] * off[1]) / (along[0] ** 2 + along[1] ** 2)
        if math.dist(point, self.centre) == 0:
            return math.nan
        angle = abs(sweep(self.start, self.centre, 1 if self.turn > 0 else -1, point))
        whole = abs(self.sweep)
        if 2 * math.pi - angle < 1e-12 and whole < 2 * math.pi - 1e-12:
            return 0.0
        return angle / whole if angle <= whole * (1 + 1e-12) else math.nan

    def box(self) -> tuple[float, float, float, float]:
        """Left, lower, right, upper."""
        points = [self.start, self.end]
        if self.turn:
            radius = max(self.radius, math.dist(self.centre, self.start))
            for quarter in ((1, 0), (0, 1), (-1, 0), (0, -1)):
                tip = (self.centre[0] + radius * quarter[0], self.centre[1] + radius * quarter[1])
                if not math.isnan(self.fraction(tip)):
                    points.append(tip)
        us, vs = zip(*points, strict=True)
        return min(us), min(vs), max(us), max(vs)


class Contour:
    """Lines and arcs one after the other, and on which side of them the cutter belongs (+1 left, -1 right)."""

    def __init__(self, curves: Sequence[Curve], side: int, closed: bool):
        self.curves = list(curves)
        self.side = side
        self.boxes = np.array([curve.box() for curve in curves])
        self._start = np.array([curve.start for curve in curves])
        self._end = np.array([curve.end for curve in curves])
        self._centre = np.array([curve.centre for curve in curves])
        self._turn = np.array([curve.turn for curve in curves])
        self._radius = np.array([curve.radius for curve in curves])
        self._sweep = np.array([abs(curve.sweep) for curve in curves])
        sense = np.where(self._turn > 0, 1.0, -1.0)
        off = self._start - self._centre
        self._sense, self._first = sense, np.arctan2(off[:, 1], off[:, 0])
        self._normals = self._vertex_normals(closed)

    def _vertex_normals(self, closed: bool) -> np.ndarray:
        """At starts [:, 0] and ends [:, 1]: the sum of the normals, to the cutter's side, of curves meeting there."""
        ways = np.array([[curve.direction(0.0), curve.direction(1.0)] for curve in self.curves])
        normals = np.stack([-ways[..., 1], ways[..., 0]], axis=-1) * self.side
        sums = normals.copy()
        sums[1:, 0] += normals[:-1, 1]
        sums[:-1, 1] += normals[1:, 0]
        if closed:
            sums[0, 0] += normals[-1, 1]
            sums[-1, 1] += normals[0, 0]
        else:  # beyond the end of an open contour there is no wrong side
            sums[0, 0] = sums[-1, 1] = 0.0
        return sums

    def distance(self, points: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
        """Signed distances of points (m, 2) to the contour: - where a point lies on the other side of it.

        near: the indices of the curves that are looked at. Exact: to feet on lines and arcs, and to ends.
        """
        which = np.arange(len(self.curves)) if near is None else near
        start, end, centre = self._start[which], self._end[which], self._centre[which]
        is_arc = self._turn[which] != 0
        point = points[:, None, :]
        along = end - start
        length = np.where(is_arc, 1.0, (along**2).sum(axis=1))
        fraction = ((point - start) * along).sum(axis=2) / np.where(length > 0, length, 1.0)
        cross = along[:, 0] * (point - start)[..., 1] - along[:, 1] * (point - start)[..., 0]
        straight = cross / np.sqrt(np.where(length > 0, length, 1.0)) * self.side
        off = point - centre
        out = np.hypot(off[..., 0], off[..., 1]) - self._radius[which]
        inner = np.where(self._sense[which] == self.side, -1.0, 1.0)  # the cutter belongs inside: + towards the centre
        turned = (np.arctan2(off[..., 1], off[..., 0]) - self._first[which]) * self._sense[which] % (2 * math.pi)
        foot = np.where(is_arc, turned <= self._sweep[which], (fraction >= 0) & (fraction <= 1))
        signed = np.where(is_arc, out * inner, straight)
        ends = np.stack([point - start, point - end], axis=2)
        reach = np.hypot(ends[..., 0], ends[..., 1])
        ahead = np.where((ends * self._normals[which]).sum(axis=3) < 0, -1.0, 1.0) * reach
        choices = np.concatenate([np.where(foot, signed, np.inf)[..., None], ahead], axis=2).reshape(len(points), -1)
        nearest = np.abs(choices).argmin(axis=1)
        return choices[np.arange(len(points)), nearest]

    def near(self, curve: Curve) -> np.ndarray:
        """The indices of all curves of the contour that can be nearest to a point of `curve`."""
        left, lower, right, upper = curve.box()
        middle = np.array([(left + right) / 2, (lower + upper) / 2])
        reach = np.hypot(*(self._start - middle).T).min() + math.hypot(right - left, upper - lower) / 2
        beside = np.maximum(0, np.maximum(self.boxes[:, 0] - right, left - self.boxes[:, 2]))
        above = np.maximum(0, np.maximum(self.boxes[:, 1] - upper, lower - self.boxes[:, 3]))
        return np.flatnonzero(np.hypot(beside, above) <= reach)

    def along(self, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
        """Fractions of a curve's length, ascending, and signed distances there: least and greatest are among them.

        A curve is nearest to a line, an arc or an end at its own ends, where they cross, or where a normal of the one
        is a normal of the other. All these are looked at: the least distance is exact. The greatest (and how deep the
        cutter's centre goes on the wrong side) is refined from an equal division by golden section.
        """
        near = self.near(curve)
        found = {0.0, 1.0, *np.linspace(0, 1, _NEAR + 1).tolist()}
        for index in near:
            found.update(t for t in _closest(curve, self.curves[index]) if 0 < t < 1)
        fractions = np.array(sorted(found))
        distances = self.distance(curve.at(fractions), near)
        if np.ptp(distances) < _CONSTANT:
            return fractions, distances
        for sign in (1.0, -1.0):
            index = int((sign * distances).argmax())
            if sign < 0 and distances[index] >= 0:
                continue
            before, after = max(index - 1, 0), min(index + 1, len(fractions) - 1)
            others = [abs(distances[other] - distances[index]) for other in (before, after) if other != index]
            if min(others) > _CONSTANT:
                low, high = float(fractions[before]), float(fractions[after])
                found.add(self._golden(curve, near, low, high, sign))
        fractions = np.array(sorted(found))
        return fractions, self.distance(curve.at(fractions), near)

    def _golden(self, curve: Curve, near: np.ndarray, low: float, high: float, sign: float) -> float:
        ratio = (math.sqrt(5) - 1) / 2
        inner = np.array([high - ratio * (high - low), low + ratio * (high - low)])
        values = sign * self.distance(curve.at(inner), near)
        for _ in range(_REFINEMENTS):
            if values[0] > values[1]:
                high = float(inner[1])
            else:
                low = float(inner[0])
            inner = np.array([high - ratio * (high - low), low + ratio * (high - low)])
            values = sign * self.distance(curve.at(inner), near)
        return (low + high) / 2


def _closest(curve: Curve, other: Curve) -> Iterator[float]:
    """Fractions of `curve` at which its distance to `other` may be least."""
    for point in (other.start, other.end):
        yield curve.fraction(point)
    for point in crossings(curve, other):
        yield curve.fraction(point)
    if curve.turn:
        yield from _facing(curve, other)
    elif other.turn:
        yield curve.fraction(other.centre)


def _facing(arc: Curve, other: Curve) -> Iterator[float]:
    """Where an arc's radius is normal to `other`."""
    if other.turn:
        if math.dist(arc.centre, other.centre) == 0:
            return
        way = unit(arc.centre, other.centre)
    else:
        along = unit(other.start, other.end)
        way = (-along[1], along[0])
    for sign in (1, -1):
        yield arc.fraction((arc.centre[0] + sign * way[0] * arc.radius, arc.centre[1] + sign * way[1] * arc.radius))


def crossings(one: Curve, other: Curve) -> list[Point]:
    """Where the lines or circles of two curves cross (not only between their ends); none when they coincide."""
    if one.turn and other.turn:
        return _circles(one, other)
    if one.turn or other.turn:
        line, arc = (other, one) if one.turn else (one, other)
        way = unit(line.start, line.end)
        reach = (arc.centre[0] - line.start[0]) * way[0] + (arc.centre[1] - line.start[1]) * way[1]
        foot = (line.start[0] + way[0] * reach, line.start[1] + way[1] * reach)
        square = arc.radius**2 - math.dist(foot, arc.centre) ** 2
        half = math.sqrt(max(square, 0.0))
        if square < -1e-9 * arc.radius**2:
            return []
        return [(foot[0] + way[0] * half, foot[1] + way[1] * half), (foot[0] - way[0] * half, foot[1] - way[1] * half)]
    a, b = unit(one.start, one.end), unit(other.start, other.end)
    cross = a[0] * b[1] - a[1] * b[0]
    if abs(cross) < 1e-12:
        return []
    reach = ((other.start[0] - one.start[0]) * b[1] - (other.start[1] - one.start[1]) * b[0]) / cross
    return [(one.start[0] + a[0] * reach, one.start[1] + a[1] * reach)]


def _circles(one: Curve, other: Curve) -> list[Point]:
    apart = math.dist(one.centre, other.centre)
    if apart == 0:
        return []
    reach = (one.radius**2 + apart**2 - other.radius**2) / (2 * apart)
    square = one.radius**2 - reach**2
    if square < -1e-9 * one.radius**2:
        return []
    half = math.sqrt(max(square, 0.0))
    way = unit(one.centre, other.centre)
    foot = (one.centre[0] + way[0] * reach, one.centre[1] + way[1] * reach)
    return [(foot[0] - way[1] * half, foot[1] + way[0] * half), (foot[0] + way[1] * half, foot[1] - way[0] * half)]
