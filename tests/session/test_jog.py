"""Jogging in a session: axes move while they are told to, and stop whatever dies."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner
from waiting import wait_for

from rds.cli.main import app
from rds.core.errors import InputError
from rds.machines import load_machine
from rds.panels.jog.axes import jog_axes, jog_spindles
from rds.panels.jog.jog_commands import DEAD_MAN, JogCommands
from rds.panels.jog.state import Jog, _listen
from rds.panels.session import Session
from rds.panels.session.expired_orders import LATE

pytestmark = pytest.mark.realtime
PATIENCE = 30.0  # s, on a busy computer


@pytest.fixture
def jog(alone: Path) -> Iterator[Jog]:
    made = Jog(Session(alone))
    task = made.begin()
    assert task.wait(PATIENCE)
    assert task.error is None
    yield made
    made.end()


def hold_until(jog: Jog, position: float) -> None:
    def on() -> bool:
        jog.hold("X", 1)
        return jog.positions["X"] > position

    wait_for(on)


def hear(jog: Jog, reports: int = 6) -> None:
    """Let the loop report so often, 20 times a second: what it says then is no old news, however busy the computer."""
    for _ in range(reports):
        last = jog.positions
        wait_for(lambda: jog.positions is not last)  # noqa: B023


def test_a_hold_that_is_not_renewed_ends(jog: Jog) -> None:
    hold_until(jog, 1.0)
    wait_for(lambda: not jog.moving)
    hear(jog)  # it settles
    rested = jog.positions["X"]
    hear(jog)
    assert jog.positions["X"] == pytest.approx(rested, abs=0.003)
    assert jog.positions["Y"] == jog.positions["Z"] == 0.0


def test_a_machine_with_steppers_is_started_on_a_serial_line_and_moves(alone: Path) -> None:
    jog = Jog(Session(alone, "starmill"))
    task = jog.begin()
    assert task.wait(PATIENCE) and task.error is None, task.error
    try:
        assert jog.dialect == "dcs" and set(jog.speeds) == {"spindle"}
        hold_until(jog, 1.0)
        wait_for(lambda: not jog.moving)
    finally:
        jog.end()


def test_steps_go_as_far_as_they_say_and_not_out_of_the_travel(jog: Jog) -> None:
    jog.choices.set("step", "0.1")
    jog.step("Y", -1)
    wait_for(lambda: jog.positions["Y"] == pytest.approx(-0.1, abs=0.008))
    jog.choices.set("step", "10")
    jog.axes["X"] = replace(jog.axes["X"], travel=(-5.0, 5.0))
    with pytest.raises(InputError, match=r"X would leave its travel, -5 to 5 mm, at 10\.000; choose one inside"):
        jog.step("X", 1)


def test_a_step_goes_from_where_the_axis_is_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten steps of 0.01 mm from the measured position went 0.08 mm, and ten back 0.14 mm."""
    jog, orders = Jog(Session(tmp_path)), []
    monkeypatch.setattr(jog, "_order", lambda **order: orders.append(order))
    jog._hear({"measured": {"X": 0.993}, "places": {"X": 1.0}, "moving": False, "homing": ""})
    jog.choices.set("step", "0.01")
    jog.step("X", 1)
    assert orders == [{"goals": [["X", 1.01]], "speed": None}]


def test_steps_add_up_while_the_axis_is_still_on_its_way(jog: Jog) -> None:
    """Two presses of 1 mm, one soon after the other, went 1.3 mm."""
    jog.choices.set("step", "1")
    for _ in range(2):
        jog.step("Y", 1)
    wait_for(lambda: jog.positions["Y"] == pytest.approx(2.0, abs=0.008))
    jog.step("Y", 1)
    jog.rest()
    wait_for(lambda: not jog.moving)
    assert jog._stepped == {}  # it was not to come there after all


