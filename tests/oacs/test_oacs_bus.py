"""Real processes of modules on a bus: who is there, motions, clash, emergency stop, killed modules and hosts."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from waiting import wait_for

from rds.bus.modules.oacs import Change, Module, OacsDrivers, Watch, estop, scan
from rds.bus.modules.oacs.tuning import gains_from_step
from rds.bus.modules.oacs.watch import ANSWERS, INTERVAL, PATIENCE
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.results import Result, open_result

pytestmark = pytest.mark.realtime
Serve = Callable[..., subprocess.Popen[str]]
MACHINE = load_machine("mrmt-oacs")
LONG = 30.0  # s that a busy computer may take for anything


def press(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdin is not None
    process.stdin.write(line + "\n")
    process.stdin.flush()
    time.sleep(0.3)


def test_scan_and_information(serve: Serve, bus: can.BusABC) -> None:
    serve()
    found = scan(bus)
    assert [(info.id, info.kind, info.type) for info in found] == [
        (2, "ServM", "LinrZa"),
        (3, "ServM", "RotrAa"),
        (4, "ServM", "LinrXa"),
        (5, "SpinM", "DrillT"),
    ]
    assert all(info.dialect == "oacs" and info.version == 1 and info.state == "idle" for info in found)
    for info in found:
        told = Module(bus, info.id).info()
        assert told.description.serial == info.serial
        assert told.as_dict()["tuning"]["controller"] == "PID"
    assert Module(bus, 4).info().description.matrix[0][3] == 583.0


def test_an_empty_bus_has_no_modules(bus: can.BusABC) -> None:
    assert scan(bus) == []
    with pytest.raises(
        MachineError, match=r"module X \(number 4\) was told to stop and did not answer .* power and cable"
    ):
        Module(bus, 4, "X").stop()
    with pytest.raises(MachineError, match=r"module 4: nobody answers with this number: nothing came within 0.2 s"):
        Module(bus, 4).download(timeout=0.2)


def test_moves_jog_stop_and_refusals(serve: Serve, bus: can.BusABC) -> None:
    serve("X,drill")
    x = Module(bus, 4, "X")
    assert x.move(by=1.0) == pytest.approx(1.0, abs=0.5)
    assert x.move(to=-0.5) == pytest.approx(-0.5, abs=0.5)
    assert x.status["HighLimitOpen"] == 0 and x.status["Mode"] == 0
    there = x.jog(1, 0.4)
    assert there > -0.4
    with pytest.raises(
        MachineError,
        match=r"module X \(number 4\) refused to move by 500 mm: that is outside its travel, -150 to 150 mm",
    ):
        x.move(by=500.0)
    for wrong in ({}, {"by": 1.0, "to": 2.0}, {"by": 0.0}):
        with pytest.raises(InputError):
            x.move(**wrong)
    with pytest.raises(InputError, match="direction must be 1 or -1"):
        x.jog(0, 1.0)
    x.start(by=20.0)
    time.sleep(0.5)
    x.switch_direction()
    x.stop()
    with pytest.raises(MachineError, match="did not finish: it was told to stop"):
        x.wait(3.0)
    drill = Module(bus, 5, "drill")
    drill.start(by=300.0)
    readings = drill.record(0.6)
    assert readings["T_current"].max() > 0.5 and readings.units["T_acceleration_x"] == "g"
    drill.stop()


def test_tuned_step_recorded_and_evaluated(serve: Serve, bus: can.BusABC, tmp_path: Path) -> None:
    serve("X")
    x = Module(bus, 4, "X")
    tuned = x.tune("PI", Kp=2.0, Ki=0.0, sample_time=0.02, kick=0.0, tolerance=45)
    assert (tuned.controller.name, tuned.Kp, tuned.sample_time) == ("PI", 2.0, 0.02)
    assert x.tuning() == tuned
    with pytest.raises(InputError, match="no tuning parameter 'gain'"):
        x.tune(gain=3.0)
    with pytest.raises(InputError, match="Kp = -1"):
        x.tune(Kp=-1.0)
    result = x.step(2.0)
    assert isinstance(result, Result) and result.sample_period == 0.01
    assert np.allclose(np.diff(result["time"]), 0.01)
    assert result["X_measured"][0] == pytest.approx(0.0, abs=0.02) and 1.5 < result["X_measured"][-1] < 2.2
    assert open_result(result.save(tmp_path / "step.csv"))["X_measured"] == pytest.approx(result["X_measured"])
    result.plot().savefig(tmp_path / "step.png")
    gains = gains_from_step(result, "X")
    assert gains.Kp > 0 and gains.Ki > 0 and gains.Kd > 0


def test_two_modules_with_one_number_are_refused_by_name(serve: Serve, bus: can.BusABC, channel: str) -> None:
    serve("X")
    serve("X")
    with pytest.raises(
        MachineError,
        match=r"number 4 is used 2 times: by translational axis \(serial number \d+\) and by translational",
    ):
        scan(bus)
    drivers = OacsDrivers(MACHINE, ["X"], channel=channel)
    with pytest.raises(MachineError, match="number 4 is used 2 times"):
        drivers.start()
    drivers.close()


def test_a_module_that_counts_otherwise_is_refused(serve: Serve, channel: str) -> None:
    """The module of another machine moved for this one, its positions wrong by what its encoder is finer."""
    serve("X")
    finer = replace(MACHINE.axis("X"), resolution=1.0 / 170.0)
    drivers = OacsDrivers(replace(MACHINE, axes={**MACHINE.axes, "X": finer}), ["X"], channel=channel)
    with pytest.raises(MachineError, match=r"X: module 4 \(LinrXa, .*\) has 169 counts per mm, where .* 170 per mm"):
        drivers.start()
    drivers.close()


def test_coming_and_going_is_noticed_within_a_second(serve: Serve, bus: can.BusABC) -> None:
    """In calls, for a busy computer takes longer for each: so many, and the one that is just under way."""
    calls = PATIENCE + 1
    assert calls * (INTERVAL + ANSWERS) < 1.0
    events: list[tuple[int, Any]] = []

    class Counted(Watch):
        looks = 0

        def look(self) -> list[Any]:
            self.looks += 1
            return super().look()

    serve("X")
    with Counted(bus, lambda event: events.append((watch.looks, event))) as watch:
        wait_for(lambda: events, LONG)
        assert events[0][1].change == Change.APPEARED and events[0][1].module.type == "LinrXa"
        process = serve("Z")
        began = watch.looks
        wait_for(lambda: len(events) > 1, LONG)
        assert events[1][1].module.id == 2 and events[1][0] - began <= calls
        process.kill()
        process.wait()
        began = watch.looks
        wait_for(lambda: len(events) > 2, LONG)
        assert events[2][1].change == Change.DISAPPEARED and events[2][0] - began <= calls
        serve("X")
        began = watch.looks
        wait_for(lambda: any(event.change == Change.CLASH for _, event in events), LONG)
        assert events[-1][0] - began <= calls
        assert len(watch.modules) == 2


def test_a_watch_whose_bus_fails_says_so(serve: Serve, bus: can.BusABC) -> None:
    events: list[Any] = []
    with Watch(bus, events.append):
        time.sleep(0.3)
        bus.shutdown()
        wait_for(lambda: events, LONG)
    assert events[0].change == Change.BUS_LOST and "failed" in events[0].text


def test_emergency_stop_of_all_and_from_a_modules_button(serve: Serve, bus: can.BusABC, channel: str) -> None:
    process = serve()
    x = Module(bus, 4, "X")
    x.start(by=20.0)
    with can.Bus(interface="rds", channel=channel) as other:
        assert estop(other) == [2, 3, 4, 5]
    with pytest.raises(MachineError, match="emergency stop"):
        x.wait(2.0)
    assert {info.state for info in scan(bus)} == {"emergency"}
    drivers = OacsDrivers(MACHINE, channel=channel)
    with pytest.raises(MachineError, match="emergency stop of X, Z, A, drill is latched"):
        drivers.start()
    drivers.close()
    for number in (2, 3, 4, 5):
        Module(bus, number).reset_emergency()
    assert {info.state for info in scan(bus)} == {"idle"}
    press(process, "5 emergency on")
    assert {info.state for info in scan(bus)} == {"emergency"}, "the button of one stops all"
    with pytest.raises(MachineError, match="refused to reset"):
        Module(bus, 5).reset_emergency()
    press(process, "5 emergency off")
    Module(bus, 5).reset_emergency()


def test_a_broken_wire_stops_a_motion(serve: Serve, bus: can.BusABC) -> None:
    process = serve("X")
    x = Module(bus, 4, "X")
    x.start(by=20.0)
    press(process, "4 high broken")
    with pytest.raises(MachineError, match="a limit switch opened"):
        x.wait(3.0)
    with pytest.raises(MachineError, match="its limit switch is open on that side"):
        x.move(by=1.0)
    press(process, "4 high whole")


def test_a_host_that_is_killed_leaves_nothing_moving(serve: Serve, bus: can.BusABC, channel: str) -> None:
    serve("X")
    code = (
        "import can, rds.bus.modules.oacs as o\n"
        f"bus = can.Bus(interface='rds', channel={channel!r})\n"
        "print('going', flush=True)\n"
        "o.Module(bus, 4).move(by=100.0)\n"
    )
    host = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert host.stdout is not None and host.stdout.readline() == "going\n"
    time.sleep(1.5)
    host.kill()
    host.wait()
    host.stdout.close()
    time.sleep(3.0)  # nobody says a word
    (info,) = scan(bus)
    assert info.state == "idle"
    assert Module(bus, 4).stop().counts < 100 * 169 / 4


def test_the_cyclic_exchange(serve: Serve, bus: can.BusABC, channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    serve()
    opened, plain = [], can.Bus
    monkeypatch.setattr(can, "Bus", lambda *given, **options: opened.append(given) or plain(*given, **options))
    drivers = OacsDrivers(MACHINE, channel=channel, sample_period=0.005)
    drivers.start()
    assert len(opened) == 1, "most adapters can be opened once and no more"
    for _ in range(100):
        positions = drivers.exchange()
        drivers.write([8.0, -8.0, 0.0, 5.0])
        time.sleep(0.003)
    drivers.close()
    assert positions[0] > 0.05 and positions[1] < -0.05 and positions[2] == 0.0 and positions[3] > 100
    time.sleep(0.3)
    assert scan(bus)[2].state == "idle", "the watchdog has cut, and the module is free again"


def test_hostile_frames_do_not_end_the_modules(serve: Serve, bus: can.BusABC) -> None:
    process = serve()
    chance = np.random.default_rng(5)
    for _ in range(2000):
        identifier = int(
            chance.choice([0, 1, 2, 3, 4, 5, 0x10, 0x11, 0x12, 0x13, 0x112, 0x114, int(chance.integers(0x800))])
        )
        if identifier == 1:
            identifier = 0x7F
        data = chance.bytes(int(chance.integers(9)))
        bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False), 1.0)
    time.sleep(3.0)
    assert process.poll() is None and len(scan(bus)) == 4


def test_the_program_refuses_what_it_does_not_know() -> None:
    command = [sys.executable, "-m", "rds.bus.modules.oacs.server"]
    answer = subprocess.run([*command, "nothing"], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert answer.returncode == 2 and "there is no machine 'nothing'" in answer.stderr
    answer = subprocess.run(
        [*command, "mrmt-oacs", "--modules", "Q"], capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    assert answer.returncode == 2 and "no axis 'Q'" in answer.stderr
