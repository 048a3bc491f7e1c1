"""`rds nc make`: part programs of paths that nobody wrote in G-code."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from rds.cli.common import Json, print_json, refusals, writes_files
from rds.cli.option_names import named_by_options

if TYPE_CHECKING:
    from rds.core.types import Segment
    from rds.nc.paths.outlines import Outline

app = typer.Typer(
    no_args_is_help=True,
    help="Make a part program of a line, a quadrilateral, an arc, a cone, points, a drawing, or a job of operations.",
)


def _feed(value: float) -> float:
    """Refused here and not by the makers, which take and name mm/s."""
    if not 0 < value < math.inf:
        raise typer.BadParameter(f"{value:g} must be a number above 0, in mm/min")
    return value


Feed = Annotated[float, typer.Option("--feed", "-f", callback=_feed, help="Feed rate along the path, mm/min.")]
Centre = Annotated[str, typer.Option(help="Centre x,y in mm.")]
Depth = Annotated[float, typer.Option(help="Depth below z = 0, mm.")]


@dataclass(frozen=True)
class Made:
    """A path, what it is in a few words, and what there is to say of it besides."""

    segments: Sequence[Segment]
    said: str
    more: dict[str, Any] = field(default_factory=dict)
    drawing: Outline | None = None
    source: Path | None = None  # the file that it was read from


def written(
    out: Annotated[Path, typer.Option("--out", "-o", help="The part program to write.")],
    safe: Annotated[
        float | None, typer.Option(help="z of rapid moves to and from the path, mm; without it the tool feeds there.")
    ] = None,
    spindle: Annotated[float | None, typer.Option(help="Spindle speed, rev/min, clockwise.")] = None,
    blend: Annotated[float | None, typer.Option(help="Corners may be rounded by this much (G64 P), mm.")] = None,
    decimals: Annotated[int, typer.Option(min=1, max=9, help="Decimals of coordinates, in mm.")] = 4,
    plot: Annotated[Path | None, typer.Option(help="Also save a picture of the path (PNG).")] = None,
    json: Json = False,
    *,
    make: Callable[[], Made],
    options: Collection[str] = (),
) -> None:
    """Write what `make` makes as a part program, perhaps with a picture (both or none), and tell of it."""
    with refusals():
        from rds.core.atomic import keep_another, write_files
        from rds.core.errors import InputError
        from rds.nc.paths.measure import summary
        from rds.nc.paths.program import part_program

        if plot is not None and (plot.suffix.lower() != ".png" or plot.resolve() == out.resolve()):
            raise InputError(f"--plot {plot}: a picture is a PNG file beside the program; end its name in .png")
        with named_by_options(options):
            made = make()
        if made.source is not None and out.exists() and out.samefile(made.source):
            raise InputError("is the file to read from; write the part program to another one", str(out))
        keep_another(out, "rds nc make", "program of `rds nc make`")
        title = f"rds nc make: {made.said}"
        if made.more.get("deviation_mm"):
            title += f"\ndeviation {made.more['deviation_mm']:.4f} mm"
        with named_by_options(options):
            text = part_program(
                made.segments, title, safe_height=safe, spindle=spindle, blend=blend, decimals=decimals
            ).encode()
        writers: dict[Path, Callable[[Any], None]] = {out: lambda stream: stream.write(text)}
        if plot is not None:
            from rds.nc.paths.pictures import picture

            image = picture(made.segments, made.said, drawing=made.drawing).png()
            writers[plot] = lambda stream: stream.write(image)
        write_files(writers)
        found: dict[str, Any] = {"file": str(out), "picture": None if plot is None else str(plot)}
        found |= {**summary(made.segments), **made.more}
    if json:
        print_json(found)
    else:
        _tell(found)


_OURS = ("make", "options")  # parameters of `written` that are no options of its commands


def maker(make: Callable[..., Made]) -> Callable[..., None]:
    """A command of `make`'s own options and those of `written`."""
    own = inspect.signature(make).parameters
    shared = {name: p for name, p in inspect.signature(written).parameters.items() if name not in _OURS}
    hints = get_type_hints(make, include_extras=True) | get_type_hints(
        written, {**globals(), "Made": Any}, include_extras=True
    )

    options = {name.replace("_", "-") for name in (*own, *shared)}

    @wraps(make)
    def command(**given: Any) -> None:
        mine = {name: given.pop(name) for name in own}
        written(**given, make=lambda: make(**mine), options=options)

    parameters = [p.replace(kind=p.KEYWORD_ONLY, annotation=hints[p.name]) for p in (*own.values(), *shared.values())]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return app.command()(writes_files(command))


@maker
def line(
    start: Annotated[str, typer.Option(help="Start x,y or x,y,z in mm (z is 0 unless given).")],
    end: Annotated[str, typer.Option(help="End, likewise.")],
    feed: Feed,
) -> Made:
    """A straight cut between two points in space, all axes starting and ending together."""
    from rds.nc.paths.lines import line as make

    return Made(make(_numbers(start, "--start"), _numbers(end, "--end"), feed / 60), f"line from {start} to {end} mm")


