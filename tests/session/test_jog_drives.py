"""Jogging CiA 402 drives and spindles: real processes on a real bus, and what the drives themselves say afterwards."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner
from waiting import wait_for

from rds import panels
from rds.bus.modules.cia402.codes import State
from rds.bus.modules.cia402.scan import scan
from rds.bus.modules.dialects import server_module
from rds.cli.main import app
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.panels.jog.jog_commands import SPINDLE_DEAD_MAN
from rds.panels.jog.module_control import VoltageControl
from rds.panels.jog.state import Jog
from rds.panels.session import Session

from .test_jog import PATIENCE, hear, hold_until

pytestmark = pytest.mark.realtime

POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)


def taken(folder: Path, machine: str = "mini-cnc", **bus: Any) -> Jog:
    jog = Jog(Session(folder, machine, bus))
    task = jog.begin()
    assert task.wait(PATIENCE)
    assert task.error is None, task.error
    return jog


@pytest.fixture
def drives(alone: Path) -> Iterator[Jog]:
    jog = taken(alone, dialect="cia402", cia402=patient())
    yield jog
    jog.end()


def patient() -> dict[str, Any]:
    """Drives that bear what a busy computer does to the period: no test here is about time."""
    write = [[0x2000, 1, 200], [0x2000, 2, 250]]
    return {"heartbeat": 0.5, "axis": {name: {"write": write} for name in ("X", "Y", "Z", "spindle")}}


def without_power() -> bool:
    found = [device.state for device in scan(channel="mini-cnc") if device.is_drive]
    return len(found) == 4 and not any(state in POWERED for state in found)


def turn_until(jog: Jog, reached: Callable[[float], bool], direction: int = 1) -> None:
    def on() -> bool:
        jog.turn("spindle", direction, 3000.0)
        return reached(jog.speeds["spindle"])

    wait_for(on)


def test_drives_are_moved_while_held_and_by_step_within_their_limits(drives: Jog) -> None:
    assert drives.finds_home and set(drives.positions) == {"X", "Y", "Z"} and not drives.left_out
    hold_until(drives, 1.0)
    wait_for(lambda: not drives.moving)
    hear(drives)
    rested = drives.positions["X"]
    drives.choices.set("step", "0.1")
    drives.step("X", -1)
    wait_for(lambda: drives.positions["X"] == pytest.approx(rested - 0.1, abs=0.005))
    assert drives.positions["Y"] == pytest.approx(0.0, abs=0.005)
    with pytest.raises(InputError, match=r"X would leave its travel, -74\.85 to 74\.85 mm"):  # clear of the switches
        drives.go("X", 75.0)
    turn_until(drives, lambda speed: speed == pytest.approx(3000.0, abs=60.0))
    drives.halt()
    wait_for(lambda: abs(drives.speeds["spindle"]) < 30.0)
    drives._loop.kill()  # type: ignore[union-attr]
    wait_for(without_power)


def test_software_limits_narrow_the_travel_and_home_is_found(alone: Path) -> None:
    """Homing by the negative switch makes it the end of the travel, whatever the drive counted before."""
    here = {"homing": 37, "home": -0.5}  # within the limits, to which the drive would go otherwise
    limits = [[0x607D, 1, -1_000], [0x607D, 2, 2_500]]
    bus = patient()
    axes = bus["axis"]
    axes["X"] = {"write": axes["X"]["write"] + limits, **here}
    axes["spindle"] |= {"mode": "cst"}
    machine = Path(load_machine("mini-cnc").path).read_text()
    (alone / "small.toml").write_text(machine.replace("[-75.0, 75.0]", "[-3.0, 3.0]"))
    jog = taken(alone, str(alone / "small.toml"), dialect="cia402", cia402=bus)
    try:
        assert jog.axes["X"].travel == (-1.0, 2.5) and jog.positions["X"] == 0.0  # not homed at the start
        with pytest.raises(InputError, match=r"\[bus\.cia402\.axis\.X\] says homing = 37, not 17"):
            jog.find_home(["X"], 17)
        jog.find_home(["X", "Y"])  # by 17, which is chosen unless the table gives one
        wait_for(lambda: jog.homing == "Y" and jog.positions["Y"] < -1.0)
        with pytest.raises(InputError, match="Y is being homed"):
            jog.turn("spindle", 1)
        wait_for(lambda: "Y" in jog.homed and not jog.homing)
        assert jog.positions["X"] == -0.5  # the table's own method and home
        assert jog.positions["Y"] == pytest.approx(-3.0, abs=0.05)
        jog.step("Y", 1)
        wait_for(lambda: jog.positions["Y"] == pytest.approx(-2.0, abs=0.1))
        with pytest.raises(InputError, match=r"Y would leave its travel, -2\.994 to 2\.994"):
            jog.go("Y", -4.0)
        jog.find_home(["Z"], 18)
        wait_for(lambda: jog.positions["Z"] > 0.5)
        jog.halt()
        wait_for(lambda: not jog.homing and jog.ready)
        assert jog.homed == {"X", "Y"} and jog.positions["Z"] < 45.0
        jog.step("Z", -1)  # goes on as before
        wait_for(lambda: not jog.moving)
    finally:
        jog.end()


DIES = """
import sys, time
from rds.panels.session import Session
from rds.panels.jog.state import Jog
jog = Jog(Session(sys.argv[1]))
jog.begin().wait(60)
while True:
    jog.hold("X", 1)
    jog.turn("spindle", 1)
    print(jog.positions["X"], jog.speeds["spindle"], flush=True)
    time.sleep(0.05)
