"""Adapters: what goes wrong in them is told by name, one opened interface serves all modules, own frames come back."""

from __future__ import annotations

import json
import os
import select
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import cast
from uuid import uuid4

import can
import pytest
from can.interfaces.slcan import slcanBus
from typer.testing import CliRunner
from waiting import wait_for

from rds.bus.modules.bus_node import BusTime
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.bus.modules.rds.server import serve
from rds.bus.modules.shared_bus import SharedInterface, opener_of
from rds.bus.tools.adapter import AdapterFailure
from rds.bus.tools.link import bus_failed, open_bus
from rds.bus.tools.slcan_adapter import SlcanAdapter
from rds.cli.main import app
from rds.core.errors import AdapterError, MachineError
from rds.machines import load_machine
from rds.results import open_result

pytestmark = pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals are not on Windows")
QUICK = {"sleep_after_open": 0.0, "bitrate": 500_000}
UNPLUGGED = """
machine = "mini-cnc"
axis = "X"
mode = "implementation"
duration = 30.0
sample_period = 0.02
[reference]
kind = "sinusoid"
amplitude = 1.0
frequency = 0.5
[controller]
name = "pid"
[bus]
interface = "slcan"
channel = "{channel}"
bitrate = 500000
sleep_after_open = 0.0
"""


@contextmanager
def adapter(channel: str, **faults: float) -> Iterator[SlcanAdapter]:
    """In front of a channel of python-can's virtual bus."""
    with can.Bus(interface="virtual", channel=channel) as wire, SlcanAdapter(wire, **faults) as plugged:
        yield plugged


@pytest.fixture
def channel() -> str:
    return f"adapter-{uuid4().hex[:8]}"


def message(identifier: int, data: bytes = b"", extended: bool = False) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=extended)


def test_frames_go_both_ways(channel: str) -> None:
    with adapter(channel) as plugged, can.Bus(interface="virtual", channel=channel) as other:
        bus = open_bus("slcan", plugged.path, **QUICK)
        try:
            bus.send(message(0x123, b"\x01\x02"))
            heard = other.recv(5.0)
            assert heard is not None and (heard.arbitration_id, bytes(heard.data)) == (0x123, b"\x01\x02")
            other.send(message(0x18FEF1FE, b"\xff", True))
            back = bus.recv(5.0)
            assert back is not None and back.arbitration_id == 0x18FEF1FE and back.is_extended_id
            assert plugged.bitrate == 500_000
        finally:
            bus.shutdown()


def test_at_another_bit_rate_than_the_bus_nothing_is_heard_nor_acknowledged(channel: str) -> None:
    with adapter(channel, bus_bitrate=250_000) as plugged, can.Bus(interface="virtual", channel=channel) as other:
        bus = open_bus("slcan", plugged.path, **QUICK)
        try:
            wait_for(lambda: plugged.is_open)
            bus.send(message(0x123))
            other.send(message(0x124))
            assert bus.recv(0.1) is None and other.recv(0.0) is None
        finally:
            bus.shutdown()


class Prioritizing:
    """A bus whose controller would send by priority if it held more than one frame; gives each back after a while."""

    def __init__(self) -> None:
        self.sent: list[int] = []
        self.held: list[can.Message] = []
        self.most = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg.arbitration_id)
        self.held.append(msg)
        self.most = max(self.most, len(self.held))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        time.sleep(0.005)
        if not self.held:
            return None
        back = self.held.pop()
        back.is_rx = False
        return back


def test_an_adapter_that_only_listens_sends_nothing(channel: str) -> None:
    with (
        can.Bus(interface="virtual", channel=channel) as other,
        adapter(channel) as plugged,
        slcanBus(plugged.path, listen_only=True, sleep_after_open=0.0, bitrate=500_000) as bus,
    ):
        wait_for(lambda: plugged.only_listens)
        bus.send(message(0x123))
        other.send(message(0x321))
        heard = wait_for(lambda: bus.recv(0.1))
        assert heard.arbitration_id == 0x321
        assert bus.get_version(10.0) == (10, 13)  # said after the frame was looked at
        assert other.recv(0.0) is None


def test_a_bit_rate_may_be_told_by_registers(channel: str) -> None:
    for rate, timing in (
        (125_000, can.BitTiming(8_000_000, brp=4, tseg1=13, tseg2=2, sjw=1)),
        (500_000, can.BitTiming(8_000_000, brp=1, tseg1=13, tseg2=2, sjw=1)),
    ):
        with adapter(channel) as plugged:
            with can.Bus(interface="slcan", channel=plugged.path, timing=timing, sleep_after_open=0.0):
                wait_for(lambda: plugged.is_open and plugged.bitrate)
            assert plugged.bitrate == rate