@maker
def quad(
    feed: Feed,
    corner: Annotated[
        list[str] | None, typer.Option(help="A corner x,y or x,y,z in mm; four of them, in their order.")
    ] = None,
    start: Annotated[str | None, typer.Option(help="The first corner, where the sides are given by --move.")] = None,
    move: Annotated[
        list[str] | None,
        typer.Option(help="A side: direction (degrees), length (mm), change in z (mm, 0 unless given); three of them."),
    ] = None,
) -> Made:
    """A quadrilateral, closed: by four corners, or by one corner and three sides (the fourth leads back)."""
    from rds.core.errors import InputError
    from rds.nc.paths.lines import quadrilateral, quadrilateral_by_moves

    if bool(corner) == bool(start is not None or move):
        raise InputError("quad: give --corner four times, or --start and --move three times")
    if corner:
        corners = [_numbers(text, "--corner") for text in corner]
        return Made(quadrilateral(corners, feed / 60), f"quadrilateral {' '.join(corner)} mm")
    if start is None:
        raise InputError("quad: --move needs a corner to begin at; give --start")
    moves: Any = [_numbers(text, "--move") for text in move or []]
    segments = quadrilateral_by_moves(_numbers(start, "--start"), moves, feed / 60)
    return Made(segments, f"quadrilateral from {start} mm by {' '.join(move or [])} (degrees, mm, mm)")


@maker
def arc(
    centre: Centre,
    radius: Annotated[float, typer.Option(help="Radius, mm.")],
    start_angle: Annotated[float, typer.Option(help="Angle from +X to the start, degrees.")],
    sweep: Annotated[float, typer.Option(help="Degrees; positive counter-clockwise, 360 a circle, more for turns.")],
    feed: Feed,
    depth: Depth = 0.0,
    end_depth: Annotated[float | None, typer.Option(help="Depth at the end, mm: the arc becomes a helix.")] = None,
) -> Made:
    """An arc, a circle or a helix by centre, radius, start angle and sweep."""
    from rds.nc.paths.arcs import arc as make

    middle = _numbers(centre, "--centre")
    segments = make(middle, radius, start_angle, sweep, feed / 60, depth=depth, end_depth=end_depth)
    helix = "" if end_depth is None else f" to {end_depth:g} mm"
    said = f"arc about {centre} mm, radius {radius:g} mm, {sweep:g}° from {start_angle:g}°, depth {depth:g} mm{helix}"
    return Made(segments, said)


@maker
def cone(
    centre: Centre,
    radius: Annotated[float, typer.Option(help="Radius of the circle at the bottom, mm.")],
    height: Annotated[float, typer.Option(help="Depth of the bottom below z = 0, mm.")],
    step_height: Annotated[float, typer.Option(help="Rise of one turn, mm.")],
    step_width: Annotated[float, typer.Option(help="Narrowing of one turn, mm.")],
    feed: Feed,
    step_angle: Annotated[float | None, typer.Option(help="Degrees for each chord; 2 unless given.")] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Largest distance of a chord from the spiral, mm, instead of --step-angle.")
    ] = None,
) -> Made:
    """A spiral cone: a circle at the bottom, then a spiral up and inwards to z = 0."""
    from rds.nc.paths.cone import chord_angle, chord_error, spiral_cone

    middle, options = _numbers(centre, "--centre"), {"step_angle": step_angle, "tolerance": tolerance}
    segments = spiral_cone(middle, radius, height, step_height, step_width, feed / 60, **options)
    error = chord_error(radius, step_width, chord_angle(radius, step_width, **options))
    said = f"spiral cone about {centre} mm, radius {radius:g} mm, height {height:g} mm, "
    said += f"step height {step_height:g} mm, step width {step_width:g} mm"
    return Made(segments, said, {"deviation_mm": error, "tolerance_mm": tolerance})


@maker
def points(
    file: Annotated[
        Path, typer.Argument(help="Text with a point a line: x, y and perhaps z, and a header with units.")
    ],
    feed: Feed,
    unit: Annotated[str | None, typer.Option(help="mm, cm, m, um or in, where the file does not say.")] = None,
    depth: Annotated[float | None, typer.Option(help="Depth below z = 0 of points without z, mm.")] = None,
    close: Annotated[bool, typer.Option("--close", help="Go back to the first point at the end.")] = False,
    tolerance: Annotated[
        float | None, typer.Option(help="Fit arcs and longer lines that keep within this distance, mm.")
    ] = None,
) -> Made:
    """A path through the points of a file, in lines, or with --tolerance in arcs and lines."""
    from rds.nc.paths.points import path_of_points, read_points

    read = read_points(file, unit)
    segments, deviation = path_of_points(read, feed / 60, depth=depth, closed=close, tolerance=tolerance)
    more: dict[str, Any] = {"points": sum(map(len, read.pieces)), "repeated_points_left_out": read.repeated}
    more |= {} if tolerance is None else {"deviation_mm": deviation, "tolerance_mm": tolerance}
    return Made(segments, f"points of {file.name}", more, source=file)


