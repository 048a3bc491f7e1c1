"""Processes killed in the middle of a run: every sample so far is kept, and the machine comes to rest."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from lost_machines import TRIES, unless_lost
from misbehaviour import every, process, send
from typer.testing import CliRunner
from waiting import wait_for

import rds
from rds.bus.hub.address import runtime_directory
from rds.bus.hub.command import Command, commanded, remove_left
from rds.bus.modules.calling import find_machine
from rds.bus.modules.dialects import server_module
from rds.bus.modules.rds.frames import CALL, Kind, Status, answer_identifier, decode_answer
from rds.bus.modules.server_process import start_server
from rds.cli.main import app
from rds.core.contracts import Counters
from rds.modes.loop.changes import stop_channel
from rds.modes.loop.live_values import LiveValues
from rds.modes.process import recorder, target
from rds.modes.process.machine import machine_behind
from rds.modes.process.recorder import CLOSING, READY, Recorder, conclude, watch
from rds.modes.process.ring import Ring
from rds.results import Result

pytestmark = pytest.mark.realtime

Maker = Callable[..., rds.Experiment]
During = Callable[..., Callable[[int, int], None]]

FILE = """
axis = "X"
mode = "{mode}"
duration = {duration}

[reference]
kind = "sinusoid"
amplitude = 2.0
frequency = 1.0

[controller]
name = "p"

[bus]
channel = "{channel}"
"""

HOST = """
import subprocess
from rds.cli.main import main

class Popen(subprocess.Popen):
    def __init__(self, command, **options):  # a machine that nobody needs any more ends after 3 s instead of 10
        super().__init__([*command, *(["--afterlife", "3"] if "--exit-with-stdin" in command else [])], **options)

