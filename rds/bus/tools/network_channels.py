"""Buses that leave this computer: whoever shares the network moves the machine, so somebody has to want that.

CAN over a network has no password and no encryption. What stays on the computer's loopback is another matter, and so is
a cable.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlsplit

import can

from rds.core.errors import InputError
from rds.core.loopback import is_loopback

OPTION = "beyond_this_computer"  # the words in [bus] that allow it
_MULTICAST = ("udp_multicast",)  # interfaces that speak to a whole network, whatever their channel is
_HOSTS = ("host", "hostname", "ip", "ip_address", "address", "server")  # options that name another computer


def refuse_network(interface: str, channel: Any, options: Mapping[str, Any], allowed: Any) -> None:
    """InputError for a bus that leaves this computer, unless `allowed`; python-can's files count, too."""
    if not isinstance(allowed, bool):
        raise InputError(f"{OPTION} = {allowed!r} must be true or false", "[bus]")
    given: dict[str, Any] = {"interface": interface, "channel": channel, **options}
    with contextlib.suppress(can.CanError, OSError, ValueError):  # said again, in full, when the bus is opened
        given |= can.util.load_config(config={key: value for key, value in given.items() if value is not None})
    where = _where(interface, given)
    if where is not None and not allowed:
        raise InputError(
            f"interface {interface!r} {where}: whoever reaches that network can move the machine, for it has no "
            f"password; if that is meant, say {OPTION} = true in [bus]",
            "[bus]",
        )


def _where(interface: str, options: Mapping[str, Any]) -> str | None:
    """In words where beyond this computer the bus goes; None if it doesn't."""
    if interface in _MULTICAST:
        return "sends to all computers of a network"
    hosts = [str(options[key]) for key in _HOSTS if options.get(key)]
    if "://" in (channel := str(options.get("channel") or "")):  # a serial port behind a network, a remote bus
        hosts.append(urlsplit(channel).hostname or "")
    beyond = [host for host in hosts if not is_loopback(host)]
    return f"goes to {beyond[0] or channel!r}, beyond this computer" if beyond else None