def test_one_hand_at_a_time_and_the_emergency_stop_ends_it(jog: Jog) -> None:
    with pytest.raises(InputError, match="in use"):
        Session(jog.session.folder).take_machine("something else", object())
    jog.hold("X", 1)
    assert "4 modules are at zero volts" in jog.session.emergency_stop()
    assert not jog.ready
    Session(jog.session.folder).take_machine("something else", object())
    with pytest.raises(InputError):
        jog.hold("X", 1)


def test_who_is_stopped_while_taking_the_machine_does_not_have_it_after_all(alone: Path) -> None:
    jog = Jog(Session(alone))
    task = jog.begin()
    jog.stop()  # as the emergency stop does
    assert task.done and task.stopped and not jog.ready
    assert jog.session.machine_user is None and jog._loop is None and jog._server is None


def test_the_machine_is_given_back_where_no_thread_is_to_be_had(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none_left(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    jog = Jog(Session(alone))
    monkeypatch.setattr("rds.panels.session.session.Task.start", none_left)
    with pytest.raises(RuntimeError):
        jog.begin()
    assert jog.session.machine_user is None
    Session(alone).take_machine("something else", object())


def test_a_loop_that_cannot_read_an_order_lets_the_machine_go(jog: Jog) -> None:
    assert jog._loop is not None and jog._loop.stdin is not None
    jog._loop.stdin.write('{"hold": "Q", "direction": 1, "speed": 1}\n')
    jog._loop.stdin.flush()
    wait_for(lambda: jog.session.machine_user is None)
    assert not jog.ready and "take the machine again" in jog.error


def test_what_an_interface_prints_is_no_word_of_the_loop(alone: Path) -> None:
    jog = Jog(Session(alone))
    jog.session.take_machine("jogging", jog)
    words = ("adapter 3 opened", "7", '{"error": "X is lost"}')
    said = [sys.executable, "-c", f"print(*{words!r}, sep=chr(10))"]
    with subprocess.Popen(said, stdout=subprocess.PIPE, text=True) as jog._loop:
        _listen(weakref.ref(jog), jog._loop)
    assert jog.error == "X is lost" and jog.session.machine_user is None


DIES = """
import sys, time
from rds.panels.session import Session
from rds.panels.jog.state import Jog
jog = Jog(Session(sys.argv[1]))
jog.begin().wait(30)
while True:
    jog.hold("X", 1)
    print(jog._loop.pid, jog.positions["X"], flush=True)
    time.sleep(0.05)
"""


def test_whoever_gave_orders_dies_and_the_loop_ends_with_it(alone: Path) -> None:
    page = subprocess.Popen([sys.executable, "-c", DIES, str(alone)], stdout=subprocess.PIPE, text=True)
    assert page.stdout is not None
    for line in page.stdout:
        if float(line.split()[1]) > 0.5:
            break
    loop = int(line.split()[0])
    os.kill(page.pid, signal.SIGKILL)
    page.wait()
    page.stdout.close()
    wait_for(lambda: not Path(f"/proc/{loop}").exists() or "\nState:\tZ" in Path(f"/proc/{loop}/status").read_text())
    Session(alone).take_machine("a run after it", object())


def test_a_hold_lasts_as_long_as_it_is_renewed_and_goals_follow_each_other() -> None:
    machine = load_machine("mini-cnc")
    orders = JogCommands(jog_axes(machine), jog_spindles(machine))
    orders.hear({"hold": "X", "direction": -1, "speed": 99.0}, 10.0)
    assert orders.wanted(10.0 + DEAD_MAN) == ("X", -75.0, 13.0)  # its own limit
    assert orders.wanted(10.01 + DEAD_MAN) is None
    orders.hear({"goals": [["Z", 0.0], ["X", 1.0]], "speed": 2.0}, 11.0)
    assert orders.wanted(11.0) == ("Z", 0.0, 2.0)
    orders.reached("Z", 0.0)
    assert orders.wanted(20.0) == ("X", 1.0, 2.0)
    orders.hear({"stop": True}, 21.0)
    assert orders.wanted(21.0) is None


def test_orders_that_come_late_move_nothing() -> None:
    """Whoever gave them may have gone: a loop that stood still carried them out when it went on."""
    machine = load_machine("mini-cnc")
    orders = JogCommands(jog_axes(machine), jog_spindles(machine))
    late = 10.0 - LATE - 4.0
    orders.hear({"goals": [["Z", 5.0]], "speed": 2.0}, 9.0)
    orders.hear({"goals": [["X", 1.0]], "speed": 2.0, "at": late}, 10.0)
    assert orders.wanted(10.0) is None and orders.late() == 7.0 and orders.late() is None
    orders.hear({"home": {"X": 17}, "speed": 2.0, "at": late}, 10.0)
    assert not orders.homing and orders.late() == 7.0
    orders.hear({"hold": "X", "direction": 1, "speed": 2.0, "at": 9.9}, 10.0)
    assert orders.wanted(9.9 + DEAD_MAN) is not None and orders.wanted(9.91 + DEAD_MAN) is None
    orders.hear({"turn": "spindle", "speed": 900.0, "at": 9.0}, 10.1)
    assert orders.turning(10.1) == {"spindle": 0.0}
    orders.hear({"turn": "spindle", "speed": 900.0, "at": 10.1}, 10.2)
    orders.hear({"halt": True, "speed": 2.0, "at": late}, 10.3)  # what stops is never too late
    assert orders.turning(10.3) == {"spindle": 0.0} and orders.late() is None


def test_what_came_late_to_the_loop_is_said_on_the_page(tmp_path: Path) -> None:
    jog = Jog(Session(tmp_path))
    jog._hear({"late": 7.2})
    assert "was pressed 7 s ago" in jog.session.messages[-1].text


def test_the_machine_is_taken_again_at_once_while_its_bus_outlives_its_modules(jog: Jog) -> None:
    jog.end()
    task = jog.begin()
    assert task.wait(PATIENCE)
    assert task.error is None and jog.ready


def test_what_has_no_position_is_not_jogged() -> None:
    assert list(jog_axes(load_machine("mini-cnc"))) == ["X", "Y", "Z"]
    assert list(jog_axes(load_machine("mrmt-oacs"))) == ["X", "Z", "A"]


def test_an_axis_is_moved_from_the_command_line_as_from_the_panel(alone: Path) -> None:
    runner = CliRunner()
    done = runner.invoke(app, ["jog", "X", "--by", "1", "--speed", "10", "--json"])
    assert done.exit_code == 0, done.stderr
    said = json.loads(done.stdout)
    assert said == {"axis": "X", "position": pytest.approx(1.0, abs=0.01), "unit": "mm"}
    for words, why in (
        (["X"], "nothing is given"),
        (["X", "--by", "1", "--to", "1"], "--by and --to are given"),
        (["X", "--for", "1"], "--for is given: move X by a distance with --by"),
        (["spindle", "--by", "1"], "--by is given: spindle is a spindle, which turns at a speed for a time"),
        (["spindle", "--for", "1"], "say how fast it shall turn"),
        (["X", "--find-home", "17", "--speed", "1"], "a drive homes at speeds of its own"),
        (["X", "--to", "999"], "would leave its travel"),
        (["Q", "--by", "1"], "there is nothing called 'Q' to jog; there are X, Y, Z, spindle"),
    ):
        refused = runner.invoke(app, ["jog", *words, "--json"])
        assert refused.exit_code == 2 and why in refused.stderr and not refused.stdout


def test_an_axis_settles_and_is_told_to_stand_before_its_modules_end(alone: Path) -> None:
    """It was told to stand at 1.02 mm, and that no zero volts could be sent to units that had been ended before."""
    words = [sys.executable, "-m", "rds", "jog", "X", "--by", "1", "--machine", "starmill", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=4 * PATIENCE)
    assert done.returncode == 0 and done.stderr == ""
    assert json.loads(done.stdout)["position"] == pytest.approx(1.0, abs=0.011)
