"""A path as a part program, in LinuxCNC's dialect of RS274NGC."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import dist, hypot, inf, pi

from rds.core.errors import InputError
from rds.core.geometry import sweep
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.nc.paths.measure import pieces
from rds.nc.paths.numbers import BLEND, FARTHEST, FEED_RATE, HEIGHT, SPINDLE, number, point_text

# An arc's end may be off its circle by either of these (LinuxCNC, interp_internal.hh and "G2, G3 Arc Move").
ARC_TOLERANCE = 2 * 0.01 * 2**0.5  # mm
ARC_RELATIVE_TOLERANCE = 0.001  # of the radius; an end off by 100 ARC_TOLERANCE is refused whatever the radius
LEAST_RADIUS = 0.0013  # mm; LinuxCNC refuses arcs of less than 0.00005 inch
DECIMALS = 4
_COMMENT = 200  # characters; LinuxCNC's lines end at 255
_ACTIVE = re.compile(r"(msg|debug|print|log|py|abort|probe)", re.IGNORECASE)  # comments that LinuxCNC acts on


def part_program(
    segments: Sequence[Segment],
    title: str = "",
    *,
    safe_height: float | None = None,
    spindle: float | None = None,
    blend: float | None = None,
    decimals: int = DECIMALS,
) -> str:
    """The text of a part program that cuts along `segments` (of X, Y and Z, in mm and mm/s; arcs in the XY plane).

    It sets G17 G21 G40 G90 G91.1 G94; F in mm/min, absolute coordinates in mm with so many `decimals`, arcs in the
    centre format. With `safe_height` (z in mm, above the path) the tool goes to each piece of the path in rapid moves
    at that height, and back to it at the end; without it the tool feeds straight from where it stands to the start, as
    three-axis-mill's does from its origin. Arcs with a radius of less than 1.3 µm become straight. `spindle` (rev/min)
    turns it clockwise; `blend` (mm) writes G64 P.

    InputError for a path with gaps and no safe height, a safe height not above the path, an arc that is off its circle
    by more than LinuxCNC's tolerances (as given, or because of too few decimals), and numbers that make no sense.
    """
    return "\n".join(
        [
            *_lines(
                list(segments),
                title,
                None if safe_height is None else number(safe_height, "safe height", "program", HEIGHT),
                None if spindle is None else number(spindle, "spindle speed", "program", SPINDLE),
                None if blend is None else number(blend, "blend", "program", BLEND),
                decimals,
            ),
            "",
        ]
    )


def comment(text: str) -> str:
    """`text` as a comment that no interpreter takes for anything else: ASCII, no parentheses, not too long."""
    plain = text.replace("°", " deg").replace("(", "[").replace(")", "]").replace("\n", " ")
    plain = re.sub(r"[^ -~]", "?", plain).strip()
    if _ACTIVE.match(plain):
        plain = f"- {plain}"
    return f"({plain[:_COMMENT]})"


def _lines(
    segments: list[Segment],
    title: str,
    safe_height: float | None,
    spindle: float | None,
    blend: float | None,
    decimals: int,
) -> Iterator[str]:
    if not isinstance(decimals, int) or not 1 <= decimals <= 9:
        raise InputError(f"program: decimals = {decimals!r} must be a whole number from 1 to 9")
    if not segments:
        raise InputError("program: the path has no segments; there is nothing to write")
    found = pieces(segments)
    _check(found, safe_height)
    for line in title.splitlines():
        yield comment(line)
    yield "G17 G21 G40 G90 G91.1 G94"
    if blend is not None:
        yield f"G64 P{written(blend, max(decimals, DECIMALS))}"
    if spindle is not None:
        yield f"S{written(spindle, 3)} M3"
    writer = MoveWriter(decimals)
    if safe_height is not None:
        yield f"G0 Z{written(safe_height, decimals)}"
    for piece in found:
        yield from writer.approach(piece[0], safe_height)
        for segment in piece:
            yield from writer.cut(segment)
        if safe_height is not None:
            yield f"G0 Z{written(safe_height, decimals)}"
    if spindle is not None:
        yield "M5"
    yield "M2"


class MoveWriter:
    """Writes moves with those words only that change; what counts is the position as it was printed."""

    def __init__(self, decimals: int):
        self.decimals = decimals
        self.at: tuple[float, ...] = ()
        self.feed = ""

    def approach(self, first: Segment, safe_height: float | None) -> Iterator[str]:
        """To the start of a piece: over it in rapid moves and down at its feed rate, or straight at its feed rate."""
        x, y, z = self.at = self._rounded(first.start)
        if safe_height is None:
            yield f"G1 X{self._word(x)} Y{self._word(y)} Z{self._word(z)}{self._feed(first)}"
        else:
            yield f"G0 X{self._word(x)} Y{self._word(y)}"
            yield f"G1 Z{self._word(z)}{self._feed(first)}"

    def descend(self, piece: Sequence[Segment], height: float, plunge: float) -> Iterator[str]:
        """A piece from above: over its start and down to `height` (mm) in rapid moves, then at `plunge` (mm/s)."""
        x, y, z = self.at = self._rounded(piece[0].start)
        yield f"G0 X{self._word(x)} Y{self._word(y)}"
        if height > z:
            yield f"G0 Z{self._word(height)}"
        yield f"G1 Z{self._word(z)}{self._feed(LineSegment(self.at, self.at, plunge))}"
        for segment in piece:
            yield from self.cut(segment)

    def cut(self, segment: Segment) -> Iterator[str]:
        """The segment as one line; none where it is shorter than the last decimal."""
        end = self._rounded(segment.end)
        offset = None if isinstance(segment, LineSegment) else self._offset(segment, end)
        if isinstance(segment, LineSegment) or offset is None:
            words = [f"{axis}{self._word(v)}" for axis, v, u in zip("XYZ", end, self.at, strict=True) if v != u]
            if words:
                yield f"G1 {' '.join(words)}{self._feed(segment)}"
        else:
            words = [f"X{self._word(end[0])}", f"Y{self._word(end[1])}"]
            words += [f"Z{self._word(end[2])}"] if end[2] != self.at[2] else []
            words += [f"I{self._word(offset[0])}", f"J{self._word(offset[1])}"]
            yield f"{'G2' if segment.clockwise else 'G3'} {' '.join(words)}{self._feed(segment)}"
        self.at = end

    def _offset(self, arc: ArcSegment, end: tuple[float, ...]) -> tuple[float, float] | None:
        """I and J; None where the arc has to be a line: too small for LinuxCNC, or rounded to go the long way round."""
        i, j = (round(arc.centre[k] - self.at[k], self.decimals) for k in (0, 1))
        centre = (self.at[0] + i, self.at[1] + j, self.at[2])
        if min(hypot(i, j), dist(end[:2], centre[:2])) < LEAST_RADIUS:
            return None
        printed = ArcSegment(self.at, end, centre, arc.feed_rate, arc.clockwise)
        if abs(sweep(printed) - sweep(arc)) > pi:
            return None
        if off_circle(printed) > 1.0:
            raise InputError(
                f"program: with {self.decimals} decimals the arc to {point_text(arc.end)} is off its circle by more "
                f"than LinuxCNC allows; take {min(self.decimals + 2, 9)} decimals"
            )
        return i, j

    def _rounded(self, point: Sequence[float]) -> tuple[float, ...]:
        return tuple(round(value, self.decimals) + 0.0 for value in point)

    def _word(self, value: float) -> str:
        return written(value, self.decimals)

    def _feed(self, segment: Segment) -> str:
        word = f" F{written(segment.feed_rate * 60.0, 6)}"
        if word == " F0":
            raise InputError(f"program: feed rate = {segment.feed_rate:g} mm/s is F0 in a program; give a larger one")
        if word == self.feed:
            return ""
        self.feed = word
        return word


def off_circle(arc: ArcSegment) -> float:
    """How far the end of an arc is off its circle, as a multiple of what LinuxCNC allows (more than 1: refused)."""
    first, last = (hypot(*(p[k] - arc.centre[k] for k in arc.plane)) for p in (arc.start, arc.end))
    if first == 0.0:
        return inf
    error = abs(last - first)
    absolute = error / ARC_TOLERANCE
    return max(min(absolute, error / (ARC_RELATIVE_TOLERANCE * first)), absolute / 100.0)


def _check(found: list[list[Segment]], safe_height: float | None) -> None:
    """InputError for what no program can say."""
    for piece in found:
        for segment in piece:
            _check_segment(segment)
    if safe_height is None:
        if len(found) > 1:
            raise InputError(
                f"program: the path is in {len(found)} pieces, and without a safe height the tool would cut its way "
                "from one to the next; give a safe height"
            )
        return
    highest = max(point[2] for piece in found for segment in piece for point in (segment.start, segment.end))
    if safe_height <= highest:
        raise InputError(
            f"program: safe height = {safe_height:g} mm is not above the path, which reaches z = {highest:g} mm; "
            "give a larger one"
        )


def _check_segment(segment: Segment) -> None:
    points = [segment.start, segment.end]
    if isinstance(segment, ArcSegment):
        points.append(segment.centre)
    if any(len(point) != 3 for point in points):
        raise InputError(f"program: {segment} must have X, Y and Z; give each point three coordinates")
    if not all(abs(value) <= FARTHEST for point in points for value in point):
        raise InputError(f"program: {segment} leaves the space of {FARTHEST:g} mm; are its numbers in mm?")
    number(segment.feed_rate, "feed rate", "program", FEED_RATE)
    if isinstance(segment, ArcSegment) and segment.plane != (0, 1):
        raise InputError(f"program: {segment} is not in the XY plane; only arcs about Z are written")
    if isinstance(segment, ArcSegment) and off_circle(segment) > 1.0:
        raise InputError(
            f"program: the end of {segment} is off its circle by more than LinuxCNC allows "
            f"({ARC_TOLERANCE:.3f} mm and {ARC_RELATIVE_TOLERANCE:.1%} of the radius); correct its centre or its end"
        )


def written(value: float, decimals: int) -> str:
    """The value as programs have it: no exponent, no zeros at its end."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text
