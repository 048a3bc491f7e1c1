"""Which parts of a compensated stretch are the contour, and which parts of the cutter's way belong to it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rds.nc.compensation.geometry import Point
from rds.nc.compensation.moves import Element, Stretch
from rds.nc.compensation.proof_geometry import Contour, Curve, crossings
from rds.nc.language.canon import TRAVERSE

ENTRY, LEAD_IN, CONTOUR, LEAD_OUT, EXIT, RAPID = "entry", "lead-in", "contour", "lead-out", "exit", "rapid"
CONTACT = 0.002  # mm; a contour whose ends come so near to each other is closed (programs are written to 0.001 mm)

MM = {"MM": 1.0, "INCHES": 25.4}  # mm of a program unit
TOLERANCE = 0.001  # mm; what is no gouge yet: programs are written to it


class Piece(NamedTuple):
    """A part of the way of the cutter's centre, and the number of the chain (contour) that it belongs to."""

    role: str
    line: int
    curve: Curve
    chain: int


class Chain:
    """Programmed feed moves one after the other, and where on them the contour begins and ends.

    Lead-in and lead-out are what comes before the first, and after the last, point where the chain meets itself: the
    contour is closed there (or crossed, or run over again). A chain that does not meet itself is contour as a whole.
    Positions along a chain are numbers of moves: 2.25 is a quarter of the third one.
    """

    def __init__(self, elements: list[Element], tolerance: float):
        self.elements = elements
        self.curves = [Curve(e.start, e.end, e.centre, e.turn) for e in elements]
        met = list(_contacts(self.curves, tolerance))
        self.first = min((one for one, _ in met), default=0.0)
        self.last = max((other for _, other in met), default=float(len(elements)))
        closed = bool(met) and math.dist(self.point(self.first), self.point(self.last)) <= tolerance
        self.closed = closed
        self.contour_curves = [curve for _, curve in self._contour()]

    def point(self, position: float) -> Point:
        """The programmed point at a position."""
        index = min(int(position), len(self.curves) - 1)
        u, v = self.curves[index].at(position - index)
        return float(u), float(v)

    def _contour(self) -> Iterator[tuple[int, Curve]]:
        for index, curve in enumerate(self.curves):
            low, high = max(self.first - index, 0.0), min(self.last - index, 1.0)
            if high - low > 1e-9:
                yield index, curve.part(low, high)

    def contour(self, side: int) -> Contour:
        """What the cutter's edge is to touch."""
        return Contour(self.contour_curves, side, self.closed)

    def split(self, index: int, curve: Curve) -> Iterator[tuple[str, Curve]]:
        """The cutter's way along move `index`, cut where the contour begins and ends."""
        low, high = self.first - index, self.last - index
        if low >= 1 - 1e-9:
            yield LEAD_IN, curve
        elif high <= 1e-9:
            yield LEAD_OUT, curve
        else:
            begin = _foot(curve, self.curves[index], low) if low > 1e-9 else 0.0
            end = _foot(curve, self.curves[index], high) if high < 1 - 1e-9 else 1.0
            for role, start, stop in ((LEAD_IN, 0.0, begin), (CONTOUR, begin, end), (LEAD_OUT, end, 1.0)):
                if stop - start > 1e-9:
                    yield role, curve.part(start, stop)

    def corner(self, index: int) -> str:
        """The role of the arc around the corner before move `index`."""
        if index == 0:
            return ENTRY
        return LEAD_IN if index < self.first - 1e-9 else LEAD_OUT if index > self.last + 1e-9 else CONTOUR


def _foot(curve: Curve, programmed: Curve, fraction: float) -> float:
    """The fraction of the cutter's way that is beside a point of the programmed move."""
    u, v = programmed.at(fraction)
    found = curve.fraction((float(u), float(v)))
    if math.isnan(found):  # before or after a shortened arc
        return 0.0 if math.dist((u, v), curve.start) < math.dist((u, v), curve.end) else 1.0
    return min(max(found, 0.0), 1.0)


def _contacts(curves: list[Curve], tolerance: float) -> Iterator[tuple[float, float]]:
    """Positions (earlier, later) of a chain at which it meets itself."""
    for index, curve in enumerate(curves):
        if curve.turn and math.dist(curve.start, curve.end) <= tolerance and abs(curve.sweep) > math.pi:
            yield float(index), index + 1.0
    boxes = np.array([curve.box() for curve in curves]).reshape(-1, 4)
    for i, curve in enumerate(curves):
        later = boxes[i + 1 :]
        apart = np.maximum(later[:, :2] - boxes[i, 2:], boxes[i, :2] - later[:, 2:]).max(axis=1)
        for j in (np.flatnonzero(apart <= tolerance) + i + 1).tolist():
            other = curves[j]
            points = [*crossings(curve, other), curve.start, curve.end, other.start, other.end]
            for point in points:
                if j == i + 1 and math.dist(point, curve.end) <= tolerance:
                    continue
                one, two = _on(curve, point, tolerance), _on(other, point, tolerance)
                if one is not None and two is not None:
                    yield i + one, j + two


def _on(curve: Curve, point: Point, tolerance: float) -> float | None:
    """The fraction of a curve at which a point lies on it; None when it does not."""
    if math.dist(point, curve.start) <= tolerance:
        return 0.0
    if math.dist(point, curve.end) <= tolerance:
        return 1.0
    fraction = curve.fraction(point)
    if not 0 <= fraction <= 1:  # not a number is refused too
        return None
    u, v = curve.at(fraction)
    return fraction if math.dist((u, v), point) <= tolerance else None


def divide(stretch: Stretch, tolerance: float) -> tuple[list[Chain], list[Piece]]:
    """The chains of a stretch, and the cutter's way in pieces, in order. `tolerance` of contacts in program units."""
    groups: list[list[Element]] = [[]]
    place: list[tuple[int, int] | None] = []  # chain and number within it of each programmed element
    for element in stretch.programmed:
        if element.role == "contour" and element.kind != TRAVERSE:
            groups[-1].append(element)
            place.append((len(groups) - 1, len(groups[-1]) - 1))
        else:
            place.append(None)
            if element.role == "contour" and groups[-1]:
                groups.append([])
    chains = [Chain(group, tolerance) for group in groups if group]
    pieces = [piece for piece in _pieces(stretch, chains, place) if piece.curve.length > 0]
    return chains, pieces


def _pieces(stretch: Stretch, chains: list[Chain], place: list[tuple[int, int] | None]) -> Iterator[Piece]:
    extra = sum(e.role == "entry" for e in stretch.cut) - 1  # the nose's centre goes over the start first
    number, chain = -1, 0
    for element in stretch.cut:
        if element.role == "entry" and extra > 0:
            extra -= 1
            continue
        if element.start == element.end and not element.turn:
            number += element.role not in ("corner", "exit")
            continue
        curve = Curve(element.start, element.end, element.centre, element.turn)
        if element.role == "exit":
            yield Piece(EXIT, element.line, curve, chain)
        elif element.role == "corner":
            ahead = place[number + 1] if number + 1 < len(place) else None
            role = chains[ahead[0]].corner(ahead[1]) if ahead and element.kind != TRAVERSE else RAPID
            yield Piece(role, element.line, curve, ahead[0] if ahead else chain)
        else:
            number += 1
            here = place[number]
            if here is None:
                role = ENTRY if element.role == "entry" else RAPID
                yield Piece(role, element.line, curve, min(chain + (role == RAPID), len(chains) - 1))
            else:
                chain = here[0]
                for role, part in chains[chain].split(here[1], curve):
                    yield Piece(role, element.line, part, chain)
