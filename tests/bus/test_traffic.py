"""A bus on which nobody answers: quiet, or taken by a node that babbles."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import can
import pytest
from typer.testing import CliRunner

from rds.bus.hub.faults import Faults
from rds.bus.modules.calling import find_machine
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Answer
from rds.bus.tools.scan import _cyclic
from rds.bus.tools.traffic import refuse_taken
from rds.cli.main import app
from rds.core.errors import MachineError
from rds.machines import load_machine

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


class Answering(can.BusABC):
    """A bus on which a call of all modules is answered by these frames."""

    def __init__(self, *answers: can.Message):
        self.answers, self.inbox = answers, list[can.Message]()
        super().__init__("answering")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if (msg.arbitration_id, bytes(msg.data)) == (frames.CALL, b""):
            self.inbox += self.answers

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self.inbox:
            time.sleep(timeout or 0.0)
        return self.inbox.pop(0) if self.inbox else None, True


def test_an_error_frame_and_a_short_frame_are_no_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their identifiers say what went wrong: 0x024 is no acknowledgement, told by the controller."""
    answer = can.Message(arbitration_id=0x023, is_extended_id=False, data=frames.encode_answer(Answer(0, 0, 1, 0)))
    error = can.Message(arbitration_id=0x024, is_extended_id=False, is_error_frame=True, dlc=8, data=bytes(8))
    short = can.Message(arbitration_id=0x022, is_extended_id=False, data=b"\x01")
    found = _cyclic(lambda: Answering(error, short, answer), {})
    assert [row["id"] for row in found] == [3]
    monkeypatch.setattr("rds.bus.modules.calling.open_bus", lambda *_, **__: Answering(error))
    assert find_machine(load_machine("mini-cnc"), timeout=0.02) == []
