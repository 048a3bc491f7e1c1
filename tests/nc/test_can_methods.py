"""Methods A, B and C on CAN: the same part as numbers, clocks kept together, and what goes wrong on the way."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from random import Random

import can
import numpy as np
import pytest
from typer.testing import CliRunner

from rds.bus.modules import segments
from rds.bus.modules.rds import motion_frames
from rds.bus.modules.rds.frames import COMMAND, EMERGENCY, GENERAL, SETUP, encode_setup, encode_voltages
from rds.bus.modules.rds.module import AxisModule
from rds.bus.modules.rds.motion_frames import Buffer, MotionStatus, Progress, Verb
from rds.bus.modules.rds.motion_host import MotionHost
from rds.bus.modules.rds.motion_port import CanPort, VirtualCan
from rds.cli.main import app
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.nc.run.can_methods import _carry_out, can_gains, check_room, run_can_method
from rds.nc.run.serial_methods import MethodRun
from rds.nc.run.serial_motion import SerialMotion, serial_motion

CNC = load_machine("mini-cnc")
T = 0.002
ARC = "G21 G17 G90 F480 G61\nG3 X0 Y0 I-3 J0\nM2\n"
FAST, SLOW = 3000.0, -3000.0  # ppm
TITLES = {2: "X (module 2)"}


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> SerialMotion:
    file = tmp_path_factory.mktemp("can") / "arc.ngc"
    file.write_text(ARC)
    return serial_motion(file, CNC, period=T, whole=False)


@pytest.fixture(scope="module")
def runs(motion: SerialMotion) -> dict[str, MethodRun]:
    return {name: run_can_method(name, motion, CNC, bitrate=500_000) for name in "ABC"}


def test_every_method_makes_the_same_part(runs: dict[str, MethodRun]) -> None:
    for name, run in runs.items():
        assert run.path_error.max() * 1e3 < 0.1, name  # sixteenths of a count
        assert np.sqrt(np.mean(run.error**2)) * 1e3 < 6.0, name
    difference = np.abs(runs["A"].position[200:-5] - runs["C"].position[200:-5]).max()
    assert difference < 0.01  # mm: the same set points, at instants of the host or of the modules


def test_method_a_tells_each_module_its_set_points_in_its_own_slot(motion: SerialMotion) -> None:
    slots = dict(zip(CNC.axes, (3, 1, 2, 4), strict=True))
    machine = replace(CNC, axes={name: replace(axis, slot=slots[name]) for name, axis in CNC.axes.items()})
    modules = {name: AxisModule(axis, machine.slots[name], T, 0.0) for name, axis in machine.axes.items()}
    for module in modules.values():
        module.by_itself.gauge = []
    _carry_out("A", MotionHost(VirtualCan(list(modules.values()), 500_000), {}), motion, machine)
    low = {name: min(position for _, position in modules[name].by_itself.gauge or ()) for name in "XY"}
    assert low == pytest.approx({"X": -6.0, "Y": -3.0}, abs=0.1)  # mm


def test_what_each_method_takes_of_the_bus(runs: dict[str, MethodRun]) -> None:
    assert runs["B"].load < 0.2 * runs["C"].load < 0.1 * runs["A"].load
    frame, answers = 125, 3 * 125  # bits, about
    assert runs["A"].load == pytest.approx((frame + answers) / (500_000 * T), rel=0.1)


def test_clocks_that_drift_are_kept_together_by_messages(motion: SerialMotion) -> None:
    drift = {"Y": -6000.0}  # X is the one by whose clock all go
    found = {name: run_can_method(name, motion, CNC, drift=drift) for name in ("C", "C-free")}
    plain = run_can_method("C", motion, CNC)
    worst = {name: np.abs(run.position - plain.position)[-400:, 1].max() for name, run in found.items()}
    assert worst["C-free"] > 0.01  # mm
    assert worst["C"] < 0.2 * worst["C-free"]


def test_drift_is_a_key_of_the_machine_file(tmp_path: Path) -> None:
    text = Path(CNC.path).read_text().replace("[axis.X.limits]", "[axis.X.module]\ndrift = 80.0\n\n[axis.X.limits]", 1)
    file = tmp_path / "drifting.toml"
    file.write_text(text)
    machine = load_machine(str(file))
    assert AxisModule(machine.axis("X"), 0, T, 0.0).drift == pytest.approx(80e-6)
    file.write_text(text.replace("drift = 80.0", "drift = 80000.0"))
    with pytest.raises(InputError, match="drift"):
        load_machine(str(file))


def test_a_segment_survives_its_frames() -> None:
    arc = segments.arc(20_000.0, 0.0, 0.0, 2 * np.pi, 6000, first=True)
    data = b"".join(motion_frames.pieces_of_segments([arc]))
    assert len(data) == segments.SIZE
    equations = segments.Equations(segments.unpack(data))
    places = [equations.next() for _ in range(arc.steps)]
    assert places[-1] == pytest.approx(20_000.0, abs=1e-3)  # counts, after a whole circle
    report = Progress(70_000, 300, 12, MotionStatus.READY)
    assert motion_frames.decode_progress(motion_frames.encode_progress(report)) == (70_000 % 65536, 300, 12, 1)
    assert motion_frames.decode_correction(motion_frames.encode_correction(2, 1e-4, -0.5)) == pytest.approx(
        (1e-4, -0.5)
    )
    assert motion_frames.decode_setpoint(motion_frames.encode_setpoints([0, 16 * 70_001]), 1, 70_000.0) == 70_001.0


def bench() -> tuple[AxisModule, VirtualCan, MotionHost]:
    module = AxisModule(CNC.axis("X"), 0, T, 0.0)
    bus = VirtualCan([module], 500_000)
    bus.send(SETUP, encode_setup(T))
    return module, bus, MotionHost(bus, TITLES)


def begin(host: MotionHost) -> None:
    host.begin(2, Buffer.INCREMENTS, 0, can_gains(CNC.axis("X")))


def stream(host: MotionHost, steps: int = 2000) -> None:
    host.stream({2: motion_frames.pieces_of_increments([16] * steps)}, steps, T)


def test_the_hosts_clock_does_not_follow_one_that_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    with can.Bus(interface="virtual", channel="set-clock") as bus:
        port = CanPort(bus)
        before = port.now()
        assert before == pytest.approx(time.time(), abs=1.0)
        monkeypatch.setattr(time, "time", lambda: before + 3600.0)
        assert port.now() - before < 60.0


def test_lost_pieces_are_sent_again(monkeypatch: pytest.MonkeyPatch) -> None:
    module, bus, host = bench()
    begin(host)
    send, chance = bus.send, Random(1)

    def lossy(identifier: int, data: bytes) -> None:
        if identifier != motion_frames.DATA or chance.random() > 0.15:
            send(identifier, data)

    monkeypatch.setattr(bus, "send", lossy)
    host.stream({2: motion_frames.pieces_of_increments([16] * 2000)}, 2000, T)
    bus.sleep(bus.now() + 0.2)
    assert module.motion.advance(bus.now()) == pytest.approx(2.0, abs=0.02)  # mm
    assert host.retries > 0


@pytest.mark.parametrize(
    "what, said",
    [
        ("reset", "X \\(module 2\\) has been reset"),
        ("cut", "no answer from X \\(module 2\\)"),
        ("emergency", "emergency stop of X"),
        ("slow", "ran empty at step"),
        ("blocked", "could not follow"),
    ],
)
def test_what_goes_wrong_is_named_and_the_axis_stands(what: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module, bus, host = bench()
    begin(host)
    plain, at = bus.sleep, bus.now() + 1.0

    def sleep(until: float) -> None:
        if bus.now() < at:
            plain(until)
            return
        if what == "reset":
            bus.modules = [AxisModule(CNC.axis("X"), 0, T, bus.now())]
        elif what == "cut":
            bus.modules = []
        elif what == "emergency":
            module.receive(GENERAL, EMERGENCY, bus.now())
        elif what == "slow":  # computed in time for the watchdog, too late for the buffer
            monkeypatch.setattr(host, "_fill", lambda feed, report: None)
        else:
            monkeypatch.setattr(module.motion, "command", lambda voltage, at: None)
            module.motion._release()
        plain(until)

    monkeypatch.setattr(bus, "sleep", sleep)
    with pytest.raises(MachineError, match=said):
        stream(host, 4000)
    now = bus.now()
    module.expire(now + 2.0)  # alone: a second without a word
    module.motion.advance(now + 3.0)
    assert module.motion.velocity == 0.0 and not module.by_itself.active


def test_the_spindle_turns_by_every_method(tmp_path: Path) -> None:
    file = tmp_path / "turned.ngc"
    file.write_text("G21 G90 F480 G61\nM3 S1000\nG4 P0.6\nG1 X1\nM5\nG4 P1\nM2\n")
    turned = serial_motion(file, CNC, period=T, whole=False)
    for name in "ABC":
        run = run_can_method(name, turned, CNC, bitrate=500_000)
        assert run.speed[run.position[:, 0] > 0.5].max() == pytest.approx(935.0, rel=0.02), name  # no loop holds it
        assert abs(run.speed[-1]) < 10.0 and run.error.max() < 0.1, name


def test_voltages_and_set_points_keep_out_of_each_others_way() -> None:
    module, bus, host = bench()
    begin(host)
    assert module.receive(COMMAND, encode_voltages([5.0]), bus.now()) == []  # of another host
    host.stop_all()
    bus.sleep(bus.now() + 0.1)
    assert module.receive(COMMAND, encode_voltages([0.0]), bus.now())
    with pytest.raises(MachineError, match="another host commands it"):
        begin(host)
    assert module.control(bytes([99, 2]), bus.now()) is None  # no verb
    assert module.control(bytes([Verb.GAIN, 2, 7]), bus.now()) is None  # too short


@pytest.mark.parametrize("method", "AC")
def test_a_second_host_begins_no_motion_of_an_axis_that_moves(method: str) -> None:
    module, bus, host = bench()
    gains = can_gains(CNC.axis("X"))
    kind = Buffer.NONE if method == "A" else Buffer.INCREMENTS
    host.begin(2, kind, 0, gains)
    if method == "A":
        bus.send(motion_frames.SETPOINTS, motion_frames.encode_setpoints([16]))
    else:
        for number, piece in enumerate(motion_frames.pieces_of_increments([16] * 60)):
            bus.send(motion_frames.DATA, bytes([2, number]) + piece)
        bus.send(motion_frames.CONTROL, bytes([Verb.GO, 0]))
    bus.sleep(bus.now() + 0.001)
    with pytest.raises(MachineError, match="another host commands it"):
        host.begin(2, kind, 32000, [2.0 * gain for gain in gains])
    assert module.by_itself.moves and module.by_itself._gains == pytest.approx(gains, rel=1e-6)
    bus.sleep(bus.now() + 0.5)
    assert abs(module.motion.position) < 0.5
    host.begin(2, kind, 0, gains)  # it has no set points left


def test_a_bus_that_is_too_slow_is_refused_before_the_run(motion: SerialMotion) -> None:
    with pytest.raises(InputError, match=r"method A takes 216 % of 125000 bit/s.*--option period=0\.0054"):
        check_room(CNC, motion, "A", 125_000, motion.period)
    check_room(CNC, motion, "B", 125_000, motion.period)


@pytest.mark.realtime
def test_modules_of_their_own_process_make_the_same_part(motion: SerialMotion) -> None:
    run = run_can_method("C", motion, CNC, mode="implementation", drift={"X": FAST, "Y": SLOW})
    assert np.sqrt(np.mean(run.error**2)) * 1e3 < 10.0
    dry = run_can_method("B", motion, CNC, mode="emulation")
    assert len(dry.error) and dry.course.missing == 0


@pytest.mark.realtime
def test_the_modules_of_a_machine_may_have_a_name_that_no_channel_can_have(
    motion: SerialMotion, tmp_path: Path
) -> None:
    file = tmp_path / "fraese.toml"
    file.write_text(
        Path(CNC.path).read_text().replace('name = "mini-cnc"', 'name = "Große Fräse"', 1), encoding="utf-8"
    )
    dry = run_can_method("B", motion, load_machine(str(file)), mode="emulation")
    assert len(dry.error) and dry.course.missing == 0


def test_the_command_chooses_by_the_machine(tmp_path: Path) -> None:
    file = tmp_path / "line.ngc"
    file.write_text("G21 G90 F480 G61\nG1 X1\nM2\n")
    words = ["nc", "run", str(file), "--machine", "mini-cnc"]
    told = CliRunner().invoke(app, [*words, "--method", "all", "--option", "period=0.002", "--json"])
    assert told.exit_code == 0, told.output
    assert [row[0][:2] for row in json.loads(told.stdout)["tables"][0]["rows"]] == [
        "A:",
        "B:",
        "C:",
    ]
    refused = CliRunner().invoke(app, [*words, "--method", "C-thesis"])
    assert refused.exit_code == 2 and "'C-thesis' is unknown; known: A, B, C, B-free, C-free" in refused.output
    refused = CliRunner().invoke(app, [*words, "--method", "A", "--baud", "9600"])
    assert refused.exit_code == 2 and "--option bitrate=500000" in refused.output
