"""The options of the built-in bus: what a node may ask for when it opens a channel; and what is no bus's option."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rds.bus.hub import wire

BITRATES = (10_000, 1_000_000)  # bit/s, least and most: what CAN controllers do
DATA_BITRATES = (10_000, 8_000_000)
OPTIONS = ("bitrate", "data_bitrate", "name", "error_frames", "restart_ms")
_LONGEST_RESTART = 3_600_000  # ms

# what drivers, servers and scans are told beside an adapter's options: a key of this name would be taken for it
_OF_BUSES = ("identifiers", "mask", "can_filters", "ignore_config", "node", "timeout", "first")
_OF_DRIVERS = ("machine", "axes", "bus", "sample_period", "dry_run")
_OF_SERVERS = ("nodes", "ready", "stop", "orphaned", "afterlife", "chores", "exact")
OUR_WORDS = frozenset((*_OF_BUSES, *_OF_DRIVERS, *_OF_SERVERS))


def read_settings(options: Mapping[str, Any]) -> wire.Settings:
    """The settings that `options` ask for; None stands for an option that is not given.

    Raises ValueError for an unknown option or a value that can't be, with what can.
    """
    given = {key: value for key, value in options.items() if value is not None}
    given.pop("single_handle", None)  # python-can's own tools give it to every interface; it says nothing here
    if unknown := sorted(set(given) - set(OPTIONS)):
        raise ValueError(
            f"the built-in bus has no option {', '.join(unknown)}; it takes channel, can_filters, "
            f"receive_own_messages, fd, {', '.join(OPTIONS)} (python-can's files and variables count too)"
        )
    bitrate = _whole(given, "bitrate", *BITRATES, 0)
    data_bitrate = _whole(given, "data_bitrate", *DATA_BITRATES, 0)
    if data_bitrate and not bitrate:
        raise ValueError("data_bitrate without bitrate: give both, or join whatever bus there is with neither")
    name = given.get("name", "")
    if not isinstance(name, str) or len(name.encode()) > wire.NAME or not name.isprintable():
        raise ValueError(f"name {name!r} must be printable text of at most {wire.NAME} bytes")
    error_frames = given.get("error_frames", False)
    if not isinstance(error_frames, bool):
        raise ValueError(f"error_frames {error_frames!r} must be true or false")
    restart = _whole(given, "restart_ms", 0, _LONGEST_RESTART, -1)
    return wire.Settings(name, bitrate, data_bitrate, restart, error_frames)


def _whole(given: Mapping[str, Any], name: str, least: int, most: int, default: int) -> int:
    value = given.get(name, default)
    if name not in given or value == default == 0:
        return default
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ValueError(f"{name} {value!r} must be a whole number from {least:,} to {most:,}")
    return value
