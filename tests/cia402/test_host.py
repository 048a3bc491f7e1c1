"""The host's side against served drives on python-can's virtual bus: contract, modes, errors, endings."""

from __future__ import annotations

import configparser
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from math import inf, pi, sin
from pathlib import Path
from typing import Any

import can
import pytest
from waiting import wait_for

from rds.bus.modules.cia402.codes import Nmt, State
from rds.bus.modules.cia402.host import Cia402Drivers
from rds.bus.modules.cia402.node import DriveNode
from rds.bus.modules.cia402.remote import Remote
from rds.bus.modules.cia402.scan import scan
from rds.bus.modules.cia402.settings import read_settings
from rds.core.errors import InputError, MachineError
from rds.machines import Machine

from .conftest import PATIENCE

T = 0.02  # s: no test here is about speed, and a busy computer shall not decide it
PDOS = (0x1400, 0x1600, 0x1800, 0x1A00)
Served = Callable[..., tuple[str, list[DriveNode]]]


@contextmanager
def drivers(machine: Machine, channel: str, axes: list[str], **options: Any) -> Iterator[Cia402Drivers]:
    table = {"heartbeat": 0.5} | options.pop("cia402", {})
    host = Cia402Drivers(machine, axes, interface="virtual", channel=channel, sample_period=T, cia402=table, **options)
    try:
        yield host
    finally:
        host.close()


def cycle(host: Cia402Drivers, *targets: float) -> tuple[list[float], tuple[float, ...]]:
    due = time.monotonic() + T
    positions = host.exchange()
    acting = tuple(host.write(targets))
    time.sleep(max(0.0, due - time.monotonic()))
    return positions, acting


def powered(host: Cia402Drivers, *targets: float) -> None:
    for _ in range(50):
        cycle(host, *targets)
        if all(drive.enabled for drive in host.drives):
            return
    raise AssertionError("no power")


def answered(host: Cia402Drivers, target: float) -> tuple[float, float, float]:
    """The one drive's position, when it was asked for and when it had come, of the next cycle that it answers in time:
    before, after (s), position."""
    for _ in range(50):
        missing, before = host.counters.missing, time.monotonic()
        (position,), after = host.exchange(), time.monotonic()
        host.write([target])
        if host.counters.missing == missing:
            return before, after, position
        time.sleep(T)
    raise AssertionError("no answer in its period")


def no_voltage(nodes: list[DriveNode]) -> bool:
    return all(node.drive.servo.axis.voltage == 0.0 and node.drive.servo.torque is None for node in nodes)


def test_voltages_move_the_axes_and_positions_come_back(machine: Machine, served: Served) -> None:
    channel, nodes = served("X", "Y")
    with drivers(machine, channel, ["X", "Y"]) as host:
        host.start()
        assert [node.drive.state for node in nodes] == [State.SWITCHED_ON] * 2
        assert host.exchange() == [0.0, 0.0]
        powered(host, 0.0, 0.0)
        for _ in range(10):
            positions, acting = cycle(host, 4.0, -4.0)
        assert acting == (4.0, -4.0)
        assert positions[0] > 0.2 and positions[1] < -0.2
    wait_for(lambda: [node.drive.nmt for node in nodes] == [Nmt.PRE_OPERATIONAL] * 2)
    assert [node.drive.state for node in nodes] == [State.SWITCH_ON_DISABLED] * 2 and no_voltage(nodes)


def test_what_acts_is_zero_until_there_is_power(machine: Machine, served: Served) -> None:
    channel, _ = served("X")
    with drivers(machine, channel, ["X"]) as host:
        host.start()
        acting = [cycle(host, 5.0)[1][0]]
        while acting[-1] == 0.0 and len(acting) < 50:
            acting.append(cycle(host, 5.0)[1][0])
        assert acting[0] == 0.0 and acting[-1] == 5.0


