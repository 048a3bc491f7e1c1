"""Drives with bus time in the test's hands, and drives served on a bus; no test leaves a bus or a process behind."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import can
import pytest

from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.codes import Mode, State, state_of
from rds.bus.modules.cia402.drive import Drive, Frame
from rds.bus.modules.cia402.node import DriveNode
from rds.bus.modules.cia402.server import serve
from rds.machines import Machine, load_machine

NODE = 2
T = 0.001
PATIENCE = 50  # periods that a served drive and its host wait for each other; their own 10 are less than a hold-up


class Abort(Exception):
    """The drive aborted an SDO transfer with this code."""

    def __init__(self, code: int):
        self.code = code
        super().__init__(f"{code:#010x}")


class Rig:
    """A drive, and a host that decides what time it is."""

    def __init__(self, machine: Machine, axis: str = "X"):
        self.t = 1.7e9  # bus time is in seconds since the epoch
        self.drive = Drive(machine.axis(axis), self.t)
        self.node = self.drive.node
        self.frames: list[tuple[float, int, bytes]] = []
        self.keep(self.drive.boot(self.t))

    def keep(self, frames: list[Frame]) -> list[Frame]:
        self.frames += [(self.t, identifier, data) for identifier, data in frames]
        return frames

    def send(self, identifier: int, data: bytes = b"") -> list[Frame]:
        return self.keep(self.drive.receive(identifier, data, self.t))

    def wait(self, seconds: float, step: float = T) -> None:
        """Let time go on without a frame, waking the drive as a bus would."""
        end = self.t + seconds
        while self.t < end:
            self.t = min(end, self.t + step)
            self.keep(self.drive.expire(self.t))

    def sdo(self, request: bytes) -> bytes:
        answers = [
            data for identifier, data in self.send(0x600 + self.node, request) if identifier == 0x580 + self.node
        ]
        assert len(answers) == 1
        if answers[0][0] == 0x80:
            raise Abort(int.from_bytes(answers[0][4:8], "little"))
        return answers[0]

    def write(self, index: int, value: int, size: int, subindex: int = 0) -> None:
        command = 0x23 | (4 - size) << 2
        data = (value % (1 << 8 * size)).to_bytes(size, "little").ljust(4, b"\0")
        self.sdo(struct.pack("<BHB", command, index, subindex) + data)

    def read(self, index: int, subindex: int = 0, signed: bool = False) -> int:
        answer = self.sdo(struct.pack("<BHB4x", 0x40, index, subindex))
        return int.from_bytes(answer[4 : 8 - (answer[0] >> 2 & 3)], "little", signed=signed)

    def nmt(self, command: int) -> None:
        self.send(0x000, bytes([command, self.node]))

    def map(self, target: int, bits: int = 32, transmission: int = 1) -> None:
        """RPDO 1: controlword and target; TPDO 1: statusword and position, with SYNC."""
        for communication, mapping, identifier, flags, entries in (
            (0x1400, 0x1600, 0x200, 0, (0x60400010, target << 16 | bits)),
            (0x1800, 0x1A00, 0x180, 1 << 30, (0x60410010, 0x60640020)),
        ):
            self.write(communication, 1 << 31 | flags | identifier + self.node, 4, 1)
            self.write(communication, transmission if communication == 0x1400 else 1, 1, 2)
            self.write(mapping, 0, 1)
            for place, entry in enumerate(entries, 1):
                self.write(mapping, entry, 4, place)
            self.write(mapping, 2, 1)
            self.write(communication, flags | identifier + self.node, 4, 1)
        self.pack = struct.Struct("<Hi" if bits == 32 else "<Hh").pack

    def cycle(self, target: int, word: int = codes.ENABLE_OPERATION, period: float = T) -> tuple[int, int]:
        """One period: RPDO in its middle, SYNC at its end; returns statusword and position at SYNC."""
        self.t += 0.5 * period
        self.send(0x200 + self.node, self.pack(word, target))
        self.t += 0.5 * period
        for identifier, data in self.send(0x80):
            if identifier == 0x180 + self.node:
                status, position = struct.unpack("<Hi", data)
                return status, position
        raise AssertionError("no TPDO")

    def enable(self, mode: Mode, target: int = 0) -> None:
        """Through the state machine by RPDO in a cyclic mode, by SDO in the others."""
        self.write(0x6060, mode, 1)
        for word in (codes.SHUTDOWN, codes.SWITCH_ON, codes.ENABLE_OPERATION):
            if mode in (8, 9, 10):
                self.cycle(target, word)
            else:
                self.write(0x6040, word, 2)
        assert self.drive.state is State.OPERATION_ENABLED

    def ready(self, mode: Mode) -> None:
        """Mapped for `mode`, OPERATIONAL, enabled."""
        index, bits = {Mode.CYCLIC_TORQUE: (0x6071, 16), Mode.CYCLIC_VELOCITY: (0x60FF, 32)}.get(mode, (0x607A, 32))
        self.map(index, bits)
        self.nmt(1)
        self.enable(mode)

    @property
    def voltage(self) -> float:
        return self.drive.servo.axis.voltage

    def emergencies(self) -> list[int]:
        return [
            struct.unpack_from("<H", data)[0] for _, identifier, data in self.frames if identifier == 0x80 + self.node
        ]

    def state(self) -> State | None:
        return state_of(self.read(0x6041))


@pytest.fixture(scope="session")
def machine() -> Machine:
    return load_machine("mini-cnc")


@pytest.fixture
def rig(machine: Machine) -> Rig:
    return Rig(machine)


@pytest.fixture
def served(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., tuple[str, list[DriveNode]]]]:
    """Serves drives on python-can's `virtual` bus, in a thread; gives the channel and the nodes."""
    monkeypatch.setattr("rds.bus.modules.cia402.host.LOST_AFTER", PATIENCE)
    with contextlib.ExitStack() as stack:

        def starter(*axes: str, quirks: str = "", eds: Path | None = None) -> tuple[str, list[DriveNode]]:
            channel, nodes = f"test-{uuid4().hex[:8]}", []  # type: ignore[var-annotated]
            ready, stop = threading.Event(), threading.Event()
            thread = threading.Thread(
                target=serve,
                args=(machine, "virtual", channel, axes, ready.set, stop),
                kwargs={"nodes": nodes, "quirks": quirks, "eds": eds},
            )
            thread.start()
            stack.callback(thread.join)
            stack.callback(stop.set)
            assert ready.wait(30.0)
            for node in nodes:
                node.drive.objects.values |= {(0x2000, 1): PATIENCE - 10, (0x2000, 2): PATIENCE}
                node.drive.operation.look_up()
            return channel, nodes

        yield starter


