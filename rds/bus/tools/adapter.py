"""An adapter between computer and bus: what goes wrong in it is told by its name, with cause and remedy.

python-can's interfaces raise what their parsers and operating systems raise: a ValueError of int() where a serial line
garbles, an OSError where a plug is pulled. And some give back what one has sent oneself.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from typing import Any

import can

from rds.core.errors import InputError

LOG = logging.getLogger(__name__)

NOT_ADAPTERS = ("rds", "virtual")
_GIVES_BACK = ("udp_multicast",)  # interfaces on which one hears one's own frames as if they were others'
_GARBLED = (ValueError, IndexError, KeyError, TypeError, OverflowError)
_ON_ITS_WAY = 1.0  # s that an own frame may take to come back
_MOST = 4096


class AdapterFailure(can.CanOperationError):
    """The adapter has failed: its name, the cause and the remedy are in the message."""


def guard(bus: can.BusABC, interface: str, name: str) -> can.BusABC:
    """The same bus; its failures become AdapterFailure, and frames of its own that come back are dropped."""
    receive, send, shut = bus.recv, bus.send, bus.shutdown
    own: deque[tuple[float, int, bool, bytes]] = deque(maxlen=_MOST)
    gives_back = interface in _GIVES_BACK

    def guarded_receive(timeout: float | None = None) -> can.Message | None:
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            left = None if deadline is None else max(deadline - time.monotonic(), 0.0)
            try:
                message = receive(left)
            except (InputError, can.CanTimeoutError):
                raise
            except (can.CanError, OSError) as error:
                say = _garbled if isinstance(error.__cause__, UnicodeDecodeError) else _lost
                raise AdapterFailure(say(interface, name, error)) from error
            except _GARBLED as error:
                raise AdapterFailure(_garbled(interface, name, error)) from error
            if message is None or not own or not _is_own(message, own):
                return message

    def guarded_send(msg: can.Message, timeout: float | None = None) -> None:
        if gives_back:
            own.append((time.monotonic(), *_key(msg)))
        try:
            send(msg, timeout)
        except can.CanTimeoutError:
            raise
        except (can.CanError, OSError) as error:
            raise AdapterFailure(_lost(interface, name, error)) from error

    def guarded_shutdown() -> None:
        try:
            shut()
        except (can.CanError, OSError) as error:
            LOG.warning("%s", _lost(interface, name, error))  # nothing is left to be closed

    bus.recv, bus.send, bus.shutdown = guarded_receive, guarded_send, guarded_shutdown  # type: ignore[method-assign]
    return bus


def _key(message: can.Message) -> tuple[int, bool, bytes]:
    return message.arbitration_id, message.is_extended_id, bytes(message.data)


def _is_own(message: can.Message, own: deque[tuple[float, int, bool, bytes]]) -> bool:
    """Whether it is the next of one's own that is still under way; those before it were lost."""
    while own and own[0][0] < time.monotonic() - _ON_ITS_WAY:
        own.popleft()
    key = _key(message)
    for place, sent in enumerate(own):
        if sent[1:] == key:
            for _ in range(place + 1):
                own.popleft()
            return True
    return False


def _lost(interface: str, name: str, error: Exception) -> str:
    remedy = {
        "socketcan": "see `ip -details link show`; bring it up with `ip link set CHANNEL up type can bitrate ...`",
        "slcan": "plug it in again, look for its name (`ls /dev/serial/by-id`), and start again",
    }.get(interface, "check that it is plugged in, has power, and is used by no other program; then start again")
    return f"the adapter {name} is gone or has failed ({_said(error)}): {remedy}"


def _garbled(interface: str, name: str, error: Exception) -> str:
    remedy = "check its cable, that it speaks this protocol, and that no other program reads from it"
    if interface == "slcan":
        remedy += "; give its baud rate where it has one, as in tty_baudrate = 115200"
    return f"the adapter {name} sent what is no frame ({_said(error)}): {remedy}"


def _said(error: Any) -> str:
    return str(error) or type(error).__name__
