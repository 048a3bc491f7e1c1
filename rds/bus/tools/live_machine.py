"""Whether a machine lives on a bus, and which frames of strangers may reach it.

A frame from a log or from another program is a stranger among a machine's own: a command moves an axis, a call resets
its emergency stop, and an answer with a module's identifier is taken for a position that was measured. So what may
pass is listed, and nothing else does: classic data frames with the highest standard identifiers, from 0x780 on, that
no dialect uses. No dialect's module listens to them, no host takes them for an answer, and in arbitration they give
way to every frame of the machine. Remote frames make a device answer, and start CANopen's node guarding; extended
identifiers are those of modules' identities, and a drive of another maker may have been given any; a CAN FD frame is an
error to whoever knows classic CAN only.
"""

from __future__ import annotations

import time
from functools import cache

import can

from rds.bus.modules import dialects
from rds.bus.modules.cia402.codes import NODES
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Kind
from rds.bus.tools.link import bus_failed
from rds.bus.tools.listening import frames_within
from rds.core.errors import InputError

LISTEN = 0.3  # s for modules to answer a call
UNUSED = range(0x780, 0x800)  # above all that machines send
_STANDARD = range(0x800)
_DEVICE_TYPE = b"\x40\x00\x10\x00" + bytes(4)  # SDO: what are you? Read only
_REQUEST, _ANSWER, _HEARTBEAT = 0x600, 0x580, 0x700
_SEND = 0.5  # s
_MOST_WAITING = 1000  # frames taken at once by one who is in a hurry


def acts_on_machine(message: can.Message) -> str | None:
    """What the frame does to a machine, or may do; None if it certainly does nothing to one."""
    for is_one, what in (
        (message.is_error_frame, "is an error frame, which destroys others"),
        (message.is_remote_frame, "is a remote frame, which makes a device answer"),
        (message.is_extended_id, "has an extended identifier, which may be any device's"),
        (message.is_fd, "is a CAN FD frame, which is an error on a classic bus"),
    ):
        if is_one:
            return what
    return _acts().get(message.arbitration_id, "has an identifier that is not known to do nothing")


def harmless_identifiers() -> list[int]:
    """The standard identifiers whose data frames may pass: those of `UNUSED` that no dialect's table has."""
    return [identifier for identifier in UNUSED if _acts()[identifier] is None]


@cache
def _acts() -> dict[int, str | None]:
    """For each standard identifier what its data frames do to a machine; None: nothing."""
    found: dict[int, str | None] = {
        identifier: None if identifier in UNUSED else "goes before the machine's own frames" for identifier in _STANDARD
    }
    tables = [dialects.identifiers(dialect) for dialect in dialects.dialect_names()]
    used: dict[int, list[str]] = {}
    for first, last, what in (entry for table in tables for entry in table):
        for identifier in range(first, last + 1):
            used.setdefault(identifier, []).append(what)
    return found | {identifier: " or ".join(what) for identifier, what in used.items()}


def live_modules(bus: can.BusABC, listen: float = LISTEN) -> list[str]:
    """The modules and drives that are heard on `bus` within `listen` s, as words; empty if there are none.

    Modules are called (0x013, which makes them report and nothing else) and drives are asked for their device type.
    Frames that arrive meanwhile are taken from `bus`. Raises MachineError if the bus fails.
    """
    found: set[tuple[str, int]] = set()
    try:
        bus.send(_frame(frames.CALL, b""), listen)
        for node in NODES:
            bus.send(_frame(_REQUEST + node, _DEVICE_TYPE), _SEND)
        for message in frames_within(bus, listen):
            found |= _senders(message)
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error
    return _named(found)


def heard_now(bus: can.BusABC) -> list[str]:
    """The modules and drives whose frames wait in `bus`, as words. All that waits is taken from it, and nobody asked.

    Raises what `bus.recv` raises.
    """
    found: set[tuple[str, int]] = set()
    until = time.monotonic() + LISTEN
    for _ in range(_MOST_WAITING):
        message = bus.recv(0.0)
        if message is None or time.monotonic() > until:
            break
        found |= _senders(message)
    return _named(found)


def _named(found: set[tuple[str, int]]) -> list[str]:
    return [f"{what} {number}" for what, number in sorted(found)]


def _frame(identifier: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data)


def _senders(message: can.Message) -> set[tuple[str, int]]:
    identifier, data = message.arbitration_id, message.data
    if message.is_extended_id or message.is_error_frame or message.is_remote_frame or not message.is_rx:
        return set()
    if identifier - frames.ANSWER in frames.NODES and len(data) == 8 and data[5] <= max(Kind):
        return {("module", identifier - frames.ANSWER)}
    if identifier - _HEARTBEAT in NODES and len(data) == 1:
        return {("drive", identifier - _HEARTBEAT)}
    if identifier - _ANSWER in NODES and len(data) == 8 and bytes(data[1:4]) == _DEVICE_TYPE[1:4]:
        return {("drive", identifier - _ANSWER)}
    return set()


def refusal(message: can.Message, others: int, modules: list[str]) -> InputError:
    """What to say to whoever would give the frame, and so many others, to a bus with these modules."""
    more = f" ({others} more frame{' is' if others == 1 else 's are'} not harmless either)" if others else ""
    return InputError(
        f"frame {message.arbitration_id:#05x} {acts_on_machine(message)}{more}, and {', '.join(modules)} "
        f"live{'s' if len(modules) == 1 else ''} on this bus; use a channel of its own, select harmless frames with "
        f"--id (0x{UNUSED[0]:X} and above), or give --with-commands if the machine may move"
    )
