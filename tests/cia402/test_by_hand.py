"""What jogging needs of the host's side: a mode for each drive, software limits, and homing that is watched."""

from __future__ import annotations

import subprocess
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import pytest
from canopen.sdo import SdoCommunicationError
from waiting import wait_for

from rds.bus.modules.cia402 import codes, configure
from rds.bus.modules.cia402.codes import State
from rds.bus.modules.cia402.host import Cia402Drivers
from rds.bus.modules.cia402.scan import scan
from rds.core.errors import MachineError
from rds.machines import Machine

from .test_host import Served, cycle, drivers, no_voltage, powered
from .test_processes import Program, serve

pytestmark = pytest.mark.realtime
POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
PATIENT = [[0x2000, 1, 200], [0x2000, 2, 250]]  # drives that bear what a busy computer does to the period


def test_each_drive_has_a_mode_of_its_own(machine: Machine, served: Served) -> None:
    """An axis follows positions while the spindle follows a speed, and both stop by a quick stop."""
    channel, nodes = served("X", "spindle")
    slowly = [*PATIENT, [0x6085, 0, 100_000]]  # to rest in 2 s, longer than the drive waits for a heartbeat
    table = {"mode": "csp", "axis": {"X": {"write": PATIENT}, "spindle": {"mode": "csv", "write": slowly}}}
    with drivers(machine, channel, ["X", "spindle"], cia402=table) as host:
        host.start()
        powered(host, 0.0, 0.0)
        for k in range(40):
            measured, acting = cycle(host, min(0.05 * k, 1.0), 3000.0)
        assert acting == (1.0, pytest.approx(3000.0, abs=0.02))
        assert measured == [pytest.approx(1.0, abs=0.01), pytest.approx(3000.0, abs=30.0)]
    assert [node.drive.state for node in nodes] == [State.SWITCH_ON_DISABLED] * 2 and no_voltage(nodes)
    assert all(node.drive.objects[0x1001] == 0 for node in nodes)  # the host's heartbeats went on until they stood


