"""`rds report`: what the thesis measured, from measured data or from our own modules' logs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files


@writes_files
def report(
    kind: Annotated[
        str,
        typer.Argument(help="{report}."),
    ],
    data: Annotated[
        list[Path] | None,
        typer.Argument(help="Data: CSV tables, bus logs, a run; oacs:O32 is a table of oacs-thesis's appendices."),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="An option of the report; `--options` lists them."),
    ] = None,
    options: Annotated[bool, typer.Option("--options", help="List this report's options and end.")] = False,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder for tables, pictures and a page.")] = None,
    json: Json = False,
) -> None:
    """Tables and plots from measured data; with --out also as files."""
    with refusals():
        from rds.core.errors import InputError
        from rds.results.reports import make_report, option_table, write

        given = {}
        for text in set_ or ():
            name, equals, value = text.partition("=")
            if not name or not equals:
                raise InputError(f"--set {text!r} must be NAME=VALUE; `rds report {kind} --options` lists the names")
            if name in given:
                raise InputError(f"--set {name} is given twice; give it once")
            given[name] = value
        if options and (data or given or out):
            raise InputError("--options only lists the options; leave the data, --set and --out away")
        if options:
            tables, findings, files, found = [option_table(kind)], [], [], option_table(kind).to_json()
        else:
            made = make_report(kind, list(data or ()), given)
            tables, findings, found = list(made.tables), list(made.findings), made.to_json()
            files = write(made, out) if out is not None else []
    if json:
        print_json({**found, "files": [str(path) for path in files]})
        return
    from rds.cli.console import cell, show_table

    for table in tables:
        show_table(table.title, table.columns, [[cell(value) for value in row] for row in table.shown()], table.note)
    for sentence in findings:
        typer.echo(f"- {sentence}")
    if files:
        typer.echo(f"page: {files[0]}")
