"""Recording from and replaying onto the built-in bus."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import can
import pytest
from waiting import wait_for

from bus_tools.made_frames import frame, kept, of_every_kind
from rds.bus.tools.link import open_bus as open_any
from rds.bus.tools.logs import LogFile
from rds.bus.tools.record import record
from rds.bus.tools.replay import replay
from rds.bus.tools.selection import Selection
from rds.core.errors import InputError, MachineError

Opener = Callable[..., can.BusABC]
TEST_BUS = partial(open_any, "rds", "test")
EXACT = 1e-6  # s, to which times since 1970 are exact


ASKED = {0x013, *range(0x601, 0x680)}  # modules and drives are asked whether they are there


def spaced(count: int, gap: float = 0.01) -> list[can.Message]:
    return [frame(0x780 + k % 16, bytes([k]), k * gap) for k in range(count)]


def drain(bus: can.BusABC, quiet: float = 0.2) -> list[can.Message]:
    return list(iter(lambda: bus.recv(quiet), None))


def frames_in(path: Path) -> int | None:
    """How many frames a file holds, None while it is being written."""
    try:
        return len(list(LogFile(path)))
    except InputError:
        return None


class Recorder:
    """`record` in a thread."""

    def __init__(self, path: Path, **options: Any):
        self.stop, ready = threading.Event(), threading.Event()
        self.result: Any = None
        self.error: BaseException | None = None

        def run() -> None:
            try:
                self.result = record(path, TEST_BUS, stop=self.stop, ready=ready.set, **options)
            except BaseException as error:
                self.error = error

        self.thread = threading.Thread(target=run)
        self.thread.start()
        assert ready.wait(30.0)

    def end(self) -> Any:
        self.stop.set()
        return self.ended()

    def ended(self) -> Any:
        """Its result once it has as many frames as it was to count."""
        self.thread.join(60.0)
        assert self.error is None and not self.thread.is_alive()
        return self.result


class TimedBus:
    """Time that passes only by waiting and sending, and a bus that notes when it is given each frame."""

    def __init__(self) -> None:
        self.now = 0.0  # s
        self.sending: Callable[[int], float] = lambda number: 0.0  # s that it takes to send the frame of this number
        self.times: list[float] = []  # s, of each frame
        self.sent: list[can.Message] = []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def send(self, message: can.Message, timeout: float) -> None:
        self.times.append(self.now)
        self.now += self.sending(len(self.sent))
        self.sent.append(message)

    def recv(self, timeout: float) -> None:
        """Nobody else is on it."""


@pytest.fixture
def timed_bus(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A bus whose time is that of replaying."""
    bus = TimedBus()
    monkeypatch.setattr("rds.bus.tools.replay.time", bus)
    return bus


@pytest.fixture
def pair(open_bus: Opener) -> Iterator[tuple[can.BusABC, can.BusABC]]:
    yield open_bus(), open_bus()


# --- recording


@pytest.mark.parametrize("ending", ["asc", "blf", "log"])
def test_everything_on_the_bus_is_in_the_file(ending: str, tmp_path: Path, open_bus: Opener) -> None:
    sent = [message for message in of_every_kind() if not message.is_error_frame]
    recorder = Recorder(tmp_path / f"a.{ending}", count=len(sent))
    bus = open_bus()
    for message in sent:
        bus.send(message)
    result = recorder.ended()
    assert [kept(message) for message in LogFile(tmp_path / f"a.{ending}")] == [kept(message) for message in sent]
    assert result.complete and result.frames == len(sent)


def test_a_burst_as_fast_as_the_bus_carries_it_is_kept(tmp_path: Path, open_bus: Opener) -> None:
    recorder = Recorder(tmp_path / "a.log", count=20_000)
    bus = open_bus()
    for k in range(20_000):
        bus.send(can.Message(arbitration_id=1, is_extended_id=False, data=k.to_bytes(4, "big")))
    assert recorder.ended().complete
    numbers = [int.from_bytes(message.data, "big") for message in LogFile(tmp_path / "a.log")]
    assert numbers == list(range(20_000))


def test_only_what_was_selected_and_as_many_as_asked(tmp_path: Path, open_bus: Opener) -> None:
    recorder = Recorder(tmp_path / "a.log", selection=Selection(["0x782-0x783"]), count=3)
    bus = open_bus()
    for message in spaced(64):
        bus.send(message)
    assert recorder.ended().frames == 3
    assert [message.arbitration_id for message in LogFile(tmp_path / "a.log")] == [0x782, 0x783, 0x782]