@pytest.fixture
def builtin(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A private place for the built-in bus; its hubs are ended."""
    base = Path(tempfile.mkdtemp(prefix="rds", dir="/tmp"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    yield base
    for lock in base.glob("rds/*.lock"):
        with contextlib.suppress(FileNotFoundError, ValueError, ProcessLookupError):
            os.kill(int(lock.read_text()), signal.SIGTERM)
    shutil.rmtree(base, ignore_errors=True)


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Runs `python ...`; kills what is left at the end. A host here waits for drives as long as patient ones for it."""
    monkeypatch.setattr("rds.bus.modules.cia402.host.LOST_AFTER", 250)
    with contextlib.ExitStack() as stack:

        def runner(*arguments: str) -> subprocess.Popen[str]:
            pipe = subprocess.PIPE
            process = subprocess.Popen([sys.executable, *arguments], stdin=pipe, stdout=pipe, stderr=pipe, text=True)
            stack.enter_context(process)
            stack.callback(process.kill)
            return process

        yield runner


@pytest.fixture
def bus() -> Iterator[Callable[..., can.BusABC]]:
    """Opens buses, and shuts them down at the end."""
    with contextlib.ExitStack() as stack:

        def opener(channel: str, interface: str = "virtual", **options: Any) -> can.BusABC:
            return stack.enter_context(can.Bus(interface=interface, channel=channel, ignore_config=True, **options))

        yield opener
