"""The emergency stop from the host: zero volts for every module on a bus, in every dialect, in one go."""

from __future__ import annotations

import contextlib
import time

import can

from rds.bus.modules.cia402 import emergency as drives
from rds.bus.modules.oacs.host import estop as stop_oacs
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Status
from rds.bus.tools.link import bus_failed
from rds.bus.tools.listening import frames_within
from rds.core.errors import MachineError

NMT = 0x000  # CANopen: network management; command 2 stops all nodes, whose drives then disable their voltage
_STOP_ALL_NODES = bytes((0x02, 0x00))
_ANSWER_AGAIN = bytes((0x80, 0x00))  # PRE-OPERATIONAL: no process data, but who looks for them finds them
_REPEATS = 3  # a frame may be lost
_ANSWERS = 0.1  # s


def stop_everything(bus: can.BusABC) -> list[int]:
    """Zero volts on every module; numbers of the modules and node-IDs of the drives that acknowledged.

    Modules of the cyclic frames and distributed modules latch it (see reset_everything). CANopen drives get the stop
    of the network and then, each, the command to disable its voltage; one acknowledges by a state without voltage. A
    host that commands them ends its run. Hardware that knows no emergency stop gets a command of zero volts. Raises
    MachineError if the bus fails, or a drive stays under power: then cut the power.
    """
    emergency = _frame(frames.GENERAL, frames.EMERGENCY)
    network, again = _frame(NMT, _STOP_ALL_NODES), _frame(NMT, _ANSWER_AGAIN)
    zero = _frame(frames.COMMAND, frames.encode_voltages(()))
    failures: list[Exception] = []
    for _ in range(_REPEATS):
        for message in (emergency, network, again, zero):
            try:
                bus.send(message, 0.2)
            except (can.CanError, OSError) as error:
                failures.append(error)
        time.sleep(0.002)
    stopped: set[int] = set()
    with contextlib.suppress(MachineError):  # reported below with what failed here
        stopped = {node for node, status in _reports(bus).items() if status & Status.EMERGENCY}
        stopped |= set(stop_oacs(bus))
    without: dict[int, bool] = {}
    if not failures:  # 127 nodes that nobody acknowledges would take long
        try:
            without = drives.cut(bus)
        except (can.CanError, OSError) as error:
            failures.append(error)
    if failures:
        raise MachineError(f"bus {bus.channel_info} failed: {failures[0]}; cut the power") from failures[0]
    if powered := [str(node) for node, is_off in sorted(without.items()) if not is_off]:
        raise MachineError(
            f"drives of node-ID {', '.join(powered)} do not say that their voltage is off; cut the power"
        )
    return sorted(stopped | set(without))


def reset_everything(bus: can.BusABC) -> list[int]:
    """Release the latch of the emergency stop on every module; numbers of those that are free now.

    CANopen drives leave their fault when the next run starts. Raises MachineError naming the modules whose button is
    still pressed, or if the bus fails.
    """
    try:
        bus.send(_frame(frames.CALL, frames.RESET), 0.2)
    except can.CanTimeoutError:  # nobody acknowledges where nobody is
        return []
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error
    reports = _reports(bus)
    held = [str(node) for node, status in sorted(reports.items()) if status & Status.EMERGENCY]
    if held:
        raise MachineError(f"the emergency stop of {', '.join(held)} stays: release its button first")
    return sorted(reports)


def _reports(bus: can.BusABC) -> dict[int, int]:
    """The status of every module that speaks within a tenth of a second; MachineError if the bus fails."""
    found: dict[int, int] = {}
    try:
        for message in frames_within(bus, _ANSWERS):
            if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
                continue
            node = message.arbitration_id - frames.ANSWER
            if node in frames.NODES and len(message.data) == 8:
                found[node] = frames.decode_answer(message.arbitration_id, message.data).status
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error
    return found


def _frame(identifier: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data)