def test_a_frame_waits_until_the_one_before_it_is_on_the_wire() -> None:
    wire = Prioritizing()
    with SlcanAdapter(cast(can.BusABC, wire), gives_back=True) as plugged:
        bus = open_bus("slcan", plugged.path, **QUICK)
        try:
            for identifier in (0x202, 0x080, 0x203):
                bus.send(message(identifier))
            wait_for(lambda: len(wire.sent) >= 3 and not wire.held)
            assert wire.sent == [0x202, 0x080, 0x203] and wire.most == 1
            assert bus.recv(0.0) is None, "its own frames are not the computer's to hear"
        finally:
            bus.shutdown()


def test_a_garbled_line_names_the_adapter_the_cause_and_the_remedy(channel: str) -> None:
    with adapter(channel, garble=1.0) as plugged, can.Bus(interface="virtual", channel=channel) as other:
        bus = open_bus("slcan", plugged.path, **QUICK)
        try:
            wait_for(lambda: plugged.is_open)
            other.send(message(0x123, b"\x01"))
            with pytest.raises(
                AdapterFailure, match=f"adapter slcan:{plugged.path} sent what is no frame.*tty_baudrate"
            ):
                bus.recv(5.0)
        finally:
            bus.shutdown()


def test_an_adapter_that_is_unplugged_ends_a_run_by_its_name(channel: str) -> None:
    machine, stop, ready = load_machine("mini-cnc"), threading.Event(), threading.Event()
    server = threading.Thread(target=serve, args=(machine, "virtual", channel, ["X"], ready.set, stop))
    server.start()
    try:
        assert ready.wait(20.0)
        with adapter(channel) as plugged:
            drivers = AxisDrivers(
                machine, ["X"], interface="slcan", channel=plugged.path, sample_period=0.02, timeout=0.2, **QUICK
            )
            drivers.start()
            for _ in range(3):
                drivers.exchange()
                drivers.write([0.0])
            plugged.unplug()
            with pytest.raises(AdapterError, match=r"adapter slcan:\S+ is gone or has failed.*plug it in again"):
                for _ in range(20):
                    drivers.exchange()
            drivers.close()
    finally:
        stop.set()
        server.join()


@pytest.mark.realtime
def test_a_whole_run_ends_as_adapter_lost_and_its_record_opens(channel: str, tmp_path: Path) -> None:
    machine, stop, ready = load_machine("mini-cnc"), threading.Event(), threading.Event()
    server = threading.Thread(target=serve, args=(machine, "virtual", channel, ["X"], ready.set, stop))
    server.start()
    try:
        assert ready.wait(20.0)
        with adapter(channel) as plugged:
            (tmp_path / "unplugged.toml").write_text(UNPLUGGED.format(channel=plugged.path))
            record = tmp_path / "run" / "record.rds"

            def unplug() -> None:
                first, deadline = 0, time.monotonic() + 60.0
                while time.monotonic() < deadline:  # until samples have come behind the head
                    size = record.stat().st_size if record.is_file() else 0
                    first = first or size
                    if size > first:
                        break
                    time.sleep(0.01)
                plugged.unplug()

            watcher = threading.Thread(target=unplug)
            watcher.start()
            found = CliRunner().invoke(app, ["run", str(tmp_path / "unplugged.toml"), "--out", str(record.parent)])
            watcher.join()
    finally:
        stop.set()
        server.join()
    assert found.exit_code == 1, found.output
    assert "(adapter lost): the adapter slcan:" in found.stderr and "plug it in again" in found.stderr
    assert json.loads((record.parent / "ending.json").read_text())["ending"] == "adapter lost"
    assert 0 < len(open_result(record).table["time"]) < 1500


def test_all_modules_share_an_adapter_that_can_be_opened_once(channel: str) -> None:
    """Three modules behind one serial adapter answer one tick, and each hears what another one sends."""
    machine, stop, ready = load_machine("mini-cnc"), threading.Event(), threading.Event()
    with adapter(channel) as plugged, can.Bus(interface="virtual", channel=channel) as host:
        server = threading.Thread(
            target=serve, args=(machine, "slcan", plugged.path, ["X", "Y", "Z"], ready.set, stop), kwargs=QUICK
        )
        server.start()
        try:
            assert ready.wait(20.0)
            wait_for(lambda: plugged.is_open)
            host.send(message(frames.CALL))
            nodes, deadline = set(), time.monotonic() + 10.0
            while len(nodes) < 3 and time.monotonic() < deadline:
                heard = host.recv(0.5)
                nodes |= {heard.arbitration_id - frames.ANSWER} if heard is not None else set()
            assert nodes == {machine.axis(name).node for name in "XYZ"}
        finally:
            stop.set()
            server.join()


