"""A bus on which nobody answers: quiet, or taken by a node that babbles."""

from __future__ import annotations

import threading
from collections.abc import Callable

import can
import pytest
from typer.testing import CliRunner

from rds.bus.hub.faults import Faults
from rds.bus.tools.traffic import refuse_taken
from rds.cli.main import app
from rds.core.errors import MachineError

Opener = Callable[..., can.BusABC]


def test_a_babblers_bus_is_called_taken(open_bus: Opener) -> None:
    open_bus("test", bitrate=1_000_000, name="Y")
    with Faults("test") as faults:
        faults.inject("babble", node="Y", identifier=5)
        scanned = CliRunner().invoke(app, ["scan", "--channel", "test", "--json"])
    assert scanned.exit_code == 2 and scanned.stdout == ""
    assert "is taken" in scanned.stderr and "identifier 0x005" in scanned.stderr and "babbles" in scanned.stderr


def test_a_flood_on_a_bus_without_timing_is_called_taken(open_bus: Opener) -> None:
    flooding, listening = open_bus("test"), open_bus("test")
    over = threading.Event()

    def flood() -> None:
        while not over.wait(0.0005):
            for _ in range(10):  # for on a busy computer it waits for longer
                flooding.send(can.Message(arbitration_id=0x12345, data=b"12345678"))

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        with pytest.raises(MachineError, match=r"is taken; \d+ frames in 0\.\d\d s, \d+ of identifier 0x00012345"):
            refuse_taken(listening)
    finally:
        over.set()
        thread.join()


@pytest.mark.parametrize("bitrate", [None, 125_000])
def test_a_quiet_bus_and_a_few_frames_of_others_are_not(open_bus: Opener, bitrate: int | None) -> None:
    other, listening = open_bus("test", bitrate=bitrate), open_bus("test")
    for _ in range(20):
        other.send(can.Message(arbitration_id=0x700, is_extended_id=False, data=b"\x05"))
    refuse_taken(listening)
    refuse_taken(listening, 0.05)
