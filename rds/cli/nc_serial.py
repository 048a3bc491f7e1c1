"""`rds nc run --method`: a part program on nodes that carry it out: units of a serial line, or modules on CAN.

Methods A, B and C bring one motion to them; by `moves` each module goes from point to point by itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from rds.cli.common import print_json, progress_bars

if TYPE_CHECKING:
    from collections.abc import Callable

    from rds.nc.setup import Setup
    from rds.results.reports.content import Report

_MACHINE = "starmill"
_ALL = ("A", "B", "C", "C-thesis")  # what `all` stands for


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
    from functools import partial

    from rds.bus.tools.link import pair
    from rds.core.errors import InputError
    from rds.machines import load_machine
    from rds.modes import DEFAULT, EMULATION
    from rds.modes.experiment.folder import require_writable
    from rds.nc.run.serial_methods import METHODS, check_method, run_method
    from rds.nc.run.serial_motion import BYTE_TIME, serial_motion
    from rds.nc.run.serial_records import write_records
    from rds.nc.run.serial_report import methods_report
    from rds.results.reports.write import write

    if out is not None:
        require_writable(out)
    where, how = machine or _MACHINE, mode or DEFAULT
    words: dict[str, Any] = dict(map(pair, options))
    loaded = load_machine(where)
    if any(axis.module.get("motor") for axis in loaded.axes.values()):
        from rds.bus.hub.bus_settings import DEFAULT_BAUD

        offered: tuple[str, ...] = METHODS
        period, speed = BYTE_TIME, DEFAULT_BAUD if baud is None else baud
        carry_out: Callable[..., Any] = partial(run_method, baud=speed)
        rate = {"baud": speed}
    else:
        from rds.core.shared_quantities import SAMPLE_PERIOD
        from rds.nc.run import can_methods

        if baud is not None:
            raise InputError(f"--baud is of a serial line, and {loaded.name} is on CAN: give --option bitrate=500000")
        offered = can_methods.METHODS
        period = SAMPLE_PERIOD.check(words.pop("period", loaded.sample_period), "period")
        rate = {"bitrate": words.pop("bitrate", can_methods.BITRATE), "period": period}
        carry_out = partial(can_methods.run_can_method, bitrate=rate["bitrate"])
    names = [name for name in _ALL if name in offered and not (name == "C-thesis" and how == EMULATION)]
    if methods != "all":
        names = methods.split(",")
    if unknown := [name for name in names if name not in offered]:
        raise InputError(
            f"--method {unknown[0]!r} is unknown; known: {', '.join(offered)}, several with commas, or all; moves alone"
        )
    for name in names:
        check_method(name, how)
    with progress_bars() as bar:
        made = serial_motion(
            file,
            loaded,
            setup,
            motion=motion,
            synchronized=synchronized,
            progress=bar("check"),
            period=period,
            whole=offered is METHODS,
        )
        for note in made.notes:
            typer.echo(f"rds: note: {note}", err=True)
        show = bar("methods")
        runs = []
        for number, name in enumerate(names):
            show(number, len(names))
            runs.append(carry_out(name, made, loaded, mode=how, channel=channel, **words))
        show(len(names), len(names))
    settings = {"machine": where, "mode": how, "motion": motion, **rate, **words}
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
    from rds.bus.tools.link import BUILTIN, pair
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
    words: dict[str, Any] = dict(map(pair, option or []))
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


def show_report(report: Report, files: list[Path], json: bool) -> None:
    """A report's tables and findings on the terminal, or as one JSON object, with the files that were written."""
    if json:
        print_json({**report.to_json(), "files": [str(path) for path in files]})
        return
    from rds.cli.console import cell, show_table

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
