"""A part program is cut off in the middle: by the death of everything on the host, and by that of the machine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from waiting import wait_for

from rds.machines import load_machine
from rds.results import open_result

from .conftest import Bench, expect

pytestmark = pytest.mark.realtime

LINE = 2  # of the program: it lasts


ONE = pytest.mark.parametrize("bench", ["rds"], indirect=True)  # what modules do by themselves: in the other files


def serve(bench: Bench, folder: Path) -> subprocess.Popen[str]:
    """A machine of axis X alone: a run draws each axis that there is."""
    machine = Path(load_machine("mini-cnc").path).read_text().partition("[axis.Y]")[0]
    (folder / "machine.toml").write_text(machine)
    words = [str(folder / "machine.toml"), "--channel", bench.channel]
    process = bench.start("-m", "rds.bus.modules.rds.server", *words)
    expect(process, "ready")
    return process


def start(bench: Bench, folder: Path) -> subprocess.Popen[str]:
    """A run of a program that moves X for half a minute, once it does."""
    (folder / "part.ngc").write_text("G21 G90\nG1 X60 F120\nM2\n")
    (folder / "bus.toml").write_text(f'[bus]\nchannel = "{bench.channel}"\n')
    machine = ["--machine", str(folder / "machine.toml")]
    words = [
        *machine,
        "--mode",
        "implementation",
        "--controller",
        str(folder / "bus.toml"),
        "--out",
        str(folder / "out"),
    ]
    run = bench.start("-m", "rds.cli.main", "nc", "run", str(folder / "part.ngc"), *words)
    bench.wait_until_moving(run, 60.0)  # it is checked and planned first
    return run


@ONE
def test_a_host_that_dies_with_all_its_processes(bench: Bench, tmp_path: Path) -> None:
    """As if its computer had lost its power: nobody is left to stop the axes but their modules."""
    serve(bench, tmp_path)
    run = start(bench, tmp_path)
    wait_for(lambda: (tmp_path / "out" / "record.rds").exists() and bench.powered())
    processes = json.loads((tmp_path / "out" / "processes.json").read_text())
    # first what does the work, a child of the command: it would tell the end of the recorder
    hosts = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    for pid in (*map(int, hosts), run.pid, processes["recorder"], processes["target"]):
        os.kill(pid, signal.SIGKILL)
    bench.stands_without_voltage()
    left = open_result(tmp_path / "out")
    assert left.meta["ending"] == "killed" and "all its processes were killed" in left.meta["ending_reason"]
    assert f"the part program was in line {LINE}" in left.meta["notes"][-1]
    assert left["program_sample"][-1] > 0.0
    assert np.isfinite(left["X_measured"]).all()
    for name in ("live", "ring"):
        # the next run on this computer removes them, and may have done so by now
        Path(processes["live_values"]).with_suffix(f".{name}").unlink(missing_ok=True)


@ONE
def test_a_machine_that_dies(bench: Bench, tmp_path: Path) -> None:
    server = serve(bench, tmp_path)
    run = start(bench, tmp_path)
    server.kill()
    _, said = run.communicate(timeout=60)
    assert run.returncode == 1
    assert "machine lost" in said
    result = open_result(tmp_path / "out" / "result.csv")
    assert result.meta["ending"] == "machine lost"
    about = result.meta["program"]
    assert not about["completed"] and 0.0 < about["done_percent"] < 100.0
    assert about["last_line"] == result["program_line"][-1] == LINE
    assert f"in line {LINE}" in (tmp_path / "out" / "program.html").read_text()
