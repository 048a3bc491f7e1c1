"""`rds nc run` and `rds nc operate`: a part program on the machine's axes, and an operator's hand on it."""

from __future__ import annotations

import time
from collections.abc import Callable
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
from rds.cli.nc_options import MaxJumps, Parameters, ProfileName, Program, Tools, With, setup
from rds.core.shared_quantities import FEED_OVERRIDE
from rds.modes import DEFAULT, mode_names

if TYPE_CHECKING:
    from rds.cli.keys import Keys
    from rds.nc.run.run import ProgramRun, Status
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
    override: Annotated[float, declared(FEED_OVERRIDE)] = 100.0,
    controller: Annotated[
        str | None,
        typer.Option(help="Of the position axes: a name, your .py file, or an experiment's .toml (default tracking)."),
    ] = None,
    interpolator: Annotated[
        str | None,
        typer.Option(help="Make the samples in the loop: a method of the library, or your .py with interpolate()."),
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Of --interpolator: blu=0.001; with --method: noise=0.001, bitrate=500000, drift=X:80.",
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
            help="By nodes on a serial line or CAN: A, B, C, C-thesis, B-free, C-free, several with commas, or all."
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
                "--acceleration": acceleration,
                "--acceleration-time": acceleration_time,
                "--exact-stop": exact_stop,
                "--look-ahead": look_ahead,
                "--profile": profile != "planned",
                "--cut": cut,
                "--no-optional-stop": not optional_stop,
                "--exchange": exchange,
                "--yes": yes,
                "--events": events,
            }
            from rds.cli.nc_serial import by_method

            by_method(
                given,
                file,
                method,
                machine,
                mode,
                motion,
                rapids,
                baud,
                channel,
                option,
                out,
                json,
                setup(tools, parameters, with_, max_jumps),
            )
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
                profile=profile,
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
            return _operated(running)

        if exchange is not None:
            results = through_exchanges(part, exchange, yes, events, json, mode, folder, go, changes)
            del runs[0]
        elif load_mode(plan.mode).real_time:
            results = [_operated(part.start(out=folder, changes=changes))]
        else:
            with progress_bars() as bar:
                results = [part.run(out=folder, changes=changes, progress=bar(plan.mode))]
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


def _operated(running: ProgramRun) -> Result:
    """A real-time run with somebody at the keyboard, or a line on stderr for each change of state."""
    from rds.cli.keys import keyboard

    with keyboard() as keys:
        if keys is None:
            assert running.folder is not None
            _watch(running, running.folder)
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
            if stands or running.live_values["hold"]:
                running.resume()
            else:
                running.hold()
        elif key in "+=-_":
            share = running.live_values["override"] + (_STEP if key in "+=" else -_STEP)
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
    if status.tip:
        axes += "  tip " + " ".join(f"{name}{value:.3f}" for name, value in status.tip.items())
    predicted = running.plan.samples * running.plan.T
    try:
        override = f"{running.live_values['override']:.0%}"
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


def operate(
    folder: Annotated[Path, typer.Argument(help="The folder of a run that goes on (--out of `rds nc run`).")],
    hold: Annotated[bool, typer.Option("--hold", help="Come to rest on the path.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on after a hold, M0, M1 or a tool change.")] = False,
    home: Annotated[bool, typer.Option("--home", help="End the program where it is, and move home.")] = False,
    stop: Annotated[bool, typer.Option("--stop", help="Come to rest on the path, and end.")] = False,
    override: Annotated[float | None, declared(FEED_OVERRIDE)] = None,
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
        from rds.modes.loop.live_values_of_run import live_values_of

        if hold + resume + home + stop > 1:
            raise InputError("--hold, --resume, --home and --stop exclude each other; give one of them")
        with live_values_of(folder) as live_values:
            wanted = dict(map(_pair, set_ or ()))
            wanted |= {} if override is None else {"override": override / 100.0}
            if resume:
                wanted |= {"hold": 0.0, "resume": live_values["resume"] + 1.0}
            wanted |= {"home": 1.0, "hold": 0.0} if home else {}
            wanted |= {name: 1.0 for name, on in (("hold", hold), ("stop", stop)) if on}
            live_values.set_all(wanted)
            values, units = live_values.values(), {name: channel.unit for name, channel in live_values.channels.items()}
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


COMMANDS: tuple[Callable[..., Any], ...] = (run, operate)
