"""The bus of a session's own: everything that opens it opens it as its table says, the emergency stop above all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rds.bus import SerialHost, SerialPort
from rds.bus.hub.bus_settings import DEFAULT_BAUD
from rds.bus.modules.server_process import end_server, start_server
from rds.bus.tools.link import bus_name
from rds.core.errors import MachineError
from rds.panels.jog.state import Jog
from rds.panels.machine.monitor import BusMonitor
from rds.panels.machine.state import MachineState
from rds.panels.session import Session

REAL = {"interface": "virtual", "channel": 0, "bitrate": 250_000, "dialect": "cia402", "cia402": {"mode": "csp"}}


def as_told(calls: list[dict[str, Any]]) -> bool:
    told = [{key: call.get(key) for key in ("interface", "channel", "bitrate")} for call in calls]
    return bool(told) and all(each == {"interface": "virtual", "channel": 0, "bitrate": 250_000} for each in told)


@pytest.mark.parametrize("act", ["emergency_stop", "release_emergency_stop"])
def test_the_emergency_stop_opens_the_bus_with_its_bit_rate(
    act: str, tmp_path: Path, opened: list[dict[str, Any]]
) -> None:
    getattr(Session(tmp_path, bus=REAL), act)()
    assert as_told(opened)


def test_so_do_the_scan_and_the_monitor(tmp_path: Path, opened: list[dict[str, Any]]) -> None:
    session = Session(tmp_path, bus=REAL)
    state = MachineState(session)
    task = state.scan()
    assert task.wait(20.0) and "virtual:0" in str(task.error)
    assert as_told(opened)
    opened.clear()
    monitor = BusMonitor()
    watching = session.work("bus monitor", monitor.watch(*state.bus, **session.bus_options), monitor.end)
    while not opened:
        assert not watching.wait(0.02)
    watching.stop()
    assert watching.wait(20.0)
    assert as_told(opened)


def test_jogging_looks_on_the_same_channel(tmp_path: Path, opened: list[dict[str, Any]]) -> None:
    task = Jog(Session(tmp_path, bus=REAL)).begin()
    assert task.wait(20.0) and isinstance(task.error, MachineError)
    assert as_told(opened)


def test_channel_0_of_the_built_in_bus_is_not_the_machine_s(tmp_path: Path, opened: list[dict[str, Any]]) -> None:
    session = Session(tmp_path, bus={"channel": 0})
    assert MachineState(session).bus == ("rds", "0")
    session.emergency_stop()
    assert [call["channel"] for call in opened] == ["0"]
    assert bus_name("virtual", 0) == "virtual:0"


@pytest.mark.realtime
@pytest.mark.parametrize("bus", [{}, {"interface": "serial"}, {"dialect": "dcs", "channel": "starmill"}])
def test_the_emergency_stop_reaches_units_on_a_serial_line(alone: Path, bus: dict[str, Any]) -> None:
    """It looked for them on the built-in bus, or took the line for one of python-can's."""
    server = start_server("dcs", "starmill", "starmill")
    port = SerialPort("starmill", DEFAULT_BAUD)
    try:
        host = SerialHost(port, DEFAULT_BAUD, {2: "X"})
        host.jog(2, 5)
        said = Session(alone, "starmill", bus).emergency_stop()
        assert said == "emergency stop: 4 units on the serial line stand; home the machine"
        assert "no module is on the bus" in Session(alone, "starmill", bus).release_emergency_stop()
    finally:
        port.close()
        end_server(server)
