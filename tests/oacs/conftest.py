"""Benches, and real processes of modules on a bus of the test's own."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
from oacs_bench import Bench


@pytest.fixture
def bench() -> Callable[..., Bench]:
    """Makes benches: `bench("X", debounce=0.2)`."""
    return Bench


@pytest.fixture
def channel(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A channel of the built-in bus of this test's own; its hub is ended afterwards."""
    base = Path(tempfile.mkdtemp(prefix="rds", dir="/tmp"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    yield "oacs"
    for lock in base.glob("rds/*.lock"):
        with contextlib.suppress(OSError, ValueError):
            os.kill(int(lock.read_text()), signal.SIGTERM)
    time.sleep(0.1)
    shutil.rmtree(base, ignore_errors=True)


@pytest.fixture
def bus(channel: str) -> Iterator[can.BusABC]:
    """The host's bus."""
    with can.Bus(interface="rds", channel=channel) as opened:
        yield opened


@pytest.fixture
def serve(channel: str) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts processes of modules, `serve("X,Z")`, and returns when they are on the bus."""
    with contextlib.ExitStack() as stack:

        def starter(modules: str | None = None) -> subprocess.Popen[str]:
            command = [sys.executable, "-m", "rds.bus.modules.oacs.server", "mrmt-oacs", "--channel", channel]
            command += ["--exit-with-stdin"] + (["--modules", modules] if modules else [])
            pipe = subprocess.PIPE
            process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True)
            stack.enter_context(process)
            stack.callback(process.kill)
            assert process.stdout is not None and process.stdout.readline().startswith("ready")
            return process

        yield starter
