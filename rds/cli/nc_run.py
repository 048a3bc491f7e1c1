"""`rds nc run`: a part program on the machine's axes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rds.cli.common import (
    Explain,
    Json,
    declared,
    ends_as_ctrl_c,
    explain,
    print_json,
    progress_bars,
    refusals,
    results_folder,
    say_what_is_replaced,
    stdout_kept,
    writes_files,
)
from rds.cli.exchange import Events, Exchange, Yes, only_with_exchange, runs_json, through_exchanges
from rds.cli.nc_operate import LEAST_OVERRIDE, operated
from rds.cli.nc_options import ProfileName, Program, ProgramOptions
from rds.core.shared_quantities import FEED_OVERRIDE
from rds.modes import DEFAULT, mode_names

if TYPE_CHECKING:
    from rds.results import Result


@writes_files
def run(
    file: Program,
    *,
    mode: Annotated[
        str | None,
        typer.Option(
            "--mode",
            "-m",
            help=f"One of {', '.join(mode_names())} (default {DEFAULT}); controllers must drive the axes in it.",
        ),
    ] = None,
    machine: Annotated[
        str | None,
        typer.Option(
            "--machine",
            help="A machine's name, or the path of its TOML file (default mini-cnc; with --method starmill, by moves "
            "mrmt-oacs).",
        ),
    ] = None,
    reading: ProgramOptions,
    override: Annotated[float, declared(FEED_OVERRIDE)] = 100.0,
    controller: Annotated[
        str | None,
        typer.Option(help="Of the position axes: a name, your .py file, or an experiment's .toml (default tracking)."),
    ] = None,
    interpolator: Annotated[
        str | None,
        typer.Option(help="Make the samples in the loop: a method of the library, or your .py with interpolate()."),
    ] = None,
    arc_interpolator: Annotated[
        str | None, typer.Option(help="Another one for arcs, with its default options; --interpolator takes the lines.")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Of --interpolator: blu=0.001; with --method: noise=0.001, bitrate=500000, drift=X:80; moves: Kp=2.",
        ),
    ] = None,
    acceleration: Annotated[
        str | None, typer.Option(help="Filter on top of --interpolator: linear, exponential or s-shape.")
    ] = None,
    acceleration_time: Annotated[
        float | None, typer.Option(help="How long the velocity rises, s; of exponential its time constant.")
    ] = None,
    exact_stop: Annotated[
        bool, typer.Option("--exact-stop", help="With --acceleration: come to rest at the end of each segment.")
    ] = False,
    look_ahead: Annotated[
        int | None, typer.Option(help="Rows that --interpolator makes before they are needed (default 3).", min=3)
    ] = None,
    profile: ProfileName = "planned",
    cut: Annotated[
        Path | None,
        typer.Option(help="The cut and its \\[limits] (TOML): the feed is lowered so that they are kept."),
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="By nodes on a serial line or CAN: A, B, C, C-thesis, B-free, C-free, several with commas, or all; or "
            "moves: distributed modules (oacs), each axis of a line from point to point by its own controller."
        ),
    ] = None,
    motion: Annotated[
        str | None, typer.Option(help="With --method: plan (default), or constant, the thesis's motion without ramps.")
    ] = None,
    rapids: Annotated[
        str | None, typer.Option(help="With --motion constant: together (default), or each axis at its own speed.")
    ] = None,
    baud: Annotated[
        int | None, typer.Option(help="With --method on a serial line: baud rate (default 115200).")
    ] = None,
    channel: Annotated[
        str | None, typer.Option(help="With --method: a serial port, or a served machine (default: one for this run).")
    ] = None,
    begin: Annotated[
        int, typer.Option(metavar="LINE", help="Run it from this line on; all before but tool and spindle is left out.")
    ] = 0,
    steps: Annotated[bool, typer.Option("--steps", help="Wait after each line that moves.")] = False,
    optional_stop: Annotated[bool, typer.Option("--optional-stop/--no-optional-stop", help="Whether M1 stops.")] = True,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", callback=results_folder, help="Folder for the results (default: a new one under runs/)."
        ),
    ] = None,
    exchange: Exchange = None,
    yes: Yes = False,
    events: Events = None,
    explain_verdict: Explain = False,
    json: Json = False,
) -> None:
    """Run a program on all axes and the spindle; report following and contour error by program line.

    The motion is planned with look-ahead, or by another --profile, at whose corners a limit may be passed. With
    --interpolator, a method of the library or your own makes the samples while the axes move.

    In a terminal, while it runs in real time: space holds and goes on, + and - change the feed, h moves home, q stops.
    Elsewhere `rds nc operate` does the same.
    """
    own_code = method is None  # nodes run none of it, and the JSON object is printed in here
    with refusals(), stdout_kept(json and own_code), ends_as_ctrl_c():
        if method is not None:
            given = {
                "--override": override != 100.0,
                "--controller": controller,
                "--interpolator": interpolator,
                "--arc-interpolator": arc_interpolator,
                "--acceleration": acceleration,
                "--acceleration-time": acceleration_time,
                "--exact-stop": exact_stop,
                "--look-ahead": look_ahead,
                "--profile": profile != "planned",
                "--cut": cut,
                "--begin": begin,
                "--steps": steps,
                "--no-optional-stop": not optional_stop,
                "--exchange": exchange,
                "--yes": yes,
                "--events": events,
            }
            from rds.cli.nc_serial import by_method

            setup = reading.setup()
            by_method(given, file, method, machine, mode, motion, rapids, baud, channel, option, out, json, setup)
            return
        from rds.cli.nc_serial import only_with_method

        only_with_method({"--motion": motion, "--rapids": rapids, "--baud": baud, "--channel": channel})
        from rds.cli.interpolate import acceleration_of
        from rds.core.errors import InputError
        from rds.modes import load_mode
        from rds.modes.experiment.folder import new_folder, require_writable
        from rds.modes.experiment.report import exit_code, run_json
        from rds.nc.run.report import save_run
        from rds.nc.run.run import PartProgram

        if exchange is None:
            only_with_exchange(yes, events)
        if override < LEAST_OVERRIDE:
            said = f"--override {override:g} never moves, or as good as never; begin with {LEAST_OVERRIDE:g} or more"
            raise InputError(f"{said}, and hold with space or `rds nc operate --hold`")
        if override <= 2.0:
            typer.echo(
                f"rds: --override {override:g} is in per cent; for {override:g} times the feed give {100 * override:g}",
                err=True,
            )
        if out is not None:  # before the program is checked and planned, which may take a while
            require_writable(out)
        experiment = Path(controller) if controller is not None and controller.endswith(".toml") else None
        with progress_bars() as bar:
            part = PartProgram(
                file,
                machine,
                setup=reading.setup(),
                controller=None if experiment is not None else controller,
                interpolator=_interpolator(interpolator, arc_interpolator, option, look_ahead),
                acceleration=acceleration_of(acceleration, acceleration_time, None, exact_stop),
                exact_stop=exact_stop,
                profile=profile,
                begin=begin,
                steps=steps,
                cut=cut,
                experiment=experiment,
                mode=mode,
                progress=bar("check"),
            )
        plan = part.plan()
        folder = out if out is not None else new_folder(plan.names, plan.mode)
        say_what_is_replaced(folder)
        changes = [(0.0, "override", override / 100.0)] if override != 100.0 else []
        changes += [] if optional_stop else [(0.0, "optional_stop", 0.0)]
        runs = [(part.prepared, folder)]

        def go(part: Any, running: Any) -> Result:
            runs.append((part.prepared, running.folder))
            return operated(running)

        if exchange is not None:
            results = through_exchanges(part, exchange, yes, events, json, mode, folder, go, changes)
            del runs[0]
        elif load_mode(plan.mode).real_time:
            results = [operated(part.start(out=folder, changes=changes))]
        else:
            with progress_bars() as bar:
                results = [part.run(out=folder, changes=changes, progress=bar(plan.mode))]
        with progress_bars() as bar:
            bar("report")
            made = [(result, save_run(result, *each)) for result, each in zip(results, runs, strict=True)]
    result, files = made[-1]
    if json:
        told = {"program": result.meta["program"], "changes": result.meta["changes"]}
        print_json(run_json(result, files) | told | ({} if exchange is None else runs_json(made)))
    for each in made:
        if not json:
            _show(*each)
        explain(each[0], is_shown=not json, in_full=explain_verdict)
    raise typer.Exit(exit_code(result))


def _interpolator(
    name: str | None, arcs: str | None, options: list[str] | None, look_ahead: int | None
) -> dict[str, Any] | None:
    """The words of an interpolator; InputError for those that go with one which is not given."""
    from rds.cli.interpolate import options_of
    from rds.core.errors import InputError

    if name is None:
        for key, given in (("--arc-interpolator", arcs), ("--option", options), ("--look-ahead", look_ahead)):
            if given is not None and given != []:
                raise InputError(f"{key} goes with --interpolator, which is not given; add --interpolator tustin")
        return None
    words: dict[str, Any] = {"interpolator": name, "params": options_of(options or ())}
    words |= {} if arcs is None else {"arc_interpolator": arcs}
    return words if look_ahead is None else words | {"look_ahead": look_ahead}


def _show(result: Result, files: dict[str, Path]) -> None:
    from rds.cli.console import console, show_table, verdict_line
    from rds.nc.run.report import findings

    about = result.meta["program"]
    rows = [
        [
            name,
            f"{worst['max']:.4f} {worst['unit']}",
            str(worst["line"]),
            f"{worst['time_s']:.3f}",
            f"{worst['rms']:.4f}",
        ]
        for name, worst in [
            ("contour", about["contour_error"]),
            ("commanded path", about.get("path_error")),
            *about["following_error"].items(),
        ]
        if worst
    ]
    title = f"{about['file']} on {result.meta['machine']}, {result.mode}"
    show_table(title, ["error of", "largest", "in line", "at [s]", "RMS"], rows)
    screen = console()
    if force := about.get("cutting_force"):
        typer.echo(f"cutting force: at most {force['max']:.1f} N, in line {force['line']}")
    for sentence in findings(about):
        screen.print(sentence, markup=False, soft_wrap=True)
    if result.verdict is not None:
        screen.print(verdict_line(result), markup=False, soft_wrap=True)
    for kind in ("program", "report", "csv"):
        screen.print(f"{kind}: {files[kind]}", markup=False, soft_wrap=True)
