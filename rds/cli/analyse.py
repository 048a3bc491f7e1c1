"""`rds bus analyse`: load and worst-case response times before anything runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files

if TYPE_CHECKING:
    from rds.bus.analysis.analysis_report import Analysis
    from rds.bus.analysis.measured import Measured
    from rds.bus.analysis.response_times import Errors


@writes_files
def analyse(
    machine: Annotated[
        str,
        typer.Argument(
            help="A machine's name, the path of its TOML file, or a message table: a .dbc, or a .csv with the columns "
            "identifier, period_ms, length."
        ),
    ],
    bitrate: Annotated[int | None, typer.Option(help="Bit rate of CAN, bit/s (default 1000000).", min=1)] = None,
    sample_period: Annotated[
        float | None,
        typer.Option(
            "--sample-period",
            "--period",
            help="Sample period, s; by default the machine's. Of a message table: the period of messages without one.",
        ),
    ] = None,
    dialect: Annotated[str, typer.Option(help="What the modules speak: {dialect}.")] = "rds",
    response_time: Annotated[
        float, typer.Option(help="Longest time from a command's arrival to a module's answer being ready, s.")
    ] = 0.0,
    host_jitter: Annotated[float, typer.Option(help="How late the host can be, s.")] = 0.0,
    errors: Annotated[int, typer.Option(help="Frames that are disturbed at once, to be reckoned with.", min=0)] = 0,
    error_interval: Annotated[
        float | None, typer.Option(help="One more is disturbed every so many s; alone, --errors 1.")
    ] = None,
    baud: Annotated[
        int | None, typer.Option(help="Baud rate of a serial line (default: a table of several).", min=1)
    ] = None,
    units: Annotated[
        int | None, typer.Option(help="Units of the methods, in what fits (default: one for each axis).")
    ] = None,
    fits: Annotated[
        bool, typer.Option("--fits", help="On CAN: what fits, as with --period; with --plot curves.")
    ] = False,
    measured: Annotated[
        Path | None, typer.Option(help="A log of this bus: its delays beside the worst cases.", metavar="LOG")
    ] = None,
    trace: Annotated[
        Path | None,
        typer.Option(help="With --measured: each cycle's delays, a trace for \\[network], FILE.csv."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Write the timeline and response times, or curves, as a picture: png, svg or pdf."),
    ] = None,
    json: Json = False,
) -> None:
    """Bus load, and every message's worst-case response time (Davis, Burns, Bril and Lukkien, 2007).

    With --measured LOG: the delays that were recorded, beside these bounds. With --period: what fits, by method, units
    and bit rate, with margin. On a serial line (--dialect dcs) the same, by baud rate.
    """
    with refusals():
        from rds.core.errors import InputError

        serial = {"--baud": baud}
        can: dict[str, object] = {"--bitrate": bitrate, "--response-time": response_time, "--host-jitter": host_jitter}
        can |= {"--errors": errors, "--error-interval": error_interval, "--fits": fits}
        can |= {"--measured": measured, "--trace": trace}
        wrong = [name for name, value in (can if dialect == "dcs" else serial).items() if value]
        if wrong:
            where = "a CAN bus" if dialect == "dcs" else "a serial line (--dialect dcs)"
            raise InputError(f"{', '.join(wrong)} is for {where}; leave it out")
        if dialect == "dcs":
            from rds.cli.analyse_fits import show_serial
            from rds.machines import load_machine

            met = show_serial(load_machine(machine), baud, units, sample_period, plot, json)
            raise typer.Exit(0 if met else 1)
        if trace is not None and measured is None:
            raise InputError("--trace is of measured delays; give a log by --measured")
        if fits and measured is not None:
            raise InputError("--fits is of what could be, and --measured of what was; leave one of them out")
        asked = fits or sample_period is not None
        if units is not None and not (asked and dialect == "rds"):
            raise InputError("--units is of what fits a serial line or modules of dialect rds: add --fits or --period")
        from math import inf

        from rds.bus.analysis.analysis_report import analyse as analyse_bus
        from rds.bus.analysis.message_tables import is_message_table
        from rds.bus.analysis.response_times import Errors
        from rds.machines import load_machine

        interval = inf if error_interval is None else error_interval
        disturbed = Errors(errors or 1, interval) if errors or error_interval is not None else None
        if is_message_table(table := Path(machine)):
            words = {"--dialect": dialect != "rds", "--response-time": response_time, "--host-jitter": host_jitter}
            if wrong := [name for name, value in (words | {"--fits": fits, "--units": units}).items() if value]:
                raise InputError(f"{', '.join(wrong)} is for a machine, not for a message table; leave it out")
            rate = 1_000_000 if bitrate is None else bitrate
            _analyse_table(table, rate, sample_period, disturbed, measured, trace, plot, json)
        analysis = analyse_bus(
            load_machine(machine),
            1_000_000 if bitrate is None else bitrate,
            sample_period,
            dialect=dialect,
            response_time=response_time,
            host_jitter=host_jitter,
            errors=disturbed,
        )
        found = _lay_over(analysis, measured, trace)
        if plot is not None:
            from rds.cli.analyse_fits import draw_can

            draw_can(plot, analysis, load_machine(machine), sample_period, dialect, fits, found)
        rows, methods = [], []
        if asked:
            from rds.cli.analyse_fits import can_methods, can_rows

            rows = can_rows(
                load_machine(machine),
                sample_period,
                dialect=dialect,
                response_time=response_time,
                host_jitter=host_jitter,
                errors=analysis.errors,
            )
            if dialect == "rds":
                methods = can_methods(load_machine(machine), sample_period, bitrate, units)
    if json:
        fitting = {"fits": rows, "methods": methods} if asked else {}
        print_json(analysis.to_json() | fitting | ({"measured": found.to_json()} if found else {}))
    else:
        _show(analysis, found, trace)
        if asked:
            from rds.cli.analyse_fits import show_can

            show_can(rows, methods)
        if plot is not None:
            typer.echo(f"plot: {plot}")
    raise typer.Exit(0 if analysis.met and (found is None or found.met) else 1)


def _lay_over(analysis: Analysis, log: Path | None, trace: Path | None) -> Measured | None:
    """The log against the analysis; its cycles written as a trace."""
    if log is None:
        return None
    from rds.bus.analysis.measured import measured

    found = measured(analysis, log)
    if trace is not None:
        from rds.core.errors import InputError
        from rds.network.trace import write_trace

        if not found.cycle:
            raise InputError("--trace is of cycles of a command and its answers, which this schedule has not")
        about = f"delays of {analysis.title} in {log.name}: first frame (at least), and from it to the last answer, s"
        write_trace(trace, found.cycle, (about,))
    return found


def _show(analysis: Analysis, found: Measured | None, trace: Path | None) -> None:
    typer.echo(str(analysis))
    if found is not None:
        typer.echo(f"\n{found}")
    if trace is not None:
        typer.echo(f"trace: {trace}")


def _analyse_table(
    path: Path,
    bitrate: int,
    period: float | None,
    errors: Errors | None,
    log: Path | None,
    trace: Path | None,
    plot: Path | None,
    json: bool,
) -> None:
    """The bus of somebody else's message table."""
    from rds.bus.analysis.analysis_report import analyse_messages
    from rds.bus.analysis.message_tables import read_messages

    table = read_messages(path, period)
    analysis = analyse_messages(table.messages, bitrate, errors=errors, title=path.name)
    found = _lay_over(analysis, log, trace)
    if plot is not None:
        from rds.cli.analyse_fits import draw

        draw(plot, analysis, found)
    if json:
        told: dict[str, object] = {"without_period": table.without_period, "transported": [*table.transported]}
        told |= {"measured": found.to_json()} if found else {}
        print_json(analysis.to_json() | told)
    else:
        _show(analysis, found, trace)
        if plot is not None:
            typer.echo(f"plot: {plot}")
    count = len(table.messages) + len(table.without_period) + len(table.transported)
    for left_out, what, cure in (
        (table.without_period, "no period in the file", "--sample-period gives them one"),
        (
            table.transported,
            "more than 8 bytes, and nothing says that they are CAN FD,",
            "the frames of the transport protocol (J1939, ISO-TP) that carry them come on top of this load",
        ),
    ):
        if left_out:
            names = ", ".join(left_out[:6]) + (", ..." if len(left_out) > 6 else "")
            said = f"{len(left_out)} of {count} messages have {what} and are left out: {names}; {cure}"
            typer.echo(f"rds: {said}", err=True)
    raise typer.Exit(0 if analysis.met and (found is None or found.met) else 1)
