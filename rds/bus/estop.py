"""The emergency stop from the host: zero volts for every module on a bus, in every dialect, in one go."""

from __future__ import annotations

import contextlib
import time

import can

from rds.bus import frames
from rds.bus.oacs.host import estop as stop_oacs
from rds.core.errors import MachineError

NMT = 0x000  # CANopen: network management; command 2 stops all nodes, whose drives then disable their voltage
_STOP_ALL_NODES = bytes((0x02, 0x00))
_ANSWER_AGAIN = bytes((0x80, 0x00))  # PRE-OPERATIONAL: no process data, but who looks for them finds them
_REPEATS = 3  # a frame may be lost


def stop_everything(bus: can.BusABC) -> list[int]:
    """Zero volts on every module; numbers of the distributed modules that acknowledged.

    Cyclic modules get a command of zero volts (their host, if one lives, commands on: stop it too), distributed
    modules their latched emergency stop, CANopen drives the stop of the network. Raises MachineError if the bus fails:
    then cut the power.
    """
    zero = can.Message(arbitration_id=frames.COMMAND, is_extended_id=False, data=frames.encode_voltages(()))
    network = can.Message(arbitration_id=NMT, is_extended_id=False, data=_STOP_ALL_NODES)
    again = can.Message(arbitration_id=NMT, is_extended_id=False, data=_ANSWER_AGAIN)
    failures = []
    for _ in range(_REPEATS):
        for message in (zero, network, again):
            try:
                bus.send(message, 0.2)
            except (can.CanError, OSError) as error:
                failures.append(error)
        time.sleep(0.002)
    stopped: list[int] = []
    with contextlib.suppress(MachineError):  # reported below with what failed here
        stopped = stop_oacs(bus)
    if failures:
        raise MachineError(f"bus {bus.channel_info} failed: {failures[0]}; cut the power") from failures[0]
    return stopped
