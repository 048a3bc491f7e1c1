"""Host and machine over a bus: the built-in one between processes, `virtual` between threads."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any
from uuid import uuid4

import can
import pytest

from rds.bus.modules.calling import find_machine
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.bus.modules.rds.frames import Answer, Kind, Status
from rds.bus.modules.rds.identity import refuse_others
from rds.bus.modules.rds.module import AxisModule
from rds.bus.modules.rds.server import serve
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine

MACHINE = load_machine("mini-cnc")
# a period with room for a busy test computer
SLOW = replace(MACHINE, sample_period=0.01)


@pytest.fixture(params=["rds", "virtual"])
def served(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Any]]:
    monkeypatch.setattr(
        "rds.bus.modules.rds.drivers.LOST_AFTER", 5.0
    )  # s: its modules share this process, which may be held up
    where = {"interface": request.param, "channel": uuid4().hex}
    stop, ready = threading.Event(), threading.Event()
    thread = threading.Thread(target=lambda: serve(SLOW, **where, ready=ready.set, stop=stop))
    thread.start()
    assert ready.wait(30.0)
    yield where
    stop.set()
    thread.join(30.0)
    assert not thread.is_alive()


@pytest.fixture
def machine_process(program: Callable[..., Any]) -> Callable[..., Any]:
    def starter(*arguments: str) -> Any:
        process = program("rds.bus.modules.rds.server", "mini-cnc", "--channel", "m", *arguments)
        line = process.stdout.readline()
        assert line.startswith("ready mini-cnc on rds:m"), line + process.stderr.read()
        return process

    return starter


def drive(drivers: AxisDrivers, cycles: int, voltages: list[float], period: float) -> list[float]:
    positions: list[float] = []
    due = time.monotonic()
    for _ in range(cycles):
        positions = drivers.exchange()
        drivers.write(voltages)
        due += period
        time.sleep(max(0.0, due - time.monotonic()))
    return positions


def answered(drivers: AxisDrivers) -> list[float]:
    """The positions of the next exchange in which no answer is missing: modules may be held up."""
    for _ in range(500):
        before = drivers.counters.missing
        positions = drivers.exchange()
        if drivers.counters.missing == before:
            return positions
    raise AssertionError("no answer in its period")


def test_a_voltage_moves_its_axis_and_no_other(served: dict[str, Any]) -> None:
    drivers = AxisDrivers(SLOW, ["Y", "X", "spindle"], **served)
    try:
        drivers.start()
        assert drivers.exchange() == [0.0, 0.0, 0.0]
        y, x, spindle = drive(drivers, 20, [-5.0, 0.0, 3.0], 0.01)
        assert -2.0 < y < -0.8 and x == 0.0 and 1000 < spindle < 2900
    finally:
        drivers.close()


def test_positions_count_from_the_start_and_the_spindle_does_not(served: dict[str, Any]) -> None:
    drivers = AxisDrivers(SLOW, ["X", "spindle"], **served)
    drivers.start()
    drive(drivers, 20, [5.0, 5.0], 0.01)
    drivers.start()
    assert drivers.exchange() == [0.0, 0.0], "start() waits until the axes stand"
    drivers.close()


@pytest.mark.parametrize(
    "change",
    [{"resolution": 0.0009921875}, {"unit": "deg"}],
)
def test_a_module_of_another_machine_is_refused(served: dict[str, Any], change: dict[str, Any]) -> None:
    """The mill's modules moved for the mini CNC: its positions were told 0.8 % too large, without a word."""
    other = replace(SLOW, axes={**SLOW.axes, "X": replace(SLOW.axis("X"), **change)})
    drivers = AxisDrivers(other, ["X"], **served)
    with pytest.raises(MachineError, match=r"X \(node 2\): the module .* is another machine's, or of another axis"):
        drivers.start()
    drivers.close()


def test_firmware_of_another_version_is_refused() -> None:
    axis = SLOW.axis("X")
    module = AxisModule(axis, 0, SLOW.sample_period, 0.0)
    refuse_others([module.identity, module.identity._replace(scale=0)], [axis], 10.0)
    with pytest.raises(MachineError, match="speaks version 2 of these frames, and this host version 1"):
        refuse_others([module.identity._replace(version=2)], [axis], 10.0)
    with pytest.raises(MachineError, match="at ±5 V"):
        refuse_others([module.identity], [axis], 5.0)


