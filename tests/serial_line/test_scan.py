"""Who is on a line, and its emergency stop: in virtual time, as commands, and between another host's bytes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.bus.modules.dcs.drivers import DcsDrivers
from rds.bus.modules.dcs.scan import scan_line, stop_channel, stop_line
from rds.cli.main import app
from rds.core.errors import MachineError
from rds.machines import load_machine

from .conftest import Bench, Served

Server = Callable[..., Served]


def test_a_scan_lists_who_answers_and_changes_nothing(bench: Callable[..., Bench]) -> None:
    b = bench()
    rows = scan_line(b.port, 38_400)
    assert [(row["id"], row["state"], row["counts"]) for row in rows] == [(n, "not set up", 0) for n in (2, 3, 4, 5)]
    b.line.remove(3, b.port.now())
    assert [row["id"] for row in scan_line(b.port, 38_400)] == [2, 4, 5]
    b.line.cut = True
    assert scan_line(b.port, 38_400) == []


def test_a_stop_ends_a_jog_a_journey_home_and_the_steps_of_a_buffer(bench: Callable[..., Bench]) -> None:
    b = bench(noise=1e-3)
    b.host.jog(2, 5)
    b.port.write(b"h" + bytes([123]))
    b.port.sleep(b.port.now() + 0.2)
    assert any(unit.motor.moving for unit in b.line.units)
    assert stop_line(b.port, 38_400) == [2, 3, 4, 5]
    assert not any(unit.motor.moving for unit in b.line.units)


def test_a_unit_that_moves_on_is_named(bench: Callable[..., Bench]) -> None:
    b = bench()
    unit = b.line.unit(4)
    assert unit is not None
    unit._halt = lambda at: None  # type: ignore[method-assign]
    b.port.write(b"h" + bytes([124]))
    with pytest.raises(MachineError, match="units 4 on line serial still move; cut the power"):
        stop_line(b.port, 38_400)


@pytest.mark.realtime
def test_the_commands(served: Server, tmp_path: Path) -> None:
    served("starmill")
    words = ["--interface", "serial"]
    found = json.loads(CliRunner().invoke(app, ["scan", *words, "--json"]).stdout)
    assert [row["id"] for row in found["modules"]] == [2, 3, 4, 5] and found["channel"] == "starmill"
    assert json.loads(CliRunner().invoke(app, ["estop", *words, "--json"]).stdout) == {"stopped": [2, 3, 4, 5]}
    experiment = tmp_path / "experiment.toml"
    experiment.write_text('machine = "starmill"\n[bus]\ninterface = "serial"\nbaud = 115200\n')
    done = CliRunner().invoke(app, ["scan", "--experiment", str(experiment)])
    assert done.exit_code == 0 and "not set up" in done.stdout
    for refused, said in (
        (["scan", *words, "--watch"], "--watch is for distributed modules"),
        (["scan", "--baud", "9600"], "--baud is for serial lines"),
        (["estop", *words, "--reset"], "latch no emergency stop"),
        (["estop", *words, "--channel", "elsewhere"], "there is no serial line elsewhere"),
    ):
        done = CliRunner().invoke(app, refused)
        assert done.exit_code == 2 and said in " ".join(done.output.split()), done.output


@pytest.mark.realtime
def test_a_line_that_another_host_commands_is_stopped_and_its_run_ends(served: Server) -> None:
    served("starmill")
    drivers = DcsDrivers(load_machine("starmill"), ["X", "Y", "Z"], timeout=2.0)
    try:
        drivers.start()
        drivers.exchange()
        assert stop_channel("starmill", 115_200) == [2, 3, 4, 5]
        with pytest.raises(MachineError):
            for _ in range(100):
                drivers.exchange()
                drivers.write([1.0, 0.0, 0.0])
    finally:
        drivers.close()