"""


def test_whoever_jogs_drives_dies_and_they_stop(alone: Path) -> None:
    served = [sys.executable, "-m", "rds.bus.modules.cia402.server", "mini-cnc", "--exit-with-stdin"]
    pipe = subprocess.PIPE
    with subprocess.Popen(served, stdin=pipe, stdout=pipe, text=True) as server:
        assert server.stdout is not None and server.stdout.readline().startswith("ready")
        page = subprocess.Popen([sys.executable, "-c", DIES, str(alone)], stdout=pipe, text=True)
        assert page.stdout is not None
        for line in page.stdout:
            position, speed = map(float, line.split())
            if position > 0.5 and speed > 500.0:
                break
        os.kill(page.pid, signal.SIGKILL)
        page.wait()
        page.stdout.close()
        wait_for(without_power)
        server.terminate()


def test_the_emergency_stop_reaches_drives_that_are_jogged(drives: Jog) -> None:
    hold_until(drives, 0.2)
    assert "4 modules are at zero volts" in drives.session.emergency_stop()
    assert not drives.ready


def test_a_spindle_keeps_its_speed_and_stops_when_nobody_says_it_any_more(alone: Path) -> None:
    """Of modules that take voltages: the library's controller keeps the speed that the model alone would miss."""
    jog = taken(alone)
    try:
        assert jog.dialect == "rds" and jog.speeds == {"spindle": 0.0}
        turn_until(jog, lambda speed: abs(speed + 3000.0) < 30.0, -1)
        said = time.monotonic()
        jog.turn("spindle", -1, 3000.0)
        jog.hold("X", 1)  # axes and spindle do not stop each other: it would stand after 0.12 s
        jog.rest()
        wait_for(lambda: jog.speeds["spindle"] == 0.0)
        assert time.monotonic() - said > SPINDLE_DEAD_MAN
        for words, refused in ((("spindle", 1, 12_000.0), "turns at -10000 to 10000"), (("X", 1), "X is an axis")):
            with pytest.raises(InputError, match=refused):
                jog.turn(*words)
        with pytest.raises(InputError, match="speak rds have no homing"):
            jog.find_home()
    finally:
        jog.end()