def test_write_returns_what_acts_from_this_tick_on(served: dict[str, Any]) -> None:
    drivers = AxisDrivers(SLOW, ["X"], **served)
    drivers.start()
    for sent, before in ((1.25, 0.0), (2.5, 1.25), (0.1, 2.5)):
        drivers.exchange()
        assert drivers.write([sent]) == (before,)
    drivers.exchange()
    assert drivers.write([0.0])[0] == pytest.approx(0.1, abs=20 / 16384 / 2), "in units of the frame"
    for bad in ([11.0], [float("nan")], [1.0, 2.0]):
        with pytest.raises(InputError):
            drivers.write(bad)
    drivers.close()
    drivers.close()


def test_a_dry_run_moves_nothing(served: dict[str, Any]) -> None:
    drivers = AxisDrivers(SLOW, **served, dry_run=True)
    drivers.start()
    assert drive(drivers, 10, [9.0] * 4, 0.01) == [0.0] * 4
    drivers.close()


def test_stop_cuts_the_voltage_at_once(served: dict[str, Any]) -> None:
    drivers = AxisDrivers(SLOW, ["X"], **served)
    drivers.start()
    drive(drivers, 10, [5.0], 0.01)
    drivers.stop()
    time.sleep(0.08)  # 8 time constants, less than the watchdog's 10 periods
    first = answered(drivers)
    assert drivers.counters.watchdogs == 0
    assert [answered(drivers) for _ in range(5)] == [first] * 5, "it stands"
    drivers.close()


def test_silence_trips_the_watchdog_and_the_next_command_clears_it(served: dict[str, Any]) -> None:
    drivers = AxisDrivers(SLOW, ["X"], **served)
    drivers.start()
    drive(drivers, 5, [5.0], 0.01)
    time.sleep(0.25)
    drivers.write([0.0])  # so that it goes on standing, however long the next tick takes
    here = answered(drivers)
    assert drivers.counters.watchdogs == 1
    assert answered(drivers)[0] == pytest.approx(here[0], abs=0.01), "it stood until this tick"
    drivers.close()


def test_find_machine(served: dict[str, Any]) -> None:
    assert find_machine(SLOW, **served) == list(SLOW.axes)


def test_no_machine_is_found_on_an_empty_bus() -> None:
    assert find_machine(SLOW, channel="empty", timeout=0.05) == []


def test_an_unplugged_machine_is_named_with_its_remedy() -> None:
    drivers = AxisDrivers(MACHINE, ["X", "Z"], channel="nobody")
    with pytest.raises(MachineError, match=r"X \(node 2\), Z \(node 4\) on bus rds:nobody.*rds machine serve mini-cnc"):
        drivers.start()
    drivers.close()


def test_one_unplugged_module_is_named(machine_process: Callable[..., Any]) -> None:
    machine_process("--axes", "X,Y")
    drivers = AxisDrivers(MACHINE, ["X", "Y", "Z"], channel="m")
    with pytest.raises(MachineError, match=r"no answer from Z \(node 4\) on"):
        drivers.start()
    drivers.close()
    assert find_machine(MACHINE, channel="m") == ["X", "Y"]


def test_an_unknown_interface_or_axis_is_bad_input() -> None:
    with pytest.raises(MachineError, match="nonsense:1 can't be opened"):
        AxisDrivers(MACHINE, interface="nonsense", channel="1")
    with pytest.raises(InputError, match="no axis 'W'"):
        AxisDrivers(MACHINE, ["W"], channel="m")
    with pytest.raises(MachineError, match="a serial line of units has none, is served with --dialect dcs"):
        AxisDrivers(MACHINE, interface="serial", channel="no-such-line")


def test_a_machine_killed_while_running_is_lost_after_ten_periods(machine_process: Callable[..., Any]) -> None:
    process = machine_process()
    drivers = AxisDrivers(SLOW, ["X", "Y"], channel="m")
    drivers.start()
    drive(drivers, 10, [2.0, 2.0], 0.01)
    last = answered(drivers)
    process.kill()
    process.wait()
    cycles = 0
    with pytest.raises(MachineError, match=r"X \(node 2\), Y \(node 3\)"):
        while cycles < 20:
            assert drivers.exchange() == pytest.approx(last, abs=0.1), "the last position is repeated"
            cycles += 1
    assert 8 <= cycles <= 10
    drivers.close()


