"""`rds data`: what a file of logged data holds, before anything is estimated from it; the friction curve of an axis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.common import Json, print_json, progress_bars, refusals, stdout_kept, writes_files
from rds.cli.library import NamesParts

if TYPE_CHECKING:
    from rds.identification.fit.friction_curve import FrictionCurve
    from rds.identification.logs.describe import Description

app = typer.Typer(no_args_is_help=True, help="Logged data: what a file holds, and whether it can be believed.")


@app.command(cls=NamesParts)
@writes_files
def describe(
    file: Annotated[Path, typer.Argument(help="A result of rds, or a file: {data-file}.")],
    map_: Annotated[
        Path | None, typer.Option("--map", help="What the columns mean (TOML); else FILE.map.toml beside it.")
    ] = None,
    write_map: Annotated[
        bool, typer.Option("--write-map", help="Write a draft of the map as FILE.map.toml, to be corrected.")
    ] = False,
    plot: Annotated[Path | None, typer.Option(help="Save an overview as a PNG file.")] = None,
    json: Json = False,
) -> None:
    """Columns with units, range and step; the sample period; and all that makes an estimate from it doubtful."""
    with refusals(), stdout_kept(json):
        from rds.core.errors import InputError
        from rds.identification.logs.describe import describe as described

        if plot is not None and plot.suffix.lower() != ".png":
            raise InputError(f"--plot {str(plot)!r} must end in .png")
        if write_map and map_ is not None:
            raise InputError("--write-map writes a first draft, and --map gives a map; leave one of them out")
        written = []
        if write_map:
            written.append(_write_map(file))
            typer.echo(f"rds: wrote {written[0]}, a draft: check every line of it{_to_fill_in(written[0])}", err=True)
        with progress_bars() as bar:
            found = described(file, map_, bar(f"read {file.name}"), find_map=not write_map)
        if plot is not None:
            written += _save_plot(found, plot)
    if json:
        print_json(found.to_json() | {"files": [str(path) for path in written]})
    else:
        _show(found, draft=not write_map)
        for path in written:
            typer.echo(f"wrote {path}")
    raise typer.Exit(0 if found.usable else 1)


@app.command()
@writes_files
def friction(
    logs: Annotated[list[Path], typer.Argument(help="Logs of runs at constant speed, taken together.")],
    map_: Annotated[Path | None, typer.Option("--map", help="What the logs' columns mean, a TOML file.")] = None,
    axis: Annotated[str | None, typer.Option("--axis", help="The axis, where a log holds several.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Save points and curve as a PNG file.")] = None,
    json: Json = False,
) -> None:
    """The friction curve (Coulomb, viscous, Stribeck) of each direction, from stretches of constant speed."""
    with refusals(), stdout_kept(json):
        from rds.cli.logs import read_logs
        from rds.core.atomic import write_whole
        from rds.core.errors import InputError
        from rds.identification.fit.friction_curve import friction_curve

        if plot is not None and plot.suffix.lower() != ".png":
            raise InputError(f"--plot {str(plot)!r} must end in .png")
        with progress_bars() as bar:
            found = friction_curve(read_logs(logs, map_, axis, bar))
        written = []
        if plot is not None:
            from rds.identification.fit.friction_plot import friction_picture

            written.append(write_whole(plot, friction_picture(found).png()))
    if json:
        print_json(found.to_json() | {"files": [str(path) for path in written]})
        return
    _show_friction(found)
    for path in written:
        typer.echo(f"wrote {path}")


def _show_friction(found: FrictionCurve) -> None:
    from rds.cli.console import cell, show_table

    rows = [
        [p.log, cell(p.begin), cell(p.seconds), cell(p.speed), cell(p.force), cell(p.error)]
        for p in sorted(found.points, key=lambda p: p.speed)
    ]
    heads = ["log", "begin s", "length s", f"speed {found.speed_unit}", f"friction {found.force_unit}", "std error"]
    show_table("Stretches of constant speed", heads, rows)
    numbers = [
        [way, name, cell(told.value), cell(told.std_error), f"{cell(told.low)} to {cell(told.high)}", told.unit]
        for way, of_way in found.directions.items()
        for name, told in of_way.items()
    ]
    show_table("Friction", ["direction", "", "value", "std error", "95 % interval", "unit"], numbers)
    for sentence in found.unidentifiable:
        typer.echo(f"- not told: {sentence}")


def _write_map(file: Path) -> Path:
    """The draft beside the data; never over a map that is there."""
    from rds.core.atomic import write_whole
    from rds.core.errors import InputError
    from rds.identification.logs.guess import draft, map_path
    from rds.identification.logs.read_log import is_own
    from rds.identification.logs.tables import read_table

    path = map_path(file)
    if path.exists():
        raise InputError("it exists already; edit it, or move it away", str(path))
    if is_own(file):
        raise InputError("it is a result of rds, which needs no map", str(file))
    write_whole(path, draft(read_table(file)).encode())
    return path


def _to_fill_in(path: Path) -> str:
    """Where a draft has marks for what the file does not tell; "" for none."""
    from rds.core.errors import InputError
    from rds.identification.logs.map import LogMap

    try:
        LogMap.read(path)
    except InputError as error:
        return f". In {str(error).removeprefix(f'{path}, ')}"
    return ""


def _save_plot(found: Description, path: Path) -> list[Path]:
    """The overview as a picture; none where there is no log to show."""
    from rds.core.atomic import write_whole
    from rds.identification.logs.describe_plot import overview

    if not found.logs:
        typer.echo(f"rds: {path} was not written: there is no log to show", err=True)
        return []
    return [write_whole(path, overview(found.logs).png())]


def _show(found: Description, draft: bool) -> None:
    from rds.cli.console import show_table
    from rds.results.units import heading

    def shown(value: float | None) -> str:
        return "" if value is None else f"{value:.6g}"

    rows = [
        [
            heading(c.name, c.unit),
            *(("words", "", "") if c.words else map(shown, (c.low, c.high, c.step))),
            str(c.values),
            str(c.missing or ""),
        ]
        for c in found.columns
    ]
    show_table(
        f"{found.path.name} ({found.format})", ("column", "lowest", "highest", "step", "values", "missing"), rows
    )
    if found.map:
        typer.echo(f"meaning of the columns: {found.map}")
    for log in found.logs:
        said = f"{log.name}: {len(log)} samples, {log.time[-1] - log.time[0]:.6g} s, every {log.sample_period:.6g} s"
        if log.resolution is not None:
            said += f"; resolution {log.resolution:.6g} {log.units.get('position', 'mm')}"
        if log.closed_loop is not None:
            said += "; closed loop" if log.closed_loop else "; open loop"
        typer.echo(said)
    for finding in found.findings:
        typer.echo(f"{finding.gravity}: {finding.what} [{finding.kind}]")
    if found.draft and draft:
        place = f"{found.path.name}.map.toml"
        typer.echo(f"\nA draft of {place}, to be corrected (--write-map writes it):\n\n{found.draft}")
