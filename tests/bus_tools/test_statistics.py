"""Counting frames: rates, periods and loads against what was put in; decoding; no I/O."""

from __future__ import annotations

import math
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus_tools.made_frames import frame, of_every_kind
from rds.bus.medium.bits import frame_time
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Answer, Kind, Status
from rds.bus.tools.decode import cyclic, decoder
from rds.bus.tools.monitor import View, to_json
from rds.bus.tools.monitor_view import picture
from rds.bus.tools.statistics import Key, Statistics, since
from rds.core.errors import InputError


def counted(messages: list[can.Message], **options: int) -> Statistics:
    statistics = Statistics(**options)
    for message in messages:
        statistics.add(message)
    return statistics


def test_nothing_was_seen() -> None:
    snapshot = Statistics().snapshot()
    assert (snapshot.rows, snapshot.frames, snapshot.rate, snapshot.load) == ((), 0, 0.0, 0.0)
    assert Statistics().snapshot(5.0).seconds == 5.0


def test_a_regular_message() -> None:
    snapshot = counted([frame(0x21, bytes([k % 256]), k * 0.001) for k in range(1001)]).snapshot()
    (row,) = snapshot.rows
    assert row.key == Key(False, 0x21, False) and str(row.key) == "0x021"
    assert row.count == snapshot.frames == 1001
    assert row.rate == pytest.approx(1000.0, rel=1e-6)
    assert row.period == pytest.approx(1e-3, rel=1e-6)
    assert row.jitter < 1e-6
    assert row.data == bytes([1000 % 256])


@given(st.lists(st.floats(1e-4, 2.0), min_size=2, max_size=50))
def test_period_and_jitter_are_mean_and_deviation(gaps: list[float]) -> None:
    at, stamps = 0.0, [0.0]
    for gap in gaps:
        at += gap
        stamps.append(at)
    messages = [can.Message(timestamp=stamp, arbitration_id=1) for stamp in stamps]
    (row,) = counted(messages).snapshot().rows
    mean = sum(gaps) / len(gaps)
    deviation = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / (len(gaps) - 1))
    assert row.period == pytest.approx(mean, rel=1e-9)
    assert row.jitter == pytest.approx(deviation, rel=1e-6, abs=1e-9)
    assert row.shortest == pytest.approx(min(gaps)) and row.longest == pytest.approx(max(gaps))


def test_one_frame_has_no_period_and_two_no_jitter() -> None:
    (row,) = counted([frame(1)]).snapshot(1.0).rows
    assert math.isnan(row.rate) and math.isnan(row.period) and math.isnan(row.jitter)
    (row,) = counted([frame(1), frame(1, at=0.5)]).snapshot(1.0).rows
    assert row.rate == pytest.approx(2.0) and math.isnan(row.jitter)


def test_the_load_is_the_exact_time_on_the_wire() -> None:
    messages = [message for message in of_every_kind() if not message.is_error_frame]
    time = sum(
        frame_time(
            m.arbitration_id,
            m.data,
            bitrate=500_000,
            data_bitrate=2_000_000,
            interframe=True,
            extended=m.is_extended_id,
            remote=m.is_remote_frame,
            fd=m.is_fd,
            bitrate_switch=m.bitrate_switch,
            error_state=m.error_state_indicator,
            dlc=m.dlc if m.is_remote_frame else None,
        )
        for m in messages
    )
    snapshot = counted(messages, bitrate=500_000, data_bitrate=2_000_000).snapshot(0.01)
    assert snapshot.load == pytest.approx(time * 1e-9 / 0.01 * 100)
    assert sum(row.load for row in snapshot.rows) == pytest.approx(snapshot.load)


def test_error_frames_and_impossible_ones_are_counted_apart() -> None:
    wrong = frame(0x21, bytes(8))
    wrong.data = bytearray(9)
    snapshot = counted([frame(0, is_error_frame=True), wrong, frame(0x21, bytes(8))]).snapshot(1.0)
    assert (snapshot.errors, snapshot.impossible, snapshot.frames) == (1, 1, 2)


def test_standard_extended_and_remote_frames_are_counted_apart() -> None:
    kinds = [frame(0x21), frame(0x21, is_extended_id=True), frame(0x21, is_remote_frame=True)]
    assert [str(row.key) for row in counted(kinds).snapshot(1.0).rows] == ["0x021", "0x021 remote", "0x00000021"]


def test_rates_of_the_last_second() -> None:
    statistics = counted([frame(1, at=k * 0.01) for k in range(100)])
    before = statistics.snapshot(1.0)
    assert before.rate == pytest.approx(100.0)
    for k in range(500):
        statistics.add(frame(2, bytes(8), 1.0 + k * 0.002))
    now = since(statistics.snapshot(2.0), before)
    first, second = now.rows
    assert (first.rate, first.load, first.count) == (0.0, pytest.approx(0.0, abs=1e-9), 100)
    assert second.rate == pytest.approx(500.0)
    assert now.load == pytest.approx(second.load)


