"""An operator's hand on a part program that runs: keys in its terminal, and `rds nc operate` from another."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.cli.common import (
    Json,
    declared,
    named_values,
    print_json,
    refusals,
)
from rds.core.shared_quantities import FEED_OVERRIDE

if TYPE_CHECKING:
    from rds.cli.keys import Keys
    from rds.nc.run.run import ProgramRun, Status
    from rds.results import Result

_HELP = "space hold and go on, + and - feed, h home, q stop"
_LOOK = 0.1  # s between two looks at a run
_STEP = 0.1  # of the override, by one key
LEAST_OVERRIDE = 0.1  # per cent: an hour becomes six weeks
_STATES = ("runs", "held", "stops", "waits for the tool", "dwells", "waits for the spindle", "goes home", "is over")


def operated(running: ProgramRun) -> Result:
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
                remedy = f"`rds nc operate {folder} --resume` in another terminal goes on"
                typer.echo(f"rds: line {status.line}: {_STATES[before]}; {remedy}", err=True)
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
                    line.update(live_line(status, running), refresh=True)
                for key in keys.pressed(_LOOK):
                    press(key, running)
        except KeyboardInterrupt:
            running.stop()


def press(key: str, running: ProgramRun) -> None:
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


def live_line(status: Status, running: ProgramRun) -> str:
    """The live line: where, what, how fast, how far."""
    from rds.nc.run.run import LOCKS

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
    if lock := LOCKS.get(status.whose_feed):
        override += f" ({lock})"
    return (
        f"line {status.line} {_STATES[status.state]}  {axes}  feed {status.feed:.0f} mm/min, override {override}  "
        f"{status.share:.0%} of {predicted:.1f} s\n{_HELP}"
    )


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
            wanted = named_values(set_ or (), "--set", "X.Pgain=30")
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
