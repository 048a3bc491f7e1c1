"""`rds nc bundled`: the part programs that come with the package, listed and copied."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files


@writes_files
def bundled(
    name: Annotated[str | None, typer.Argument(help="The one to copy; without it they are listed.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The file to write: by default NAME.ngc in this folder.")
    ] = None,
    json: Json = False,
) -> None:
    """List the part programs that come with the package, or copy one of them."""
    with refusals():
        from rds.core.atomic import write_whole
        from rds.core.errors import InputError
        from rds.nc.bundled import bundled as all_of_them
        from rds.nc.bundled import find_bundled

        if name is None:
            if out is not None:
                raise InputError("--out says where to copy a program, and none is named; name one of the list")
            found = [
                {"name": file.removesuffix(".ngc"), "machine": each.machine, "title": each.title}
                for file, each in all_of_them().items()
            ]
            if json:
                print_json({"programs": found})
                return
            from rds.cli.console import show_table

            rows = [[each["name"], each["machine"], each["title"]] for each in found]
            show_table("Part programs of the package", ["name", "machine", ""], rows)
            return
        chosen = find_bundled(name)
        path = out or Path(chosen.file)
        if path.exists():
            raise InputError("is there already; give another name with --out", str(path))
        write_whole(path, chosen.text().encode())
    if json:
        print_json({"program": str(path), "machine": chosen.machine})
    else:
        typer.echo(f"program: {path} (for {chosen.machine})")
