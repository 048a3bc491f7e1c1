"""Real processes on a bus of the test's own: machines, hosts, and an eye that sees whether an axis has voltage."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
from typer.testing import CliRunner, Result
from waiting import wait_for

from rds.bus.modules.cia402.codes import State, state_of
from rds.bus.modules.dialects import server_module
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Status
from rds.bus.tools.estop import reset_everything
from rds.cli.main import app
from rds.core.errors import MachineError
from rds.machines import load_machine
from rds.results import open_result

from .host_process import HEARTBEAT, MACHINES

HERE = Path(__file__).parent
T = 0.04  # s: nothing here is about speed, and ten periods are longer than a busy computer holds a process up
PATIENCE = 20.0  # s
_POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)


class Bench:
    """A channel of the built-in bus, and the processes on it, all in one dialect."""

    def __init__(self, dialect: str, stack: contextlib.ExitStack):
        self.dialect, self.channel = dialect, "safe"
        self.machine = load_machine(MACHINES[dialect])
        self.node = self.machine.axis("X").node
        self.start_counts = 0  # of axis X where it is switched on
        self._stack = stack

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """`python ...`, killed at the end of the test."""
        pipe = subprocess.PIPE
        process = subprocess.Popen([sys.executable, *arguments], stdin=pipe, stdout=pipe, stderr=pipe, text=True)
        self._stack.enter_context(process)
        self._stack.callback(process.kill)
        return process

    def serve(self, axes: str = "X", dialect: str | None = None) -> subprocess.Popen[str]:
        """The machine's modules (or those of another dialect's machine), on the bus."""
        dialect = dialect or self.dialect
        machine = load_machine(MACHINES[dialect]).path
        process = self.start("-m", server_module(dialect), machine, "--channel", self.channel, "--axes", axes)
        expect(process, "ready")
        return process

    def host(self, volts: float = 0.0, *flags: str, period: float = T) -> subprocess.Popen[str]:
        """A host that commands axis X; it is about to start."""
        script = str(HERE / "host_process.py")
        return self.start(script, self.dialect, self.channel, str(period), str(volts), *flags)

    def moving(self, volts: float = 6.0, *flags: str, period: float = T) -> subprocess.Popen[str]:
        """A host under whose command axis X has voltage and moves."""
        host = self.host(volts, *flags, period=period)
        self.wait_until_moving(host)
        return host

    def run(self, folder: Path) -> subprocess.Popen[str]:
        """The same of start_run(), once axis X moves."""
        run = self.start_run(folder)
        self.wait_until_moving(run)
        return run

    def start_run(self, folder: Path) -> subprocess.Popen[str]:
        """A run of a minute of constant voltage on axis X, as `rds run` without the plots."""
        text = (
            f'machine = "{self.machine.path}"\naxes = ["X"]\nmode = "system-test"\nduration = 60.0\n'
            f'sample_period = {T}\n[signal]\nkind = "constant"\nvalue = 6.0\n'
            f'[bus]\nchannel = "{self.channel}"\ndialect = "{self.dialect}"\n'
        )
        if self.dialect == "cia402":
            text += f"[bus.cia402]\nheartbeat = {HEARTBEAT}\n"
        (folder / "run.toml").write_text(text)
        return self.start(str(HERE / "run_process.py"), str(folder / "run.toml"), str(folder / "out"))

    def rds(self, *arguments: str) -> Result:
        """The command line, on this channel."""
        return CliRunner().invoke(app, [*arguments, "--channel", self.channel])

    @contextlib.contextmanager
    def bus(self) -> Iterator[can.BusABC]:
        """A connection that hears everything."""
        with can.Bus(interface="rds", channel=self.channel) as bus:
            yield bus

    def wait_until_moving(self, host: subprocess.Popen[str], patience: float = PATIENCE) -> None:
        """Listen until axis X has moved on by a few counts under command of this process; fails if that ends."""
        identifier = self.node + (0x180 if self.dialect == "cia402" else frames.ANSWER)
        place = slice(2, 6) if self.dialect == "cia402" else slice(0, 4)
        first, deadline = None, time.monotonic() + patience
        with self.bus() as bus:
            while time.monotonic() < deadline:
                message = bus.recv(0.5)
                assert host.poll() is None, host.communicate()
                if message is not None and message.arbitration_id == identifier:
                    counts = int.from_bytes(message.data[place], "little", signed=True)
                    first = counts if first is None else first
                    if abs(counts - first) > 20:
                        return
        raise AssertionError("it does not move")

    def counts(self) -> int:
        """Axis X's encoder now."""
        return self._look()[1]

    def powered(self) -> bool:
        """Whether axis X may have voltage, by what its module says."""
        return self._look()[0]

    def until_released(self, bus: can.BusABC) -> None:
        """Reset the emergency stop as soon as the module has noticed that its button is released."""

        def is_free() -> bool:
            with contextlib.suppress(MachineError):
                reset_everything(bus)
                return self.dialect != "cia402" or not self._upload(0x60FD) & 8
            return False

        wait_for(is_free)

    def stands_without_voltage(self) -> None:
        """Axis X's module says that it has no voltage, and it comes to rest and stays so."""
        wait_for(lambda: not self.powered())
        wait_for(self._still)
        assert not self.powered()

    def _still(self) -> bool:
        first = self.counts()
        time.sleep(0.2)
        return self.counts() == first

    def _look(self) -> tuple[bool, int]:
        if self.dialect == "cia402":
            state = state_of(self._upload(0x6041))
            return state in _POWERED and self._upload(0x6077) & 0xFFFF != 0, self._upload(0x6064)
        answer = frames.decode_answer(0, self._ask(frames.CALL, b"", frames.ANSWER + self.node, is_report))
        return bool(answer.status & Status.ENABLED and not answer.status & Status.EMERGENCY), answer.counts

    def _upload(self, index: int) -> int:
        request = bytes((0x40, index & 0xFF, index >> 8, 0)) + bytes(4)
        data = self._ask(0x600 + self.node, request, 0x580 + self.node, lambda data: data[1:4] == request[1:4])
        return int.from_bytes(data[4:8], "little")

    def _ask(self, identifier: int, data: bytes, answer: int, fits: Callable[[bytes], bool]) -> bytes:
        """Ask until the answer comes: a bus that was just cut may not carry it. All questions are answered then: a host
        that begins would take the answer to one of these for its own.
        """
        deadline, asked = time.monotonic() + PATIENCE, 0
        while time.monotonic() < deadline:
            with contextlib.suppress(can.CanError, OSError), self.bus() as bus:
                bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data), 0.5)
                asked += 1
                until = time.monotonic() + 0.5
                while (left := until - time.monotonic()) > 0:
                    message = bus.recv(left)
                    if message is not None and message.arbitration_id == answer and fits(bytes(message.data)):
                        for _ in range(asked - 1):
                            bus.recv(0.5)
                        return bytes(message.data)
        raise AssertionError(f"nobody answers {identifier:#x} with {answer:#x}")


