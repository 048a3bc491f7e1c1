"""A line of the STARMILL in virtual time, and one that is served for real."""

from __future__ import annotations

import queue
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from rds.bus.modules.dcs.build import make_line
from rds.bus.modules.dcs.host import Host
from rds.bus.modules.dcs.line import FieldLine
from rds.bus.modules.dcs.port import VirtualPort
from rds.bus.modules.dcs.server import serve
from rds.machines import load_machine

TITLES = {2: "X (unit 2)", 3: "Y (unit 3)", 4: "Z (unit 4)"}


@pytest.fixture(autouse=True)
def runtime_directory(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A private place for lines."""
    base = Path(tempfile.mkdtemp(prefix="rds", dir="/tmp"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    yield base
    shutil.rmtree(base)


class Bench:
    """A line in virtual time with a host at its end."""

    def __init__(self, baud: float = 38_400, **options: Any):
        self.machine = load_machine("starmill")
        self.line: FieldLine = make_line(self.machine, baud=baud, **options)
        self.port = VirtualPort(self.line)
        self.host = Host(self.port, baud, TITLES)

    def position(self, unit: int) -> float:
        """Where a carriage really is, mm."""
        found = self.line.unit(unit)
        assert found is not None
        return found.position(self.port.now())


@pytest.fixture
def bench() -> Callable[..., Bench]:
    """Makes lines in virtual time."""
    return Bench


class Served:
    """A machine that is served by a thread, and hands at its line."""

    def __init__(self, channel: str, hands: queue.SimpleQueue[str]):
        self.channel, self._hands = channel, hands

    def do(self, line: str) -> None:
        """As a line on the server's stdin."""
        self._hands.put(line)


@pytest.fixture
def served() -> Iterator[Callable[..., Served]]:
    """Serves the STARMILL on a pseudo-terminal until the test ends."""
    with ExitStack() as stack:

        def start(channel: str = "starmill", **options: Any) -> Served:
            stop, ready, hands = threading.Event(), threading.Event(), queue.SimpleQueue[str]()
            arguments = {"channel": channel, "ready": ready.set, "stop": stop, "lines": hands, **options}
            thread = threading.Thread(target=serve, args=(load_machine("starmill"),), kwargs=arguments)
            thread.start()
            stack.callback(thread.join, 30.0)
            stack.callback(stop.set)
            assert ready.wait(30.0)
            return Served(channel, hands)

        yield start
