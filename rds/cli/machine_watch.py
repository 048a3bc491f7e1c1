"""`rds machine watch`: modules are lost and found, and the machine that they make now is offered and accepted."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.buses import BusOptions
from rds.cli.common import Json, print_json, refusals, until_ctrl_c, writes_files

_INTERVAL = 0.1  # s between two looks
_WORDS = {"removed": "lost", "added": "found", "present": "there is", "ready": "accepted", "moving": "moves"}


@writes_files
def watch(
    machine: Annotated[
        str, typer.Argument(help="The machine till now: its name, or the path of its TOML file.", metavar="MACHINE")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="The file of the new machine, MACHINE.toml.")],
    *,
    yes: Annotated[bool, typer.Option("--yes", help="Accept whatever makes a machine, without asking.")] = False,
    move: Annotated[
        str | None, typer.Option(help="After acceptance, move an axis by so much: X=1 (mm, degrees).")
    ] = None,
    events: Annotated[
        Path | None, typer.Option(help="CSV file of what happens, for `rds report reconfiguration`.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="End after so long; by default with Ctrl-C.", min=0.0)] = None,
    once: Annotated[bool, typer.Option("--once", help="End with the first machine that is accepted.")] = False,
    on_bus: BusOptions,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the files of --out and --events.")] = False,
    json: Json = False,
) -> None:
    """Watch a machine's modules (dialect oacs); offer what they make after each change, and write it when accepted.

    A module that is unplugged has ended the run already, and the watchdogs of the others have cut their voltage.
    """
    with refusals(), ExitStack() as stack:
        from rds.bus.modules.oacs.events import EventFile
        from rds.bus.modules.oacs.offers import Offers
        from rds.core.errors import InputError
        from rds.machines import load_machine

        if json and not yes:
            raise InputError("--json cannot ask; add --yes, which accepts whatever makes a machine")
        if not out.name.endswith(".toml"):
            raise InputError(f"--out {out.name!r} must end with .toml")
        if out.exists() and not force:
            raise InputError("there is such a file already; choose another name, or give --force", str(out))
        motion = _motion(move) if move else None
        before = load_machine(machine)
        if not (on_bus.channel or on_bus.experiment or on_bus.interface):
            on_bus = on_bus._replace(channel=before.name)
        place = on_bus.chosen()
        bus = stack.enter_context(place.opened())
        offers = Offers(bus, before)
        file = EventFile(events, force) if events is not None else None
        if file is not None:
            stack.callback(file.close)
        stop = stack.enter_context(until_ctrl_c())
        ends = None if seconds is None else time.monotonic() + seconds
        rows: list[dict[str, Any]] = []

        def tell(happened: Any) -> None:
            if file is not None:
                file.add(happened)
            rows.append({"time_s": round(happened.time, 3), "event": happened.event, "module": happened.module})
            if not json and happened.event not in ("offered", "refused"):
                said = _WORDS.get(happened.event, happened.event)
                typer.echo(f"{happened.time:9.3f} s  {said} {happened.module or out}")

        while not stop.is_set() and (ends is None or time.monotonic() < ends):
            happened, offer = offers.look()
            for each in happened:
                tell(each)
            if offer is not None and not json:
                typer.echo(f"             {offer.verdict}")
            if offer is not None and offer.verdict.ok and (yes or typer.confirm("accept?")):
                changes, _ = offers.look()
                for each in changes:
                    tell(each)
                if any(each.event in ("removed", "added") for each in changes):
                    typer.echo("             the modules have changed meanwhile: this one is void", err=True)
                    continue
                tell(offers.accept(offer, out)[1])
                if motion is not None:
                    tell(offers.move(*motion))
                if once:
                    break
            stop.wait(_INTERVAL)
    if json:
        print_json({"machine": str(out) if any(row["event"] == "ready" for row in rows) else None, "events": rows})


def _motion(text: str) -> tuple[str, float]:
    from rds.core.errors import InputError

    axis, equals, value = (word.strip() for word in text.partition("="))
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not (axis and equals) or not 0.0 < abs(number) < float("inf"):
        raise InputError(f"--move {text!r} must be AXIS=DISTANCE, as in X=1")
    return axis, number
