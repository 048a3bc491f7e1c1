"""`rds jog`: one axis of a machine moved by hand from the command line, as the jog panel moves it."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rds.commands.common import Json, ends_as_ctrl_c, print_json, refusals

if TYPE_CHECKING:
    from rds.session.jog import Jog

_LOOKS = 0.05  # s
_SPARE = 5.0  # s without a way made until an axis counts as stuck
_THERE = 10.0  # counts from the goal that are there


def jog(
    axis: Annotated[str, typer.Argument(help="The axis, as in X.")],
    by: Annotated[float | None, typer.Option(help="Distance, mm or degrees.")] = None,
    to: Annotated[float | None, typer.Option(help="Position, mm or degrees.")] = None,
    speed: Annotated[float | None, typer.Option(help="mm/s or degrees/s; by default 5, or the fastest.")] = None,
    machine: Annotated[str, typer.Option(help="A machine's name, or the path of its TOML file.")] = "mini-cnc",
    interface: Annotated[str, typer.Option(help="python-can interface.")] = "rds",
    channel: Annotated[str | None, typer.Option("--channel", "-c", help="By default the machine's name.")] = None,
    json: Json = False,
) -> None:
    """Move one axis, hold the others where they are, and say where it stands; Ctrl-C or a kill stops it."""
    with refusals():
        from rds.core.errors import InputError, MachineError
        from rds.session.jog import Jog
        from rds.session.session import Session

        if (by is None) == (to is None):
            given = "neither is given" if by is None else "both are given"
            raise InputError(f"{given}: move by a distance with --by, or to a position with --to, as in --by 5")
        bus = {"interface": interface} | ({"channel": channel} if channel else {})
        with tempfile.TemporaryDirectory(prefix="rds-jog-") as folder, ends_as_ctrl_c():
            hand = Jog(Session(Path(folder), machine, bus))
            try:
                begun = hand.begin()
                begun.wait()
                if begun.error is not None:
                    raise begun.error
                goal = to if to is not None else hand.positions.get(axis, 0.0) + (by or 0.0)
                hand.go(axis, goal, speed)
                stands = _arrived(hand, axis, goal)
            except KeyboardInterrupt:
                typer.echo("rds: stopped by Ctrl-C", err=True)
                raise typer.Exit(130) from None
            finally:
                hand.end()
        if stands is None:
            raise MachineError(f"{axis} did not arrive: {hand.error or 'it stands still'}; look for what holds it up")
    unit = hand.axes[axis].unit
    if json:
        print_json({"axis": axis, "position": stands, "unit": unit})
    else:
        typer.echo(f"{axis} stands at {stands:.3f} {unit}")


def _arrived(hand: Jog, axis: str, goal: float) -> float | None:
    """The position at the goal, at rest; None where the axis stands still for _SPARE s on the way, or all has ended."""
    near, last, since = _THERE * hand.axes[axis].resolution, hand.positions[axis], time.monotonic()
    while hand.ready:
        time.sleep(_LOOKS)
        at, now = hand.positions.get(axis, last), time.monotonic()
        if abs(at - goal) <= near and not hand.moving:
            return at
        if abs(at - last) > near:
            last, since = at, now
        if now - since > _SPARE:
            break
    return None