def test_a_machine_that_stood_still_a_while_is_caught_up_with(machine_process: Callable[..., Any]) -> None:
    process = machine_process()
    drivers = AxisDrivers(SLOW, ["X", "Y"], channel="m")
    drivers.start()
    drive(drivers, 10, [2.0, 2.0], 0.01)
    os.kill(process.pid, signal.SIGSTOP)
    drive(drivers, 4, [2.0, 2.0], 0.01)
    os.kill(process.pid, signal.SIGCONT)
    drive(drivers, 20, [2.0, 2.0], 0.01)
    counters = drivers.counters
    assert 3 * 2 <= counters.missing <= 6 * 2 and counters.late >= 3 * 2 and counters.lost_ticks == 0
    before = replace(counters)
    drive(drivers, 10, [2.0, 2.0], 0.01)
    assert (counters.missing, counters.late) == (before.missing, before.late), "in step again"
    drivers.close()


def test_a_killed_hub_ends_the_run_and_the_machine_comes_back(machine_process: Callable[..., Any]) -> None:
    process = machine_process()
    bus = can.Bus(interface="rds", channel="m")
    drivers = AxisDrivers(SLOW, ["X"], bus=bus)
    drivers.start()
    os.kill(bus.hub_pid, signal.SIGKILL)  # type: ignore[attr-defined]
    with pytest.raises(MachineError, match=r"failed.*ended without a word"):
        drive(drivers, 20, [1.0], 0.01)
    drivers.stop()
    drivers.close()
    bus.shutdown()
    deadline = time.monotonic() + 30.0
    while len(find_machine(MACHINE, channel="m")) < 4:
        assert time.monotonic() < deadline
    process.terminate()
    assert process.wait(30) == 0
    report = process.stderr.read()
    assert "module X lost its bus" in report and "module X is back on its bus" in report


class Puppet(can.BusABC):
    """A bus whose answers the test writes."""

    def __init__(self) -> None:
        self.answers: list[list[can.Message]] = []
        self.inbox: list[can.Message] = []
        super().__init__("puppet")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.arbitration_id == frames.COMMAND and self.answers:
            self.inbox += self.answers.pop(0)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.inbox:
            return self.inbox.pop(0), False
        time.sleep(timeout or 0)
        return None, False


def answer(ticks: int, counts: int = 0, kind: Kind = Kind.ANSWER, status: Status = Status.ENABLED) -> can.Message:
    data = frames.encode_answer(Answer(counts, status, kind, ticks))
    return can.Message(arbitration_id=0x22, is_extended_id=False, data=data)


@pytest.fixture
def puppet() -> Iterator[tuple[Puppet, AxisDrivers]]:
    with Puppet() as bus:
        drivers = AxisDrivers(MACHINE, ["X"], bus=bus)
        bus.answers = [[answer(65530)]]
        drivers.exchange()
        drivers.counters.__init__()  # type: ignore[misc]
        yield bus, drivers


def test_the_tick_count_wraps_round(puppet: tuple[Puppet, AxisDrivers]) -> None:
    bus, drivers = puppet
    bus.answers = [[answer((65531 + k) % 65536, k)] for k in range(20)]
    assert [round(drivers.exchange()[0] * 1000) for _ in range(20)] == list(range(20))
    assert (drivers.counters.late, drivers.counters.lost_ticks, drivers.counters.missing) == (0, 0, 0)


def test_a_late_answer_is_not_taken_for_the_next(puppet: tuple[Puppet, AxisDrivers]) -> None:
    bus, drivers = puppet
    bus.answers = [[], [answer(65531, 1), answer(65532, 2)], [answer(65533, 3)]]
    assert [round(drivers.exchange()[0] * 1000) for _ in range(3)] == [0, 2, 3]
    assert (drivers.counters.missing, drivers.counters.late) == (1, 1)


def test_a_lost_tick_is_noticed(puppet: tuple[Puppet, AxisDrivers]) -> None:
    bus, drivers = puppet
    bus.answers = [[], [answer(65531, 1)], [answer(65532, 2)], [answer(65533, 3)]]
    assert [round(drivers.exchange()[0] * 1000) for _ in range(4)] == [0, 1, 2, 3]
    assert drivers.counters.lost_ticks == 1