def test_what_a_format_cannot_hold_is_counted(tmp_path: Path, open_bus: Opener) -> None:
    recorder = Recorder(tmp_path / "a.trc", count=8)
    bus = open_bus()
    for message in [*of_every_kind(), frame(0x7FF)]:  # the last is kept, and comes after all the others
        if not message.is_error_frame:
            bus.send(message)
    result = recorder.ended()
    assert result.unkept == {"remote frames": 3, "CAN FD frames": 4}
    assert not result.complete and result.frames == 8


def test_a_killed_hub_is_in_the_result_and_recording_goes_on(
    tmp_path: Path, hub: Callable[..., Any], open_bus: Opener
) -> None:
    process = hub("test")
    recorder = Recorder(tmp_path / "a.log")
    first = open_bus()
    first.send(frame(1))
    wait_for(lambda: b" 001#" in (tmp_path / "a.log").read_bytes())
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    bus = open_bus()

    def second_arrives() -> bool:
        bus.send(frame(2))
        return b" 002#" in (tmp_path / "a.log").read_bytes()

    wait_for(second_arrives)
    result = recorder.end()
    assert len(result.faults) == 1 and "ended without a word" in result.faults[0]
    assert not result.complete
    assert {message.arbitration_id for message in LogFile(tmp_path / "a.log")} == {1, 2}


def test_a_disk_that_is_full_is_said_with_the_file(tmp_path: Path, open_bus: Opener) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    path = tmp_path / "a.log"
    path.symlink_to("/dev/full")
    sender = open_bus()
    with pytest.raises(OSError, match="No space left") as failed:
        record(path, open_bus, force=True, count=10, ready=lambda: [sender.send(frame(k)) for k in range(10)])
    assert failed.value.filename == str(path)


def test_no_bus_no_file(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match="can't be opened"):
        record(tmp_path / "a.log", partial(open_any, "socketcan", "no-such-bus-0"))
    assert not list(tmp_path.iterdir())


