"""After an emergency stop drives are without voltage, and can be found and used again without being switched off."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import can
import pytest

from rds.bus.cia402.codes import State
from rds.bus.cia402.host import Cia402Drivers
from rds.bus.cia402.scan import scan
from rds.bus.estop import stop_everything
from rds.core.errors import MachineError
from rds.machines import Machine

from .test_processes import patient, run, serve

pytestmark = pytest.mark.realtime
Program = Callable[..., "subprocess.Popen[str]"]


def test_a_run_ends_and_the_next_one_starts(machine: Machine, program: Program) -> None:
    serve(program, "X", "Y")
    drives = Cia402Drivers(machine, ["X", "Y"], channel="drives", cia402=patient("X", "Y"))
    drives.start()
    assert run(drives, 0.2, 3.0)[-1] > 0.0
    with can.Bus(interface="rds", channel="drives") as bus:
        stop_everything(bus)
    with pytest.raises(MachineError):
        run(drives, 3.0, 3.0)
    drives.close()
    found = scan(channel="drives")
    assert [device.node for device in found] == [2, 3]
    assert all(device.state not in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE) for device in found)
    again = Cia402Drivers(machine, ["X", "Y"], channel="drives", cia402=patient("X", "Y"))
    again.start()
    assert run(again, 0.2, -3.0)[-1] < 0.0
    again.close()


def test_drives_that_another_master_stopped_are_used(machine: Machine, program: Program) -> None:
    serve(program, "X")
    with can.Bus(interface="rds", channel="drives") as bus:
        bus.send(can.Message(arbitration_id=0, is_extended_id=False, data=bytes([0x02, 0x00])))
    assert scan(channel="drives") == []  # as CiA 301 has it: no SDO in STOPPED
    drives = Cia402Drivers(machine, ["X"], channel="drives", cia402=patient("X"))
    drives.start()
    assert run(drives, 0.2, 3.0)[-1] > 0.0
    drives.close()