@maker
def outline(
    file: Annotated[Path, typer.Argument(help="A drawing: PNG, JPEG or PGM image, or text of # and . (.txt).")],
    pixel: Annotated[float, typer.Option(help="Size of a pixel or character, mm.")],
    feed: Feed,
    at: Annotated[str, typer.Option(help="Place of the drawing's lower left corner, x,y in mm.")] = "0,0",
    depth: Depth = 0.0,
    passes: Annotated[int, typer.Option(min=1, help="Equal steps in which the depth is reached.")] = 1,
    trace: Annotated[
        str, typer.Option(help="contour (between the pixels) or blob (through their centres).")
    ] = "contour",
    tolerance: Annotated[
        float, typer.Option(help="Smooth the outline; how far it may be from the traced one, mm.")
    ] = 0.0,
    arcs: Annotated[bool, typer.Option("--arcs", help="Cut the smoothed outline in arcs as well as lines.")] = False,
    holes: Annotated[str, typer.Option(help="refuse, fill (outer outline alone) or cut (each hole too).")] = "refuse",
    level: Annotated[
        str | None,
        typer.Option(help="Darkness, 0 to 1, from which on a pixel belongs to the shape (0.5), or auto: Otsu's."),
    ] = None,
    invert: Annotated[bool, typer.Option("--invert", help="The shape is light on dark.")] = False,
    specks: Annotated[
        int | None, typer.Option(min=0, help="Leave out islands and holes of at most so many pixels.")
    ] = None,
    blur: Annotated[float | None, typer.Option(min=0.0, help="Smooth the darkness over so many pixels first.")] = None,
    photo: Annotated[
        bool,
        typer.Option(
            "--photo",
            help="Clean a photograph: --level auto, --blur 1.5, --specks of 0.1 % of the pixels, unless given; parts "
            "one pixel wide are left out, and parts that touch at a corner joined.",
        ),
    ] = False,
) -> Made:
    """The outline of the shape in a drawing, counter-clockwise and closed."""
    from rds.nc.paths.drawing import read_drawing
    from rds.nc.paths.outlines import outline as make

    darkness = read_drawing(file)
    if specks is None:
        specks = darkness.size // 1000 if photo else 0
    options: dict[str, Any] = {"method": trace, "holes": holes, "invert": invert, "arcs": arcs, "photo": photo}
    options |= {"level": _level(level, photo), "blur": (1.5 if photo else 0.0) if blur is None else blur}
    options |= {"specks": specks, "tolerance": tolerance, "at": _numbers(at, "--at"), "depth": depth, "passes": passes}
    traced = make(darkness, pixel, feed / 60, name=str(file), **options)
    rows, columns = traced.darkness.shape
    said = f"outline of {file.name}, {columns} x {rows} pixels of {pixel:g} mm"
    more = {"deviation_mm": traced.deviation, "tolerance_mm": tolerance, "outlines": len(traced.rings)}
    more["specks_left_out"] = traced.specks
    return Made(traced.segments, said, more, traced, file)


def _level(text: str | None, photo: bool) -> float | None:
    """The level as a number; None for the automatic one."""
    if text == "auto" or (text is None and photo):
        return None
    return 0.5 if text is None else _numbers(text, "--level")[0]


def _numbers(text: str, option: str) -> list[float]:
    from rds.core.errors import InputError

    try:
        return [float(word) for word in text.split(",")]
    except ValueError as error:
        raise InputError(f"{option} {text!r} is not numbers with commas between them, as in 10,-2.5") from error


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


def _tell(found: dict[str, Any]) -> None:
    extent = ", ".join(f"{axis} {low:.4g} to {high:.4g}" for axis, (low, high) in found["extent_mm"].items())
    shape = "closed" if found["closed"] else "open"
    pieces = "" if found["pieces"] == 1 else f" in {found['pieces']} pieces"
    typer.echo(
        f"{found['file']}: {_count(found['lines'], 'line')}, {_count(found['arcs'], 'arc')}{pieces}, {shape}; "
        f"{found['length_mm']:.2f} mm, {found['cutting_time_s']:.1f} s at the feed rate; {extent} mm"
    )
    if found.get("deviation_mm") or found.get("tolerance_mm"):
        limit = found["tolerance_mm"]
        allowed = f" (tolerance {limit:g} mm)" if limit else ""
        typer.echo(f"deviation: {found['deviation_mm']:.4f} mm at most{allowed}")
    if found.get("repeated_points_left_out"):
        points = _count(found["repeated_points_left_out"], "point")
        typer.echo(f"left out, as they repeat the one before: {points}")
    if found.get("specks_left_out"):
        typer.echo(f"left out, as islands or holes of few pixels: {_count(found['specks_left_out'], 'speck')}")
    if found["picture"]:
        typer.echo(f"picture: {found['picture']}")