def test_a_killed_recorder_leaves_what_it_took(tmp_path: Path, open_bus: Opener) -> None:
    path = tmp_path / "a.blf"
    command = [sys.executable, "-m", "rds.cli.bus", "record", str(path), "--channel", "test"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "recording" in process.stderr.readline()
    bus = open_bus()
    for message in spaced(100):
        bus.send(message)
    wait_for(lambda: frames_in(path) == 100)
    process.kill()
    process.wait()
    process.stderr.close()
    assert len(list(LogFile(path))) == 100


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminal that hangs up")
def test_a_closed_terminal_ends_a_recording_whole(tmp_path: Path, open_bus: Opener) -> None:
    path = tmp_path / "a.log"
    command = [sys.executable, "-m", "rds.cli.bus", "record", str(path), "--channel", "test"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert "recording" in process.stderr.readline()
        bus = open_bus()
        for message in spaced(100):
            bus.send(message)
        wait_for(lambda: (frames_in(path) or 0) > 0)
        process.send_signal(signal.SIGHUP)
        said, problems = process.communicate(timeout=60)
    assert process.returncode == 0, problems
    assert said.startswith(f"{frames_in(path)} frames")


# --- replaying


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_frames_come_at_their_times(speed: float, timed_bus: Any) -> None:
    log = spaced(30)
    result = replay(log, timed_bus, speed=speed)
    assert [kept(message) for message in timed_bus.sent] == [kept(message) for message in log]
    assert timed_bus.times == pytest.approx([0.01 * k / speed for k in range(30)], abs=EXACT)
    assert result.sent == 30 and result.loops == 1 and result.latest < EXACT


def test_frames_cross_the_bus_and_no_sooner_than_their_times(pair: tuple[can.BusABC, can.BusABC]) -> None:
    sender, witness = pair
    log = spaced(30)
    result = replay(log, sender)
    assert [kept(message) for message in drain(witness)] == [kept(message) for message in log]
    assert result.seconds >= 0.29 - EXACT


def test_lateness_does_not_add_up(timed_bus: Any) -> None:
    log = spaced(50)
    timed_bus.sending = lambda number: 0.035 if number == 20 else 0.008  # s, where a frame is due each 10 ms
    result = replay(log, timed_bus)
    late = [at - 0.01 * k for k, at in enumerate(timed_bus.times)]
    assert late[:21] == pytest.approx([0.0] * 21, abs=EXACT)
    assert late[21:34] == pytest.approx(
        [0.025 - 0.002 * k for k in range(13)], abs=EXACT
    )  # 2 ms a frame are made up for
    assert late[34:] == pytest.approx([0.0] * 16, abs=EXACT)
    assert result.latest == pytest.approx(0.025, abs=EXACT)


def test_as_fast_as_possible(pair: tuple[can.BusABC, can.BusABC], timed_bus: Any) -> None:
    sender, witness = pair
    assert replay(spaced(200, gap=1.0), sender, speed=float("inf")).sent == 200
    assert timed_bus.now == 0.0  # s waited
    assert len(drain(witness)) == 200


def test_a_part_of_a_log_by_time_and_identifier(pair: tuple[can.BusABC, can.BusABC]) -> None:
    sender, witness = pair
    selection = Selection(["0x780-0x784", "0x786"])
    result = replay(spaced(32), sender, begin=0.02, end=0.20, selection=selection, speed=10)
    wanted = [k for k in range(2, 21) if k % 16 <= 4 or k % 16 == 6]
    assert [message.data[0] for message in drain(witness)] == wanted
    assert result.skipped == {"not selected": 32 - len(wanted)}


def test_loops_follow_each_other_evenly(timed_bus: Any) -> None:
    assert replay(spaced(5, gap=0.02), timed_bus, loops=3).loops == 3
    assert [message.data[0] for message in timed_bus.sent] == [0, 1, 2, 3, 4] * 3
    assert timed_bus.times == pytest.approx([0.02 * k for k in range(15)], abs=EXACT)


def test_error_frames_are_left_out_and_counted(pair: tuple[can.BusABC, can.BusABC]) -> None:
    sender, witness = pair
    result = replay(of_every_kind(), sender, loops=2)
    assert result.skipped == {"error frames": 1}
    found = [message for message in drain(witness) if message.arbitration_id not in ASKED]
    assert result.sent == len(found) == 2 * (len(of_every_kind()) - 1)


def test_a_replay_that_waits_can_be_stopped(timed_bus: Any) -> None:
    class Stop(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            timed_bus.sleep(timeout)
            if timed_bus.now >= 1.0:
                self.set()
            return self.is_set()

    result = replay([frame(0x790), frame(0x791, at=100.0)], timed_bus, stop=Stop())
    assert result.stopped and result.sent == 1
    assert timed_bus.now < 1.2


@pytest.mark.parametrize(
    "options, word",
    [
        ({"speed": 0.0}, "speed"),
        ({"speed": float("nan")}, "speed"),
        ({"loops": 0}, "loop"),
        ({"begin": 5.0, "end": 1.0}, "from 5.0 s"),
        ({"begin": -1.0}, "from"),
        ({"begin": 50.0}, "no frame to send"),
        ({"selection": Selection(["0x1"])}, "no frame to send"),
    ],
)
def test_what_makes_no_sense_is_refused(options: dict[str, Any], word: str, open_bus: Opener) -> None:
    with pytest.raises(InputError, match=word):
        replay(spaced(5), open_bus(), **options)


def test_a_damaged_log_is_refused_before_anything_is_sent(tmp_path: Path, pair: tuple[can.BusABC, can.BusABC]) -> None:
    path = tmp_path / "a.log"
    path.write_text("(1.0) can0 700#11\n(1.1) can0 700#1\n")
    with pytest.raises(InputError, match=r"a\.log:2"):
        replay(LogFile(path), pair[0])
    assert not drain(pair[1])


@pytest.mark.parametrize("text", ["x", "0x", "0x20000000", "-1", "5-3", "1-", "0x10-"])
def test_what_is_no_identifier_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        Selection([text])


def test_identifiers_of_eight_digits_are_extended() -> None:
    assert frame(0x21) in Selection(["0x021"]) and frame(0x21, is_extended_id=True) not in Selection(["0x21"])
    assert frame(0x21, is_extended_id=True) in Selection(["0x00000021"])
    assert frame(0x12345, is_extended_id=True) in Selection(["0x10000-0x20000"])


# --- a machine on the bus


@pytest.fixture
def machine(program: Callable[..., Any]) -> None:
    """The demo machine on the test channel, in a process of its own."""
    server = program("rds.bus.modules.rds.server", "mini-cnc", "--channel", "test")
    assert server.stdout.readline().startswith("ready")


def test_frames_that_act_on_a_live_machine_are_refused(machine: None, open_bus: Opener) -> None:
    bus, witness = open_bus(), open_bus()
    drain(witness)
    logs = {
        identifier: [frame(0x790), frame(identifier, bytes(8), 0.01)]
        for identifier in (0x010, 0x011, 0x012, 0x021, 0x004, 0x001, 0x000, 0x201, 0x601)
    }
    for identifier, log in logs.items():
        with pytest.raises(InputError, match=r"module 2.*live on this bus.*--with-commands") as caught:
            replay(log, bus)
        assert f"{identifier:#05x}" in str(caught.value)
    assert 0x790 not in {message.arbitration_id for message in drain(witness)}
    for log in logs.values():
        assert replay(log, bus, selection=Selection(["0x790"])).sent == 1


@pytest.mark.parametrize("log, ends", [([0x010, 0x010], True), ([0x790, 0x790], False)])
def test_a_machine_that_comes_meanwhile_ends_a_replay_of_commands(log: list[int], ends: bool, timed_bus: Any) -> None:
    class Clock(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            timed_bus.sleep(timeout)
            return False

    came: list[can.Message] = []

    def recv(timeout: float) -> can.Message | None:
        if timed_bus.now < 50.0 or came:
            return None
        came.append(frame(0x022, bytes(8)))  # module 2 answers
        return came[0]

    timed_bus.recv = recv
    messages = [frame(identifier, bytes(8), at) for identifier, at in zip(log, (0.0, 100.0), strict=True)]
    if not ends:
        assert replay(messages, timed_bus, stop=Clock()).sent == 2
        return
    with pytest.raises(InputError, match="module 2 lives on this bus"):
        replay(messages, timed_bus, stop=Clock())
    assert timed_bus.now < 51.0
    assert timed_bus.sent[-1].data == bytes(8) and timed_bus.sent[-1].arbitration_id == 0x010, "zero volts at the end"


def test_with_commands_ends_at_zero_volts(machine: None, open_bus: Opener) -> None:
    bus, witness = open_bus(), open_bus()
    command = frame(0x010, b"\0\x40" + bytes(6))
    assert replay([command], bus, with_commands=True).sent == 1
    commands = [bytes(message.data) for message in drain(witness) if message.arbitration_id == 0x010]
    assert commands == [bytes(command.data), bytes(8)]


def test_without_a_machine_commands_are_frames_like_others(pair: tuple[can.BusABC, can.BusABC]) -> None:
    assert replay([frame(0x010, bytes(8))], pair[0]).sent == 1


def test_mf4_is_recorded_from_the_bus_and_replayed_onto_it(
    tmp_path: Path, open_bus: Opener, pair: tuple[can.BusABC, can.BusABC]
) -> None:
    pytest.importorskip("asammdf", reason="MF4 needs the package asammdf: pip install asammdf")
    sender, listener = pair
    sent = spaced(50)
    recorder = Recorder(tmp_path / "log.mf4", count=50)
    for message in sent:
        sender.send(message)
    assert recorder.ended().frames == 50
    drain(listener)
    replay(LogFile(tmp_path / "log.mf4"), sender, speed=float("inf"))
    heard = drain(listener)
    assert [(m.arbitration_id, bytes(m.data)) for m in heard] == [(m.arbitration_id, bytes(m.data)) for m in sent]


@pytest.mark.parametrize("ending", ["asc", "blf", "trc", "log"])
def test_a_recording_opens_with_python_can_s_own_reader(ending: str, tmp_path: Path, open_bus: Opener) -> None:
    sent = spaced(60)
    recorder = Recorder(tmp_path / f"log.{ending}", count=60)
    bus = open_bus()
    for message in sent:
        bus.send(message)
    assert recorder.ended().frames == 60
    with can.LogReader(tmp_path / f"log.{ending}") as reader:
        found = list(reader)
    assert [(m.arbitration_id, bytes(m.data)) for m in found] == [(m.arbitration_id, bytes(m.data)) for m in sent]
    assert all(a.timestamp <= b.timestamp for a, b in itertools.pairwise(found))