subprocess.Popen = Popen
main()
"""


@contextmanager
def served(channel: str, dialect: str = "rds") -> Iterator[subprocess.Popen[str]]:
    """A machine of our own on the built-in bus."""
    command = [sys.executable, "-m", server_module(dialect), "mini-cnc", "--channel", channel]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert server.stdout is not None
        assert server.stdout.readline().startswith("ready")
        yield server
    finally:
        server.terminate()
        server.communicate(timeout=10)


def statuses(channel: str) -> set[Status]:
    """What the modules of the channel say of themselves."""
    import can

    nodes = [answer_identifier(axis.node) for axis in rds.load_machine("mini-cnc").axes.values()]
    found = {}
    with can.Bus(interface="rds", channel=channel) as bus:
        bus.send(can.Message(arbitration_id=CALL, is_extended_id=False, data=b""))
        deadline = time.monotonic() + 2.0
        while len(found) < len(nodes) and time.monotonic() < deadline:
            message = bus.recv(0.1)
            if message is not None and message.arbitration_id in nodes:
                answer = decode_answer(message.arbitration_id, message.data)
                if answer.kind == Kind.REPORT:
                    found[message.arbitration_id] = answer.status
    assert len(found) == len(nodes)
    return set(found.values())


def started(
    folder: Path, mode: str, duration: float, channel: str, tries: int = TRIES, **options: Any
) -> subprocess.Popen[str]:
    """`rds run` of an experiment in a process of its own, when its record has begun to grow."""
    experiment = folder / "experiment.toml"
    experiment.write_text(FILE.format(mode=mode, duration=duration, channel=channel))
    command = [sys.executable, "-c", HOST, "run", str(experiment), "--out", str(folder / "run"), "--json"]
    host = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
    wait_for(lambda: (folder / "run" / "record.rds").is_file() or host.poll() is not None)
    if host.poll() is not None:
        said = host.communicate()
        assert "no answer from" in said[1] and tries > 1, said  # else the computer has held the machine up
        return started(folder, mode, duration, channel, tries - 1, **options)
    return host


def check_readable(folder: Path, ending: str, at_least: int = 100) -> Result:
    result = rds.open_result(folder)
    assert result.meta["ending"] == ending
    assert len(result) >= at_least
    samples = np.rint(result["time"] / 0.001)
    assert (np.diff(samples) >= 1).all()
    assert np.isfinite(result["X_measured"]).all()
    return result


def test_a_killed_target(experiment: Maker, during: During, alone: Path) -> None:
    kill = during(lambda: send(alone / "run", "target"), 300)
    with served("own") as _:
        own = experiment(bus={"channel": "own"}, duration=5.0)
        result = own.run("implementation", out=alone / "run", progress=kill)
        assert result.meta["ending"] == "killed"
        assert "signal 9" in result.meta["ending_reason"]
        wait_for(lambda: statuses("own") == {Status.WATCHDOG})
    assert 300 <= len(result) < 4500
    saved = check_readable(alone / "run", "killed", 300)
    assert (saved["X_measured"] == result["X_measured"]).all()
    for name in ("result.parquet", "result.csv", "result.mat", "result.json"):
        (alone / "run" / name).unlink()
    raw = check_readable(alone / "run", "killed", 300)
    assert (raw["X_measured"] == result["X_measured"]).all()


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[subprocess.Popen[bytes], Recorder]]:
    """A target that takes no samples, and its recorder, who is impatient."""
    monkeypatch.setattr(recorder, "HANG_AFTER", 0.3)
    ring = Ring.create(tmp_path / "a.ring", ["sample"], 10)
    LiveValues.create(ring.live_values_path, []).close()
    ring.beat(READY)
    with subprocess.Popen([sys.executable, "-S", "-c", "input()"], stdin=-1, stderr=subprocess.DEVNULL) as target:
        yield target, Recorder(tmp_path, ring)
        target.kill()
    ring.close()


@pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="no /proc here")
def test_a_target_that_was_stopped_is_not_the_codes_fault(recorded: tuple[subprocess.Popen[bytes], Recorder]) -> None:
    """The student was to look for a loop without an end."""
    target, its = recorded
    target.send_signal(signal.SIGSTOP)
    hung = watch(target, its, 0.001)
    assert hung is not None and hung[0] == "killed"
    assert "stopped from outside" in hung[1] and target.returncode == -signal.SIGKILL


def test_the_time_of_a_hang_counts_discarded_periods(recorded: tuple[subprocess.Popen[bytes], Recorder]) -> None:
    target, its = recorded
    for sample in (0, 1, 2, 7):  # four came too late and were discarded
        its.ring.append([sample])
    hung = watch(target, its, 0.001)
    assert hung is not None and "at t = 0.008 s" in hung[1]


def test_a_loop_that_has_ended_has_time_to_brake(
    recorded: tuple[subprocess.Popen[bytes], Recorder], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drives may brake for 5 s, and a bus not answer for 5 s: the student's code was said to hang."""
    monkeypatch.setattr(recorder, "CLOSES_WITHIN", 0.5)
    process, its = recorded
    its.ring.beat(CLOSING)
    began = time.monotonic()
    hung = watch(process, its, 0.001)
    assert time.monotonic() - began > 0.5
    assert hung is not None and hung[0] == "machine lost"
    assert "had not let go of the machine" in hung[1] and "control()" not in hung[1]


@pytest.mark.parametrize("stop, ending", [(False, ("machine lost", "lost")), (True, ("stopped", "stopped while X"))])
def test_homing_may_last_and_be_stopped(
    recorded: tuple[subprocess.Popen[bytes], Recorder], monkeypatch: pytest.MonkeyPatch, stop: bool, ending: Any
) -> None:
    """It has a time of its own, longer than that of all the rest: a stop was heard only when it was over."""
    ring, beats = recorded[1].ring, []
    ring.beat(0)

    def start(homing: Callable[[str, float], None]) -> None:
        for place in range(3):
            homing("X", place)
            beats.append(ring.heartbeat)
        if stop:
            ring.ask_to_stop()
            homing("X", 3.0)
        raise rds.MachineError("lost")

    drivers = SimpleNamespace(start=start, close=lambda: None, counters=Counters())
    monkeypatch.setattr(target, "prepare", lambda priority, cpu: {})
    monkeypatch.setattr("rds.bus.modules.dialects.open_drivers", lambda *_: drivers)
    plan: Any = SimpleNamespace(mode="implementation", T=0.001, late=None, priority=0, cpu=None, machine=None, names=[])
    plan.bus = {"interface": "virtual"}
    report = target.run(plan, ring, LiveValues.open(ring.live_values_path))
    assert report["ending"] == ending[0] and report["reason"].startswith(ending[1])
    assert len(set(beats[:2])) == 2 and max(beats) < READY
    assert ring.heartbeat == CLOSING


