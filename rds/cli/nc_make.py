"""`rds nc make`: part programs of paths that nobody wrote in G-code."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Collection
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer
from typer.models import ArgumentInfo, OptionInfo

from rds.cli.common import Json, declared, print_json, refusals, writes_files
from rds.cli.option_groups import take
from rds.cli.option_names import named_by_options
from rds.core.quantities import Flag, Quantity
from rds.nc.paths.numbers import BLEND, DECIMALS, HEIGHT, SPINDLE
from rds.nc.paths.objects import DEPTH, FEED, OBJECTS, File, MadePath, numbers

app = typer.Typer(
    no_args_is_help=True,
    help="Make a part program of a line, a quadrilateral, an arc, a cone, points, a drawing, or a job of operations.",
)


def _feed(value: float) -> float:
    """Refused here and not by the makers, which take and name mm/s."""
    if not 0 < value < math.inf:
        raise typer.BadParameter(f"{value:g} must be a number above 0, in mm/min")
    return value


def _sentence(meaning: str) -> str:
    return f"{meaning[0].upper()}{meaning[1:]}."


Feed = Annotated[float, typer.Option("--feed", "-f", callback=_feed, help=_sentence(FEED.described))]


def _option(name: str, hint: Any) -> Any:
    """What typer is told of a parameter that has a declaration."""
    if name == "feed":
        return Feed
    kind, said = get_args(hint)
    if isinstance(said, OptionInfo | ArgumentInfo):
        return hint
    words = _sentence(said.described if isinstance(said, Quantity) else said.meaning)
    if isinstance(said, File):
        return Annotated[kind, typer.Argument(help=words)]
    if isinstance(said, Flag):
        return Annotated[kind, typer.Option(f"--{name}", help=words)]
    return Annotated[kind, typer.Option(help=words)]


def written(
    out: Annotated[Path, typer.Option("--out", "-o", help="The part program to write.")],
    safe: Annotated[float | None, declared(HEIGHT)] = None,
    spindle: Annotated[float | None, declared(SPINDLE)] = None,
    blend: Annotated[float | None, declared(BLEND, "G64 P")] = None,
    decimals: Annotated[int, declared(DECIMALS)] = 4,
    plot: Annotated[Path | None, typer.Option(help="Also save a picture of the path (PNG).")] = None,
    json: Json = False,
    *,
    make: Callable[[], MadePath],
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
        with named_by_options(options):
            text = part_program(
                made.segments, made.title, safe_height=safe, spindle=spindle, blend=blend, decimals=decimals
            ).encode()
        files = {out: text}
        if plot is not None:
            from rds.nc.paths.pictures import picture

            files[plot] = picture(made.segments, made.said, drawing=made.drawing).png()
        write_files(files)
        found: dict[str, Any] = {"file": str(out), "picture": None if plot is None else str(plot)}
        found |= {**summary(made.segments), **made.more}
    if json:
        print_json(found)
    else:
        _tell(found)


_OURS = ("make", "options")  # parameters of `written` that are no options of its commands
_SHARED = {name: p for name, p in inspect.signature(written).parameters.items() if name not in _OURS}
_SHARED_HINTS = get_type_hints(written, include_extras=True)


def maker(make: Callable[..., MadePath]) -> Callable[..., None]:
    """A command of `make`'s own options and those of `written`."""
    own = inspect.signature(make).parameters
    declared_hints = get_type_hints(make, include_extras=True)
    hints = {name: _option(name, declared_hints[name]) for name in own} | _SHARED_HINTS

    options = {name.replace("_", "-") for name in (*own, *_SHARED)}

    @wraps(make)
    def command(**given: Any) -> None:
        mine = {name: given.pop(name) for name in own}
        written(**given, make=lambda: make(**mine), options=options)

    parameters = [p.replace(kind=p.KEYWORD_ONLY, annotation=hints[p.name]) for p in (*own.values(), *_SHARED.values())]
    take(command, parameters)
    return app.command()(writes_files(command))


for _make in OBJECTS.values():
    maker(_make)


@maker
def outline(
    file: Annotated[Path, typer.Argument(help="A drawing: PNG, JPEG or PGM image, or text of # and . (.txt).")],
    pixel: Annotated[float, typer.Option(help="Size of a pixel or character, mm.")],
    feed: Feed,
    at: Annotated[str, typer.Option(help="Place of the drawing's lower left corner, x,y in mm.")] = "0,0",
    depth: Annotated[float, DEPTH] = 0.0,
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
) -> MadePath:
    """The outline of the shape in a drawing, counter-clockwise and closed."""
    from rds.nc.paths.drawing import read_drawing
    from rds.nc.paths.outlines import outline as make

    darkness = read_drawing(file)
    if specks is None:
        specks = darkness.size // 1000 if photo else 0
    options: dict[str, Any] = {"method": trace, "holes": holes, "invert": invert, "arcs": arcs, "photo": photo}
    options |= {"level": _level(level, photo), "blur": (1.5 if photo else 0.0) if blur is None else blur}
    options |= {"specks": specks, "tolerance": tolerance, "at": numbers(at, "at"), "depth": depth, "passes": passes}
    traced = make(darkness, pixel, feed / 60, name=str(file), **options)
    rows, columns = traced.darkness.shape
    said = f"outline of {file.name}, {columns} x {rows} pixels of {pixel:g} mm"
    more = {"deviation_mm": traced.deviation, "tolerance_mm": tolerance, "outlines": len(traced.rings)}
    more["specks_left_out"] = traced.specks
    return MadePath(traced.segments, said, more, traced, file)


def _level(text: str | None, photo: bool) -> float | None:
    """The level as a number; None for the automatic one."""
    if text == "auto" or (text is None and photo):
        return None
    return 0.5 if text is None else numbers(text, "level")[0]


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