def test_a_drive_that_stays_under_power_after_its_quick_stop_is_told_to_give_it_up(
    machine: Machine, served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rds.bus.modules.cia402.host._STOPPING", 0.5)
    channel, nodes = served("X")
    table = {"mode": "csp", "axis": {"X": {"write": [[0x605A, 0, 6]]}}}
    with drivers(machine, channel, ["X"], cia402=table) as host:
        host.start()
        powered(host, 0.0)
    wait_for(lambda: nodes[0].drive.state is State.SWITCH_ON_DISABLED and no_voltage(nodes))


@pytest.mark.parametrize(
    "written, direction, expected",
    [
        ([[0x607D, 1, -20000], [0x607D, 2, 30000]], -1, (-30.0, 20.0)),
        ([[0x607D, 2, 30000]], -1, (-30.0, inf)),
        ([[0x607D, 1, 0], [0x607D, 2, 0]], 1, (-inf, inf)),
    ],
)
def test_software_limits_are_read_in_the_axiss_unit(
    machine: Machine, served: Served, written: list[list[int]], direction: int, expected: tuple[float, float]
) -> None:
    channel, _ = served("X")
    table: dict[str, Any] = {"axis": {"X": {"write": written, "direction": direction}}}
    with drivers(machine, channel, ["X"], cia402=table) as host:
        host.start()
        assert host.limits == [pytest.approx(expected)]


def test_home_gets_the_position_that_the_table_gives_it(machine: Machine, served: Served) -> None:
    channel, _ = served("X")
    axis = {"homing": 37, "home": -12.5, "direction": -1}
    with drivers(machine, channel, ["X"], cia402={"positions": "drive", "axis": {"X": axis}}) as host:
        host.start()
        assert host.exchange() == [-12.5]


def test_a_drive_whose_home_offset_has_the_other_sign_is_told_and_can_be_homed(
    machine: Machine, served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of some makers 0x607C is the position at home: the axis was 25 mm from where the host believed it to be."""
    download = configure._download
    monkeypatch.setattr(
        configure,
        "_download",
        lambda node, index, sub, value: download(node, index, sub, -value if index == 0x607C else value),
    )
    channel, nodes = served("X")
    axis: dict[str, Any] = {"homing": 37, "home": -12.5}
    with drivers(machine, channel, ["X"], cia402={"positions": "drive", "axis": {"X": axis}}) as host:
        with pytest.raises(MachineError, match=r"take `home` out, and give write = \[\[0x607C, 0, -12500\]\]"):
            host.start()
        assert no_voltage(nodes)
    axis = {"homing": 37, "write": [[0x607C, 0, -12500]]}
    with drivers(machine, channel, ["X"], cia402={"positions": "drive", "axis": {"X": axis}}) as host:
        host.start()
        assert host.exchange() == [-12.5]


@pytest.mark.parametrize("stands", [-100_000, -99_960, 0, 1, 40])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_drive_that_ends_its_homing_beside_its_mark_or_at_its_zero_is_a_right_one(
    monkeypatch: pytest.MonkeyPatch, stands: int, sign: int
) -> None:
    """A count to the offset's side of zero was refused, with a remedy that would have put home at the wrong place."""
    drive: Any = SimpleNamespace(name="X", home_offset=sign * 100_000)
    monkeypatch.setattr(configure, "_position", lambda node: sign * stands)
    configure._check_home(drive, drive)
    monkeypatch.setattr(configure, "_position", lambda node: sign * (100_000 + stands % 100))
    with pytest.raises(MachineError, match="the other way round"):
        configure._check_home(drive, drive)


def test_whoever_watches_a_homing_sees_it_move_and_can_end_it(machine: Machine, served: Served) -> None:
    class Enough(Exception):
        pass

    seen: list[float] = []

    def watch(axis: str, position: float) -> None:
        assert axis == "X"
        seen.append(position)
        if position < -0.5:
            raise Enough

    channel, nodes = served("X")
    table: dict[str, Any] = {"positions": "drive", "axis": {"X": {"homing": 17}}}
    with drivers(machine, channel, ["X"], cia402=table) as host:
        with pytest.raises(Enough):
            host.start(watch)
        assert seen[-1] < -0.5 < seen[0] and no_voltage(nodes)
    with drivers(machine, channel, ["X"], cia402={"positions": "drive"}) as host:  # and it can be used again
        host.start()
        powered(host, seen[-1])


def test_a_homing_that_fails_says_why_and_takes_the_power_past_a_late_answer(
    machine: Machine, served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An answer that comes too late is no answer to the next request, which took the power's withdrawal for refused."""
    download, late = configure._download, ["Unexpected response 0x4B"]

    def silent(axis: str, position: float) -> None:
        raise SdoCommunicationError("No SDO response received")

    def delayed(node: Any, index: int, subindex: int, value: int) -> None:
        if late and (index, value) == (0x6040, codes.DISABLE_VOLTAGE) and nodes[0].drive.state in POWERED:
            raise SdoCommunicationError(late.pop())
        download(node, index, subindex, value)

    channel, nodes = served("X")
    monkeypatch.setattr(configure, "_download", delayed)
    with drivers(machine, channel, ["X"], cia402={"axis": {"X": {"homing": 17}}}) as host:
        with pytest.raises(MachineError, match="stopped answering during configuration: No SDO response"):
            host.start(silent)
        assert not late and nodes[0].drive.state is State.SWITCH_ON_DISABLED and no_voltage(nodes)


def test_an_emergency_stop_while_a_drive_is_homed_is_told_as_such(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    with (
        can.Bus(interface="virtual", channel=channel) as bus,
        drivers(machine, channel, ["X"], cia402={"axis": {"X": {"homing": 17}}}) as host,
    ):
        stop = can.Message(arbitration_id=0, is_extended_id=False, data=[codes.NmtCommand.STOP, 0])
        with pytest.raises(MachineError, match=r"emergency stop: X \(node 2\) was stopped from outside"):
            host.start(lambda axis, position: bus.send(stop))
        wait_for(lambda: no_voltage(nodes))


HOMES = """
from rds.bus.modules.cia402.host import Cia402Drivers
from rds.machines import load_machine
host = Cia402Drivers(load_machine("mini-cnc"), ["X"], channel="drives", cia402={"axis": {"X": {"homing": 17}}})
host.start(lambda axis, position: position < -0.5 and print("homing", flush=True))
"""


def test_a_host_that_is_killed_while_it_homes_leaves_no_voltage(
    builtin: Path, program: Program, machine: Machine
) -> None:
    """The drive waits for the host's heartbeats in homing as it does in the cycle."""
    serve(program, "X")
    host: subprocess.Popen[str] = program("-c", HOMES)
    assert host.stdout is not None and host.stdout.readline() == "homing\n"
    host.kill()
    wait_for(lambda: scan(channel="drives")[0].state is State.FAULT)
    again = Cia402Drivers(machine, ["X"], channel="drives", cia402={"positions": "drive"})
    again.start()
    stands = again.exchange()[0]
    assert -60.0 < stands < -0.5  # far from the switch, which is at -75 mm
    again.close()
