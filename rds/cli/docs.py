"""The documentation as pages, as a command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files


@writes_files
def docs(
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for the pages; default: the cache.")] = None,
    browser: Annotated[bool, typer.Option("--open", help="Open them in the browser.")] = False,
    json: Json = False,
) -> None:
    """Make the documentation into HTML pages with a search, to read offline."""
    with refusals():
        from rds.panels.help.build import FIRST, help_pages

        first = help_pages(out) / f"{FIRST}.html"
    if json:
        print_json({"pages": str(first)})
    else:
        typer.echo(str(first))
    if browser:
        import webbrowser

        webbrowser.open(first.as_uri())
