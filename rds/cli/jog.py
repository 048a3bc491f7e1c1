"""`rds jog`: an axis moved, a spindle turned or a drive homed from the command line, as the jog panel does it."""

from __future__ import annotations

import tempfile
import time
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rds.cli.buses import BusOptions, Machine, bus_table_of, machine_of
from rds.cli.common import Json, ends_as_ctrl_c, print_json, refusals
from rds.cli.option_groups import grouped_options

if TYPE_CHECKING:
    from rds.panels.jog.state import Jog

_LOOKS = 0.05  # s
_SPARE = 5.0  # s without a way made until an axis counts as stuck
_THERE = 10.0  # counts from the goal that are there
_SETTLES = 0.3  # s there, before an axis is let go: the loop still takes the last counts
_STANDS = 0.01  # of its highest speed: a spindle that is slower stands


@grouped_options
def jog(
    axis: Annotated[str, typer.Argument(help="The axis, as in X, or the spindle.")],
    *,
    by: Annotated[float | None, typer.Option(help="Distance, mm or degrees.")] = None,
    to: Annotated[float | None, typer.Option(help="Position, mm or degrees.")] = None,
    find_home: Annotated[
        int | None, typer.Option(metavar="METHOD", help="Home a CiA 402 drive, as in 17: negative limit switch.")
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(help="mm/s or degrees/s, by default 5, or the fastest; a spindle's in rev/min, - turns it back."),
    ] = None,
    seconds: Annotated[float | None, typer.Option("--for", help="How long a spindle turns, s.")] = None,
    machine: Machine = None,
    on_bus: BusOptions,
    json: Json = False,
) -> None:
    """Move one axis, turn a spindle or home a drive, hold the others where they are; Ctrl-C or a kill stops it."""
    with refusals():
        from rds.core.errors import InputError
        from rds.panels.jog.state import Jog
        from rds.panels.session.session import Session

        bus = bus_table_of(on_bus.experiment, on_bus.interface, on_bus.channel, on_bus.bitrate)
        with tempfile.TemporaryDirectory(prefix="rds-jog-") as folder, ends_as_ctrl_c():
            hand = Jog(Session(Path(folder), machine or machine_of(on_bus.experiment), bus))
            hand.check(axis)
            ways = {"--by": by, "--to": to, "--find-home": find_home, "--for": seconds}
            named = [way for way, value in ways.items() if value is not None]
            allowed = ["--for"] if axis in hand.spindles else ["--by", "--to", "--find-home"]
            if len(named) != 1 or named[0] not in allowed:
                raise InputError(_which(axis, named, allowed))
            if axis in hand.spindles and speed is None:
                raise InputError(f"{axis}: say how fast it shall turn, in rev/min, as in --speed 1000")
            if find_home is not None and speed is not None:
                raise InputError("--speed: a drive homes at speeds of its own, objects 0x6099; leave it out")
            try:
                begun = hand.begin()
                begun.wait()
                if begun.error is not None:
                    raise begun.error
                if seconds is not None:
                    said, text = _turned(hand, axis, speed or 0.0, seconds)
                elif find_home is not None:
                    said, text = _homed(hand, axis, find_home)
                else:
                    goal = to if to is not None else hand.positions.get(axis, 0.0) + (by or 0.0)
                    said, text = _moved(hand, axis, goal, speed)
            except KeyboardInterrupt:
                typer.echo("rds: stopped by Ctrl-C", err=True)
                raise typer.Exit(130) from None
            finally:
                hand.end()
    if json:
        print_json(said)
    else:
        typer.echo(text)


def _which(axis: str, named: list[str], allowed: list[str]) -> str:
    """Why the ways to move that were given will not do."""
    both = f"{' and '.join(named)} are given"
    given = both if len(named) > 1 else f"{named[0]} is given" if named else "nothing is given"
    if allowed == ["--for"]:
        return f"{given}: {axis} is a spindle, which turns at a speed for a time, as in --speed 1000 --for 5"
    return (
        f"{given}: move {axis} by a distance with --by, or to a position with --to, as in --by 5; "
        "a drive is homed with --find-home 17"
    )


def _moved(hand: Jog, axis: str, goal: float, speed: float | None) -> tuple[dict[str, Any], str]:
    hand.go(axis, goal, speed)
    near, last, since = _THERE * hand.axes[axis].resolution, hand.positions[axis], time.monotonic()
    there = inf  # when it came there
    while hand.ready:
        time.sleep(_LOOKS)
        at, now = hand.positions.get(axis, last), time.monotonic()
        there = min(there, now) if abs(at - goal) <= near and not hand.moving else inf
        if now - there >= _SETTLES:
            return _stands(hand, axis, at)
        if abs(at - last) > near:
            last, since = at, now
        if now - since > _SPARE:
            break
    raise _failed(hand, f"{axis} did not arrive", "it stands still")


def _homed(hand: Jog, axis: str, method: int) -> tuple[dict[str, Any], str]:
    hand.find_home([axis], method)
    while hand.ready and axis not in hand.homed:
        time.sleep(_LOOKS)
    while hand.ready:
        if not hand.homing:
            return _stands(hand, axis, hand.positions[axis])
        time.sleep(_LOOKS)
    raise _failed(hand, f"{axis} was not homed", "the machine was lost")


def _turned(hand: Jog, spindle: str, speed: float, seconds: float) -> tuple[dict[str, Any], str]:
    """At the end the spindle is brought to rest; the speed that is told is the last one measured before."""
    from rds.panels.session.fields import Number

    until = time.monotonic() + Number("for", "--for", "", unit="s", above=0.0, high=86_400.0).check(seconds)  # type: ignore[operator]
    hand.turn(spindle, 1, speed)
    measured = 0.0
    while hand.ready and time.monotonic() < until:
        time.sleep(_LOOKS)
        measured = hand.speeds.get(spindle, measured)
        hand.turn(spindle, 1, speed)
    hand.still(spindle)
    most, stuck = hand.spindles[spindle].speeds[1], time.monotonic() + _SPARE
    while hand.ready and time.monotonic() < stuck:
        time.sleep(_LOOKS)
        if abs(hand.speeds.get(spindle, 0.0)) < _STANDS * most:
            said = {"axis": spindle, "speed": measured, "unit": hand.spindles[spindle].unit}
            return said, f"{spindle} turned at {measured:.0f} {hand.spindles[spindle].unit}, and stands"
    raise _failed(hand, f"{spindle} did not come to rest", "it turns on")


def _stands(hand: Jog, axis: str, at: float) -> tuple[dict[str, Any], str]:
    unit = hand.axes[axis].unit
    return {"axis": axis, "position": at, "unit": unit}, f"{axis} stands at {at:.3f} {unit}"


def _failed(hand: Jog, what: str, why: str) -> Exception:
    from rds.core.errors import MachineError

    return MachineError(f"{what}: {hand.error or why}; look for what holds it up")
