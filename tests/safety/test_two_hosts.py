"""Two hosts: the second is refused and told who commands; frames of a stranger do not add up to a motion."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.module import WATCHDOG_PERIODS

from .conftest import Bench, T, expect

pytestmark = pytest.mark.realtime


@pytest.mark.parametrize("bench", ["rds"], indirect=True)  # the lock is the channel's, whatever is spoken there
def test_a_second_run_is_refused_and_told_who_commands(bench: Bench, tmp_path: Path) -> None:
    bench.serve()
    first = bench.moving()
    run = bench.start_run(tmp_path)
    _, err = run.communicate(timeout=60)
    assert run.returncode == 2 and f"process {first.pid}" in err and "host_process.py" in err, err
    assert first.poll() is None and bench.powered()


def test_a_second_host_without_the_lock_hears_the_first_and_does_not_start(bench: Bench) -> None:
    bench.serve()
    first = bench.moving()
    assert "another host commands" in expect(bench.host(0.0, "--free"), "lost")
    assert first.poll() is None and bench.powered()


def test_a_strangers_frames_move_nothing_and_end_the_host(bench: Bench) -> None:
    bench.serve()
    host = bench.host(0.0)
    expect(host, "moving")  # under command, of zero volts
    with bench.bus() as bus:
        sent = time.monotonic()
        until = sent + 1.0
        for message in rogue(bench):
            # who was silent for longer than a module remembers whom it refused, is a host that begins
            if not sent <= (now := time.monotonic()) < min(until, sent + WATCHDOG_PERIODS * T / 2):
                break
            bus.send(message, 0.5)
            sent = now
            time.sleep(T / 3)
        assert "another host commands" in expect(host, "lost")
    assert bench.counts() == bench.start_counts, "not a count, neither beside the host nor after it had gone"
    bench.stands_without_voltage()


def rogue(bench: Bench) -> Iterator[can.Message]:
    """Full voltage, as somebody sends it who knows the protocol but not the host."""
    while True:
        if bench.dialect == "cia402":
            data, identifier = struct.pack("<Hh", 0x000F, 1000), 0x200 + bench.node
        else:
            data, identifier = frames.encode_voltages([10.0] * 4), frames.COMMAND
        yield can.Message(arbitration_id=identifier, is_extended_id=False, data=data)
