"""`rds nc run` and `rds nc operate`: a part program on the machine's axes, and an operator's hand on it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rds.cli.common import (
    Json,
    ends_as_ctrl_c,
    explain,
    print_json,
    progress_bars,
    refusals,
    say_what_is_replaced,
    stdout_kept,
    writes_files,
)
from rds.cli.nc_options import MaxJumps, Parameters, Program, Tools, With, setup
from rds.modes import DEFAULT, mode_names

if TYPE_CHECKING:
    from rds.cli.keys import Keys
    from rds.nc.run.run import PartProgram, ProgramRun, Status
    from rds.results import Result

_HELP = "space hold and go on, + and - feed, h home, q stop"
_LOOK = 0.1  # s between two looks at a run
_STEP = 0.1  # of the override, by one key
_LEAST_OVERRIDE = 0.1  # per cent: an hour becomes six weeks
_STATES = ("runs", "held", "stops", "waits for the tool", "dwells", "waits for the spindle", "goes home", "is over")


@writes_files
def run(
    file: Program,
    mode: Annotated[
        str | None,
        typer.Option(
            "--mode",
            "-m",
            help=f"One of {', '.join(mode_names())} (default {DEFAULT}); controllers must drive the axes in it.",
        ),
    ] = None,
    machine: Annotated[
        str | None, typer.Option("--machine", help="A machine's name, or the path of its TOML file (default mini-cnc).")
    ] = None,
    tools: Tools = None,
    parameters: Parameters = None,
    with_: With = None,
    max_jumps: MaxJumps = None,
    override: Annotated[float, typer.Option(help="Feed, per cent of the programmed one.", min=0, max=200)] = 100.0,
    controller: Annotated[
        str | None,
        typer.Option(help="Of the position axes: a name, your .py file, or an experiment's .toml (default tracking)."),
    ] = None,
    interpolator: Annotated[
        str | None,
        typer.Option(help="Make the samples in the loop: a method of the library, or your .py with interpolate()."),
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="Of --interpolator: blu=0.001, a file's params.")
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
    optional_stop: Annotated[bool, typer.Option("--optional-stop/--no-optional-stop", help="Whether M1 stops.")] = True,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the results (default: a new one under runs/).")
    ] = None,
    json: Json = False,
) -> None:
    """Run a program on all axes and the spindle; report following and contour error by program line.

    The motion is the planned one, with look-ahead; `rds nc time --profile` compares others. With --interpolator, a
    method of the library or your own makes the samples while the axes move.

    In a terminal, while it runs in real time: space holds and goes on, + and - change the feed, h moves home, q stops.
    Elsewhere `rds nc operate` does the same.
    """
    with refusals(), stdout_kept(json), ends_as_ctrl_c():
        from rds.cli.interpolate import acceleration_of
        from rds.core.errors import InputError
        from rds.modes import load_mode
        from rds.modes.experiment.folder import new_folder, require_writable
        from rds.modes.experiment.report import exit_code, run_json
        from rds.nc.run.report import save_run
        from rds.nc.run.run import PartProgram

        if override < _LEAST_OVERRIDE:
            said = f"--override {override:g} never moves, or as good as never; begin with {_LEAST_OVERRIDE:g} or more"
            raise InputError(f"{said}, and hold with space or `rds nc operate --hold`")
        if out is not None:  # before the program is checked and planned, which may take a while
            require_writable(out)
        experiment = Path(controller) if controller is not None and controller.endswith(".toml") else None
        with progress_bars() as bar:
            part = PartProgram(
                file,
                machine,
                setup=setup(tools, parameters, with_, max_jumps),
                controller=None if experiment is not None else controller,
                interpolator=_interpolator(interpolator, option, look_ahead),
                acceleration=acceleration_of(acceleration, acceleration_time, None, exact_stop),
                exact_stop=exact_stop,
                experiment=experiment,
                mode=mode,
                progress=bar("check"),
            )
        plan = part.plan()
        folder = out if out is not None else new_folder(plan.names, plan.mode)
        say_what_is_replaced(folder)
        changes = [(0.0, "override", override / 100.0)] if override != 100.0 else []
        changes += [] if optional_stop else [(0.0, "optional_stop", 0.0)]
        if load_mode(plan.mode).real_time:
            result = _operated(part, folder, changes)
        else:
            with progress_bars() as bar:
                result = part.run(out=folder, changes=changes, progress=bar(plan.mode))
        files = save_run(result, part.prepared, folder)
    if json:
        print_json({**run_json(result, files), "program": result.meta["program"], "changes": result.meta["changes"]})
    else:
        _show(result, files)
    explain(result)
    raise typer.Exit(exit_code(result))


def _interpolator(name: str | None, options: list[str] | None, look_ahead: int | None) -> dict[str, Any] | None:
    """The words of an interpolator; InputError for those that go with one which is not given."""
    from rds.cli.interpolate import option_of
    from rds.core.errors import InputError

    if name is None:
        for key, given in (("--option", options), ("--look-ahead", look_ahead)):
            if given is not None and given != []:
                raise InputError(f"{key} goes with --interpolator, which is not given; add --interpolator tustin")
        return None
    words: dict[str, Any] = {"interpolator": name, "params": dict(map(option_of, options or ()))}
    return words if look_ahead is None else words | {"look_ahead": look_ahead}


def _operated(part: PartProgram, folder: Path, changes: list[tuple[float, str, float]]) -> Result:
    """A real-time run with somebody at the keyboard, or a line on stderr for each change of state."""
    from rds.cli.keys import keyboard

    running = part.start(out=folder, changes=changes)
    with keyboard() as keys:
        if keys is None:
            _watch(running, folder)
        else:
            _operate(running, keys)
    return running.wait()


def _watch(running: ProgramRun, folder: Path) -> None:
    """Say when it waits for somebody, and how that somebody makes it go on."""
    before = -1
    try:
        while not running.done:
            time.sleep(_LOOK)
            status = running.status()
            if status is None or status.state == before:
                continue
            before = status.state
            if _STATES[before] in ("stops", "waits for the tool", "held"):
                typer.echo(
                    f"rds: line {status.line}: {_STATES[before]}; `rds nc operate {folder} --resume` goes on", err=True
                )
    except KeyboardInterrupt:
        running.stop()


def _operate(running: ProgramRun, keys: Keys) -> None:
    from rich.console import Console
    from rich.live import Live

    with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as line:
        try:
            while not running.done:
                status = running.status()
                if status is not None:
                    line.update(_line(status, running), refresh=True)
                for key in keys.pressed(_LOOK):
                    _press(key, running)
        except KeyboardInterrupt:
            running.stop()


def _press(key: str, running: ProgramRun) -> None:
    """What a key does; nothing where the run has not begun or is over."""
    from rds.core.errors import InputError

    try:
        if key == " ":
            status = running.status()
            stands = status is not None and _STATES[status.state] in ("held", "stops", "waits for the tool")
            if stands or running.desk["hold"]:
                running.resume()
            else:
                running.hold()
        elif key in "+=-_":
            share = running.desk["override"] + (_STEP if key in "+=" else -_STEP)
            running.override(min(max(round(share, 2), 0.0), 2.0))
        elif key in "hH":
            running.home()
        elif key in "qQ":
            running.stop()
    except InputError:
        return


def _line(status: Status, running: ProgramRun) -> str:
    """The live line: where, what, how fast, how far."""
    axes = "  ".join(
        f"{name} {value:.0f} rev/min" if running.units.get(f"{name}_measured") == "rev/min" else f"{name} {value:.3f}"
        for name, value in status.measured.items()
    )
    predicted = running.plan.samples * running.plan.T
    try:
        override = f"{running.desk['override']:.0%}"
    except Exception:  # it has just ended
        override = "–"
    return (
        f"line {status.line} {_STATES[status.state]}  {axes}  feed {status.feed:.0f} mm/min, override {override}  "
        f"{status.share:.0%} of {predicted:.1f} s\n{_HELP}"
    )


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
        for name, worst in [("contour", about["contour_error"]), *about["following_error"].items()]
        if worst
    ]
    title = f"{about['file']} on {result.meta['machine']}, {result.mode}"
    show_table(title, ["error of", "largest", "in line", "at [s]", "RMS"], rows)
    screen = console()
    for sentence in findings(about):
        screen.print(sentence, markup=False, soft_wrap=True)
    if result.verdict is not None:
        screen.print(verdict_line(result), markup=False, soft_wrap=True)
    for kind in ("program", "report", "csv"):
        screen.print(f"{kind}: {files[kind]}", markup=False, soft_wrap=True)


def operate(
    folder: Annotated[Path, typer.Argument(help="The folder of a run that goes on (--out of `rds nc run`).")],
    hold: Annotated[bool, typer.Option("--hold", help="Come to rest on the path.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on after a hold, M0, M1 or a tool change.")] = False,
    home: Annotated[bool, typer.Option("--home", help="End the program where it is, and move home.")] = False,
    stop: Annotated[bool, typer.Option("--stop", help="Come to rest on the path, and end.")] = False,
    override: Annotated[
        float | None, typer.Option(help="Feed, per cent of the programmed one.", min=0, max=200)
    ] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Any live value, as X.Pgain=30.")
    ] = None,
    json: Json = False,
) -> None:
    """Change a run that goes on, from another terminal: hold, resume, override, home, stop, or a gain.

    Without an option, say what its live values are.
    """
    with refusals():
        from rds.core.errors import InputError
        from rds.modes.loop.live_values_of_run import desk_of

        if hold + resume + home + stop > 1:
            raise InputError("--hold, --resume, --home and --stop exclude each other; give one of them")
        with desk_of(folder) as desk:
            wanted = dict(map(_pair, set_ or ()))
            wanted |= {} if override is None else {"override": override / 100.0}
            if resume:
                wanted |= {"hold": 0.0, "resume": desk["resume"] + 1.0}
            wanted |= {"home": 1.0, "hold": 0.0} if home else {}
            wanted |= {name: 1.0 for name, on in (("hold", hold), ("stop", stop)) if on}
            desk.set_all(wanted)
            values, units = desk.values(), {name: channel.unit for name, channel in desk.channels.items()}
    if json:
        print_json(values)
    elif wanted:
        typer.echo(", ".join(f"{name} = {value:g}" for name, value in wanted.items()))
    else:
        for name, value in values.items():
            typer.echo(f"{name} = {value:g} {units[name]}".rstrip())


def _pair(text: str) -> tuple[str, float]:
    from rds.core.errors import InputError

    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise InputError(f"--set {text!r} must be NAME=VALUE with a number, as in --set X.Pgain=30") from None


@writes_files
def methods(
    file: Annotated[Path, typer.Argument(help="A path file (.toml) or a part program.")],
    add: Annotated[
        list[Path] | None, typer.Option(help="Your .py file with interpolate(), beside the library's; can be repeated.")
    ] = None,
    machine: Annotated[
        str, typer.Option("--machine", help="A machine's name, or the path of its TOML file.")
    ] = "mini-cnc",
    controller: Annotated[str, typer.Option(help="Of the position axes: a name, or your .py file.")] = "tracking",
    acceleration: Annotated[
        str | None, typer.Option(help="Filter on top of each: linear, exponential or s-shape.")
    ] = None,
    acceleration_time: Annotated[
        float | None, typer.Option(help="How long the velocity rises, s; of exponential its time constant.")
    ] = None,
    period: Annotated[float | None, typer.Option(help="Sample period, s (default the machine's).")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the table, the picture and a page.")
    ] = None,
    json: Json = False,
) -> None:
    """Compare interpolators on a simulated machine: contour error, feed ripple, jerk, and compute time of a sample."""
    with refusals():
        from rds.cli.interpolate import acceleration_of
        from rds.modes.experiment.folder import require_writable
        from rds.nc.run.methods import compare_methods, methods_report
        from rds.results.reports.write import write

        if out is not None:
            require_writable(out)
        filter_ = acceleration_of(acceleration, acceleration_time, None, False)
        with progress_bars() as bar:
            compared = compare_methods(
                file,
                add or (),
                machine=machine,
                controller=controller,
                acceleration=filter_,
                sample_period=period,
                progress=bar("methods"),
            )
        settings = {"machine": machine, "controller": controller, "acceleration": acceleration}
        made = methods_report(compared, file, settings)
        files = write(made, out) if out is not None else []
    if json:
        print_json({**made.to_json(), "files": [str(path) for path in files]})
        return
    from rds.cli.console import cell, show_table

    for table in made.tables:
        show_table(table.title, table.columns, [[cell(value) for value in row] for row in table.shown()], table.note)
    for sentence in made.findings:
        typer.echo(f"- {sentence}")
    if files:
        typer.echo(f"page: {files[0]}")


COMMANDS: tuple[Callable[..., Any], ...] = (run, operate, methods)
