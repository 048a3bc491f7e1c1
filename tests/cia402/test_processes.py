"""Real processes on the built-in bus at 1 kHz: what happens, not how fast."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest
from waiting import wait_for

from rds.bus.modules.cia402.codes import State
from rds.bus.modules.cia402.host import Cia402Drivers
from rds.bus.modules.cia402.scan import scan
from rds.core.errors import MachineError
from rds.machines import Machine

pytestmark = pytest.mark.realtime
Program = Callable[..., "subprocess.Popen[str]"]
HOST = """
import sys, time
from rds.bus.modules.cia402.host import Cia402Drivers
from rds.machines import load_machine
patient = {"axis": {"X": {"write": [[0x2000, 1, 200], [0x2000, 2, 250]]}}}
host = Cia402Drivers(load_machine("mini-cnc"), ["X"], channel="drives", cia402=patient)
host.start()
due = time.monotonic()
for k in range(1_000_000):
    host.exchange()
    host.write([5.0])
    if k == 100:
        print("moving", flush=True)
    due = max(due + 0.001, time.monotonic())
    time.sleep(max(0.0, due - time.monotonic()))
"""


def serve(program: Program, *axes: str) -> subprocess.Popen[str]:
    server = program("-m", "rds.bus.modules.cia402.server", "mini-cnc", "--channel", "drives", "--axes", ",".join(axes))
    assert server.stdout is not None
    assert server.stdout.readline().startswith("ready mini-cnc on rds:drives")
    return server


def patient(*axes: str) -> dict[str, Any]:
    """Drives that bear what a busy computer does to the period: nothing here is about time."""
    return {"axis": {axis: {"write": [[0x2000, 1, 200], [0x2000, 2, 250]]} for axis in axes}}


def run(host: Cia402Drivers, seconds: float, voltage: float) -> list[float]:
    positions, due = [], time.monotonic()
    for _ in range(round(seconds * 1000)):
        positions.append(host.exchange()[0])
        host.write([voltage] * len(host.drives))
        due = max(due + 0.001, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
    return positions


@pytest.mark.parametrize("axes", [("X",), ("X", "Y", "Z")])
def test_a_second_under_command(builtin: Path, program: Program, machine: Machine, axes: tuple[str, ...]) -> None:
    serve(program, *axes)
    host = Cia402Drivers(machine, axes, channel="drives", cia402=patient(*axes))
    try:
        host.start()
        positions = run(host, 1.0, 4.0)
        # 1.72 (mm/s)/V · 4 V less friction, whatever the computer does to the period
        assert positions[-1] > 2.0
        assert host.counters.emergencies == 0 and host.counters.foreign == 0
    finally:
        host.close()


def test_a_killed_host_leaves_no_voltage(
    builtin: Path, program: Program, machine: Machine, bus: Callable[..., can.BusABC]
) -> None:
    serve(program, "X")
    host = program("-c", HOST)
    assert host.stdout is not None and host.stdout.readline() == "moving\n"
    assert scan("rds", "drives")[0].state is State.OPERATION_ENABLED
    host.send_signal(signal.SIGKILL)
    wait_for(lambda: scan("rds", "drives")[0].state is State.FAULT)
    with bus("drives", "rds") as client:
        torque = sdo(client, 0x6077)
        assert torque == 0
        first = sdo(client, 0x6064)
        time.sleep(0.3)
        assert sdo(client, 0x6064) == first


def test_nobody_on_a_bus_with_bit_timing(builtin: Path, machine: Machine) -> None:
    """No acknowledgement, so a frame waits for ever there: neither host nor scan may."""
    assert scan("rds", "drives", bitrate=1_000_000) == []
    host = Cia402Drivers(machine, ["X"], channel="drives", bitrate=1_000_000)
    try:
        with pytest.raises(MachineError, match=r"no drive answers for X \(node 2\)"):
            host.start()
    finally:
        host.close()


def test_killed_drives_are_told(builtin: Path, program: Program, machine: Machine) -> None:
    server = serve(program, "X")
    host = Cia402Drivers(machine, ["X"], channel="drives", cia402=patient("X"))
    try:
        host.start()
        run(host, 0.1, 1.0)
        server.kill()
        with pytest.raises(MachineError, match=r"X \(node 2\)|bus rds:drives"):
            run(host, 2.0, 1.0)
    finally:
        host.close()


def test_a_server_ends_when_it_is_told(builtin: Path, program: Program) -> None:
    server = serve(program, "X")
    server.send_signal(signal.SIGTERM)
    assert server.wait(30.0) == 0


def test_a_server_ends_when_its_starter_has_gone(builtin: Path, program: Program) -> None:
    server = program(
        "-m",
        "rds.bus.modules.cia402.server",
        "mini-cnc",
        "--channel",
        "drives",
        "--exit-with-stdin",
        "--afterlife",
        "0.3",
    )
    assert server.stdout is not None and server.stdin is not None
    assert server.stdout.readline().startswith("ready")
    server.stdin.close()
    assert server.wait(30.0) == 0


def sdo(client: can.BusABC, index: int) -> int:
    request = bytes([0x40, index & 0xFF, index >> 8, 0, 0, 0, 0, 0])
    client.send(can.Message(arbitration_id=0x602, data=request, is_extended_id=False))
    deadline = time.monotonic() + 30.0
    while (left := deadline - time.monotonic()) > 0:
        message = client.recv(left)
        if message is not None and message.arbitration_id == 0x582:
            return int.from_bytes(message.data[4:8], "little")
    raise AssertionError("no answer")