def test_the_modules_on_one_adapter_hear_each_other(channel: str) -> None:
    with adapter(channel) as plugged, ExitStack() as stack:
        opener = opener_of("slcan", plugged.path, **QUICK)
        first, second = (stack.enter_context(opener([0x10, number], node=f"{number}")) for number in (1, 2))
        first.send(message(0x10, b"\x07"))
        heard = second.recv(5.0)
        assert heard is not None and bytes(heard.data) == b"\x07"
        assert first.recv(0.0) is None
        plugged.unplug()
        with pytest.raises(can.CanError, match="is gone or has failed"):
            second.recv(5.0)
        with pytest.raises(MachineError, match="can't be opened"):
            opener([0x10])


def test_a_module_that_was_held_up_has_every_frame_and_is_not_behind_afterwards(channel: str) -> None:
    shared = SharedInterface(lambda: can.Bus(interface="virtual", channel=channel), "shared")
    with shared.end([0x10]) as module, shared.end() as other:
        for number in range(1000):
            other.send(message(0x10, number.to_bytes(2, "big")))
        heard = [module.recv(0.0) for _ in range(1000)]
        assert [int.from_bytes(each.data, "big") for each in heard if each is not None] == list(range(1000))
        assert module.recv(0.0) is None and not select.select([module], [], [], 0.0)[0]
        other.send(message(0x10, b"\x07"))
        last = module.recv(0.0)
        assert last is not None and bytes(last.data) == b"\x07"
        assert last.timestamp == 0.0, "none: the adapter's stamps are of a clock that nobody here has"


def test_bus_time_goes_on_from_where_it_was_when_the_clock_of_the_stamps_is_set() -> None:
    clock = BusTime()
    before = clock.at(1000.0)
    assert clock.at(1000.25) - before == pytest.approx(0.25, abs=1e-6)
    for stamp in (5000.0, 1.7e9, 3.0, 0.0):
        assert before < clock.at(stamp) < before + 60.0


def test_bus_time_is_that_of_the_stamps_however_late_frames_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    local = SimpleNamespace(time=lambda: 1.7e9, monotonic=lambda: 0.0)
    monkeypatch.setattr("rds.bus.modules.bus_node.time", local)
    clock = BusTime()
    at = clock.at(1.7e9)
    local.monotonic = lambda: 5.0  # it was held up for so long, and nothing came for nearly as long
    assert [clock.at(1.7e9 + later) - at for later in (0.25, 4.5)] == [0.25, 4.5]


def test_bus_time_goes_on_when_the_clock_of_the_stamps_is_set_back_in_a_silence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It stood for as long as nothing had come, and so did the axes of simulated modules."""
    local = SimpleNamespace(time=lambda: 1.7e9, monotonic=lambda: 0.0)
    monkeypatch.setattr("rds.bus.modules.bus_node.time", local)
    clock = BusTime()
    clock.at(1.7e9)
    local.monotonic = lambda: 60.0
    assert [clock.at(1.7e9 - 3540.0 + later) - 1.7e9 for later in (0.0, 0.25)] == [60.0, 60.25]


def test_own_frames_that_an_interface_gives_back_are_dropped() -> None:
    group = f"ff15::{uuid4().hex[:4]}"
    options = {"port": 43000 + os.getpid() % 1000, "beyond_this_computer": True}
    try:
        bus, other = (open_bus("udp_multicast", group, **options) for _ in range(2))
    except MachineError as error:
        pytest.skip(f"no multicast here: {error}")
    try:
        for number in range(5):
            bus.send(message(0x100 + number, bytes([number])))
            other.send(message(0x200 + number, bytes([number])))
        for ends, first in ((bus, 0x200), (other, 0x100)):
            heard = [frame.arbitration_id for _ in range(5) if (frame := ends.recv(5.0)) is not None]
            assert heard == [first + number for number in range(5)]
            assert ends.recv(0.05) is None
    finally:
        bus.shutdown()
        other.shutdown()


def test_a_bus_that_fails_says_once_what_to_do(alone: Path) -> None:
    with can.Bus(interface="rds", channel="fails") as bus:
        os.kill(bus.hub_pid, signal.SIGKILL)
        with pytest.raises(can.CanError) as lost:
            while True:
                bus.recv(1.0)
        said = str(bus_failed(bus.channel_info, lost.value))
    assert said.count("open the bus again") == 1 and said.count("built-in bus") == 1
    assert "cable" not in said, "there is none"
    assert str(bus_failed("slcan:/dev/ttyACM0", OSError("no such device"))).endswith(
        "no such device; check power, cable and adapter, then open it again"
    )
