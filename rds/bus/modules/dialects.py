"""What the modules on a bus speak: for each dialect its server, its drivers on the host, and how to see it is there.

A dialect is a folder beside this file with two modules that are looked for by their names.

`dialect` says what others must know of it: `drivers()`, the class of the host's drivers, which keeps
`rds.core.contracts.Drivers`; `IDENTIFIERS`, the standard identifiers that it uses, as first, last and what a frame with
one does to a machine; `answers(machine, interface, channel, **options)`, whether its modules are there, for which
nothing moves; where axes are commanded by other things than voltages, `commands(machine, axes, bus)`; and what its
server takes of `rds machine serve` beside the options of a bus, `SERVED_WITH`. It is read for runs that need no bus, so
it imports what needs python-can in its functions.

`server` has `serve(machine, interface, channel, axes, ready, stop, lines, **options)`, and is a program
(`server_program.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

from rds.bus.hub.bus_settings import SERIAL
from rds.core.contracts import Drivers
from rds.core.errors import InputError
from rds.core.registry import Registry
from rds.machines.machine import Machine

LIBRARY = Registry(
    "dialect",
    {
        "rds": "rds.bus.modules.rds.dialect",
        "oacs": "rds.bus.modules.oacs.dialect",
        "cia402": "rds.bus.modules.cia402.dialect",
        "dcs": "rds.bus.modules.dcs.dialect",
    },
    own=False,
)
DEFAULT = "rds"
SERIAL_DIALECTS = ("dcs",)  # not on CAN: their interface is "serial"


def dialect_names() -> list[str]:
    """The dialects there are; the first is the cyclic frames of `rds.bus.modules.rds.frames`."""
    return LIBRARY.names()


def interface_of(dialect: str, interface: str) -> str:
    """The interface that a dialect is spoken on, where the built-in bus stands for "none was said"."""
    return SERIAL if dialect in SERIAL_DIALECTS and interface == "rds" else interface


def bus_interface(machine: Machine, bus: Mapping[str, Any]) -> str:
    """The interface that a `[bus]` table says; where it says none, that on which the machine's modules are.

    A machine whose axes have a motor in [axis.NAME.module] has units on a serial line.
    """
    if "interface" not in bus and "dialect" not in bus and any(a.module.get("motor") for a in machine.axes.values()):
        return SERIAL
    return interface_of(str(bus.get("dialect", DEFAULT)), str(bus.get("interface", "rds")))


def check_dialect(dialect: str) -> None:
    """InputError listing the dialects there are, for another one."""
    LIBRARY.module(dialect)


def server_module(dialect: str) -> str:
    """The module that serves a machine in this dialect, for `python -m`."""
    return LIBRARY.modules[dialect].removesuffix("dialect") + "server"


def serve_machine(
    machine: Machine, dialect: str, interface: str, channel: str | None, ready: Callable[[], Any], **options: Any
) -> None:
    """Serve `machine` until the process is told to end; `options` as of `serve_loop.serve_nodes`.

    InputError for an unknown dialect; else as each server says.
    """
    check_dialect(dialect)
    import_module(server_module(dialect)).serve(machine, interface, channel, ready=ready, **options)


def check_served_with(dialect: str, option: str, value: Any) -> None:
    """InputError for an option of `rds machine serve` that the modules of this dialect do not have."""
    if option in getattr(LIBRARY.module(dialect), "SERVED_WITH", ()):
        return
    having = [name for name in LIBRARY.names() if option in getattr(LIBRARY.module(name), "SERVED_WITH", ())]
    raise InputError(
        f"--{option} {value}: simulated modules of dialect {dialect} do not have it; those of {' and '.join(having)} "
        "do (--dialect)"
    )


def identifiers(dialect: str) -> tuple[tuple[int, int, str], ...]:
    """The standard identifiers that a dialect uses, first and last, and what a frame with one does to a machine."""
    table: tuple[tuple[int, int, str], ...] = LIBRARY.module(dialect).IDENTIFIERS
    return table


def commands(dialect: str, machine: Machine, axes: Sequence[str], bus: Mapping[str, Any]) -> dict[str, str]:
    """What each axis is commanded by over this bus: "voltage", or a target for a loop that its drive closes.

    Such are "velocity", "position", and "profile" for positions that the drive goes to by a profile of its own.
    InputError for a table of the dialect in `bus` that will not do.
    """
    module = LIBRARY.module(dialect)
    if not hasattr(module, "commands"):
        return dict.fromkeys(axes, "voltage")
    commanded: dict[str, str] = module.commands(machine, axes, bus)
    return commanded


def open_drivers(
    dialect: str, machine: Machine, axes: Sequence[str], sample_period: float, dry_run: bool, bus: dict[str, Any]
) -> Drivers:
    """The host's drivers of a machine's axes; `bus` goes to them as it is."""
    drivers: Drivers = LIBRARY.module(dialect).drivers()(
        machine, axes, sample_period=sample_period, dry_run=dry_run, **bus
    )
    return drivers


def is_served(dialect: str, machine: Machine, interface: str, channel: str | None, **options: Any) -> bool:
    """Whether modules of this dialect answer on a channel; nothing moves there. `options` go to the interface.

    InputError naming the dialects of those that answer, if none of them speaks this one.
    """
    if _answers(dialect, machine, interface, channel, **options):
        return True
    rest = [] if dialect in SERIAL_DIALECTS else [other for other in LIBRARY.names() if other != dialect]
    others = [other for other in rest if _answers(other, machine, interface, channel, **options)]
    if not others:
        return False
    from rds.bus.tools.link import bus_name

    speak = " and ".join(others)
    raise InputError(
        f"what answers on bus {bus_name(interface, channel)} speaks {speak}, not {dialect}: set [bus] dialect = "
        f'"{others[0]}", or choose another channel'
    )


def find_dialect(
    machine: Machine, interface: str, channel: str | None, first: str = DEFAULT, **options: Any
) -> str | None:
    """What the modules on a channel speak; None where none answers. Nothing moves there.

    The dialect `first` is asked for before the others; `options` go to the interface.
    """
    order = sorted(LIBRARY.names(), key=lambda dialect: dialect != first)
    return next((each for each in order if _answers(each, machine, interface, channel, **options)), None)


def _answers(dialect: str, machine: Machine, interface: str, channel: str | None, **options: Any) -> bool:
    is_there: bool = LIBRARY.module(dialect).answers(machine, interface, channel, **options)
    return is_there
