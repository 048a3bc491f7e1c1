"""Whether a machine lives on a bus, and which frames it, or whoever controls it, would act on.

A frame from a log or from another program is a stranger among a machine's own: a command moves an axis, and an answer
with a module's identifier is taken for a position that was measured.
"""

from __future__ import annotations

import can

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Kind
from rds.bus.tools.listening import frames_within
from rds.core.errors import InputError, MachineError

LISTEN = 0.3  # s for modules to answer a call

# standard identifiers, first and last, and what such a frame does to a machine
_ACTS = (
    (0x000, 0x000, "starts or stops CANopen nodes, or speaks for a module (oacs)"),
    (0x001, 0x00F, "calls or commands modules (oacs)"),
    (frames.COMMAND, frames.COMMAND, "sets voltages"),
    (frames.DRY_COMMAND, frames.DRY_COMMAND, "is a command's tick"),
    (frames.SETUP, frames.SETUP, "sets the sample period"),
    (frames.ANSWER + 1, frames.ANSWER + frames.NODES[-1], "would pass for a module's measured position"),
    (0x080, 0x080, "makes drives take over their set points (CANopen SYNC)"),
    (0x112, 0x11F, "takes part in a module's data download (oacs)"),
    (0x200, 0x27F, "commands a drive (CANopen process data)"),
    (0x300, 0x37F, "commands a drive (CANopen process data)"),
    (0x400, 0x47F, "commands a drive (CANopen process data)"),
    (0x500, 0x57F, "commands a drive (CANopen process data)"),
    (0x600, 0x67F, "sets a drive's parameters (CANopen SDO)"),
)


def acts_on_machine(message: can.Message) -> str | None:
    """What the frame does to a machine, or None if it does nothing to one."""
    if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
        return None
    identifier = message.arbitration_id
    return next((what for first, last, what in _ACTS if first <= identifier <= last), None)


def live_modules(bus: can.BusABC, listen: float = LISTEN) -> list[str]:
    """The modules and drives that are heard on `bus` within `listen` s, as words; empty if there are none.

    Modules are called (0x013, which makes them report and nothing else); a drive shows itself by its heartbeat or its
    process data. Frames that arrive meanwhile are taken from `bus`. Raises MachineError if the bus fails.
    """
    found: set[tuple[str, int]] = set()
    try:
        bus.send(can.Message(arbitration_id=frames.CALL, is_extended_id=False, data=b""), listen)
        for message in frames_within(bus, listen):
            found |= _senders(message)
    except (can.CanError, OSError) as error:
        raise MachineError(f"the bus failed: {error}") from error
    return [f"{what} {number}" for what, number in sorted(found)]


def _senders(message: can.Message) -> set[tuple[str, int]]:
    identifier = message.arbitration_id
    if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
        return set()
    if identifier - frames.ANSWER in frames.NODES and len(message.data) == 8 and message.data[5] <= max(Kind):
        return {("module", identifier - frames.ANSWER)}
    if 0x701 <= identifier <= 0x77F and len(message.data) == 1:
        return {("drive", identifier - 0x700)}
    return set()


def refusal(message: can.Message, modules: list[str]) -> InputError:
    """What to say to whoever would give the frame to a bus with these modules."""
    return InputError(
        f"frame {message.arbitration_id:#05x} {acts_on_machine(message)}, and {', '.join(modules)} live on this bus; "
        "use a channel of its own, leave these frames out with --id, or give --with-commands if the machine may move"
    )
