"""The page with all panels, as a command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.buses import Experiment, Machine, bus_table_of, machine_of
from rds.cli.common import refusals, writes_files


@writes_files
def app(
    folder: Annotated[Path, typer.Argument(help="The folder with your files; runs are kept in its runs/.")] = Path("."),
    machine: Machine = None,
    panel: Annotated[str, typer.Option(help="The panel to begin with.")] = "menu",
    experiment: Experiment = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port; by default the first free one.")] = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Open the panels as a web page of this machine, until Ctrl-C.

    Only who has its address gets in: keep it to yourself. Other users of the computer see nothing of it.
    """
    with refusals():
        from rds.core.extras import missing

        try:
            from rds.panels.app.serve import serve

            serve(folder, machine or machine_of(experiment), panel, port, browser, bus=bus_table_of(experiment))
        except ModuleNotFoundError as error:
            raise missing(error.name or "Voilà", "the page", extra="lab") from error
