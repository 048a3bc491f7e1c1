"""After an emergency stop drives are without voltage, and can be found and used again without being switched off."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import can
import canopen
import pytest

from rds.bus.modules.cia402.codes import State, state_of
from rds.bus.modules.cia402.configure import library
from rds.bus.modules.cia402.host import Cia402Drivers
from rds.bus.modules.cia402.scan import scan
from rds.bus.tools.estop import stop_everything
from rds.bus.tools.link import open_bus
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


@pytest.mark.parametrize("option", [0, 1, 2, 3])
def test_no_option_code_leaves_voltage(option: int, machine: Machine, program: Program) -> None:
    """A drive whose 0x6007 is 0 goes on when the network stops: it is told to disable its voltage."""
    serve(program, "X")
    with open_bus("rds", "drives") as bus, library(bus) as network:
        node = network.add_node(machine.axis("X").node, canopen.ObjectDictionary())
        for index, value, size in ((0x6007, option, 2), (0x6060, 3, 1), (0x60FF, 8000, 4)):
            node.sdo.download(index, 0, value.to_bytes(size, "little"))
        node.nmt.state = "OPERATIONAL"
        for word in (0x06, 0x07, 0x0F):
            node.sdo.download(0x6040, 0, word.to_bytes(2, "little"))
        node.sdo.download(0x60FF, 0, (8000).to_bytes(4, "little"))
        assert state_of(int.from_bytes(node.sdo.upload(0x6041, 0), "little")) is State.OPERATION_ENABLED
        node.nmt.send_command(0x02)
        if option == 0:  # as CiA 402 has it
            node.nmt.send_command(0x80)
            assert state_of(int.from_bytes(node.sdo.upload(0x6041, 0), "little")) is State.OPERATION_ENABLED
    with can.Bus(interface="rds", channel="drives") as bus:
        assert stop_everything(bus) == [machine.axis("X").node]
    (found,) = scan(channel="drives")
    assert found.state in (State.SWITCH_ON_DISABLED, State.FAULT)


def test_drives_that_another_master_stopped_are_used(machine: Machine, program: Program) -> None:
    serve(program, "X")
    with can.Bus(interface="rds", channel="drives") as bus:
        bus.send(can.Message(arbitration_id=0, is_extended_id=False, data=bytes([0x02, 0x00])))
    assert scan(channel="drives") == []  # as CiA 301 has it: no SDO in STOPPED
    drives = Cia402Drivers(machine, ["X"], channel="drives", cia402=patient("X"))
    drives.start()
    assert run(drives, 0.2, 3.0)[-1] > 0.0
    drives.close()