def is_report(data: bytes) -> bool:
    """Whether an answer is of now, not of a tick."""
    return data[5] == frames.Kind.REPORT


def expect(process: subprocess.Popen[str], word: str, patience: float = 60.0) -> str:
    """The next line of a process's stdout that begins with the word.

    Fails if the process ends without one; after `patience` s without one it is killed: no test waits for ever.
    """
    assert process.stdout is not None and process.stderr is not None
    said = []
    limit = threading.Timer(patience, process.kill)
    limit.start()
    try:
        for line in process.stdout:
            if line.startswith(word):
                return line
            said.append(line)
    finally:
        limit.cancel()
    raise AssertionError(f"no {word!r} within {patience:g} s, but {said} {process.stderr.read()}")


def tell(process: subprocess.Popen[str], line: str) -> None:
    """A line to a process's stdin."""
    assert process.stdin is not None
    process.stdin.write(line + "\n")
    process.stdin.flush()


def ended(run: subprocess.Popen[str], folder: Path) -> tuple[str, str]:
    """How `rds run` ended by its record: ending and reason."""
    _, err = run.communicate(timeout=60)
    meta = open_result(folder / "out" / "result.csv").meta
    assert meta["ending"] != "done", err
    return str(meta["ending"]), str(meta["ending_reason"])


def hub_pid(base: Path, channel: str) -> int:
    """The process of the channel's hub."""
    return int((base / "rds" / f"{channel}.lock").read_text())


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A runtime directory of the test's own; its hubs are ended."""
    base = Path(tempfile.mkdtemp(prefix="rds", dir="/tmp"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    yield base
    for lock in base.glob("rds/*.lock"):
        with contextlib.suppress(OSError, ValueError):
            os.kill(int(lock.read_text()), signal.SIGTERM)
    shutil.rmtree(base, ignore_errors=True)


@pytest.fixture(params=["rds", "oacs", "cia402"])
def bench(request: pytest.FixtureRequest, place: Path) -> Iterator[Bench]:
    """A bench in each dialect."""
    with contextlib.ExitStack() as stack:
        yield Bench(request.param, stack)
