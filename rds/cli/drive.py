"""`rds drive`: a CiA 402 drive out of the box made ready, its node-ID, its parameters kept or reset."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.buses import BUILTIN, BusOptions, ChosenBus
from rds.cli.common import Json, ends_as_ctrl_c, print_json, refusals, writes_files
from rds.cli.option_groups import grouped_options

app = typer.Typer(no_args_is_help=True, help="CiA 402 drives out of the box: set-up, node-ID, stored parameters.")

PRIORITY = 80  # as a run's
Node = Annotated[int | None, typer.Option(help="Node-ID; by default the only drive's on the bus.", min=1, max=127)]
Yes = Annotated[
    bool, typer.Option("--yes", help="Do not ask: every step is agreed to. Somebody has to watch the axis.")
]


@app.command()
@writes_files
def setup(
    *,
    out: Annotated[Path, typer.Option("--out", "-o", help="The machine file; the experiment goes beside it.")] = Path(
        "drive.toml"
    ),
    node: Node = None,
    axis: Annotated[str, typer.Option(help="What the axis is to be called.")] = "X",
    unit: Annotated[str, typer.Option(help="mm or deg.")] = "mm",
    lead: Annotated[float, typer.Option(help="mm (degrees) per revolution of the drive's shaft.", min=1e-9)] = 1.0,
    counts: Annotated[
        float | None, typer.Option(help="Position units per mm (degree), where the drive's objects do not say them.")
    ] = None,
    travel: Annotated[float, typer.Option(help="To both sides of where the axis stands, mm (degrees).")] = 10.0,
    mode: Annotated[
        str | None, typer.Option(help="csp, csv, cst or pp; by default the first of them that the drive can.")
    ] = None,
    sample_period: Annotated[float, typer.Option(help="s.", min=1e-4, max=0.1)] = 0.002,
    eds: Annotated[Path | None, typer.Option(help="The drive's EDS; it is kept for the next time.")] = None,
    torque: Annotated[int, typer.Option(help="Per mille at most in the first motion.", min=1, max=500)] = 100,
    distance: Annotated[int, typer.Option(help="Counts of the first motion.", min=10, max=100_000)] = 40,
    direction: Annotated[
        int | None, typer.Option(help="-1 if the drive counts against the axis's direction; else it is asked.")
    ] = None,
    store: Annotated[bool, typer.Option("--store", help="Keep the drive's parameters in it (0x1010).")] = False,
    on_bus: BusOptions,
    force: Annotated[bool, typer.Option("--force", help="Overwrite existing files.")] = False,
    yes: Yes = False,
    json: Json = False,
) -> None:
    """Make a drive ready, step by step, each after a yes; write its machine file and an experiment that moves it.

    It recognizes the drive, takes its units and limits, maps its process data, moves the axis by a few counts at low
    torque and back, and measures the delay. What was changed for that alone is written back, also after a no.
    """
    with refusals(), ends_as_ctrl_c():
        from rds.bus.modules.cia402.commissioned import experiment_text, machine_text
        from rds.bus.modules.cia402.commissioning import CommissioningOptions, Declined, commission
        from rds.core.atomic import write_whole
        from rds.core.errors import InputError
        from rds.modes.process.environment import prepared

        if not (yes or sys.stdin.isatty()):
            raise InputError("set-up asks before each step, and there is no terminal: add --yes if somebody watches")
        if direction not in (None, 1, -1):
            raise InputError(f"--direction {direction} must be 1 or -1")
        if mode not in (None, "csp", "csv", "cst", "pp"):
            raise InputError(f"--mode {mode} must be csp, csv, cst or pp")
        unit = "deg" if unit in ("degree", "degrees", "°") else unit
        if unit not in ("mm", "deg"):
            raise InputError(f"--unit {unit} must be mm or deg")
        if out.suffix != ".toml":
            raise InputError(f"--out {out} must end with .toml")
        sine, steps = (out.with_name(f"{out.stem}-{motion}.toml") for motion in ("sine", "steps"))
        for path in (out, sine, steps):
            if path.exists() and not force:
                raise InputError("there is such a file already; choose another name, or give --force", str(path))
        place = on_bus.chosen()
        number = _the_node(place, node)
        options = CommissioningOptions(
            number, axis, unit, lead, counts, travel, sample_period, mode, eds, torque, distance, keep_in_drive=store
        )
        try:
            # a drive bears no host that is held up for ten periods
            with _opened(place) as bus, prepared(PRIORITY, None):
                made = commission(bus, options, out.stem, _Terminal(yes, json, direction, axis))
        except Declined:
            typer.echo("rds: ended; what was changed on the drive has been written back", err=True)
            raise typer.Exit(1) from None
        write_whole(out, machine_text(made.choices, str(made.identity)).encode())
        written = sine if made.choices.motion == "sine" else steps
        write_whole(written, experiment_text(made.choices, out.name, _table(place)).encode())
    if json:
        print_json(made.to_json() | {"machine": str(out), "experiment": str(written)})
    else:
        typer.echo(f"wrote {out} and {written}; next: rds run {written}")


@app.command("node-id")
@grouped_options
def node_id(
    to: Annotated[int, typer.Argument(metavar="NODE", help="The node-ID that it gets.", min=1, max=127)],
    on_bus: BusOptions,
    temporary: Annotated[
        bool, typer.Option("--temporary", help="Do not store it in the drive: it is gone when that is switched off.")
    ] = False,
    yes: Yes = False,
    json: Json = False,
) -> None:
    """Give a node-ID to the one drive on the bus that has none, by LSS (CiA 305)."""
    with refusals():
        from rds.bus.modules.cia402.lss import give_node_id

        place = on_bus.chosen()
        _agreed(f"give node-ID {to} to the drive without one on {place.name}", yes)
        with _opened(place) as bus:
            found = give_node_id(bus, to, keep=not temporary)
    if json:
        print_json({"node": to, "identity": list(found)})
    else:
        vendor, product, _, serial = found
        typer.echo(f"vendor {vendor:#x}, product {product:#x}, serial number {serial} is node {to} now")


@app.command()
@grouped_options
def store(*, node: Node = None, on_bus: BusOptions, yes: Yes = False) -> None:
    """Keep a drive's parameters in it, also when it is switched off (object 0x1010)."""
    from rds.bus.modules.cia402 import parameters

    _parameters(parameters.store, "keep its parameters", on_bus, node, yes)


