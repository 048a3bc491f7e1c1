"""A host that is killed, a bus that is cut, a module that is replaced: no voltage stays on an axis."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from rds.bus.hub.faults import Faults

from .conftest import HERE, Bench, ended, expect, hub_pid, tell

pytestmark = pytest.mark.realtime


def test_a_killed_host_leaves_no_voltage(bench: Bench) -> None:
    bench.serve()
    host = bench.moving()
    host.send_signal(signal.SIGKILL)
    bench.stands_without_voltage()


@pytest.mark.parametrize("bench", ["rds"], indirect=True)  # the target is the same in all; see above for the modules
def test_a_killed_target_leaves_no_voltage_and_a_record(bench: Bench, place: Path, tmp_path: Path) -> None:
    bench.serve()
    run = bench.run(tmp_path)
    os.kill(target(place), signal.SIGKILL)
    assert ended(run, tmp_path)[0] == "killed"
    bench.stands_without_voltage()


def test_a_killed_hub_ends_the_host_and_the_voltage(bench: Bench, place: Path) -> None:
    bench.serve()
    host = bench.moving()
    os.kill(hub_pid(place, bench.channel), signal.SIGKILL)
    assert "failed" in expect(host, "lost")
    bench.stands_without_voltage()


@pytest.mark.parametrize("bench", ["rds"], indirect=True)
def test_a_killed_hub_is_in_the_record_of_the_run(bench: Bench, place: Path, tmp_path: Path) -> None:
    bench.serve()
    run = bench.run(tmp_path)
    os.kill(hub_pid(place, bench.channel), signal.SIGKILL)
    ending, reason = ended(run, tmp_path)
    assert ending == "machine lost" and "failed" in reason
    bench.stands_without_voltage()


def test_an_unplugged_module_has_no_voltage_and_ends_its_host(bench: Bench) -> None:
    bench.serve()
    host = bench.moving()
    with Faults(bench.channel) as line:
        line.inject("unplug", node="X")
        assert f"X (node {bench.node})" in expect(host, "lost")
        line.inject("plug", node="X")
    bench.stands_without_voltage()


def test_a_module_that_takes_anothers_place_is_noticed_and_stands(bench: Bench) -> None:
    first = bench.start(str(HERE / "standby_process.py"), bench.dialect, bench.channel)
    second = bench.start(str(HERE / "standby_process.py"), bench.dialect, bench.channel)
    for process in (first, second):
        expect(process, "standby")
    tell(first, "go")
    expect(first, "ready")
    # a period of 0.1 s leaves it a second until silence alone would end the host
    host = bench.moving(period=0.1)
    first.kill()
    first.wait()
    tell(second, "go")
    expect(second, "ready")
    reason = expect(host, "lost")
    assert "has restarted" in reason, reason
    bench.stands_without_voltage()
    assert bench.counts() == 0, "it has not moved at all"


def target(place: Path) -> int:
    """The target process of the run in this runtime directory."""
    for path in Path("/proc").glob("[0-9]*"):
        try:
            command, environment = (path / "cmdline").read_bytes(), (path / "environ").read_bytes()
        except OSError:
            continue
        if (
            b"rds.modes.process.target" in command
            and b"process.recorder" not in command
            and str(place).encode() in environment
        ):
            return int(path.name)
    raise AssertionError("no target")