def test_a_recorder_that_was_held_up_kills_nobody(
    recorded: tuple[subprocess.Popen[bytes], Recorder], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All processes of a container are paused together, and the clock goes on."""
    target, its = recorded
    now = [time.monotonic()]
    waits = [0.05, 0.05, 60.0, 0.05]

    def wait(process: subprocess.Popen[bytes], seconds: float) -> None:
        now[0] += waits.pop()
        if not waits:
            process.kill()
            process.wait()

    monkeypatch.setattr(recorder, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(recorder, "wait_for_end", wait)
    assert watch(target, its, 0.001) is None


def test_what_is_kept_of_a_killed_run_is_said_only_if_there_is_something(tmp_path: Path) -> None:
    assert conclude(tmp_path, 10, -9, None)["reason"].endswith("by signal 9; its samples up to then are kept")
    assert conclude(tmp_path, 0, -9, None)["reason"].endswith("by signal 9, before its first sample")


def test_the_command_of_a_killed_run_is_cleared_away(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each had a channel of its own, and its file stayed."""
    monkeypatch.setattr("rds.bus.hub.command._YOUNG", -1.0)
    folder = runtime_directory()
    (folder / "killed.command").write_text("process 1")
    with Command("living"):
        remove_left()
        assert [path.name for path in folder.glob("*.command")] == ["living.command"]


def test_what_an_earlier_run_without_a_recorder_left_is_not_taken_for_this_one_s(tmp_path: Path) -> None:
    """Here the target is a module of Python's that ends at once."""
    about = {"run": "1", "sample_period": 0.001, "samples": 10, "units": {}}
    ring = Ring.create(tmp_path / "rds-0.ring", ["sample"], 10, **about)
    LiveValues.create(ring.live_values_path, [stop_channel()]).close()
    (tmp_path / "target.json").write_text('{"ending": "done", "reason": ""}')
    command = [sys.executable, "-P", "-m", "rds.modes.process.recorder", str(tmp_path), str(ring.path), "keyword"]
    subprocess.run(command, check=True)
    ring.close()
    assert json.loads((tmp_path / "unstarted.json").read_text())["ending"] == "killed"


def test_who_only_looks_keeps_nobody_from_the_command(alone: Path) -> None:
    looks = Command("own")
    assert looks.acquire() and commanded("own")
    given_back = threading.Timer(0.02, looks.release)
    given_back.start()
    with Command("own"):
        given_back.join()


@pytest.mark.parametrize(("mode", "told"), [("implementation", 1), ("emulation", 0)])
def test_who_gets_a_machine_of_its_own_beside_a_served_one_is_told(
    experiment: Maker, alone: Path, monkeypatch: pytest.MonkeyPatch, mode: str, told: int
) -> None:
    """The run moved a simulated machine that nobody saw, without a word, while another one moved the served one."""
    monkeypatch.setattr("rds.bus.hub.address.channels", lambda: ["mini-cnc"])
    monkeypatch.setattr("rds.bus.modules.server_process.start_server", lambda *_: None)
    monkeypatch.setattr("rds.bus.modules.server_process.end_server", lambda _: None)
    plan = experiment().plan(mode)
    with warnings.catch_warnings(record=True) as said, Command("mini-cnc"), machine_behind(plan) as settled:
        assert settled.bus["channel"].startswith("mini-cnc-")
    assert len(said) == told and all("a simulated machine of its own" in str(each.message) for each in said)


def test_a_machine_that_is_killed_before_it_is_there(alone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was said to have said nothing."""
    (alone / "python").write_text("#!/bin/sh\nkill -9 $$\n")
    (alone / "python").chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(alone / "python"))
    with pytest.raises(rds.MachineError, match="did not start: its process was ended by signal 9"):
        start_server("rds", "mini-cnc", "own")


def test_every_sample_before_the_kill_is_on_the_disk(experiment: Maker, during: During, alone: Path) -> None:
    """Not only those of the recorder's last look: the ring outlives the target."""
    heads = []

    def kill() -> None:
        send(alone / "run", "target", signal.SIGSTOP)
        ring = next(path for path in mapped(process(alone / "run", "target")))
        opened = Ring.open(ring)
        heads.append(opened.head)
        opened.close()
        send(alone / "run", "target")

    result = experiment(duration=5.0).run("emulation", out=alone / "run", progress=during(kill))
    assert len(result) == heads[0]


def mapped(number: int) -> list[str]:
    maps = Path(f"/proc/{number}/maps")
    if not maps.is_file():
        pytest.skip("no /proc here")
    return [line.split()[-1] for line in maps.read_text().splitlines() if line.endswith(".ring")]


def test_a_killed_host_leaves_the_run_going_to_its_end(alone: Path) -> None:
    host = started(alone, "implementation", 2.0, "own")
    host.kill()
    host.communicate()
    wait_for(lambda: (alone / "run" / "ending.json").is_file())
    result = check_readable(alone / "run", "done")
    assert len(result) >= 1000  # the rest were discarded, on a busy computer
    assert result["time"][-1] > 1.5
    wait_for(lambda: not find_machine(rds.load_machine("mini-cnc"), channel="own"), 20.0)  # nobody needs it now
    assert sorted(path.name for path in (alone / "run").iterdir()) == ["ending.json", "record.rds"]


def test_a_killed_recorder(experiment: Maker, during: During, alone: Path) -> None:
    numbers = []

    def kill() -> None:
        numbers.append(process(alone / "run", "target"))
        send(alone / "run", "recorder")

    result = experiment(duration=5.0).run("emulation", out=alone / "run", progress=during(kill))
    assert result.meta["ending"] == "killed"
    assert "the recorder process was ended from outside, by signal 9" in result.meta["ending_reason"]
    check_readable(alone / "run", "killed", 200)
    command = Path(f"/proc/{numbers[0]}/cmdline")
    assert not command.is_file() or not command.read_bytes()  # gone, or waiting for an init that doesn't look
    assert not {"plan.pickle", "target.json", "processes.json"} & {path.name for path in (alone / "run").iterdir()}


def test_a_recorder_that_fails_by_itself_says_why(experiment: Maker, alone: Path) -> None:
    """It was said to have been ended from outside."""
    (alone / "run" / "target.log").mkdir(parents=True)  # where it would write what the target says
    with pytest.raises(rds.RdsError, match=r"recorder process failed with code 1; .* IsADirectoryError.*target\.log"):
        experiment(duration=0.1).run("emulation", out=alone / "run")


def test_a_machine_that_is_lost_in_the_middle(alone: Path) -> None:
    with served("own") as server:
        host = started(alone, "implementation", 20.0, "own")
        server.kill()
        said, errors = host.communicate(timeout=120)
    assert host.returncode == 1
    assert json.loads(said)["ending"] == "machine lost"
    assert "no answer from X (node 2)" in errors
    check_readable(alone / "run", "machine lost", 10)


@pytest.mark.parametrize("dialect", ["rds", "cia402"])
def test_a_machine_that_is_lost_at_the_beginning_is_not_the_loops_fault(
    experiment: Maker, during: During, alone: Path, dialect: str
) -> None:
    """Nearly all of such a short run is waiting for the dead machine: its bus was said to be too slow."""
    with served("own", dialect) as server:
        own = experiment(bus={"channel": "own", "dialect": dialect}, sample_period=0.02)
        result = own.run("implementation", out=alone / "run", progress=during(server.kill, 1))
    assert result.meta["ending"] == "machine lost"
    assert result.meta["drivers"]["silent"] >= 9, "the tenth ended the run, and has no row"
    assert result.verdict == "void", result.meta["verdict_reason"]


def test_a_machine_that_is_not_there(alone: Path) -> None:
    """On a bus that is not the built-in one, nothing is started in its place."""
    bus = 'interface = "virtual"\n'
    (alone / "e.toml").write_text(FILE.format(mode="implementation", duration=1.0, channel="empty") + bus)
    done = CliRunner().invoke(app, ["run", "e.toml", "--out", "run", "--json"])
    assert (done.exit_code, done.stdout) == (2, "")
    assert "no answer from X (node 2) on bus virtual:empty" in done.stderr
    assert "rds machine serve mini-cnc" in done.stderr
    assert not (alone / "run").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["ctrl-c", "polite kill"])
def test_an_interrupted_run_stops_safely_and_is_saved(alone: Path, number: signal.Signals) -> None:
    """After a polite kill it said "stopped", and the axes moved on to the end of the run."""
    with served("own"):
        host = started(alone, "implementation", 20.0, "own", start_new_session=True)
        os.killpg(host.pid, number)
        said, errors = host.communicate(timeout=120)
        assert host.returncode == 1, errors
        wait_for(lambda: statuses("own") == {Status.WATCHDOG})  # after a last command of zero volts
    outcome = json.loads(said)
    assert outcome["ending"] == "stopped"
    assert "the run ended early (stopped)" in errors
    assert (alone / "run" / "result.parquet").is_file()
    check_readable(alone / "run", "stopped", 1)


def test_a_polite_kill_of_the_target_stops_safely(experiment: Maker, during: During, alone: Path) -> None:
    stop = during(lambda: send(alone / "run", "target", signal.SIGTERM))
    result = experiment(duration=10.0).run("implementation", out=alone / "run", progress=stop)
    assert result.meta["ending"] == "stopped"


# --- a student's code that ends a run -----------------------------------------------------------------------------


def at_once(t: float, what: Callable[[], Any]) -> Callable[..., Any]:
    """A controller whose answer at time `t` is what `what()` returns, if it returns."""

    def control(now: float, r: Any, y: float, state: Any, params: Any) -> tuple[Any, Any]:
        return (what() if now >= t - 1e-9 else 0.5), state

    return control


def fails() -> float:
    return 1 / 0


FAULTS = {
    "nan": (lambda: float("nan"), r"returned the voltage nan at t = 1\.000 s \(axis X\); it must return"),
    "raises": (fails, r"ZeroDivisionError: division by zero.*\(at t = 1\.000 s\)"),
    "text": (lambda: "5 V", r"returned the voltage '5 V' at t = 1\.000 s"),
    "sys.exit": (lambda: sys.exit(3), r"SystemExit: 3.*\(at t = 1\.000 s\)"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_simulation(experiment: Maker, alone: Path, fault: str) -> None:
    what, said = FAULTS[fault]
    with pytest.raises(rds.ContractError, match=said):
        experiment(at_once(1.0, what)).run(out=alone / "run")
    kept = rds.open_result(alone / "run")
    assert kept.meta["ending"] == "fault" and kept["time"][-1] < 1.0


@pytest.mark.parametrize(
    ("fault", "mode"),
    [("nan", "implementation"), ("raises", "implementation"), ("text", "emulation"), ("sys.exit", "implementation")],
)
def test_a_fault_in_real_time(experiment: Maker, alone: Path, fault: str, mode: str) -> None:
    what, said = FAULTS[fault]
    with pytest.raises(rds.ContractError, match=said.replace(r"1\.000", r"0\.2\d\d")):
        unless_lost(lambda: experiment(at_once(0.2, what)).run(mode, out=alone / "run"))
    result = check_readable(alone / "run", "fault", 100)
    assert result["time"][-1] < 0.3
    kept = sorted(path.name for path in (alone / "run").iterdir() if path.suffix != ".log")
    assert kept == ["ending.json", "record.rds"]


def test_a_controller_that_hangs_is_killed(experiment: Maker, alone: Path) -> None:
    def hang() -> None:
        while True:
            time.sleep(0.01)  # what hangs and takes the processor meanwhile is in test_blame.py

    started = time.monotonic()
    with pytest.raises(
        rds.ContractError, match=r"did not return for 5 s at t = 0\.(4\d\d|500) s, in test_killed\.py, line \d+, in ha"
    ):  # on a busy computer the period before may have been discarded
        unless_lost(lambda: experiment(at_once(0.5, hang)).run("implementation", out=alone / "run"))
    assert time.monotonic() - started > 5.0
    assert len(check_readable(alone / "run", "fault", 400)) <= 500


def test_a_controller_that_ends_the_process(experiment: Maker, alone: Path) -> None:
    ending = experiment(at_once(0.5, lambda: os._exit(7)))
    result = unless_lost(lambda: ending.run("implementation", out=alone / "run"))
    assert result.meta["ending"] == "killed"
    assert "ended with code 7 by itself" in result.meta["ending_reason"]
    assert len(result) <= 500


@pytest.mark.parametrize("mode", ["emulation", "implementation"])
def test_what_a_controller_prints_is_kept_apart(
    experiment: Maker, alone: Path, capfd: pytest.CaptureFixture[str], mode: str
) -> None:
    talking = experiment(every(100, lambda: print("hello")), duration=0.5)
    result = unless_lost(lambda: talking.run(mode, out=alone / "run"))
    assert capfd.readouterr().out == ""  # nor what the simulation beside an implementation prints
    assert "what your code printed during the run is in target.log, in the folder of the run" in result.meta["notes"]
    printed = (alone / "run" / "target.log").read_text().count("hello")
    assert printed == len(result) // 100 > 1  # a busy computer leaves samples out


def test_what_a_law_writes_as_bytes_stops_no_simulation_beside_a_run(
    experiment: Maker, alone: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def write() -> None:
        sys.stdout.buffer.write(b"hello\n")
        sys.stdout.flush()

    talking = experiment(every(100, write), duration=0.5, compiled=True)
    result = unless_lost(lambda: talking.run("implementation", out=alone / "run"))
    assert capfd.readouterr().out == "" and "X_simulated" in result.columns
    told = [note for note in result.meta["notes"] if note.startswith(("not compiled", "what your code printed"))]
    assert len(told) == 2  # what is said of the compiler takes nothing else away


def test_too_many_late_samples_in_a_row_end_the_run(experiment: Maker) -> None:
    def slow() -> None:
        time.sleep(0.002)

    late = experiment(every(1, slow), timing={"stop_after": 20, "late": "process"})
    result = unless_lost(lambda: late.run("emulation"))
    assert (result.meta["ending"], result.verdict) == ("overloaded", "missed")
    assert 20 <= len(result) <= 40


# --- folders ------------------------------------------------------------------------------------------------------


def test_a_new_run_replaces_an_earlier_one_in_its_folder(experiment: Maker, during: During, alone: Path) -> None:
    """Its record from its first sample on: a kill must not leave the old result under the new run's name."""
    first = unless_lost(lambda: experiment(duration=0.3).run("emulation", out=alone / "run"))
    assert len(first) == 300
    second = unless_lost(lambda: experiment(duration=0.2).run("emulation", out=alone / "run"))
    assert len(second) == len(rds.open_result(alone / "run")) == 200
    seen = []

    def look() -> None:
        seen.append(rds.open_result(alone / "run"))

    experiment(duration=0.6).run("implementation", out=alone / "run", progress=during(look, 300))
    assert seen[0].meta["ending"] == "killed"  # nothing better is known of it so far
    assert seen[0].mode == "implementation"


def test_a_run_that_never_began_leaves_the_earlier_one(experiment: Maker, alone: Path) -> None:
    first = unless_lost(lambda: experiment(duration=0.2).run("emulation", out=alone / "run"))
    with served("own"), Command("own"), pytest.raises(rds.MachineError, match="another run commands the machine"):
        experiment(duration=0.2, bus={"channel": "own"}).run("emulation", out=alone / "run")
    assert (rds.open_result(alone / "run")["time"] == first["time"]).all()
    assert not {"unstarted.json", "plan.pickle"} & {path.name for path in (alone / "run").iterdir()}


def test_two_runs_do_not_share_a_folder(experiment: Maker, during: During, alone: Path) -> None:
    said = []

    def again() -> None:
        with pytest.raises(rds.InputError, match="another run is being recorded there") as refusal:
            experiment(duration=0.2).run("emulation", out=alone / "run")
        said.append(str(refusal.value))

    first = experiment(duration=0.5)
    result = unless_lost(lambda: first.run("emulation", out=alone / "run", progress=during(again, 0)))
    assert said
    assert result.meta["ending"] == "done"


def test_what_cannot_be_sent_to_the_target_is_refused(experiment: Maker, alone: Path) -> None:
    lock = threading.Lock()

    def control(t: float, r: Any, y: float, state: Any, params: Any) -> Any:
        with lock:
            return 0.0, state

    experiment(control, duration=0.1).run()
    with pytest.raises(rds.ContractError, match=r"cannot pickle '_thread.lock' object; keep open files, locks"):
        experiment(control).run("emulation", out=alone / "run")
    assert not (alone / "run").exists()