@app.command()
@grouped_options
def restore(*, node: Node = None, on_bus: BusOptions, yes: Yes = False) -> None:
    """Reset a drive's parameters to its manufacturer's: from when it is switched on again (object 0x1011)."""
    from rds.bus.modules.cia402 import parameters

    what = "forget its parameters, and take its manufacturer's when it is switched on again"
    _parameters(parameters.restore, what, on_bus, node, yes)


class _Terminal:
    """Says and asks on stderr."""

    def __init__(self, yes: bool, quiet: bool, direction: int | None, axis: str):
        self._yes, self._quiet, self._direction, self._axis = yes, quiet, direction, axis

    def say(self, text: str) -> None:
        if not self._quiet:
            typer.echo(f"  {text}", err=True)

    def agree(self, step: str) -> bool:
        if self._yes:
            self.say(step)
            return True
        return typer.confirm(f"{step}?", err=True)

    def choose_direction(self, moved: int) -> int:
        if self._direction is not None:
            return self._direction
        if self._yes:
            return 1
        return (
            1 if typer.confirm(f"{self._axis} moved: was that its positive direction?", default=True, err=True) else -1
        )


def _parameters(does: Callable[[Any], None], what: str, on_bus: BusOptions, node: int | None, yes: bool) -> None:
    with refusals():
        import canopen

        from rds.bus.modules.cia402.configure import library

        place = on_bus.chosen()
        number = _the_node(place, node)
        _agreed(f"let node {number} {what}", yes)
        with _opened(place) as bus, library(bus) as network:
            does(network.add_node(number, canopen.ObjectDictionary()))
    typer.echo(f"node {number}: done")


def _agreed(step: str, yes: bool) -> None:
    if yes:
        return
    if not sys.stdin.isatty():
        from rds.core.errors import InputError

        raise InputError("it asks first, and there is no terminal: add --yes")
    if not typer.confirm(f"{step}?", err=True):
        raise typer.Exit(1)


def _the_node(place: ChosenBus, node: int | None) -> int:
    """The node that is meant: the one that was said, or the only drive that answers."""
    from rds.bus.modules.cia402.scan import scan
    from rds.core.errors import InputError, MachineError

    if place.is_line:
        raise InputError("drives are on CAN, and this is a serial line")
    if node is not None:
        return node
    drives = [found for found in scan(place.interface, place.channel, **place.options) if found.is_drive]
    if not drives:
        raise MachineError(
            f"no drive answers on {place.name}: check power, cable and bit rate (`rds doctor --bus`); one that has no "
            "node-ID yet gets it by `rds drive node-id`"
        )
    if len(drives) > 1:
        names = ", ".join(f"{found.node} ({found.name or 'no name'})" for found in drives)
        raise InputError(f"{len(drives)} drives answer on {place.name}: {names}; choose one by --node")
    return drives[0].node


@contextmanager
def _opened(place: ChosenBus) -> Iterator[Any]:
    """The bus; what fails on it is a MachineError."""
    import can
    from canopen.sdo import SdoAbortedError, SdoCommunicationError

    from rds.core.errors import MachineError

    with place.opened() as bus:
        try:
            yield bus
        except (can.CanError, OSError, SdoCommunicationError) as error:
            raise MachineError(f"bus {place.name} failed: {error}") from error
        except SdoAbortedError as error:
            raise MachineError(f"the drive refused an object: {error}") from error


def _table(place: ChosenBus) -> dict[str, Any]:
    """The keys of [bus] for an experiment."""
    there = {"interface": place.interface, "channel": place.channel}
    if place.interface == BUILTIN:
        del there["interface"]
    return {key: value for key, value in (there | place.options).items() if value is not None}
