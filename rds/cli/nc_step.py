"""`rds nc step`: a part program line by line, with the words in force."""

from __future__ import annotations

import sys
from dataclasses import asdict
from itertools import islice
from typing import Annotated

import typer

from rds.cli.canon import until_nobody_reads
from rds.cli.common import Json, print_json, refusals
from rds.cli.nc_options import Program, ProgramOptions
from rds.cli.option_groups import grouped_options

_HELP = "Enter: the next line; a number: go on to that line; a: all; q: quit"


@grouped_options
def step(
    file: Program,
    reading: ProgramOptions,
    most: Annotated[int, typer.Option(min=1, help="Lines that are executed at most.")] = 10000,
    json: Json = False,
) -> None:
    """Execute a program line by line: where the tool is after each line, the words in force, parameters that changed.

    In a terminal Enter goes on by a line; elsewhere all lines are printed. Lines that a branch passes over have a -.
    """
    with refusals(), until_nobody_reads():
        from rds.nc.stepping import steps

        what = reading.setup()
        found = islice(
            steps(file, tools=what.tool_list(), parameters=what.parameters, options=what.options),
            most,
        )
        if json:
            print_json({"program": str(file), "steps": [asdict(step) for step in found]})
            return
        asks = sys.stdin.isatty() and sys.stdout.isatty()
        until = 0
        if asks:
            typer.echo(_HELP)
        for step in found:
            typer.echo(f"-{str(step)[1:].splitlines()[0]}" if step.skipped else str(step))
            if asks and not step.skipped and (until == 0 or step.line == until):
                word = typer.prompt("", default="", show_default=False, prompt_suffix="> ").strip().lower()
                if word == "q":
                    return
                asks = word != "a"
                until = int(word) if word.isdigit() else 0
