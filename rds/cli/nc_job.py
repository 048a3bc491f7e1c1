"""`rds nc make job`: a part program of a drawing or a text, by operations and tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.common import Json, print_json, refusals, writes_files

_DECIMALS = 4


@writes_files
def job(
    file: Annotated[Path, typer.Argument(help="A job (.toml), or a drawing (.svg, .dxf) whose layers are listed.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="The part program to write.")] = None,
    decimals: Annotated[int, typer.Option(min=1, max=9, help="Decimals of coordinates, in mm.")] = _DECIMALS,
    unit: Annotated[str | None, typer.Option(help="Of a DXF drawing that does not say its own: mm, cm, m, in.")] = None,
    json: Json = False,
) -> None:
    """Make a part program of pockets, contours with tabs, holes, faces and engravings from SVG, DXF or text.

    A job names the drawing, the tool library, and for each operation the layer, the tool and the depth.
    """
    with refusals():
        from rds.core.errors import InputError

        is_job = file.suffix.lower() == ".toml"
        if is_job and unit is not None:
            raise InputError(
                "--unit is for a drawing whose layers are listed; a job has `unit` among its own words", str(file)
            )
        if not is_job and (out is not None or decimals != _DECIMALS):
            option = "--decimals" if out is None else "--out"
            raise InputError(f"{option} is for a job (.toml); of a drawing the layers are listed, for a job to name")
        if not is_job:
            found = _layers(file, unit)
        elif out is None:
            raise InputError("what is the part program to be called? give --out NAME.ngc", str(file))
        elif out.resolve() == file.resolve():
            raise InputError("is the job itself; write the part program to another file", str(out))
        else:
            found = _made(file, out, decimals)
    if json:
        print_json(found)
        return
    if "layers" in found:
        for layer in found["layers"]:
            typer.echo(
                f"layer {layer['layer']!r}: {layer['closed']} closed, {layer['open']} open, {layer['circles']} circles "
                f"and points; X {layer['x_mm'][0]:.4g} to {layer['x_mm'][1]:.4g}, "
                f"Y {layer['y_mm'][0]:.4g} to {layer['y_mm'][1]:.4g} mm"
            )
    else:
        typer.echo(f"{found['file']}: {len(found['operations'])} operations")
        for number, operation in enumerate(found["operations"], start=1):
            contours = f"; {operation['length_mm']:.1f} mm at feed" if operation["length_mm"] else ""  # holes have none
            typer.echo(f"{number}: {operation['title']}{contours}")
            for note in operation["notes"]:
                typer.echo(f"   note: {note}")
    for note in found["notes"]:
        typer.echo(f"note: {note}")


def _layers(file: Path, unit: str | None) -> dict[str, Any]:
    from rds.nc.shapes.files import read_vector_drawing

    drawing = read_vector_drawing(str(file), unit)
    layers = []
    for name in drawing.layers:
        curves = drawing.on(name)
        low = [min(float(curve.points[:, k].min()) for curve in curves) for k in (0, 1)]
        high = [max(float(curve.points[:, k].max()) for curve in curves) for k in (0, 1)]
        circles = sum(curve.circle is not None for curve in curves)
        closed = sum(curve.closed for curve in curves) - circles
        layers.append(
            {
                "layer": name,
                "closed": closed,
                "open": len(curves) - closed - circles,
                "circles": circles,
                "x_mm": [low[0], high[0]],
                "y_mm": [low[1], high[1]],
            }
        )
    return {"drawing": str(file), "layers": layers, "notes": drawing.notes}


def _made(file: Path, out: Path, decimals: int) -> dict[str, Any]:
    from rds.core.atomic import keep_another, write_whole
    from rds.nc.machining.job import read_job
    from rds.nc.paths.measure import total_length

    job = read_job(file)
    keep_another(out, "(operation 1: ", "program of `rds nc make job`")
    write_whole(out, job.program(decimals).encode())
    operations = [
        {
            "title": cut.title,
            "kind": cut.kind,
            "tool": cut.tool.number,
            "notes": cut.notes,
            "length_mm": sum(total_length(piece) for piece in cut.pieces),
            "uncut_mm2": cut.uncut,
        }
        for cut in job.cuts
    ]
    return {"file": str(out), "operations": operations, "notes": job.notes}
