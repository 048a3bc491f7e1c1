"""What serving a machine has in common, whatever its modules speak: each case runs in all dialects."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest
from waiting import wait_for

from rds.bus.hub.faults import Faults
from rds.bus.modules.dialects import SERIAL_DIALECTS, dialect_names, serve_machine, server_module
from rds.core.errors import InputError
from rds.machines import load_machine

MACHINE = load_machine("mini-cnc")
CAN = [name for name in dialect_names() if name not in SERIAL_DIALECTS]  # a serial line: tests/serial_line
pytestmark = [pytest.mark.realtime, pytest.mark.parametrize("dialect", CAN)]


def test_every_dialect_plays_a_schedule_of_faults(dialect: str, program: Callable[..., Any], tmp_path: Path) -> None:
    schedule = tmp_path / "faults.toml"
    schedule.write_text('[[fault]]\nkind = "unplug"\nnode = "X"\n')
    where = ["mini-cnc", "--channel", "m", "--option", "bitrate=500000", "--axes", "X,Z"]
    server = program(server_module(dialect), *where, "--faults", str(schedule))
    assert server.stdout.readline().startswith("ready mini-cnc on rds:m: X, Z")
    with Faults("m") as line:
        found = {node["name"]: node for node in line.nodes()}
        assert list(found) == ["X", "Z"]
        assert found["Z"]["plugged"] and not found["X"]["plugged"]
    server.send_signal(signal.SIGTERM)
    assert server.wait(30) == 0
    schedule.write_text('[[fault]]\nkind = "unplugg"\nnode = "X"\n')
    wrong = program(server_module(dialect), *where, "--faults", str(schedule))
    assert wrong.wait(30) == 2 and f"{schedule}, line 2" in wrong.stderr.read()


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminal that hangs up")
def test_a_closed_terminal_ends_a_server_in_order(dialect: str, program: Callable[..., Any]) -> None:
    server = program(server_module(dialect), "mini-cnc", "--channel", "m", "--axes", "X")
    assert server.stdout.readline().startswith("ready")
    server.send_signal(signal.SIGHUP)
    assert server.wait(30) == 0


def test_faults_need_the_built_in_bus(dialect: str, tmp_path: Path) -> None:
    from rds.bus.medium.fault_file import read_faults

    schedule = tmp_path / "faults.toml"
    schedule.write_text('[[fault]]\nkind = "unplug"\nnode = "X"\n')
    with pytest.raises(InputError, match="faults can be injected on the built-in bus only, not on virtual:m"):
        serve_machine(MACHINE, dialect, "virtual", "m", lambda: None, faults=read_faults(schedule))


def test_a_lost_bus_is_opened_again(
    dialect: str, hub: Callable[..., Any], program: Callable[..., Any], open_bus: Callable[..., can.BusABC]
) -> None:
    first = hub("m")
    server = program(server_module(dialect), "mini-cnc", "--channel", "m")
    assert server.stdout.readline().startswith("ready")
    first.kill()
    first.wait()

    def names() -> list[str]:
        with Faults("m") as line:
            return [node["name"] for node in line.nodes()]

    bus = open_bus(channel="m")  # starts another hub
    wait_for(lambda: set(MACHINE.axes) <= set(names()))
    assert server.poll() is None
    bus.shutdown()


def test_it_ends_when_its_starter_has_gone_and_nobody_commands(dialect: str, program: Callable[..., Any]) -> None:
    server = program(server_module(dialect), "mini-cnc", "--channel", "m", "--exit-with-stdin", "--afterlife", "0.3")
    assert server.stdout.readline().startswith("ready")
    began = time.monotonic()
    server.stdin.close()
    assert server.wait(30) == 0
    assert time.monotonic() - began >= 0.3


def test_an_interface_without_descriptors_is_served_in_a_thread(dialect: str) -> None:
    """python-can's virtual bus has none; the same function serves it, and ends when told."""
    ready, stop = threading.Event(), threading.Event()
    serving = threading.Thread(
        target=lambda: serve_machine(
            MACHINE, dialect, "virtual", f"serving-{dialect}-{os.getpid()}", ready.set, stop=stop
        )
    )
    serving.start()
    assert ready.wait(30)
    stop.set()
    serving.join(30)
    assert not serving.is_alive()
