"""The bus with bit timing between real processes: order, stamps, refusals, error states, and runs that meet faults."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from waiting import wait_for

import rds
from rds.bus.hub import connect
from rds.bus.hub.faults import Faults
from rds.bus.medium.bits import frame_time
from rds.bus.medium.error_reports import describe
from rds.bus.medium.fault_kinds import Fault
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.results import Result

from .conftest import FORK

MBIT = 1_000_000
PERIOD = 0.02  # s of runs that meet faults: with room for a busy computer
MACHINE = load_machine("mini-cnc")


def frame(identifier: int, data: bytes = b"", **fields: Any) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=fields.pop("extended", False), **fields)


@pytest.fixture
def timed(open_bus: Callable[..., can.BusABC]) -> Callable[..., can.BusABC]:
    return lambda name, **options: open_bus(bitrate=MBIT, name=name, **options)


@pytest.fixture
def faults(timed: Callable[..., can.BusABC]) -> Iterator[Faults]:
    timed("listener")
    with Faults("test") as line:
        yield line


def state_of(line: Faults, name: str) -> dict[str, Any]:
    return next(node for node in line.nodes() if node["name"] == name)


# --- the bus


def test_stamps_are_spaced_by_exact_frame_times(timed: Callable[..., can.BusABC]) -> None:
    sender, receiver = timed("A"), timed("B")
    with Faults("test") as line:
        line.inject("babble", node="B", identifier=0)  # so that all wait for the bus together
        for number in range(30):
            sender.send(frame(0x100 + number, bytes(range(number % 9))))
        wait_for(lambda: state_of(line, "A")["waiting"] == 30)
        line.clear()
        seen: list[can.Message] = []
        while len(seen) < 30:
            message = receiver.recv(10.0)
            assert message is not None
            seen.append(message)
    assert [message.arbitration_id for message in seen] == list(range(0x100, 0x100 + 30))
    for before, after in pairwise(seen):
        expected = 3000 + frame_time(after.arbitration_id, bytes(after.data), bitrate=MBIT)
        # a float of seconds since 1970 is exact to a quarter of a µs
        assert (after.timestamp - before.timestamp) * 1e9 == pytest.approx(expected, abs=600)


def send_some(identifier: int, count: int, go: Any) -> None:
    with can.Bus(interface="rds", channel="test", can_filters=[{"can_id": 0x7FF, "can_mask": 0x7FF}]) as bus:
        go.wait()
        for number in range(count):
            bus.send(frame(identifier, number.to_bytes(2, "little")))
        while bus.recv(0.5) is None:
            pass


def test_all_see_one_order_and_nobody_overtakes_himself(
    timed: Callable[..., can.BusABC], start: Callable[..., Any]
) -> None:
    first, second, go = timed("A"), timed("B"), FORK.Event()
    senders = (0x300, 0x200, 0x100)
    processes = [start(send_some, identifier, 200, go) for identifier in senders]
    with Faults("test") as line:
        wait_for(lambda: len(line.nodes()) == 5)
        go.set()
        seen = []
        for bus in (first, second):
            got = [bus.recv(10.0) for _ in range(600)]
            seen.append([(m.arbitration_id, int.from_bytes(m.data, "little"), m.timestamp) for m in got if m])
        assert seen[0] == seen[1] and len(seen[0]) == 600
        for identifier in senders:
            assert [number for who, number, _ in seen[0] if who == identifier] == list(range(200))
        statistics = line.statistics()
        assert statistics["frames"] == 600 and statistics["delivery_lateness"]["count"] == 600
    first.send(frame(0x7FF))
    for process in processes:
        process.join(30)
        assert process.exitcode == 0


def test_statistics_begin_anew_when_asked(timed: Callable[..., can.BusABC]) -> None:
    sender, listener = timed("A"), timed("B")
    with Faults("test") as line:
        line.inject("corrupt", node="A", count=2)
        sender.send(frame(0x123))
        assert listener.recv(10.0) is not None
        found = line.statistics(reset=True)
        assert (found["frames"], found["error_frames"], found["struck"]) == (1, 2, 2)
        again = line.statistics()
        assert (again["frames"], again["error_frames"], again["struck"]) == (0, 0, 0)


def test_another_bit_rate_is_refused_and_none_joins(
    timed: Callable[..., can.BusABC], open_bus: Callable[..., can.BusABC]
) -> None:
    timed("A")
    with pytest.raises(can.CanInitializationError, match="the bus runs at 1000000 bit/s, not 500000"):
        open_bus(bitrate=500_000)
    with pytest.raises(can.CanInitializationError, match="data rate is 1000000, not 4000000"):
        open_bus(bitrate=MBIT, data_bitrate=4 * MBIT)
    assert open_bus().bitrate == MBIT  # type: ignore[attr-defined]
    open_bus("other")
    with pytest.raises(can.CanInitializationError, match="untimed; open it without a bitrate"):
        open_bus("other", bitrate=MBIT)


def test_the_next_first_node_chooses_anew(open_bus: Callable[..., can.BusABC]) -> None:
    first = open_bus(bitrate=MBIT)
    hub = first.hub_pid  # type: ignore[attr-defined]
    first.shutdown()
    for options, expected in (({}, 0), ({"bitrate": 125_000}, 125_000)):
        bus = open_bus(**options)
        assert (bus.hub_pid, bus.bitrate) == (hub, expected)  # type: ignore[attr-defined]
        bus.shutdown()


@pytest.mark.parametrize(
    "options, reason",
    [
        ({"bitrate": 5}, "from 10000 to 1000000 bit/s"),
        ({"bitrate": "fast"}, "bitrate = 'fast' must be a whole number"),
        ({"data_bitrate": MBIT}, "without bitrate"),
        ({"name": "x" * 100}, "at most"),
        ({"restart_ms": -5}, "restart_ms"),
        ({"restart_ms": -1}, "restart_ms"),
        ({"error_frames": 1}, "true or false"),
    ],
)
def test_bad_options_are_refused(open_bus: Callable[..., can.BusABC], options: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        open_bus(**options)


def test_a_sender_waits_when_its_controller_is_full(
    open_bus: Callable[..., can.BusABC],
) -> None:
    sender, receiver = open_bus(bitrate=125_000), open_bus()
    begin = time.monotonic()
    for number in range(1500):
        sender.send(frame(1, number.to_bytes(8, "little")))
    assert time.monotonic() - begin > 0.5, "1500 frames last 1.4 s"
    assert [int.from_bytes(m.data, "little") for _ in range(1500) if (m := receiver.recv(2.0))] == list(range(1500))


def test_alone_a_node_waits_for_somebody_who_acknowledges(timed: Callable[..., can.BusABC]) -> None:
    alone = timed("A")
    alone.send(frame(5))
    wait_for(lambda: alone.state is can.BusState.PASSIVE)
    with pytest.raises(can.CanTimeoutError, match="nobody acknowledges"):
        for _ in range(5000):
            alone.send(frame(6), timeout=0.05)
    other = timed("B")
    message = other.recv(10.0)
    assert message is not None and message.arbitration_id == 5
    wait_for(lambda: alone.state is can.BusState.ACTIVE)


# --- error states


def test_bus_off_and_back_on_request(timed: Callable[..., can.BusABC], faults: Faults) -> None:
    node, quick = timed("A", error_frames=True), timed("B", restart_ms=100)
    for name, bus in (("A", node), ("B", quick)):
        faults.inject("corrupt", node=name, count=32)
        bus.send(frame(5))
        wait_for(lambda bus=bus: bus.state is can.BusState.ERROR)  # type: ignore[misc]
    with pytest.raises(can.CanOperationError, match=r"bus off.*restart\(\)"):
        node.send(frame(6))
    wait_for(lambda: quick.state is can.BusState.ACTIVE)
    assert state_of(faults, "A")["state"] == "bus off", "nobody asked it to come back"
    node.restart()  # type: ignore[attr-defined]
    wait_for(lambda: node.state is can.BusState.ACTIVE)
    with pytest.raises(can.CanOperationError, match="not bus off"):
        node.restart()  # type: ignore[attr-defined]
    node.send(frame(7))
    message = quick.recv(10.0)
    assert message is not None and message.arbitration_id == 7
    reports = []
    while (message := node.recv(0.05)) is not None:
        assert message.is_error_frame
        reports.append(describe(message.arbitration_id, message.data))
    assert any(text.startswith("transmit passive") for text in reports)
    assert any(text.startswith("bus off") for text in reports) and reports[-1].startswith("restarted")


def test_opening_the_bus_again_is_a_new_controller(timed: Callable[..., can.BusABC], faults: Faults) -> None:
    node = timed("A")
    faults.inject("corrupt", node="A", count=32)
    node.send(frame(5))
    wait_for(lambda: node.state is can.BusState.ERROR)
    node.shutdown()
    assert timed("A").state is can.BusState.ACTIVE


def test_faults_need_a_bus_and_a_node_on_it(timed: Callable[..., can.BusABC]) -> None:
    with pytest.raises(MachineError, match="no bus on channel 'nobody'"):
        Faults("nobody")
    timed("A")
    with Faults("test") as line:
        with pytest.raises(InputError, match="no node is called 'B'; on the bus: A"):
            line.inject("unplug", node="B")
        with pytest.raises(InputError, match="did you mean 'unplug'"):
            line.inject("unplugg", node="A")


@pytest.mark.parametrize(
    "question",
    [
        *("", "nonsense", "[]", "5", "[" * 100_000, '{"do": []}', '{"do": "restart", "number": "x"}'),
        *('{"do": "inject"}', *(f'{{"do": "inject", "faults": {faults}}}' for faults in ("[5]", '"xyz"', "[[]]"))),
    ],
    ids=range(11),
)
def test_a_question_that_makes_no_sense_hurts_nobody(timed: Callable[..., can.BusABC], question: str) -> None:
    first, second = timed("A"), timed("B")
    visitor = connect.visit("test")
    assert visitor is not None
    assert "error" in connect.ask(visitor, question)
    visitor.sock.close()
    first.send(frame(1))
    assert second.recv(10.0) is not None


def test_a_lone_node_that_is_killed_keeps_no_hub(start: Callable[..., Any], hub: Callable[..., Any]) -> None:
    process = hub("test", "--linger", "0.2")
    flood = start(flood_alone)
    flood.join(60)
    assert process.wait(30) == 0


def flood_alone() -> None:
    bus = can.Bus(interface="rds", channel="test", bitrate=MBIT)
    with contextlib.suppress(can.CanTimeoutError):
        while True:
            bus.send(frame(1), timeout=0.05)
    os._exit(0)


def test_faults_end_with_the_line_that_owns_them(timed: Callable[..., can.BusABC], faults: Faults) -> None:
    timed("A")
    with Faults("test") as line:
        line.play([Fault("unplug", "A")])
        assert not state_of(faults, "A")["plugged"]
    wait_for(lambda: state_of(faults, "A")["plugged"])


def test_an_untimed_bus_refuses_what_needs_bits(open_bus: Callable[..., can.BusABC]) -> None:
    sender, receiver = open_bus(name="A"), open_bus(name="B")
    with Faults("test") as line:
        with pytest.raises(InputError, match="bit timing"):
            line.inject("corrupt", node="A")
        line.inject("lose", node="A")
        for number in range(2):
            sender.send(frame(number))
        message = receiver.recv(10.0)
        assert message is not None and message.arbitration_id == 1
        line.inject("unplug", node="B", duration=0.2)
        sender.send(frame(2))
        time.sleep(0.4)
        sender.send(frame(3))
        message = receiver.recv(10.0)
        assert message is not None and message.arbitration_id == 3


# --- runs


def experiment(period: float, duration: float, **bus: Any) -> rds.Experiment:
    return rds.Experiment(
        axis=("X", "Y", "Z", "spindle"),
        reference=rds.sinusoid(2.0, 1.0),
        controller={"name": "tracking", "gains": [1600.0, -36.6]},
        overrides={
            "spindle": {"reference": rds.sinusoid(500.0, 1.0), "controller": {"name": "p", "Pgain": 0.005}},
        },
        sample_period=period,
        duration=duration,
        mode="implementation",
        bus=bus,
    )


def run(own: rds.Experiment, folder: Path, ending: str) -> Result:
    """Run until it ends so; twice more at most, where the system stood still (the run is void then)."""
    result = own.run(out=folder / "out")
    for attempt in range(2):
        if result.meta["ending"] == ending or result.verdict != "void":
            break
        result = own.run(out=folder / f"out{attempt}")
    return result


@pytest.mark.realtime
def test_an_emulation_on_the_timed_bus_repeats_simulation(tmp_path: Path) -> None:
    """1 kHz with four axes at 1 Mbit/s: 0.6 ms of every ms are on the wire."""
    own = experiment(0.001, 0.5, bitrate=MBIT)
    simulated, emulated = own.run("simulation"), own.run("emulation", out=tmp_path / "out")
    assert emulated.meta["ending"] == "done"
    for column in simulated.columns:
        assert np.array_equal(simulated.table[column], emulated.table[column]), column


@pytest.mark.realtime
@pytest.mark.parametrize(
    "fault, reason",
    [
        ('kind = "unplug"\nnode = "Y"', "no answer from Y (node 3)"),
        ('kind = "die"\nnode = "Z"', "no answer from Z (node 4)"),
        ('kind = "babble"\nnode = "spindle"\nfor = 1.0', "no answer from"),
        ('kind = "unplug"\nnode = "host"', "no answer from"),
        ('kind = "corrupt"\nnode = "host"\nfor = 5.0', "bus off"),
    ],
    ids=lambda value: value.replace("\n", ", ").replace('"', "") if "kind" in str(value) else "",
)
def test_a_fault_that_lasts_ends_the_run_as_documented(tmp_path: Path, fault: str, reason: str) -> None:
    schedule = tmp_path / "faults.toml"
    schedule.write_text(f"[[fault]]\nat = 0.3\n{fault}\n")
    result = run(experiment(PERIOD, 1.0, bitrate=500_000, faults=str(schedule)), tmp_path, "machine lost")
    assert result.meta["ending"] == "machine lost", result.meta.get("ending_reason")
    assert reason in result.meta["ending_reason"]
    # The schedule's clock starts with the bus, a moment before the loop's: how long, a busy computer decides.
    assert 0.15 <= result.table["time"].iloc[-1] <= 0.3 + 13 * PERIOD


PASSING = (
    'kind = "lose"\nnode = "Y"\ncount = 3',
    'kind = "corrupt"\ncount = 20\nprobability = 0.5\nseed = 1',
    'kind = "delay"\nnode = "Y"\ncount = 3\nby = 0.05',
    'kind = "duplicate"\nnode = "host"\ncount = 3',
    'kind = "hang"\nnode = "Y"\nfor = 0.1',
    'kind = "unplug"\nnode = "Y"\nfor = 0.1',
)


@pytest.mark.realtime
def test_faults_that_pass_do_not_end_a_run(tmp_path: Path) -> None:
    """One after the other, each with a third of a second to pass."""
    schedule = tmp_path / "faults.toml"
    schedule.write_text("".join(f"[[fault]]\nat = {0.3 * n}\n{fault}\n" for n, fault in enumerate(PASSING, 1)))
    result = run(experiment(PERIOD, 2.4, bitrate=500_000, faults=str(schedule)), tmp_path, "done")
    assert result.meta["ending"] == "done", result.meta.get("ending_reason")


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("fault", "ending"), [('kind = "die"', "machine lost"), ('kind = "hang"\nfor = 0.07', "done")], ids=["die", "hang"]
)
def test_a_module_silent_at_the_end_is_lost_unless_it_comes_back(tmp_path: Path, fault: str, ending: str) -> None:
    """Less than 0.1 s before the end: too late for the run itself to notice."""
    schedule = tmp_path / "faults.toml"
    schedule.write_text(f'[[fault]]\nat = 0.25\nnode = "Y"\n{fault}\n')
    period = 0.005  # lost after 20 periods without an answer
    words = experiment(period, 0.3, bitrate=500_000, faults=str(schedule))
    result = run(words, tmp_path, ending)
    assert result.meta["ending"] == ending, result.meta.get("ending_reason")
    assert ("no answer from Y (node 3)" in (result.meta.get("ending_reason") or "")) == (ending == "machine lost")


@pytest.mark.realtime
def test_a_run_with_a_fault_for_nobody_says_so(tmp_path: Path) -> None:
    schedule = tmp_path / "faults.toml"
    schedule.write_text('[[fault]]\nat = 0.3\nkind = "unplug"\nnode = "W"\n')
    with pytest.raises(InputError, match=r"node 'W', which is not on bus.*there are X, Y, Z, spindle, host"):
        run(experiment(PERIOD, 0.5, bitrate=500_000, faults=str(schedule)), tmp_path, "done")


def test_a_module_that_is_plugged_in_again_is_at_zero_volts(program: Callable[..., Any]) -> None:
    """Its watchdog has cut the voltage; the old answers that waited in its controller confuse nobody."""
    server = program("rds.bus.modules.rds.server", "mini-cnc", "--channel", "m", "--option", "bitrate=500000")
    assert server.stdout.readline().startswith("ready")
    drivers = AxisDrivers(MACHINE, ["X", "Y"], channel="m", sample_period=0.01)
    drivers.start()

    def cycles(count: int) -> list[float]:
        positions: list[float] = []
        for _ in range(count):
            due = time.monotonic() + 0.01
            positions = drivers.exchange()
            drivers.write([0.0, 2.0])
            time.sleep(max(0.0, due - time.monotonic()))
        return positions

    with Faults("m") as line:
        before = cycles(10)[1]
        line.inject("unplug", node="Y")
        with pytest.raises(MachineError, match=r"no answer from Y \(node 3\)"):
            cycles(20)
        drivers.stop()
        time.sleep(0.3)
        line.inject("plug", node="Y")
        drivers.start()
        stopped = drivers.exchange()[1]
        assert stopped == 0.0, "counted from where it stands"
        assert cycles(10)[1] > 0.0 and before > 0.0
        assert drivers.counters.watchdogs == 0
    drivers.close()


def test_the_machine_brings_its_own_faults(program: Callable[..., Any], tmp_path: Path) -> None:
    schedule = tmp_path / "faults.toml"
    schedule.write_text('[[fault]]\nkind = "unplug"\nnode = "X"\n')
    server = program(
        "rds.bus.modules.rds.server",
        "mini-cnc",
        "--channel",
        "m",
        "--option",
        "bitrate=500000",
        "--faults",
        str(schedule),
    )
    assert server.stdout.readline().startswith("ready")
    with Faults("m") as line:
        assert [node["name"] for node in line.nodes()] == list(MACHINE.axes)
        assert not state_of(line, "X")["plugged"] and state_of(line, "Y")["plugged"]
    schedule.write_text('[[fault]]\nkind = "unplugg"\nnode = "X"\n')
    other = program("rds.bus.modules.rds.server", "mini-cnc", "--channel", "n", "--faults", str(schedule))
    assert other.wait(30) == 2 and f"{schedule}, line 2" in other.stderr.read()


def test_the_error_states_and_the_hub_leave_nothing_behind(
    hub: Callable[..., Any], open_bus: Callable[..., can.BusABC], runtime_directory: Path
) -> None:
    process = hub("test", "--linger", "0.5")
    bus = open_bus(bitrate=MBIT)
    assert (runtime_directory / "rds" / "test.states").exists()
    bus.shutdown()
    assert process.wait(30) == 0
    assert os.listdir(runtime_directory / "rds") == []
