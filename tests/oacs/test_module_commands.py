"""`rds scan`, `rds module`, `rds estop` as a user types them, against real processes of modules."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import can
import pytest
from typer.testing import CliRunner

from rds.bus.modules.oacs.pid import MEANINGS, Tuning
from rds.cli.main import app

pytestmark = pytest.mark.realtime
Serve = Callable[..., subprocess.Popen[str]]
Rds = Callable[..., Any]


@pytest.fixture
def rds(channel: str) -> Rds:
    """Runs `rds ARGUMENTS --channel ...`, and returns the result."""
    return lambda *arguments: CliRunner().invoke(app, [*map(str, arguments), "--channel", channel])


@pytest.fixture
def said(rds: Rds) -> Rds:
    """The same with --json; returns what it says."""

    def run(*arguments: object) -> Any:
        result = rds(*arguments, "--json")
        assert result.exit_code == 0, result.output
        return json.loads(result.stdout)

    return run


def refused(result: Any) -> str:
    """Why; all refusals have exit code 2 and say nothing on stdout."""
    assert result.exit_code == 2 and result.stdout == ""
    return str(result.stderr)


def test_an_axis_from_scan_to_emergency_stop(serve: Serve, rds: Rds, said: Rds, tmp_path: Path) -> None:
    serve("X,Z")
    rows = said("scan")["modules"]
    assert [(row["id"], row["type"], row["dialect"], row["version"], row["state"]) for row in rows] == [
        (2, "LinrZa", "oacs", 1, "idle"),
        (4, "LinrXa", "oacs", 1, "idle"),
    ]
    info = said("module", 4, "info")
    assert (info["axis"], info["counts_per_unit"], info["unit"]) == ("X", 169.0, "mm")
    tuned = said("module", 4, "tune", "--controller", "pi", "--set", "Kp=2", "--set", "kick=0", "--set", "Ki=0",
                 "--set", "sample_time=0.02", "--set", "tolerance=45")  # fmt: skip
    assert (tuned["controller"], tuned["Kp"], tuned["kick"]) == ("PI", 2.0, 0.0)
    assert said("module", 4, "tune") == tuned
    stepped = said("module", 4, "step", "--by", 2, "--out", tmp_path / "step")
    assert stepped["samples"] > 50 and Path(stepped["files"]["plot"]).stat().st_size > 5000
    assert stepped["response"]["unit"] == "mm" and abs(stepped["response"]["steady_error"]) < 0.5
    assert stepped["response"]["rise_time"] is None, "it ends 45 counts short of 338: never at 90 %"
    pi = said("module", 4, "tune", "--from-step", stepped["files"]["csv"])
    gains = said("module", 4, "tune", "--from-step", stepped["files"]["csv"], "--controller", "PID")
    assert pi["controller"] == "PI" and pi["Kp"] == pytest.approx(0.75 * gains["Kp"]), "the row of what is in force"
    assert gains["controller"] == "PID" and gains["Kp"] != 2.0 and gains["Kd"] > 0.0
    only = said("module", 4, "tune", "--from-step", stepped["files"]["csv"], "--controller", "p")
    assert (only["controller"], only["Ki"], only["Kd"]) == ("PI", 0.0, 0.0)
    assert only["Kp"] == pytest.approx(gains["Kp"] / 1.2)
    assert "controller P has no Ki" in refused(rds("module", 4, "tune", "--controller", "P", "--set", "Ki=1"))
    said("module", 4, "tune", "--set", "Kp=2", "--set", "Ki=0", "--set", "Kd=0", "--set", "kick=0")
    there = said("module", 4, "jog", "1", "--seconds", 0.3)
    assert there["unit"] == "mm" and there["position"] > 2.0
    assert "stands at" in rds("module", 4, "move", "--to", 2).stdout
    assert "nothing moves" in refused(rds("module", 4, "switch"))
    assert said("module", 4, "stop") == {"stopped": 4}
    assert said("estop") == {"stopped": [2, 4]}
    assert "emergency stop is latched" in refused(rds("module", 4, "move", "--by", 1))
    assert said("module", 4, "reset") == {"reset": 4}
    assert [row["state"] for row in said("scan")["modules"]] == ["emergency", "idle"]


def test_a_tool_jogs_and_has_no_position(serve: Serve, rds: Rds, said: Rds) -> None:
    serve("drill")
    turned = said("module", 5, "jog", "-1", "--seconds", 1.2, "--duty", 0.5)
    assert turned["unit"] == "rev/min" and -300 < turned["speed"] < -200
    assert said("scan")["modules"][0]["state"] in ("settling", "idle")
    for words in (("move", "--by", 100), ("step",)):
        assert "module 5 is a tool and can't" in refused(rds("module", 5, *words))


def test_refusals_say_what_and_why(serve: Serve, rds: Rds) -> None:
    serve("X")
    absent = refused(rds("module", 7, "info"))
    assert absent.startswith("rds: module 7: nobody answers with this number") and "rds scan" in absent
    assert "number 99 must be from 2 to 14" in refused(rds("module", 99, "info"))
    assert "outside its travel" in refused(rds("module", 4, "move", "--by", 400))
    assert "neither is given: move by a distance with --by, or to a point with --to" in refused(
        rds("module", 4, "move")
    )
    assert "both are given" in refused(rds("module", 4, "move", "--by", 1, "--to", 2))
    assert "no tuning parameter 'Kq'" in refused(rds("module", 4, "tune", "--set", "Kq=1"))
    assert "--duti" in refused(rds("module", 4, "jog", "1", "--duti", "0.5"))
    assert "must be NAME=VALUE" in refused(rds("module", 4, "tune", "--set", "Kp"))
    for value in ("1", "PI"):
        assert "chosen by --controller" in refused(rds("module", 4, "tune", "--set", f"controller={value}"))
    assert "Kp is given twice, 2 and 3" in refused(rds("module", 4, "tune", "--set", "Kp=2", "--set", "Kp=3"))


def test_an_emergency_stop_that_nobody_acknowledges_fails(rds: Rds, bus: can.BusABC) -> None:
    for words in ((), ("--json",)):
        stopped = rds("estop", *words)
        assert stopped.exit_code == 1
        assert "nobody acknowledged" in stopped.stderr and "cut the power" in stopped.stderr
        assert "rds, oacs, cia402" in stopped.stderr
    assert json.loads(stopped.stdout) == {"stopped": []}


@pytest.mark.parametrize(
    ("words", "number"),
    [
        (["move", "--by", "100"], signal.SIGINT),
        (["jog", "1", "--seconds", "20"], signal.SIGTERM),
        (["jog", "1", "--seconds", "20"], signal.SIGHUP),
        (["step", "--by", "100"], signal.SIGTERM),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else signal.Signals(value).name,
)
def test_what_ends_the_command_ends_the_motion(
    serve: Serve, bus: can.BusABC, channel: str, words: list[str], number: int, tmp_path: Path
) -> None:
    """At once: by a stop on the bus, not by the module's own watchdog, 2 s after the host's last word."""
    serve("X")
    command = [sys.executable, "-m", "rds.cli.main", "module", "4", *words, "--channel", channel]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as process:
        heard = hear(bus, lambda message: message.arbitration_id == 4 and message.data[:1] == b"\x03")
        assert heard.data[1] != 0  # a motion begins
        hear(bus, lambda message: message.arbitration_id == 0 and message.data[:2] == b"\x04\x04")  # it is accepted
        process.send_signal(number)
        hear(bus, lambda message: message.arbitration_id == 4 and message.data[:2] == b"\x03\x00")
        _, said = process.communicate(timeout=60)
    by = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
    assert process.returncode != 0
    assert said.decode() == f"rds: the module was told to stop where it is\nrds: stopped by {by}\n"


def hear(bus: can.BusABC, wanted: Callable[[can.Message], bool]) -> can.Message:
    """The next such frame."""
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        message = bus.recv(1.0)
        if message is not None and not message.is_extended_id and wanted(message):
            return message
    raise AssertionError("it did not come")


def test_what_a_module_says_is_shown_with_units(serve: Serve, rds: Rds) -> None:
    serve("X")
    shown = " ".join(rds("module", 4, "info").stdout.replace("│", " ").split())
    for line in ("highest 150 mm", "counts per unit 169 counts/mm", "clockwise speed 130 mm/min", "supply 12 V"):
        assert line in shown
    assert "the axis shifts along x" in shown and "1 0 0 583" in shown
    tuning = " ".join(rds("module", 4, "tune").stdout.replace("│", " ").split())
    assert tuning in shown and "Ki 1.5 duty/(count s) integral gain" in tuning


def test_every_tuning_parameter_has_a_meaning() -> None:
    assert list(MEANINGS) == [field.name for field in fields(Tuning)]
