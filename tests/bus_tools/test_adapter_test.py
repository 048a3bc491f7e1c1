"""`rds doctor --bus`: measured on buses whose faults are known."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import can
import pytest

from rds.bus.tools import adapter_test
from rds.bus.tools.adapter_test import AdapterReport, examine, hints, latency_timer
from rds.bus.tools.link import open_bus
from rds.bus.tools.slcan_adapter import SlcanAdapter

SDO = bytes.fromhex("4000100000000000")


@contextmanager
def device(channel: str, node: int = 5, times: int = 1, silent: int = 0) -> Iterator[None]:
    """A CANopen device that answers `times` times, but not every `silent`-th question."""
    stop = threading.Event()

    def answer(bus: can.BusABC) -> None:
        asked = 0
        while not stop.is_set():
            heard = bus.recv(0.05)
            if heard is None or heard.arbitration_id != 0x600 + node:
                continue
            asked += 1
            if silent and asked > 1 and asked % silent == 0:
                continue
            for _ in range(times):
                bus.send(
                    can.Message(
                        arbitration_id=0x580 + node, data=b"\x43\x00\x10\x00\x92\x01\x02\x00", is_extended_id=False
                    )
                )

    with can.Bus(interface="virtual", channel=channel) as bus:
        thread = threading.Thread(target=answer, args=(bus,))
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()


@pytest.fixture
def channel(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(adapter_test, "_LISTENS", 0.01)
    return f"doctor-{uuid4().hex[:8]}"


def examined(channel: str, count: int = 40, **options: bool) -> AdapterReport:
    with can.Bus(interface="virtual", channel=channel, **options) as bus:
        return examine(bus, "virtual", 500_000, count)


def test_a_device_that_answers_all_is_measured(channel: str) -> None:
    with device(channel):
        found = examined(channel)
    assert found.answerer == "the CANopen device with node-ID 5"
    assert (found.asked, found.lost, found.doubled, found.echo) == (40, 0, 0, False)
    assert sum(found.histogram()) == 40 and found.ok


def test_losses_answers_that_come_twice_and_an_echo_are_counted(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter_test, "_PATIENCE", 0.1)
    with device(channel, times=2, silent=10):
        found = examined(channel, receive_own_messages=True)
    assert found.lost == 4 and found.doubled >= 30 and found.echo and not found.ok
    said = " ".join(found.hints)
    assert "4 of 40 questions were not answered" in said and "came twice" in said and "receive_own_messages" in said


def test_nobody_there_is_told(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter_test, "_PATIENCE", 0.05)
    found = examined(channel)
    assert found.answerer is None and not found.ok and found.sample_period() is None
    assert "nobody answers" in found.hints[0]


@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals are not on Windows")
def test_an_adapter_that_collects_frames_is_found_out(channel: str) -> None:
    with (
        device(channel),
        can.Bus(interface="virtual", channel=channel) as wire,
        SlcanAdapter(wire, latency=0.016) as plugged,
    ):
        bus = open_bus("slcan", plugged.path, sleep_after_open=0.0, bitrate=500_000)
        try:
            found = examine(bus, "slcan", 500_000, 15, plugged.path)
        finally:
            bus.shutdown()
    median = found.percentile(50.0)
    assert median is not None and median >= 0.016 and "seems to collect frames" in " ".join(found.hints)
    assert (found.sample_period() or 0.0) >= 0.02


def report(**values: object) -> AdapterReport:
    usual = {"bus": "can0", "bitrate": 500_000, "answerer": "module 2", "asked": 100, "round_trips": (1e-3,) * 100}
    usual |= {"lost": 0, "late": 0, "doubled": 0, "echo": False, "load": 0.0, "error_frames": 0, "errors": {}}
    return AdapterReport(**{**usual, "state": "active", "latency_timer": None, "hints": ()} | values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "values, said",
    [
        ({"error_frames": 90}, "60 ohm"),
        ({"error_frames": 2}, "motor leads"),
        ({"errors": {"no acknowledgement": 7}}, "nobody acknowledges"),
        ({"latency_timer": 0.016}, "latency_timer"),
    ],
)
def test_the_pattern_of_errors_speaks_for_its_cause(values: dict[str, object], said: str) -> None:
    assert said in " ".join(hints(report(**values)))


def test_the_sample_period_has_room_for_all_axes() -> None:
    assert not hints(report())
    assert report().sample_period(1) == pytest.approx(2e-3)  # 1 ms and a quarter, rounded up
    assert report(bitrate=125_000).sample_period(6) == pytest.approx(10e-3)  # 7 frames of 1.08 ms, 80 % of the bus
    assert report(round_trips=(1.5e-4,) * 9).sample_period(1) == pytest.approx(1e-3)  # the bus, not the adapter


def test_the_latency_timer_is_read_where_the_system_tells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ttyUSB0").mkdir()
    (tmp_path / "ttyUSB0" / "latency_timer").write_text("16\n")
    monkeypatch.setattr(adapter_test, "_SERIAL", tmp_path)
    assert latency_timer("/dev/ttyUSB0") == pytest.approx(0.016) and latency_timer("can0") is None
