"""Opening a bus: any python-can interface, errors in the words of the machine's user."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rds.bus.hub.bus_settings import SERIAL
from rds.bus.tools.network_channels import OPTION, refuse_network
from rds.core.errors import InputError, MachineError
from rds.machines.machine import Machine

if TYPE_CHECKING:
    import can

BUILTIN = "rds"  # the built-in bus's name among python-can's interfaces
_NO_OPTIONS = ("dialect", "cia402", "faults", "interface", "channel")  # keys of a [bus] table that are not can.Bus's


def bus_name(interface: str, channel: str | None) -> str:
    """How messages call a bus."""
    return interface if channel in (None, "") else f"{interface}:{channel}"


def bus_failed(name: str, error: Exception) -> MachineError:
    """The error of a bus that failed while it was used. The built-in bus has no cable; its errors say what to do."""
    if name.startswith(("built-in bus", BUILTIN)):
        return MachineError(f"{name} failed: {str(error).removeprefix(f'{name}: ')}")
    return MachineError(f"bus {name} failed: {error}; check power, cable and adapter, then open it again")


def bus_options(table: Mapping[str, Any]) -> dict[str, Any]:
    """What of a `[bus]` table goes to can.Bus beside interface and channel, such as the bit rate."""
    return {key: value for key, value in table.items() if key not in _NO_OPTIONS}


def default_channel(machine: Machine, interface: str, channel: str | None) -> str | None:
    """The channel that was asked for, else that of the machine on the built-in bus and a serial line, else none: the
    interface has a default of its own.
    """
    return channel if channel is not None or interface not in (BUILTIN, SERIAL) else machine.channel


def open_bus(
    interface: str,
    channel: str | None,
    identifiers: Sequence[int] | None = None,
    mask: int = 0x7FF,
    node: str | None = None,
    **options: Any,
) -> can.BusABC:
    """An open bus that receives the standard frames whose identifier, masked, is one of `identifiers` (None: all).

    `node` is what the built-in bus calls this node; `options` go to the interface as they are (bitrate, fd...).
    Raises MachineError if the bus can't be opened, InputError for one that leaves this computer (network_channels.py)
    unless the option `beyond_this_computer` is true.
    """
    import can

    from rds.bus.tools.adapter import NOT_ADAPTERS, guard

    if node is not None and interface == BUILTIN:
        options.setdefault("name", node)
    if interface != BUILTIN:
        refuse_network(interface, channel, options, options.pop(OPTION, False))
    filters = None
    if identifiers is not None:
        filters = standard_filters(identifiers, mask)
    try:
        bus = can.Bus(
            interface=interface,
            channel=channel,
            can_filters=filters,
            # what a user's python-can files say of real buses (a bit rate...) isn't meant for the built-in one
            ignore_config=interface == BUILTIN,
            **options,
        )
    except (can.CanError, OSError, ValueError, TypeError, NotImplementedError) as error:
        remedy = "check interface, channel and options (on the command line, or in the [bus] table)"
        if interface == "slcan":
            remedy += (
                "; `ls /dev/serial/by-id` shows serial adapters; one that may not be opened needs your user in its "
                "group, dialout as a rule, and one that another program has open waits for that program's end"
            )
        if interface == SERIAL:
            remedy += (
                "; this interface is python-can's, of CAN frames on a serial port: a serial line of units has none, is "
                "served with --dialect dcs, and its units answer `rds scan --interface serial`"
            )
        raise MachineError(f"bus {bus_name(interface, channel)} can't be opened: {error}; {remedy}") from error
    if interface in NOT_ADAPTERS:
        return bus
    return guard(bus, interface, bus_name(interface, channel))


def standard_filters(identifiers: Sequence[int], mask: int = 0x7FF) -> list[Any]:
    """Filters, in python-can's form, for the standard frames whose identifier, masked, is one of `identifiers`."""
    return [{"can_id": wanted, "can_mask": mask, "extended": False} for wanted in identifiers]


def pair(text: str) -> tuple[str, Any]:
    """KEY=VALUE; a value that looks like a number or true/false becomes one, as in python-can's own files."""
    from can.util import cast_from_string

    key, equals, value = text.partition("=")
    if not equals or not key:
        raise InputError(f"option {text!r} must be KEY=VALUE", "--option")
    return key, cast_from_string(value)
