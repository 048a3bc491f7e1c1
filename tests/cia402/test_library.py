"""The drive under canopen's own drive profile, `BaseNode402`, which knows nothing of ours."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from importlib.resources import files

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402
from waiting import wait_for

from rds.bus.modules.cia402.node import DriveNode

PATIENCE = 10.0  # s; the library's own, 0.2 to 0.8 s, are less than a busy computer may take
EDS = str(files("rds.bus.modules.cia402").joinpath("axis.eds"))


@pytest.fixture
def drive(served: Callable[..., tuple[str, list[DriveNode]]]) -> Iterator[tuple[BaseNode402, DriveNode]]:
    channel, nodes = served("X")
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    network.connect(interface="virtual", channel=channel)
    try:
        node = BaseNode402(2, EDS)
        node.TIMEOUT_CHECK_TPDO = node.TIMEOUT_SWITCH_OP_MODE = PATIENCE
        node.TIMEOUT_SWITCH_STATE_FINAL = node.TIMEOUT_SWITCH_STATE_SINGLE = node.sdo.RESPONSE_TIMEOUT = PATIENCE
        network.add_node(node)
        node.nmt.state = "PRE-OPERATIONAL"
        node.setup_402_state_machine()
        node.nmt.state = "OPERATIONAL"
        yield node, nodes[0]
    finally:
        network.sync.stop()
        network.disconnect()


def test_to_operation_enabled_and_back(drive: tuple[BaseNode402, DriveNode]) -> None:
    node, ours = drive
    node.op_mode = "PROFILED VELOCITY"
    for state in ("READY TO SWITCH ON", "OPERATION ENABLED", "SWITCHED ON", "SWITCH ON DISABLED", "OPERATION ENABLED"):
        node.state = state
        assert node.state == state == ours.drive.state


def test_a_profile_move_and_homing(drive: tuple[BaseNode402, DriveNode]) -> None:
    node, _ = drive
    node.op_mode = "PROFILED POSITION"
    node.state = "OPERATION ENABLED"
    node.sdo[0x607A].raw = 1500
    node.controlword = 0x1F
    wait_for(lambda: node.sdo[0x6041].raw & 0x0400)  # target reached
    assert node.sdo[0x6064].raw == pytest.approx(1500, abs=12)
    node.sdo[0x6098].raw = 37
    assert node.homing(timeout=30)
    assert node.is_homed() and abs(node.sdo[0x6064].raw) <= 12


def test_a_fault_and_its_reset(drive: tuple[BaseNode402, DriveNode]) -> None:
    node, ours = drive
    node.op_mode = "PROFILED VELOCITY"
    node.state = "OPERATION ENABLED"
    ours.fault(0x4310)
    wait_for(lambda: node.state == "FAULT" and node.emcy.active)
    assert node.emcy.active[0].code == 0x4310
    node.reset_from_fault()
    assert node.state == "OPERATION ENABLED" and not node.emcy.active


def test_cyclic_position_with_the_librarys_sync(drive: tuple[BaseNode402, DriveNode]) -> None:
    node, ours = drive
    node.nmt.state = "PRE-OPERATIONAL"
    node.sdo[0x60C2][1].raw = 50  # ms: the library's threads are what they are
    node.sdo[0x6065].raw = 20000
    node.rpdo[3].trans_type, node.rpdo[3].enabled = 1, True
    node.rpdo[3].save()
    node.rpdo[1].enabled = False
    node.rpdo[1].save()
    node.tpdo[3].enabled = True
    node.tpdo[3].save()
    node.nmt.state = "OPERATIONAL"
    node.sdo[0x6060].raw = 8
    target = node.rpdo[3]
    for word in (0x06, 0x07, 0x0F):
        target[0x6040].raw = word
        target.transmit()
        node.network.sync.transmit()
        time.sleep(0.02)

    def measured(position: int) -> int:
        target[0x607A].raw = position
        target.transmit()
        node.network.sync.transmit()
        time.sleep(0.02)
        return int(node.tpdo[3][0x6064].raw)

    seen = [measured(20 * k) for k in range(40)]
    assert len(set(seen)) > 10, "along the positions, not in one leap"
    wait_for(lambda: abs(measured(780) - 780) <= 12)
    assert ours.drive.state == "OPERATION ENABLED"


def test_the_librarys_block_transfer_reads_and_writes(drive: tuple[BaseNode402, DriveNode]) -> None:
    node, _ = drive
    with node.sdo.open(0x1008, mode="rb", block_transfer=True) as name:
        assert name.read() == b"RDS simulated axis"
    with node.sdo.open(0x6065, mode="wb", size=4, block_transfer=True) as window:
        window.write((4321).to_bytes(4, "little"))
    assert node.sdo[0x6065].raw == 4321