def test_other_frames_are_ignored_and_counted(puppet: tuple[Puppet, AxisDrivers]) -> None:
    bus, drivers = puppet
    report = answer(65530, 9, Kind.REPORT, Status.WATCHDOG)
    foreign = can.Message(arbitration_id=0x22, is_extended_id=True), can.Message(arbitration_id=0x23)
    bus.answers = [[report, *foreign, answer(65531, 1)]]
    assert drivers.exchange() == [0.001]
    assert (drivers.counters.watchdogs, drivers.counters.foreign) == (1, 2)


class Wired(Puppet):
    """A bus with the module of axis X, which does not get the first set-ups."""

    def __init__(self, lost: int = 1) -> None:
        super().__init__()
        self.lost = lost
        self.module = AxisModule(SLOW.axis("X"), 0, SLOW.sample_period, time.monotonic())
        self.set_ups = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.set_ups += msg.arbitration_id == frames.SETUP
        if msg.arbitration_id != frames.SETUP or self.set_ups > self.lost:
            answers = self.module.receive(msg.arbitration_id, msg.data, time.monotonic())
            self.inbox += [can.Message(arbitration_id=0x22, data=data, is_extended_id=False) for data in answers]


@pytest.mark.parametrize("lost, earlier", [(1, None), (1, 0.001), (1, 0.1), (3, 0.001)])
def test_a_set_up_that_was_lost_is_sent_again(lost: int, earlier: float | None) -> None:
    """With a shorter period of an earlier host it answered, took no command, and its axis stood still: nobody was told.
    With a longer one its voltage lasted too long.
    """
    with Wired(lost) as bus:
        if earlier:
            bus.module.receive(frames.SETUP, frames.encode_setup(earlier), time.monotonic())
        drivers = AxisDrivers(SLOW, ["X"], bus=bus)
        drivers.start()
        drivers.exchange()
        assert bus.module.status == Status.ENABLED and bus.module._period == SLOW.sample_period


def test_a_module_that_takes_no_command_is_told() -> None:
    with Wired(lost=100) as bus:
        bus.module.receive(frames.SETUP, frames.encode_setup(0.001), time.monotonic())
        with pytest.raises(MachineError, match=r"X \(node 2\) .* answers, and takes no command of a sample period"):
            AxisDrivers(SLOW, ["X"], bus=bus).start()


class Moving(Puppet):
    """A bus on which X is at these counts in turn."""

    def __init__(self, *counts: int):
        super().__init__()
        self.counts, self.ticks = counts, 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.arbitration_id == frames.COMMAND:
            self.ticks += 1
            self.inbox.append(answer(self.ticks, self.counts[self.ticks % len(self.counts)]))


def test_a_run_begins_with_axes_that_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.bus.modules.drivers_base._LONGEST_COAST", 0.1)
    with Moving(7, 8, 7, 7) as bus:  # between two counts
        AxisDrivers(MACHINE, ["X"], bus=bus).start()
        assert bus.ticks < 40
    with Moving(7, 12, 9, 4, 10) as bus:  # a fine encoder
        AxisDrivers(MACHINE, ["X"], bus=bus).start()
    with Moving(*range(0, 2000, 2)) as bus, pytest.raises(MachineError, match=r"X \(node 2\).*did not come to rest"):
        AxisDrivers(MACHINE, ["X"], bus=bus).start()


def test_the_server_says_what_is_wrong(program: Callable[..., Any]) -> None:
    for arguments, code, words in (
        (["nonsense"], 2, "no machine 'nonsense'"),
        (["mini-cnc", "--axes", "X,Q"], 2, "no axis 'Q'"),
        (["mini-cnc", "--option", "baud=5"], 1, "no option baud"),
        (["mini-cnc", "--interface", "nonsense"], 1, "can't be opened"),
    ):
        process = program("rds.bus.modules.rds.server", *arguments)
        out, err = process.communicate(timeout=30)
        assert process.returncode == code and words in err and out == "" and "Traceback" not in err


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_the_server_ends_cleanly_on_signals(machine_process: Callable[..., Any]) -> None:
    for number in (signal.SIGTERM, signal.SIGINT):
        process = machine_process()
        process.send_signal(number)
        assert process.wait(30) == 0


def test_an_orphaned_machine_ends_when_nobody_commands_it(machine_process: Callable[..., Any]) -> None:
    process = machine_process("--exit-with-stdin", "--afterlife", "1")
    process.stdin.close()
    drivers = AxisDrivers(SLOW, ["X"], channel="m")
    drivers.start()
    drive(drivers, 50, [0.0], 0.01)
    drivers.close()
    assert process.poll() is None
    assert process.wait(30) == 0