@pytest.mark.parametrize("options", [{"bitrate": 0}, {"bitrate": -1}, {"data_bitrate": 0}])
def test_a_bit_rate_is_positive(options: dict[str, int]) -> None:
    with pytest.raises(InputError, match="bit rate"):
        Statistics(**options)


# --- decoding


def test_cyclic_messages_in_words() -> None:
    command = cyclic(0x010, frames.encode_voltages([2.5, -1.25]))
    assert command is not None and command.name == "command"
    assert command.signals == {"slot 0": "+2.500 V", "slot 1": "-1.250 V", "slot 2": "+0.000 V", "slot 3": "+0.000 V"}
    answer = cyclic(0x023, frames.encode_answer(Answer(-7, Status.ENABLED | Status.DRY_RUN, Kind.ANSWER, 65537)))
    assert answer is not None and answer.name == "answer of module 3"
    assert answer.signals == {"position": "-7 counts", "status": "enabled+dry_run", "ticks": "1"}
    setup = cyclic(0x012, frames.encode_setup(0.001))
    assert setup is not None and setup.signals == {"period": "1 ms"}
    assert cyclic(0x013, b"") is not None


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_any_frame_is_decoded_or_not(identifier: int, data: bytes) -> None:
    cyclic(identifier, data)


DBC = """VERSION ""
BU_: A
BO_ 1280 Oven: 2 A
 SG_ Temperature : 0|8@1+ (0.5,-10) [0|100] "degC" A
 SG_ Door : 8|1@1+ (1,0) [0|1] "" A
VAL_ 1280 Door 0 "closed" 1 "open" ;
"""


def test_a_dbc_file_decodes_the_others(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    path = tmp_path / "oven.dbc"
    path.write_text(DBC)
    decode = decoder([path])
    found = decode(frame(1280, b"\x40\x01"))
    assert found == ("Oven", {"Temperature": "22 degC", "Door": "open"})
    assert decode(frame(1280, b"\x40")) is not None, "too short, and said so"
    assert decode(frame(1280, b"\x40\x01", is_extended_id=True)) is None
    assert decode(frame(1281)) is None and decode(frame(1280, is_remote_frame=True)) is None
    command = decode(frame(0x010, bytes(8)))
    assert command is not None and command.name == "command"


def test_a_dbc_file_that_is_given_goes_before_our_own_messages(tmp_path: Path) -> None:
    """The identifier 0x021 is a module's answer here; on a bus of somebody else's it is what their file says."""
    path = tmp_path / "oven.dbc"
    path.write_text('VERSION ""\nBU_: Oven\nBO_ 33 Door: 8 Oven\n SG_ Open : 0|8@1+ (1,0) [0|1] "" Oven\n')
    ours, theirs = decoder()(frame(0x021, bytes(8))), decoder([path])(frame(0x021, bytes(8)))
    assert ours is not None and ours.name.endswith("of module 1")
    assert theirs is not None and theirs.name == "Door" and theirs.signals == {"Open": "0"}


def test_what_is_no_dbc_file_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    with pytest.raises(InputError, match="no such DBC"):
        decoder([tmp_path / "none.dbc"])
    (tmp_path / "long.dbc").write_text("a" * 100_000)
    with pytest.raises(InputError, match="can't be read as a DBC file") as refused:
        decoder([tmp_path / "long.dbc"])
    assert len(str(refused.value)) < 1000
    (tmp_path / "bad.dbc").write_text("rubbish")
    with pytest.raises(InputError, match=r"can't be read as a DBC file: .*correct that place, or remove it"):
        decoder([tmp_path / "bad.dbc"])
    (tmp_path / "car.dbc").write_text('VERSION ""\nBU_:\nBO_ 274726912 Door: 8 Vector__XXX\n')
    with pytest.raises(InputError, match=r"more than 11 bits in message Door.*add 2147483648 \(2\^31\) to the number"):
        decoder([tmp_path / "car.dbc"])


def test_without_cantools_it_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    for name in [name for name in sys.modules if name.startswith("cantools")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "cantools", None)
    with pytest.raises(InputError, match="reading a DBC file needs cantools, which is not installed; "):
        decoder([tmp_path / "oven.dbc"])
    monkeypatch.setattr("rds.bus.tools.decode.find_spec", lambda name: None)
    assert decoder()(frame(0x013)) is not None, "the cyclic messages need none"


def test_the_dialects_own_dbc_is_read() -> None:
    pytest.importorskip("cantools")
    found = decoder()(frame(0x144, bytes(8)))
    assert found is not None and found.name.startswith("Status")


# --- views


def test_every_view_can_be_drawn_and_is_plain_json() -> None:
    import json

    from rich.console import Console

    for messages in ([], of_every_kind(), of_every_kind() * 3):
        view = View(counted(messages).snapshot(), "rds:test", 1_000_000, "active", 3, ["the bus failed: why"])
        text = json.dumps(to_json(view, decoder()), allow_nan=False)
        assert json.loads(text)["frames"] == view.snapshot.frames
        console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
        console.print(picture(view, decoder(), height=14))
        drawn = console.export_text()
        assert "rds:test: active" in drawn and "the bus failed: why" in drawn
        assert len(drawn.splitlines()) <= 24
