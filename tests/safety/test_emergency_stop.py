"""The emergency stop from the command line, from Python and from a module's button; the run's record says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.bus.tools.estop import reset_everything, stop_everything
from rds.core.errors import MachineError

from .conftest import Bench, ended, expect, tell

pytestmark = pytest.mark.realtime


def test_from_the_command_line_in_a_run(bench: Bench, tmp_path: Path) -> None:
    bench.serve()
    run = bench.run(tmp_path)
    stop = bench.rds("estop")
    assert stop.exit_code == 0, stop.stderr
    assert f"acknowledged by {bench.node}" in stop.stdout
    ending, reason = ended(run, tmp_path)
    assert ending == "machine lost" and "emergency stop" in reason
    bench.stands_without_voltage()


def test_from_python(bench: Bench) -> None:
    bench.serve()
    host = bench.moving()
    with bench.bus() as bus:
        stop_everything(bus)
        assert "emergency stop" in expect(host, "lost")
        bench.stands_without_voltage()
        if bench.dialect != "cia402":  # whose drives leave their fault at the start of a run, as the profile has it
            assert "emergency stop" in expect(bench.host(6.0), "lost")
        assert reset_everything(bus) == ([] if bench.dialect == "cia402" else [bench.node])
    bench.moving()


def test_from_a_modules_button(bench: Bench) -> None:
    axes = {"rds": "X,Y", "oacs": "X,Z", "cia402": "X"}[bench.dialect]
    machine = bench.serve(axes)
    host = bench.moving()
    other = {"rds": 3, "oacs": 2, "cia402": bench.node}[bench.dialect]  # a button stops its module, and all others
    tell(machine, f"{other} emergency on")
    assert "emergency stop" in expect(host, "lost")
    bench.stands_without_voltage()
    reason = expect(bench.host(6.0), "lost")
    assert "emergency stop" in reason, reason
    with bench.bus() as bus:
        if bench.dialect != "cia402":
            with pytest.raises(MachineError, match=f"emergency stop of {other} stays: release its button"):
                reset_everything(bus)
        tell(machine, f"{other} emergency off")
        bench.until_released(bus)
    bench.moving()
