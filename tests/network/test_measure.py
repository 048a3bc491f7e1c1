"""Delays measured: directions by hand, and a machine on the built-in bus, whose trace drives an experiment."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import rds
from rds.cli.main import app
from rds.network.loops.bus_times import directions
from rds.network.loops.host_load import HostLoad
from rds.network.loops.measure import _measured, _plan
from rds.network.trace import read_trace

COMMAND, ANSWER = 0x010, 0x021


def test_directions_by_hand() -> None:
    """A clock 1000 s ahead; the quickest command and the quickest answer take no time, so the split is exact."""
    sent = np.array([0.0, 1.0, 2.0, 3.0])
    to_bus, answer, back = np.array([0.0, 0.2, 0.1, 0.1]), 0.3, np.array([0.4, 0.0, 0.1, 0.1])
    received = sent + to_bus + answer + back
    frames = [[(1000 + s + a, COMMAND), (1000 + s + a + answer, ANSWER)] for s, a in zip(sent, to_bus, strict=True)]
    frames[2].insert(0, (1000.5, ANSWER))  # of a sample before, late
    del frames[3][1]  # lost
    found = directions(sent, received, frames, 1)
    assert found.actuator == pytest.approx(to_bus)
    assert found.sensor[:3] == pytest.approx((answer + back)[:3])
    assert np.isnan(found.sensor[3])
    assert found.split_error == pytest.approx(0.0, abs=1e-9)


def test_without_stamps_each_direction_is_half_of_the_round_trip() -> None:
    found = directions(np.array([0.0, 1.0]), np.array([0.2, 1.4]), [[], []], 1)
    assert found.sensor == pytest.approx([0.1, 0.2])
    assert found.actuator == pytest.approx([0.1, 0.2])
    assert found.split_error == pytest.approx(0.2)


class Still:
    """Drivers of axes that stand."""

    def start(self) -> None: ...
    def exchange(self) -> list[float]:
        return [0.0] * 3

    def write(self, voltages: list[float]) -> list[float]:
        return voltages

    def close(self) -> None: ...


def test_an_adapter_that_can_be_opened_once_is_the_drivers_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.bus.modules.dialects.open_drivers", lambda *_: Still())
    monkeypatch.setattr("rds.bus.tools.link.open_bus", lambda *_, **__: pytest.fail("it was opened for a second node"))
    plan = _plan("mini-cnc", 0.002, {"interface": "slcan", "channel": "/dev/ttyACM0"}, "p")
    found = _measured(plan, 20, HostLoad())
    assert len(found.sensor) > 0 and found.sensor == pytest.approx(found.actuator)
    assert found.to_json()["bus_load_percent"] is None and "bus load" not in str(found)


@pytest.mark.realtime
@pytest.mark.usefixtures("alone")
def test_a_machine_is_measured_and_its_trace_drives_an_experiment(tmp_path: Path) -> None:
    trace, picture = tmp_path / "bus.csv", tmp_path / "bus.png"
    words = ["network", "measure", "--seconds", "0.5", "--sample-period", "0.005", "--bitrate", "1000000", "--json"]
    ran = CliRunner().invoke(app, [*words, "-o", str(trace), "--plot", str(picture)])
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)
    delays = told["delays_us"]
    # a command frame of 8 bytes at 1 Mbit/s takes 111 to 135 µs; three answers follow
    assert delays["total"]["p50"] > 111 + 3 * 47
    whole = {name: delays[name]["mean"] for name in ("sensor", "computing", "actuator")}
    if not delays["sensor"]["lost"]:
        assert sum(whole.values()) == pytest.approx(delays["total"]["mean"])
    assert 5.0 < told["bus_load_percent"] < 50.0
    load = told["host_load_percent"]
    assert {"steady", "running"} <= set(load) <= {"started", "steady", "set up", "running"}
    assert load["steady"]["process_mean"] < load["running"]["process_mean"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    columns = read_trace(trace)
    result = rds.Experiment(
        axis="X",
        duration=0.1,
        reference=rds.square(1.0, 5.0),
        controller="p",
        network={"actuator": {"kind": "trace", "file": str(trace)}},
    ).run()
    wanted = np.where(np.isnan(columns["actuator"]), -1.0, columns["actuator"])
    assert result["X_delay_ca"][: len(wanted)] == pytest.approx(wanted[:100], abs=1e-9)


@pytest.mark.realtime
@pytest.mark.usefixtures("alone")
def test_a_serial_line_is_as_full_as_the_formula_says() -> None:
    """At 115,200 bit/s a frame and four answers take 4.65 ms."""
    words = ["network", "measure", "starmill", "--interface", "serial", "--seconds", "0.4", "--sample-period", "0.02"]
    ran = CliRunner().invoke(app, [*words, "--json"])
    assert ran.exit_code == 0, ran.output
    told = json.loads(ran.stdout)
    assert told["bitrate"] == 115_200
    assert told["bus_load_percent"] == pytest.approx(100 * 4.64583e-3 / 0.02, rel=1e-3)


def test_no_time_is_refused() -> None:
    ran = CliRunner().invoke(app, ["network", "measure", "--seconds", "0"])
    assert ran.exit_code == 2
    assert "seconds = 0.0 must be from 0.05 to 3600 s" in ran.stderr
