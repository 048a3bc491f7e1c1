"""`rds nc run --method`: a part program on nodes that carry it out: units of a serial line, or modules on CAN.

Methods A, B and C bring one motion to them; by `moves` each module goes from point to point by itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from rds.cli.common import named_values, print_json, progress_bars

if TYPE_CHECKING:
    from rds.nc.setup import Setup
    from rds.results.reports.content import Report

_MACHINE = "starmill"


def run_methods(
    file: Path,
    methods: str,
    *,
    machine: str | None,
    mode: str | None,
    setup: Setup,
    motion: str,
    synchronized: bool,
    baud: int | None,
    channel: str | None,
    options: list[str],
    out: Path | None,
    json: bool,
) -> None:
    """Carry a program out by one method or several ("A,C", "all"), and show their errors in one table.

    InputError for words that are none; MachineError if a node or the bus fails.
    """
    from rds.core.errors import InputError
    from rds.machines import load_machine
    from rds.modes import DEFAULT
    from rds.modes.experiment.folder import require_writable
    from rds.nc.run.node_methods import all_of, check_methods, nodes_of, run_together
    from rds.nc.run.serial_records import write_records
    from rds.nc.run.serial_report import methods_report
    from rds.results.reports.write import write

    if out is not None:
        require_writable(out)
    where, how = machine or _MACHINE, mode or DEFAULT
    words = _words(options)
    loaded = load_machine(where)
    nodes = nodes_of(loaded, baud, words)
    names = all_of(nodes, how) if methods == "all" else methods.split(",")
    if unknown := [name for name in names if name not in nodes.methods]:
        known = f"{', '.join(nodes.methods)}, several with commas, or all; moves alone"
        raise InputError(f"--method {unknown[0]!r} is unknown; known: {known}")
    check_methods(names, how)
    with progress_bars() as bar:
        show = bar("methods")
        runs = run_together(
            *(nodes, names, file, loaded, setup),
            mode=how,
            motion=motion,
            synchronized=synchronized,
            channel=channel,
            progress=bar("check"),
            begins=lambda number, _: show(number, len(names)),
            tell=lambda note: typer.echo(f"rds: note: {note}", err=True),
        )
        show(len(names), len(names))
    settings = {"machine": where, "mode": how, "motion": motion, **nodes.rate, **nodes.options}
    report = methods_report(runs, file, settings)
    files = [*write(report, out), *write_records(runs, out)] if out is not None else []
    astray = any(any(run.astray.values()) for run in runs)
    show_report(report, files, json)
    raise typer.Exit(int(astray))


def by_method(
    given: dict[str, Any],
    file: Path,
    method: str,
    machine: str | None,
    mode: str | None,
    motion: str | None,
    rapids: str | None,
    baud: int | None,
    channel: str | None,
    option: list[str] | None,
    out: Path | None,
    json: bool,
    setup: Any,
) -> None:
    """A run on nodes that carry the motion out. InputError for options of the other runs."""
    from rds.core.errors import InputError

    if others := [name for name, value in given.items() if value]:
        raise InputError(f"{', '.join(others)} is for runs in a loop; with --method the nodes move by themselves")
    if method == "moves":
        of_others = {"--motion": motion, "--rapids": rapids, "--baud": baud}
        _run_moves(of_others, file, machine, mode, channel, option, out, json, setup)
        return
    if rapids not in (None, "together", "each"):
        raise InputError(f"--rapids {rapids!r} must be together or each")
    if rapids == "each" and motion != "constant":
        raise InputError("--rapids each goes with --motion constant: planned motion moves all axes together")
    run_methods(
        file,
        method,
        machine=machine,
        mode=mode,
        setup=setup,
        motion=motion or "plan",
        synchronized=rapids != "each",
        baud=baud,
        channel=channel,
        options=option or [],
        out=out,
        json=json,
    )


def _run_moves(
    others: dict[str, Any],
    file: Path,
    machine: str | None,
    mode: str | None,
    channel: str | None,
    option: list[str] | None,
    out: Path | None,
    json: bool,
    setup: Setup,
) -> None:
    """By the controllers of distributed modules: a move command to each axis of each line."""
    from rds.bus.tools.link import BUILTIN
    from rds.core.errors import InputError
    from rds.machines import load_machine
    from rds.modes import DEFAULT
    from rds.modes.experiment.folder import require_writable
    from rds.nc.run.module_moves import BITRATE, MACHINE, METHOD, moves_report, run_moves
    from rds.results.reports.write import write

    if given := [name for name, value in others.items() if value is not None]:
        said = f"{', '.join(given)} is of methods A, B and C"
        raise InputError(f"{said}; with --method {METHOD} each module has a controller of its own")
    if out is not None:
        require_writable(out)
    words = _words(option or ())
    bus = {"interface": words.pop("interface", BUILTIN), "bitrate": words.pop("bitrate", BITRATE)}
    where, how = machine or MACHINE, mode or DEFAULT
    with progress_bars() as bar:
        run = run_moves(
            *(file, load_machine(where), setup),
            mode=how,
            channel=channel,
            tuning=words,
            progress=bar("check"),
            carried=bar("moves"),
            tell=lambda note: typer.echo(f"rds: note: {note}", err=True),
            **bus,
        )
    report = moves_report(run, file, {"machine": where, "mode": how, **words})
    files = write(report, out) if out is not None else []
    show_report(report, files, json)


def _words(options: Iterable[str]) -> dict[str, Any]:
    """The values of --option by name: numbers, true, false or texts."""
    from can.util import cast_from_string

    return named_values(options, "--option", "noise=0.001", cast_from_string)


def show_report(report: Report, files: list[Path], json: bool) -> None:
    """A report's tables and findings on the terminal, or as one JSON object, with the files that were written."""
    if json:
        print_json({**report.to_json(), "files": [str(path) for path in files]})
        return
    from rds.cli.console import cell, show_table

    typer.echo(report.title)
    for table in report.tables:
        show_table(table.title, table.columns, [[cell(value) for value in row] for row in table.shown()], table.note)
    for sentence in report.findings:
        typer.echo(f"- {sentence}")
    if files:
        typer.echo(f"page: {files[0]}")


def only_with_method(given: dict[str, Any]) -> None:
    """InputError for options that say how a method runs, where none does."""
    from rds.core.errors import InputError

    if others := [name for name, value in given.items() if value is not None]:
        raise InputError(f"{', '.join(others)} goes with --method, which is not given; add --method C")
