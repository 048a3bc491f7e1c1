"""The proof of cutter compensation: how far the cutter's edge is from the programmed contour all along its path.

The deviation at a point of the path of the cutter's centre is its distance to the contour less the cutter's radius: 0
where the edge touches the contour, + where it stays clear of it, - where it gouges. Distances are those of lines and
arcs, not of polygons; the least deviation (the deepest gouge) is exact but for rounding. All is seen along the plane's
normal: a stretch from G41 or G42 to the move after G40 is measured against its own contour, at whatever height.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from rds.nc.compensation.moves import Stretch
from rds.nc.compensation.proof_geometry import Contour, Curve
from rds.nc.compensation.proof_pieces import (
    CONTACT,
    CONTOUR,
    ENTRY,
    EXIT,
    LEAD_IN,
    LEAD_OUT,
    MM,
    RAPID,
    TOLERANCE,
    Chain,
    Piece,
    divide,
)
from rds.nc.language.dialect import Dialect

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Part:
    """A piece of the path with the cutter's deviation along it, mm."""

    role: str
    line: int
    curve: Curve  # program units
    distance: np.ndarray  # path length from the stretch's beginning, mm, in the plane
    deviation: np.ndarray

    @property
    def least(self) -> float:
        """The deepest gouge (-), or how near the edge comes, mm."""
        return float(self.deviation.min())

    @property
    def greatest(self) -> float:
        """How far the edge stays from the contour, mm."""
        return float(self.deviation.max())

    @property
    def deepest_at(self) -> np.ndarray:
        """Where the cutter's centre is at the least deviation, program units."""
        length = float(self.distance[-1] - self.distance[0])
        return self.curve.at((self.distance[self.deviation.argmin()] - self.distance[0]) / length)


@dataclass(frozen=True)
class StretchProof:
    """One stretch of compensated motion, measured."""

    stretch: Stretch
    chains: tuple[Chain, ...]
    parts: tuple[Part, ...]
    uncut: float  # mm; the farthest that the edge stays from a corner of the contour: what inside corners keep

    def of(self, *roles: str) -> list[Part]:
        """The parts of some roles (all without)."""
        return [part for part in self.parts if not roles or part.role in roles]

    @property
    def radius(self) -> float:
        """The cutter's, mm."""
        return self.stretch.radius * MM[self.stretch.units]

    @property
    def lines(self) -> tuple[int, int]:
        """The first and last program line."""
        lines = [element.line for element in (*self.stretch.programmed, *self.stretch.cut)]
        return min(lines), max(lines)

    @property
    def max_deviation(self) -> float:
        """The greatest size of the deviation along the contour, mm; 0 when there is no contour."""
        return max((max(-part.least, part.greatest) for part in self.of(CONTOUR)), default=0.0)

    def range(self, *roles: str) -> tuple[float, float] | None:
        """The least and the greatest deviation of some roles, mm; None when there are no such moves."""
        parts = self.of(*roles)
        if not parts:
            return None
        return min(part.least for part in parts), max(part.greatest for part in parts)

    def gouges(self, tolerance: float = TOLERANCE) -> list[Part]:
        """Parts where the cutter's edge goes beyond the contour by more than `tolerance` mm; rapids are not judged."""
        return [part for part in self.parts if part.role != RAPID and part.least < -tolerance]


@dataclass(frozen=True)
class Proof:
    """All compensated stretches of a program."""

    name: str
    stretches: tuple[StretchProof, ...]

    @property
    def max_deviation(self) -> float:
        """The greatest size of the deviation along the contours, mm."""
        return max((stretch.max_deviation for stretch in self.stretches), default=0.0)

    def gouges(self, tolerance: float = TOLERANCE) -> list[Part]:
        """Parts of all stretches where the edge goes beyond the contour by more than `tolerance` mm."""
        return [part for stretch in self.stretches for part in stretch.gouges(tolerance)]

    def numbers(self) -> dict[str, Any]:
        """What `rds nc check --proof --json` says; lengths in mm."""
        return {
            "max_deviation_mm": self.max_deviation,
            "gouges": [_gouge(part) for part in self.gouges()],
            "stretches": [_numbers(stretch) for stretch in self.stretches],
        }

    def plot(self, stretch: int = 0) -> Figure:
        """The picture of one stretch: see rds.nc.compensation.proof_plot."""
        from rds.nc.compensation.proof_plot import plot

        return plot(self, stretch)


def _gouge(part: Part) -> dict[str, Any]:
    return {"line": part.line, "role": part.role, "depth_mm": -part.least}


def _numbers(proof: StretchProof) -> dict[str, Any]:
    first, last = proof.lines
    numbers: dict[str, Any] = {
        "lines": [first, last],
        "plane": proof.stretch.plane,
        "side": "left" if proof.stretch.side > 0 else "right",
        "radius_mm": proof.radius,
        "path_mm": float(sum(part.distance[-1] - part.distance[0] for part in proof.parts)),
        "max_deviation_mm": proof.max_deviation,
        "uncut_mm": proof.uncut,
    }
    for role in (ENTRY, LEAD_IN, CONTOUR, LEAD_OUT, EXIT):
        found = proof.range(role)
        numbers[role] = None if found is None else {"least_mm": found[0], "greatest_mm": found[1]}
    return numbers


def measure(stretch: Stretch) -> StretchProof:
    """The deviation along a recorded stretch."""
    unit = MM[stretch.units]
    chains, pieces = divide(stretch, CONTACT / unit)
    contours = [chain.contour(stretch.side) for chain in chains]
    parts: list[Part] = []
    begin = 0.0
    for piece in pieces:
        length = piece.curve.length * unit
        if contours:
            fractions, distances = contours[piece.chain].along(piece.curve)
        else:  # G41, an entry, G40: no contour
            fractions, distances = np.array([0.0, 1.0]), np.full(2, np.nan)
        parts.append(
            Part(piece.role, piece.line, piece.curve, begin + fractions * length, (distances - stretch.radius) * unit)
        )
        begin += length
    parts = [part for part in parts if not np.isnan(part.deviation).any()]
    return StretchProof(stretch, tuple(chains), tuple(parts), _uncut(stretch, chains, pieces) * unit)


def _uncut(stretch: Stretch, chains: list[Chain], pieces: list[Piece]) -> float:
    worst = 0.0
    for number, chain in enumerate(chains):
        curves = [piece.curve for piece in pieces if piece.chain == number and piece.role == CONTOUR]
        if not curves:
            continue
        path = Contour(curves, stretch.side, closed=False)
        for curve in chain.contour_curves:
            distance = abs(float(path.distance(np.array([curve.start]), path.near(Curve(curve.start, curve.start)))[0]))
            worst = max(worst, distance - stretch.radius)
    return worst


def proof(
    source: str | Path | TextIO,
    *,
    tools: Any = None,
    parameters: Any = None,
    options: Dialect = Dialect(),  # noqa: B008 (frozen)
    name: str = "",
) -> Proof:
    """Interpret a program (see `interpret`) and measure its compensated stretches. Raises ProgramError as that does."""
    from rds.nc.language.interpreter import interpret

    stretches: list[Stretch] = []
    for _ in interpret(source, tools=tools, parameters=parameters, options=options, name=name, stretches=stretches):
        pass
    title = name or (source.name if isinstance(source, Path) else "")
    return Proof(title, tuple(measure(stretch) for stretch in stretches if stretch.programmed))
