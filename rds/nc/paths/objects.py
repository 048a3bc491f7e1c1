"""The objects of three-axis-mill, as their numbers are typed: one declaration for `rds nc make` and for the page.

What a maker takes is its signature: `Annotated` has the declaration (meaning, unit, range), a default says that it may
be left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rds.core.errors import InputError
from rds.core.quantities import Choice, Flag, Quantity

if TYPE_CHECKING:
    from rds.core.types import Segment
    from rds.nc.paths.outlines import Outline


@dataclass(frozen=True)
class Numbers:
    """Numbers with commas between them, as in 10,-2.5. `form` says which; `sizes`: how many there may be."""

    meaning: str
    form: str
    sizes: tuple[int, ...]


@dataclass(frozen=True)
class File:
    """A file that is read."""

    meaning: str


@dataclass(frozen=True)
class MadePath:
    """A path, what it is in a few words, and what there is to say of it besides."""

    segments: Sequence[Segment]
    said: str
    more: dict[str, Any] = field(default_factory=dict)
    drawing: Outline | None = None
    source: Path | None = None  # the file that it was read from

    @property
    def title(self) -> str:
        """The comment at the head of its program, by which `rds nc make` knows its own files."""
        deviation = self.more.get("deviation_mm")
        return f"rds nc make: {self.said}" + (f"\ndeviation {deviation:.4f} mm" if deviation else "")


FEED = Quantity("feed rate along the path", "mm/min", above=0.0)
DEPTH = Quantity("depth below z = 0", "mm")
CENTRE = Numbers("centre x,y in mm", "x,y [mm]", (2,))
POINT = "x,y,z [mm]"
SIDE = "direction,length,change in z [°, mm, mm]"


def line(
    start: Annotated[str, Numbers("start x,y or x,y,z in mm (z is 0 unless given)", POINT, (2, 3))],
    end: Annotated[str, Numbers("end x,y or x,y,z in mm (z is 0 unless given)", POINT, (2, 3))],
    feed: Annotated[float, FEED],
) -> MadePath:
    """A straight cut between two points in space, all axes starting and ending together."""
    from rds.nc.paths.lines import line as make

    return MadePath(make(numbers(start, "start"), numbers(end, "end"), feed / 60), f"line from {start} to {end} mm")


def quad(
    feed: Annotated[float, FEED],
    corner: Annotated[
        list[str] | None, Numbers("a corner x,y or x,y,z in mm; four of them, in their order", POINT, (2, 3))
    ] = None,
    start: Annotated[str | None, Numbers("the first corner, from which three moves go on", POINT, (2, 3))] = None,
    move: Annotated[
        list[str] | None,
        Numbers(
            "a side: direction (degrees), length (mm), change in z (mm, 0 unless given); three of them", SIDE, (2, 3)
        ),
    ] = None,
) -> MadePath:
    """A quadrilateral, closed: by four corners, or by one corner and three sides (the fourth leads back)."""
    from rds.nc.paths.lines import quadrilateral, quadrilateral_by_moves

    if bool(corner) == bool(start is not None or move):
        raise InputError("quad: give --corner four times, or --start and --move three times")
    if corner:
        corners = [numbers(text, "corner") for text in corner]
        return MadePath(quadrilateral(corners, feed / 60), f"quadrilateral {' '.join(corner)} mm")
    if start is None:
        raise InputError("quad: --move needs a corner to begin at; give --start")
    moves: Any = [numbers(text, "move") for text in move or []]
    segments = quadrilateral_by_moves(numbers(start, "start"), moves, feed / 60)
    return MadePath(segments, f"quadrilateral from {start} mm by {' '.join(move or [])} (degrees, mm, mm)")


def arc(
    centre: Annotated[str, CENTRE],
    radius: Annotated[float, Quantity("radius", "mm", above=0.0)],
    start_angle: Annotated[float, Quantity("angle from +X to the start", "degrees")],
    sweep: Annotated[float, Quantity("angle swept, counter-clockwise; 360 a circle, more for turns", "degrees")],
    feed: Annotated[float, FEED],
    depth: Annotated[float, DEPTH] = 0.0,
    end_depth: Annotated[float | None, Quantity("depth at the end, with which the arc becomes a helix", "mm")] = None,
) -> MadePath:
    """An arc, a circle or a helix by centre, radius, start angle and sweep."""
    from rds.nc.paths.arcs import arc as make

    middle = numbers(centre, "centre")
    segments = make(middle, radius, start_angle, sweep, feed / 60, depth=depth, end_depth=end_depth)
    helix = "" if end_depth is None else f" to {end_depth:g} mm"
    said = f"arc about {centre} mm, radius {radius:g} mm, {sweep:g}° from {start_angle:g}°, depth {depth:g} mm{helix}"
    return MadePath(segments, said)


def cone(
    centre: Annotated[str, CENTRE],
    radius: Annotated[float, Quantity("radius of the circle at the bottom", "mm", above=0.0)],
    height: Annotated[float, Quantity("depth of the bottom below z = 0", "mm", above=0.0)],
    step_height: Annotated[float, Quantity("rise of one turn", "mm", above=0.0)],
    step_width: Annotated[float, Quantity("narrowing of one turn", "mm", low=0.0)],
    feed: Annotated[float, FEED],
    step_angle: Annotated[
        float | None, Quantity("angle of a chord, 2 unless given", "degrees", above=0.0, high=45.0)
    ] = None,
    tolerance: Annotated[
        float | None,
        Quantity("largest distance of a chord from the spiral, instead of the step angle", "mm", above=0.0),
    ] = None,
) -> MadePath:
    """A spiral cone: a circle at the bottom, then a spiral up and inwards to z = 0."""
    from rds.nc.paths.cone import chord_angle, chord_error, spiral_cone

    middle, options = numbers(centre, "centre"), {"step_angle": step_angle, "tolerance": tolerance}
    segments = spiral_cone(middle, radius, height, step_height, step_width, feed / 60, **options)
    error = chord_error(radius, step_width, chord_angle(radius, step_width, **options))
    said = f"spiral cone about {centre} mm, radius {radius:g} mm, height {height:g} mm, "
    said += f"step height {step_height:g} mm, step width {step_width:g} mm"
    return MadePath(segments, said, {"deviation_mm": error, "tolerance_mm": tolerance})


def points(
    file: Annotated[Path, File("text with a point a line: x, y and perhaps z, and a header with units")],
    feed: Annotated[float, FEED],
    unit: Annotated[
        str | None,
        Choice("unit of the points where the file does not say it: mm, cm, m, um or in", ("mm", "cm", "m", "um", "in")),
    ] = None,
    depth: Annotated[float | None, Quantity("depth below z = 0 of points without z", "mm")] = None,
    close: Annotated[bool, Flag("go back to the first point at the end")] = False,
    tolerance: Annotated[
        float | None, Quantity("fit arcs and longer lines that keep within this distance", "mm", above=0.0)
    ] = None,
) -> MadePath:
    """A path through the points of a file, in lines, or with a tolerance in arcs and lines."""
    from rds.nc.paths.points import path_of_points, read_points

    read = read_points(file, unit)
    segments, deviation = path_of_points(read, feed / 60, depth=depth, closed=close, tolerance=tolerance)
    more: dict[str, Any] = {"points": sum(map(len, read.pieces)), "repeated_points_left_out": read.repeated}
    more |= {} if tolerance is None else {"deviation_mm": deviation, "tolerance_mm": tolerance}
    return MadePath(segments, f"points of {file.name}", more, source=file)


OBJECTS: dict[str, Callable[..., MadePath]] = {"line": line, "quad": quad, "arc": arc, "cone": cone, "points": points}


def numbers(text: str, name: str) -> list[float]:
    """The numbers of `text`; InputError that begins with `name`."""
    try:
        return [float(word) for word in text.split(",")]
    except ValueError as error:
        raise InputError(f"{name} {text!r} is not numbers with commas between them, as in 10,-2.5") from error