def test_a_drive_is_homed_and_the_spindle_turned_from_the_command_line(alone: Path) -> None:
    bus = '[bus]\ndialect = "cia402"\n[bus.cia402.axis.X]\nhoming = 37\nhome = 4.0\n'
    (alone / "drives.toml").write_text(bus)
    served = [sys.executable, "-m", "rds.bus.modules.cia402.server", "mini-cnc", "--exit-with-stdin"]
    with subprocess.Popen(served, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None and server.stdout.readline().startswith("ready")
        for words, expected in (
            (["X", "--find-home", "37"], {"axis": "X", "position": 4.0, "unit": "mm"}),
            (
                ["spindle", "--speed=-2000", "--for", "1.5"],
                {"axis": "spindle", "speed": pytest.approx(-2000.0, abs=30.0), "unit": "rev/min"},
            ),
        ):
            done = CliRunner().invoke(app, ["jog", *words, "--experiment", "drives.toml", "--json"])
            assert done.exit_code == 0, done.stderr
            assert json.loads(done.stdout) == expected
        assert without_power()
        server.terminate()


def test_what_modules_that_take_voltages_cannot_move_is_left_out_with_its_reason(alone: Path) -> None:
    """An axis without a model; drives need none. The spindle has one, and no module here."""
    text = Path(load_machine("mini-cnc").path).read_text()
    rotary = '[axis.C]\nnode = 9\nunit = "deg"\ntravel = [-90.0, 90.0]\nresolution = 0.01\n'
    fifth = re.sub(r"\[axis\.Y\.model\][^\[]*", "", text).replace("[axis.spindle]", rotary + "[axis.spindle]")
    (alone / "five.toml").write_text(fifth)
    hand = VoltageControl(load_machine(str(alone / "five.toml")), "rds", {"interface": "virtual", "channel": "five"})
    try:
        assert list(hand.axes) == ["X", "Z"] and not hand.spindles
        assert "no model with tau and K" in hand.left_out["Y"] and "no model with tau and K" in hand.left_out["C"]
        assert "no module answers" in hand.left_out["spindle"]
    finally:
        hand.close()


def test_an_axis_that_goes_astray_is_let_go(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One with a wrong sign ran to its end at full voltage, held or not; one that was blocked was pushed for ever."""
    hand = VoltageControl(load_machine("mini-cnc"), "rds", {"interface": "virtual", "channel": "astray"})
    try:
        monkeypatch.setattr(hand._drivers, "write", lambda volts: None)
        rest = dict.fromkeys(hand.axes, 0.0)
        hand._measured = rest | {"X": 1.0}
        for _ in range(50):  # in which its module may say nothing
            hand.write(rest, rest)
        hand._measured = rest | {"X": 0.3}  # half the voltage
        for _ in range(500):
            hand.write(rest, rest)
        hand._measured = rest | {"X": -1.0}
        with pytest.raises(MachineError, match="X is 1 mm from where it is to be"):
            for _ in range(110):
                hand.write(rest, rest)
    finally:
        hand.close()


def test_a_panel_that_nobody_shows_any_more_lets_the_machine_go(alone: Path) -> None:
    """Its axes were held, and the machine in use, for as long as its kernel lived."""
    pytest.importorskip("anywidget", reason="panels need rds[lab]")
    from rds.panels.jog.panel import JogView
    from rds.panels.page.shell import Shell
    from rds.panels.page.still_here import IN_BACKGROUND, IN_SIGHT

    jog = taken(alone)
    view = JogView(Shell(jog.session), jog)
    for said, stays in (("in background", IN_BACKGROUND), ("in sight", IN_SIGHT)):
        view._here.until = 0.0
        view._here._said(None, {"kind": said}, None)
        view._here.until -= stays - 5.0
        view._show()
        assert jog.ready
    view._here.until -= 5.0
    view._show()
    assert not jog.ready and jog.session.machine_user is None
    assert "the machine was let go" in view.notice.value


@pytest.mark.parametrize("dialect", ["rds", "cia402"])
def test_a_machine_is_jogged_without_its_spindle(alone: Path, dialect: str) -> None:
    served = [sys.executable, "-m", server_module(dialect), "mini-cnc", "--axes", "X,Y,Z", "--exit-with-stdin"]
    with subprocess.Popen(served, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None and server.stdout.readline().startswith("ready")
        jog = taken(alone)
        try:
            assert jog.dialect == dialect and set(jog.positions) == {"X", "Y", "Z"} and not jog.speeds
            with pytest.raises(InputError, match="spindle cannot be jogged: no module answers for it"):
                jog.turn("spindle", 1)
        finally:
            jog.end()
        server.terminate()


def test_panels_are_shown_for_a_bus_of_ones_own(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ipywidgets", reason="panels need rds[lab]")
    monkeypatch.setattr("rds.panels.page.shell.Shell", lambda session, panel: SimpleNamespace(widget=session))
    bus = {"interface": "virtual", "channel": "mine", "dialect": "cia402"}
    jog = Jog(panels.main(alone, bus=bus))
    task = jog.begin()
    assert task.wait(PATIENCE)
    assert str(task.error) == "no module of mini-cnc answers on virtual:mine; switch it on"
    assert jog.session.machine_user is None


@pytest.mark.parametrize(
    "table, says",
    [
        ('dialect = "cia402"\n[bus.cia402.axis.X]\nhoming = 5', "homing = 5 must be one of"),
        ('dialect = "cia402"\n[bus.cia402]\naxis = 3', "must be tables"),
        ("[bus.cia402]", 'add `dialect = "cia402"`'),
        ('dialect = "cia402"\ncia402 = 3', "must be a table"),
        ('faults = "faults.toml"', "faults.toml"),
        ('interface = "virtual"\ndry_run = true', "dry_run is no option of a bus"),
    ],
)
def test_a_bus_that_will_not_do_is_refused_in_words(alone: Path, table: str, says: str) -> None:
    (alone / "bus.toml").write_text(f"[bus]\n{table}\n")
    refused = CliRunner().invoke(app, ["jog", "X", "--by", "1", "--experiment", "bus.toml"])
    assert refused.exit_code == 2 and says in refused.stderr, refused.stderr
    assert "Traceback" not in refused.stderr
