"""The options of the built-in bus: what a node may ask for when it opens a channel; and what is no bus's option."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rds.bus.hub import wire
from rds.core.errors import InputError
from rds.core.quantities import Quantity

# what CAN controllers do
BITRATE = Quantity(
    "bit rate; every frame then takes its exact time on the wire", "bit/s", 10_000, 1_000_000, whole=True
)
DATA_BITRATE = Quantity("bit rate of the fast part of CAN FD frames", "bit/s", 10_000, 8_000_000, whole=True)
RESTART = Quantity("time until the host comes back from bus off", "ms", 0, 3_600_000, whole=True)
# a serial line (dialect dcs); the rest of it belongs to a line that a run starts itself
SERIAL = "serial"
DEFAULT_BAUD = 115_200
BAUD = Quantity("baud rate; a byte takes ten bits", "bit/s", 300, 10_000_000, default=DEFAULT_BAUD, whole=True)
NOISE = Quantity("share of the bytes in which noise turns a bit", "", 0.0, 1.0)
_LINE = {
    "baud": BAUD,
    "noise": NOISE,
    "seed": Quantity("seed of the noise", "", 0, whole=True),
    "gap": Quantity("silence that ends half a frame", "s", 1e-4, 1.0),
}
OF_OWN_LINE = ("noise", "seed", "drift", "gap", "trace")  # what only a line that is simulated here has
_OF_SERIAL = ("interface", "channel", "dialect", "checksum", *_LINE, "drift", "trace")
_PARTS_OF_TIMING = (
    *("f_clock", "brp", "tseg1", "tseg2", "sjw", "nof_samples"),
    *(f"{rate}_{part}" for rate in ("nom", "data") for part in ("brp", "tseg1", "tseg2", "sjw")),
)
OPTIONS = ("bitrate", "data_bitrate", "name", "error_frames", "restart_ms")

# what drivers, servers and scans are told beside an adapter's options: a key of this name would be taken for it
_OF_BUSES = ("identifiers", "mask", "can_filters", "ignore_config", "node", "timeout", "first")
_OF_DRIVERS = ("machine", "axes", "bus", "sample_period", "dry_run")
_OF_SERVERS = ("nodes", "ready", "stop", "orphaned", "afterlife", "chores", "exact")
OUR_WORDS = frozenset((*_OF_BUSES, *_OF_DRIVERS, *_OF_SERVERS))


def bus_fault(table: Mapping[str, Any]) -> tuple[str, str] | None:
    """The key of a `[bus]` table that no bus can have, and why; None if there is none. Every door refuses with it."""
    if ours := sorted(OUR_WORDS & table.keys()):
        return ours[0], f"cannot be said: {ours[0]} is no option of a bus, but a word of our own; remove it"
    if "cia402" in table and table.get("dialect") != "cia402":
        return "cia402", 'is for drives: add `dialect = "cia402"` to [bus], or remove it'
    return None


def serial_fault(table: Mapping[str, Any]) -> tuple[str, str] | None:
    """The key of a serial line's `[bus]` table that cannot be, and why; None if there is none."""
    for key, value in table.items():
        if key not in _OF_SERIAL:
            return key, f"is no option of a serial line; it takes {', '.join(_OF_SERIAL)}"
        fault = _LINE[key].fault(value) if key in _LINE else None
        if key == "checksum" and not isinstance(value, bool):
            fault = "must be true or false (whether frames carry a checksum)"
        if fault is not None:
            return key, fault
    if table.get("interface", SERIAL) != SERIAL:
        return "interface", f'must be "{SERIAL}": dialect dcs is spoken on serial lines'
    return None


def read_settings(options: Mapping[str, Any]) -> wire.Settings:
    """The settings that `options` ask for; None stands for an option that is not given.

    Raises ValueError for an unknown option or a value that can't be, with what can.
    """
    given = {key: value for key, value in options.items() if value is not None}
    given.pop("single_handle", None)  # python-can's own tools give it to every interface; it says nothing here
    if (timing := given.pop("timing", None)) is not None:
        for part in _PARTS_OF_TIMING:  # python-can's files and tools leave them beside what they have made of them
            given.pop(part, None)
        given |= _rates_of(timing, given)
    if unknown := sorted(set(given) - set(OPTIONS)):
        raise ValueError(
            f"the built-in bus has no option {', '.join(unknown)}; it takes channel, can_filters, "
            f"receive_own_messages, fd, timing, {', '.join(OPTIONS)} (python-can's files and variables count too)"
        )
    bitrate = _whole(given, "bitrate", BITRATE, 0)
    data_bitrate = _whole(given, "data_bitrate", DATA_BITRATE, 0)
    if data_bitrate and not bitrate:
        raise ValueError("data_bitrate without bitrate: give both, or join whatever bus there is with neither")
    name = given.get("name", "")
    if not isinstance(name, str) or len(name.encode()) > wire.NAME or not name.isprintable():
        raise ValueError(f"name {name!r} must be printable text of at most {wire.NAME} bytes")
    error_frames = given.get("error_frames", False)
    if not isinstance(error_frames, bool):
        raise ValueError(f"error_frames {error_frames!r} must be true or false")
    restart = _whole(given, "restart_ms", RESTART, -1)
    return wire.Settings(name, bitrate, data_bitrate, restart, error_frames)


def _rates_of(timing: Any, given: Mapping[str, Any]) -> dict[str, int]:
    """The bit rates of python-can's `BitTiming` or `BitTimingFd`. Sample points say nothing here: all clocks agree."""
    if (nominal := getattr(timing, "nom_bitrate", None)) is not None:
        rates = {"bitrate": nominal, "data_bitrate": timing.data_bitrate}
    elif (nominal := getattr(timing, "bitrate", None)) is not None:
        rates = {"bitrate": nominal}
    else:
        raise ValueError(f"timing {timing!r:.80} must be a can.BitTiming or a can.BitTimingFd")
    for key, rate in rates.items():
        if given.get(key, rate) != rate:
            raise ValueError(f"{key} {given[key]!r} is not that of timing, {rate}; give one of the two")
    return rates


def _whole(given: Mapping[str, Any], name: str, declared: Quantity, default: int) -> int:
    value = given.get(name, default)
    if name not in given or value == default == 0:
        return default
    try:
        return int(declared.check(value, name))
    except InputError as error:
        raise ValueError(str(error)) from None
