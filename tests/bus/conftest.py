"""Every test here gets a runtime directory of its own, and fails if it leaves a bus or a process behind."""

from __future__ import annotations

import contextlib
import fcntl
import gc
import logging
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import can
import pytest
from waiting import wait_for

from rds.bus.hub import connect
from rds.bus.medium.medium import Medium

from . import wires

FORK = multiprocessing.get_context("fork")  # quick, and these tests hold no threads when they fork


@pytest.fixture(autouse=True)
def runtime_directory(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A private place for sockets; short, because a socket's path is. Hubs left in it are ended."""
    base = Path(tempfile.mkdtemp(prefix="rds", dir="/tmp"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base))
    yield base
    for lock in base.glob("rds/*.lock"):
        with contextlib.suppress(FileNotFoundError, ValueError, ProcessLookupError):
            os.kill(int(lock.read_text()), signal.SIGTERM)
            wait_for(partial(is_free, lock))
    shutil.rmtree(base)


@pytest.fixture(autouse=True)
def nothing_left_open(runtime_directory: Path) -> Iterator[None]:
    """Fails the test that leaves a bus open or a child process running."""
    gc.freeze()  # so that only what the test made is searched
    yield
    children = multiprocessing.active_children()
    for child in children:
        child.kill()
        child.join()
    gc.collect()
    # type(), for canopen's placeholder of a network raises whatever is asked of it
    buses = [thing for thing in gc.get_objects() if issubclass(type(thing), can.BusABC) and not thing._is_shutdown]
    for bus in buses:
        bus.shutdown()
    assert not children, f"left running: {children}"
    assert not buses, f"left open: {buses}"


@pytest.fixture
def open_bus() -> Iterator[Callable[..., can.BusABC]]:
    """Opens buses of the built-in interface and shuts them down afterwards."""
    with contextlib.ExitStack() as stack:

        def opener(channel: str = "test", **options: Any) -> can.BusABC:
            return stack.enter_context(can.Bus(interface="rds", channel=channel, **options))

        yield opener
        # a bus that was let go reports that once more when it is collected
        logging.getLogger("can").setLevel(logging.WARNING)


@pytest.fixture
def start() -> Iterator[Callable[..., Any]]:
    """Runs functions in processes of their own; kills what is left at the end."""
    processes = []

    def starter(function: Callable[..., Any], *arguments: Any) -> Any:
        process = FORK.Process(target=function, args=arguments)
        process.start()
        processes.append(process)
        return process

    yield starter
    for process in processes:
        process.kill()
        process.join()


@pytest.fixture
def program() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Runs `python -m MODULE ...`; kills what is left at the end."""
    with contextlib.ExitStack() as stack:

        def runner(module: str, *arguments: str, **options: Any) -> subprocess.Popen[str]:
            command = [sys.executable, "-m", module, *arguments]
            pipe = subprocess.PIPE
            process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, **options)
            stack.enter_context(process)
            stack.callback(process.kill)
            return process

        yield runner


@pytest.fixture
def hub(program: Callable[..., subprocess.Popen[str]], runtime_directory: Path) -> Callable[..., subprocess.Popen[str]]:
    """Starts a hub by hand in the foreground, with other limits than usual."""

    def starter(channel: str = "test", *arguments: str) -> subprocess.Popen[str]:
        process = program("rds.bus.hub.hub", channel, *arguments)
        wait_for(lambda: greets(channel) or process.poll() is not None)  # its address is there before it listens
        return process

    return starter


def greets(channel: str) -> bool:
    """Whether the channel's hub takes connections."""
    with contextlib.suppress(OSError, ValueError):
        connection = connect.visit(channel)
        if connection is not None:
            connection.sock.close()
            return True
    return False


def is_free(lock: Path) -> bool:
    """Whether no hub holds the lock."""
    try:
        with lock.open() as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return True


@pytest.fixture(params=["timed", "untimed"])
def medium(request: pytest.FixtureRequest) -> Medium[str]:
    """A bus with nodes A, B and C, in virtual time."""
    return wires.bus() if request.param == "timed" else wires.untimed()
