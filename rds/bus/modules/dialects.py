"""What the modules on a bus speak: for each dialect its server, its drivers on the host, and how to see it is there.

A dialect is a folder beside this file. Its server module has `serve(machine, interface, channel, axes, ready, stop,
**options)` and is a program (`server_program.py`); its drivers are a class that keeps `rds.core.contracts.Drivers`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rds.bus.hub.bus_settings import SERIAL
from rds.core.contracts import Drivers
from rds.core.errors import InputError
from rds.machines.machine import Machine

if TYPE_CHECKING:  # where the type checker proves that every dialect keeps the contract
    from rds.bus.modules.cia402.host import Cia402Drivers
    from rds.bus.modules.dcs.drivers import DcsDrivers
    from rds.bus.modules.oacs.drivers import OacsDrivers
    from rds.bus.modules.rds.drivers import AxisDrivers

    _CHECKED: tuple[type[Drivers], ...] = (AxisDrivers, OacsDrivers, Cia402Drivers, DcsDrivers)

_DRIVERS = {
    "rds": ("rds.bus.modules.rds.drivers", "AxisDrivers"),
    "oacs": ("rds.bus.modules.oacs.drivers", "OacsDrivers"),
    "cia402": ("rds.bus.modules.cia402.host", "Cia402Drivers"),
    "dcs": ("rds.bus.modules.dcs.drivers", "DcsDrivers"),
}
_SERVERS = {
    "rds": "rds.bus.modules.rds.server",
    "oacs": "rds.bus.modules.oacs.server",
    "cia402": "rds.bus.modules.cia402.server",
    "dcs": "rds.bus.modules.dcs.server",
}
_IDENTIFIERS = {
    "rds": "rds.bus.modules.rds.frames",
    "oacs": "rds.bus.modules.oacs.messages",
    "cia402": "rds.bus.modules.cia402.codes",
    "dcs": "rds.bus.modules.dcs.frames",
}
_COMMANDS = {"cia402": "rds.bus.modules.cia402.settings"}  # where a dialect commands by other things than voltages
DEFAULT = "rds"
SERIAL_DIALECTS = ("dcs",)  # not on CAN: their interface is "serial"


def dialect_names() -> list[str]:
    """The dialects there are; the first is the cyclic frames of `rds.bus.modules.rds.frames`."""
    return list(_DRIVERS)


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
    if dialect not in _DRIVERS:
        raise InputError(f"unknown dialect {dialect!r}; known dialects: {', '.join(_DRIVERS)}")


def server_module(dialect: str) -> str:
    """The module that serves a machine in this dialect, for `python -m`."""
    return _SERVERS[dialect]


def identifiers(dialect: str) -> tuple[tuple[int, int, str], ...]:
    """The standard identifiers that a dialect uses, first and last, and what a frame with one does to a machine."""
    table: tuple[tuple[int, int, str], ...] = import_module(_IDENTIFIERS[dialect]).IDENTIFIERS
    return table


def commands(dialect: str, machine: Machine, axes: Sequence[str], bus: Mapping[str, Any]) -> dict[str, str]:
    """What each axis is commanded by over this bus: "voltage", or a target for a loop that its drive closes.

    Such are "velocity", "position", and "profile" for positions that the drive goes to by a profile of its own.
    InputError for a table of the dialect in `bus` that will not do.
    """
    if dialect not in _COMMANDS:
        return dict.fromkeys(axes, "voltage")
    commanded: dict[str, str] = import_module(_COMMANDS[dialect]).commands(bus.get(dialect) or {}, machine, axes)
    return commanded


def open_drivers(
    dialect: str, machine: Machine, axes: Sequence[str], sample_period: float, dry_run: bool, bus: dict[str, Any]
) -> Drivers:
    """The host's drivers of a machine's axes; `bus` goes to them as it is."""
    module, name = _DRIVERS[dialect]
    adapter: Callable[..., Drivers] = getattr(import_module(module), name)
    return adapter(machine, axes, sample_period=sample_period, dry_run=dry_run, **bus)


def is_served(dialect: str, machine: Machine, interface: str, channel: str | None, **options: Any) -> bool:
    """Whether modules of this dialect answer on a channel; nothing moves there. `options` go to the interface.

    InputError naming the dialects of those that answer, if none of them speaks this one.
    """
    if _answers(dialect, machine, interface, channel, **options):
        return True
    rest = [] if dialect in SERIAL_DIALECTS else [other for other in _DRIVERS if other != dialect]
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
    order = sorted(_DRIVERS, key=lambda dialect: dialect != first)
    return next((each for each in order if _answers(each, machine, interface, channel, **options)), None)


def _answers(dialect: str, machine: Machine, interface: str, channel: str | None, **options: Any) -> bool:
    if dialect in SERIAL_DIALECTS:
        from rds.bus.modules.dcs.calling import find_units

        return interface == SERIAL and bool(find_units(machine, channel, **options))
    if dialect == "cia402":
        from rds.bus.modules.cia402.scan import scan

        return any(device.is_drive for device in scan(interface, channel, **options))
    from rds.bus.modules.calling import find_machine

    # the modules of the oacs dialect answer cyclic frames as well
    nodes = {machine.axis(name).node for name in find_machine(machine, interface, channel, **options)}
    if not nodes:
        return False
    from rds.bus.modules.oacs.host import identify
    from rds.bus.tools.link import open_bus

    bus = open_bus(interface, channel, node="scan", **options)
    try:
        distributed = {info.id for info in identify(bus)}
    finally:
        bus.shutdown()
    return bool(nodes & distributed if dialect == "oacs" else nodes - distributed)
