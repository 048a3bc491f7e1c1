"""Whatever a student's code does to the process that runs it, the command says so and gives an exit code."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

EXPERIMENT = """
axis = "X"
duration = 0.1
[reference]
kind = "sinusoid"
amplitude = 1.0
frequency = 1.0
[controller]
file = "law.py"
"""
LAW = """
import os, signal, sys, threading, time

def spin():
    while True:
        pass

def control(t, r, y, state, params):
    if 0.0495 < t < 0.0505:
        {act}
    return 10.0 * (r.position - y), state
"""


def run(folder: Path, act: str) -> subprocess.Popen[str]:
    (folder / "law.py").write_text(LAW.format(act=act))
    (folder / "experiment.toml").write_text(EXPERIMENT)
    command = [sys.executable, "-m", "rds.cli.main", "run", "experiment.toml", "--out", "out", "--json"]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize(
    ("act", "said"),
    [
        ("os._exit(0)", "ended with code 0 by itself"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "ended by signal 9 (SIGKILL)"),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "ended by signal 11 (SIGSEGV)"),
        ("os.closerange(3, 1000)", "closed its files"),
        ("sys.exit(0)", "SystemExit"),
    ],
)
def test_what_ends_the_process_is_said(alone: Path, act: str, said: str) -> None:
    process = run(alone, act)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert said in err
    assert out == ""


@pytest.mark.parametrize("act", ["os.fork()", "threading.Thread(target=spin).start()"])
def test_what_stays_behind_neither_holds_nor_speaks(alone: Path, act: str) -> None:
    process = run(alone, act)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert json.loads(out)["mode"] == "simulation"


@pytest.mark.parametrize(("number", "said"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")])
def test_ctrl_c_ends_an_endless_simulation(alone: Path, number: signal.Signals, said: str) -> None:
    process = run(alone, "open('there', 'w').close(); spin()")
    while not (alone / "there").exists():
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(number)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert f"stopped by {said}" in err
    assert not (alone / "out").exists()
