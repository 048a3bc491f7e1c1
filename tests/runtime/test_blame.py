"""Verdicts of real runs: the slow are blamed, the stalled are not. `met` is asserted nowhere: computers are busy."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lost_machines import unless_lost
from misbehaviour import busy, every, send

import rds
from rds.modes.process import second_look

pytestmark = pytest.mark.realtime

Maker = Callable[..., rds.Experiment]


@pytest.mark.parametrize(
    ("wait", "samples", "mode"),
    [
        pytest.param(busy, 1, "implementation", id="computes always"),
        pytest.param(busy, 50, "emulation", id="computes now and then"),
        pytest.param(time.sleep, 1, "emulation", id="sleeps always"),
        pytest.param(time.sleep, 50, "implementation", id="sleeps now and then"),
    ],
)
def test_two_milliseconds_of_one_are_missed(experiment: Maker, wait: Any, samples: int, mode: str) -> None:
    slow = experiment(every(samples, lambda: wait(0.002)), duration=0.25 if samples == 1 else 0.5)
    result = unless_lost(lambda: slow.run(mode))
    assert result.verdict == "missed"
    assert "control() and the model took " in result.meta["verdict_reason"]
    assert result.meta["ending"] == "done"
    assert result.meta["timing"]["compute"]["max"] >= 2000.0


def test_a_slow_model_is_missed(experiment: Maker) -> None:
    def advance(x: Any, u: Any, T: float, params: Any) -> Any:
        busy(0.0015)
        return x

    slow = experiment(model=advance, duration=0.25)
    assert unless_lost(lambda: slow.run("emulation")).verdict == "missed"


def test_a_single_slow_call_comes_back_when_it_is_made_again(experiment: Maker) -> None:
    slow_once = experiment(every(300, lambda: busy(0.03)), duration=0.4)
    result = unless_lost(lambda: slow_once.run("emulation"))
    assert result.verdict == "missed"


@pytest.mark.parametrize("wait", [busy, time.sleep])
def test_a_stall_longer_than_any_patience_is_missed(
    experiment: Maker, wait: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second look that goes through the whole run with a fixed patience gave up, and called the computer slow."""
    monkeypatch.setattr(second_look, "STARTING", 1.0)  # s: what a fixed patience would be
    stalls_once = experiment(every(300, lambda: wait(1.0)), duration=0.4)
    result = unless_lost(lambda: stalls_once.run("emulation"))
    assert result.verdict == "missed"


@pytest.mark.parametrize("apart", [False, True])
def test_what_a_run_started_is_started_once_and_ends_with_it(experiment: Maker, alone: Path, apart: bool) -> None:
    noted = alone / "started"

    def start() -> None:
        child = subprocess.Popen(["sleep", "600"], start_new_session=apart)
        with open(noted, "a") as file:
            file.write(f"{child.pid}\n")
        time.sleep(0.02)

    result = unless_lost(lambda: experiment(every(150, start), duration=0.2).run("emulation"))
    assert result.verdict in ("missed", "void")
    numbers = noted.read_text().split()
    assert len(numbers) == 1
    assert not Path(f"/proc/{numbers[0]}").exists()


def test_a_thread_that_takes_the_processor_is_missed(experiment: Maker) -> None:
    def spin() -> None:
        busy(2.0)

    def start() -> None:
        threading.Thread(target=spin, daemon=True).start()

    starting = experiment(every(80, start), duration=0.1)
    result = unless_lost(lambda: starting.run("emulation"))
    if result.meta["environment"]["rehearsal"]["stalls"] == 0:
        assert result.verdict == "missed"
    assert result.meta["environment"]["threads"] >= 1


def test_who_is_stopped_is_not_blamed(experiment: Maker, alone: Path) -> None:
    stops = []

    def stop_now_and_then(samples: int, of: int) -> None:
        if samples > 120 * (len(stops) + 1) and len(stops) < 6:
            stops.append(samples)
            send(alone / "run", "target", signal.SIGSTOP)
            time.sleep(0.05)
            send(alone / "run", "target", signal.SIGCONT)

    result = experiment(duration=1.3).run("emulation", out=alone / "run", progress=stop_now_and_then)
    assert len(stops) >= 3
    assert result.verdict == "void"
    assert result.meta["timing"]["late"] >= 3 * 40
    assert f"stopped from outside {len(stops)} times (SIGSTOP" in result.meta["verdict_evidence"]
    assert "Repeat it on a quieter computer" in result.meta["verdict_reason"]


def test_who_is_stopped_and_slow_is_blamed(experiment: Maker, alone: Path) -> None:
    stops = []

    def stop_now_and_then(samples: int, of: int) -> None:
        if len(stops) < 6 and samples > 50:
            with contextlib.suppress(FileNotFoundError):  # the run has just ended
                send(alone / "run", "target", signal.SIGSTOP)
                time.sleep(0.05)
                send(alone / "run", "target", signal.SIGCONT)
                stops.append(samples)

    slow = experiment(every(1, lambda: busy(0.002)), duration=0.5)
    assert slow.run("emulation", out=alone / "run", progress=stop_now_and_then).verdict == "missed"
    assert stops


HOG = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
print("ready", flush=True)
for _ in range(int(sys.argv[2])):
    time.sleep(0.135 - time.monotonic() % 0.135)  # the same instants on all processors, or the loop moves to a free one
    end = time.monotonic() + 0.015
    while time.monotonic() < end:
        pass
"""


def test_whose_processor_is_taken_is_not_blamed(experiment: Maker) -> None:
    """Something more urgent takes all processors at once for 15 ms, seven times in the run's second."""
    if not hasattr(os, "sched_setscheduler"):
        pytest.skip("no scheduling classes here")
    probe = subprocess.run([sys.executable, "-c", HOG, str(min(os.sched_getaffinity(0))), "0"], capture_output=True)
    if probe.returncode:
        pytest.skip("real-time priority is not permitted here")
    commands = [[sys.executable, "-c", HOG, str(cpu), "1000"] for cpu in os.sched_getaffinity(0)]
    hogs = [subprocess.Popen(command, stdout=subprocess.PIPE) for command in commands]
    try:
        for hog in hogs:
            assert hog.stdout is not None
            hog.stdout.readline()
        result = unless_lost(lambda: experiment(duration=1.0).run("emulation"))
    finally:
        for hog in hogs:
            hog.kill()
            hog.communicate()
    assert result.verdict == "void"
    assert result.meta["timing"]["late"] >= 3 * 10
