"""`rds nc bundled`: the part programs and paths that come with the package, listed and copied."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files


@writes_files
def bundled(
    name: Annotated[str | None, typer.Argument(help="The one to copy; without it they are listed.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The file to write: by default NAME.ngc, or NAME.toml of a path.")
    ] = None,
    json: Json = False,
) -> None:
    """List the part programs and paths that come with the package, or copy one of them: circle, or circle.toml."""
    with refusals():
        from rds.core.atomic import write_whole
        from rds.core.errors import InputError
        from rds.nc.bundled import PROGRAM, bundled_paths, find_bundled
        from rds.nc.bundled import bundled as programs

        if name is None:
            if out is not None:
                raise InputError("--out says where to copy a program, and none is named; name one of the list")
            found = {
                kind: [
                    {"name": file.removesuffix(PROGRAM), "machine": each.machine, "title": each.title}
                    for file, each in of.items()
                ]
                for kind, of in (("programs", programs()), ("paths", bundled_paths()))
            }
            if json:
                print_json(found)
                return
            from rds.cli.console import show_table

            for kind, title in (("programs", "Part programs of the package"), ("paths", "Paths of the package")):
                rows = [[each["name"], each["machine"], each["title"]] for each in found[kind]]
                show_table(title, ["name", "machine", ""], rows)
            return
        chosen = find_bundled(name)
        kind = "program" if chosen.file.endswith(PROGRAM) else "path"
        path = out or Path(chosen.file)
        if path.exists():
            raise InputError("is there already; give another name with --out", str(path))
        write_whole(path, chosen.text().encode())
    if json:
        print_json({kind: str(path), "machine": chosen.machine})
    else:
        typer.echo(f"{kind}: {path} (for {chosen.machine})")