def test_there_is_no_power_before_the_first_command_or_in_a_dry_run(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    with drivers(machine, channel, ["X"]) as host:
        host.start()
        for _ in range(5):
            host.exchange()
        time.sleep(0.3)  # far more than any time-out: nobody minds
        host.exchange()
        assert nodes[0].drive.state is State.SWITCHED_ON
    with drivers(machine, channel, ["X"], dry_run=True) as host:
        host.start()
        for _ in range(5):
            assert cycle(host, 5.0) == ([0.0], (0.0,))
        assert nodes[0].drive.state is State.SWITCHED_ON


def test_csp_leads_along_positions_and_csv_along_velocities(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    wide = {"axis": {"X": {"write": [[0x6065, 0, 20000]]}}}
    with drivers(machine, channel, ["X"], cia402={"mode": "csp"} | wide) as host:
        host.start()
        last = [cycle(host, sin(2 * pi * 0.5 * k * T))[0][0] for k in range(75)]
        assert max(last) == pytest.approx(1.0, abs=0.1) and min(last) == pytest.approx(-1.0, abs=0.2)
    wait_for(lambda: nodes[0].drive.state is State.SWITCH_ON_DISABLED)
    with drivers(machine, channel, ["X"], cia402={"mode": "csv"}) as host:
        host.start()
        powered(host, 5.0)
        for _ in range(5):
            cycle(host, 5.0)
        earliest, begun, here = answered(host, 5.0)
        for _ in range(30):
            cycle(host, 5.0)
        ended, latest, there = answered(host, 5.0)
        assert 0.95 * (ended - begun) <= (there - here) / 5.0 <= 1.05 * (latest - earliest)


def test_homing_at_the_start_makes_positions_the_drives_own(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    nodes[0].drive.servo.axis.position = nodes[0].drive.servo.axis._carriage = 0.4
    table = {"positions": "drive", "axis": {"X": {"homing": 33, "write": [[0x607C, 0, -5000]]}}}
    with drivers(machine, channel, ["X"], cia402=table) as host:
        host.start()
        assert host.exchange()[0] == pytest.approx(5.0, abs=0.05)
        assert nodes[0].drive.servo.homed


def test_a_spindle_reads_its_speed(machine: Machine, served: Served) -> None:
    channel, _ = served("spindle")
    with drivers(machine, channel, ["spindle"]) as host:
        host.start()
        powered(host, 0.0)
        for _ in range(40):
            positions, _ = cycle(host, 2.0)
        assert positions[0] == pytest.approx(1900, rel=0.05)


def test_directions_and_counts_are_the_tables(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    table = {"axis": {"X": {"direction": -1, "counts": 500.0}}}
    with drivers(machine, channel, ["X"], cia402=table) as host:
        host.start()
        powered(host, 0.0)
        for _ in range(10):
            positions, _ = cycle(host, 4.0)
        assert nodes[0].drive.servo.position < -100 and positions[0] > 0.2


def test_a_drive_needs_nothing_but_what_the_profile_makes_mandatory(
    machine: Machine, served: Served, tmp_path: Path
) -> None:
    """The EDS of a bought drive: no objects of ours, none of the optional ones, one PDO each way."""
    eds = configparser.RawConfigParser()
    eds.optionxform = str  # type: ignore[assignment,method-assign]
    eds.read_string(files("rds.bus.modules.cia402").joinpath("axis.eds").read_text())
    optional = ("2000", "2001", "1006", "1016", "1017", "1019", "1029", "60C2", "6502", "60E3")
    for section in eds.sections():
        if section.startswith(optional) or section[:4] in {f"{base + n:04X}" for base in PDOS for n in (1, 2, 3)}:
            eds.remove_section(section)
    with (tmp_path / "bought.eds").open("w") as file:
        eds.write(file)
    channel, nodes = served("X")
    table = {"rpdo_transmission": 255, "axis": {"X": {"eds": str(tmp_path / "bought.eds")}}}
    nodes[0].drive.objects.values[0x60C2, 1] = 20  # ms; such a drive has its own way to know
    nodes[0].drive.operation.look_up()
    with drivers(machine, channel, ["X"], cia402=table) as host:
        host.start()
        powered(host, 0.0)
        for _ in range(10):
            positions, _ = cycle(host, 4.0)
        assert positions[0] > 0.2


def test_a_file_that_is_no_eds_is_told(machine: Machine, served: Served, tmp_path: Path) -> None:
    (tmp_path / "bad.eds").write_text("this is no EDS")
    channel, _ = served("X")
    table = {"axis": {"X": {"eds": str(tmp_path / "bad.eds")}}}
    with drivers(machine, channel, ["X"], cia402=table) as host, pytest.raises(InputError, match=r"bad\.eds"):
        host.start()


def test_a_fault_is_told_with_node_state_and_code_and_stops_all(machine: Machine, served: Served) -> None:
    channel, nodes = served("X", "Y")
    with drivers(machine, channel, ["X", "Y"]) as host:
        host.start()
        powered(host, 2.0, 2.0)
        nodes[1].fault(0x2310)
        with pytest.raises(MachineError) as told:
            for _ in range(2 * PATIENCE):
                cycle(host, 2.0, 2.0)
        for part in ("Y (node 3)", "FAULT", "statusword 0x", "0x2310 continuous over-current"):
            assert part in str(told.value)
        wait_for(lambda: no_voltage(nodes))
    with drivers(machine, channel, ["X", "Y"]) as host:
        host.start()  # resets the fault
        powered(host, 0.0, 0.0)


def test_a_drive_that_restarts_is_told(machine: Machine, served: Served, bus: Callable[..., can.BusABC]) -> None:
    channel, _ = served("X")
    other = bus(channel)
    with drivers(machine, channel, ["X"]) as host:
        host.start()
        powered(host, 0.0)
        other.send(can.Message(arbitration_id=0, data=b"\x81\x02", is_extended_id=False))
        with pytest.raises(MachineError, match=r"X \(node 2\) has restarted"):
            for _ in range(2 * PATIENCE):
                cycle(host, 0.0)


def test_a_drive_that_dies_is_told(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    with drivers(machine, channel, ["X"], cia402={"heartbeat": 5.0}) as host:  # which is missed later
        host.start()
        powered(host, 0.0)
        nodes[0].close()
        nodes[0]._retry_at = float("inf")
        with pytest.raises(MachineError, match=r"no answer from X \(node 2\)"):
            for _ in range(2 * PATIENCE):
                cycle(host, 0.0)


def test_the_power_of_a_drive_that_stays_in_its_quick_stop_goes_though_another_one_is_lost(
    machine: Machine, served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rds.bus.modules.cia402.host._STOPPING", 0.2)
    channel, nodes = served("X", "Y")
    staying = {"write": [[0x605A, 0, 6], [0x6007, 0, 0]]}  # and the silence of the host is not its business
    table = {"heartbeat": 5.0, "mode": "csp", "axis": {"Y": staying}}
    with drivers(machine, channel, ["X", "Y"], cia402=table) as host:
        host.start()
        powered(host, 0.0, 0.0)
        nodes[0].close()
        nodes[0]._retry_at = float("inf")
        with pytest.raises(MachineError, match=r"no answer from X \(node 2\)"):
            for _ in range(2 * PATIENCE):
                cycle(host, 0.0, 0.0)
    wait_for(lambda: nodes[1].drive.state is State.SWITCH_ON_DISABLED and no_voltage(nodes))


@pytest.mark.parametrize("volts", [0.21, 12.0, 48.7])
def test_the_largest_voltage_is_a_target_whatever_its_last_bit(machine: Machine, volts: float) -> None:
    (drive,) = read_settings({"axis": {"X": {"rated_voltage": volts}}}, machine, ["X"]).drives
    remote = Remote(drive)
    assert [remote.aim(-volts), remote.aim(volts)] == pytest.approx([-volts, volts]) and remote.target == 1000
    for bad in (1.001 * max(volts, machine.converter.range), float("nan"), -float("inf")):
        with pytest.raises(InputError, match="must be from"):
            remote.aim(bad)


def test_a_missing_heartbeat_is_told(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    with drivers(machine, channel, ["X"], cia402={"heartbeat": 0.2}) as host:
        host.start()
        powered(host, 0.0)
        while host.drives[0].heard_at == inf:
            cycle(host, 0.0)
        nodes[0].drive.objects.writers[0x1017, 0](0)
        with pytest.raises(MachineError, match=r"no heartbeat from X \(node 2\)"):
            for _ in range(2 * PATIENCE):
                cycle(host, 0.0)
        wait_for(lambda: no_voltage(nodes))


def test_a_host_that_falls_silent_loses_the_power(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    with drivers(machine, channel, ["X"]) as host:
        host.start()
        powered(host, 3.0)
        cycle(host, 3.0)
        wait_for(lambda: nodes[0].drive.state is State.FAULT and no_voltage(nodes))
        with pytest.raises(MachineError, match="0x8700 sync controller"):
            cycle(host, 3.0)


def test_stop_takes_the_power_and_a_command_brings_it_back(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    with drivers(machine, channel, ["X"]) as host:
        host.start()
        powered(host, 3.0)
        host.stop()
        wait_for(lambda: nodes[0].drive.state is State.SWITCH_ON_DISABLED and no_voltage(nodes))
        for _ in range(5):
            host.exchange()
            time.sleep(T)
        assert nodes[0].drive.state is State.SWITCH_ON_DISABLED
        powered(host, 0.0)


def test_a_broken_bus_is_told_and_stop_bears_it(machine: Machine, served: Served) -> None:
    channel, nodes = served("X")
    with drivers(machine, channel, ["X"]) as host:
        host.start()
        powered(host, 3.0)
        host._bus.shutdown()
        with pytest.raises(MachineError, match="bus virtual"):
            cycle(host, 3.0)
        host.stop()
        wait_for(lambda: no_voltage(nodes))


def test_no_drive_a_wrong_one_and_two_of_a_kind(
    machine: Machine, served: Served, bus: Callable[..., can.BusABC]
) -> None:
    channel, _ = served("X")
    with drivers(machine, channel, ["X", "Z"]) as host, pytest.raises(MachineError, match=r"Z \(node 4\)"):
        host.start()
    table = {"axis": {"Z": {"node": 2}}}
    with drivers(machine, channel, ["Z"], cia402=table) as host:
        host.start()
    twin, other = served("X"), bus(channel)
    assert twin[0] != channel
    notifier = can.Notifier(other, [lambda message: _answer_too(other, message)], 0.02)
    try:
        with drivers(machine, channel, ["X"]) as host, pytest.raises(MachineError, match="2 devices answer as node 2"):
            host.start()
    finally:
        notifier.stop()


def _answer_too(bus: can.BusABC, message: can.Message) -> None:
    if message.arbitration_id == 0x602:
        data = b"\x43\x00\x10\x00\x92\x01\x02\x00"
        bus.send(can.Message(arbitration_id=0x582, data=data, is_extended_id=False))


def test_what_is_wrong_with_a_command_is_told(machine: Machine, served: Served) -> None:
    channel, _ = served("X")
    with drivers(machine, channel, ["X"]) as host:
        host.start()
        with pytest.raises(InputError, match="2 values for 1 drives"):
            host.write([1.0, 2.0])
        for bad in (10.5, float("nan"), float("inf")):
            with pytest.raises(InputError, match=r"from -10 to 10 V"):
                host.write([bad])


def test_a_refused_object_names_itself(machine: Machine, served: Served) -> None:
    channel, _ = served("X")
    table = {"axis": {"X": {"write": [[0x605A, 0, 99]]}}}
    with drivers(machine, channel, ["X"], cia402=table) as host, pytest.raises(MachineError) as told:
        host.start()
    assert "0x605A:00 = 99" in str(told.value) and "too high" in str(told.value)
    table = {"axis": {"X": {"write": [[0x6072, 0, 70_000]]}}}
    with (
        drivers(machine, channel, ["X"], cia402=table) as host,
        pytest.raises(InputError, match=r"0x6072:00 = 70000 does not fit into the 16 bits"),
    ):
        host.start()


def test_scan(served: Served) -> None:
    channel, _ = served("X", "Y")
    found = scan("virtual", channel)
    assert [(device.node, device.is_drive, device.name) for device in found] == [
        (2, True, "RDS simulated axis"),
        (3, True, "RDS simulated axis"),
    ]
    assert found[0].state is State.SWITCH_ON_DISABLED and found[0].product == 0x402
    assert found[0].version == "1.0"


def test_a_scan_beside_a_host_names_it_and_is_quiet(served: Served, caplog: pytest.LogCaptureFixture) -> None:
    channel, _ = served("X")
    with can.Bus(interface="virtual", channel=channel) as host:
        beat = can.Message(arbitration_id=0x700 + 127, is_extended_id=False, data=[Nmt.OPERATIONAL])
        task = host.send_periodic(beat, 0.02)
        found = scan("virtual", channel)
        task.stop()
    assert [(device.node, device.kind) for device in found] == [(2, "drive"), (127, "host, or a silent device")]
    assert not caplog.records, "the library's word on requests that nobody answers is none of an error"
