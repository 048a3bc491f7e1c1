"""Bytes to words and back; the published numbers of dcs-thesis."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.dcs import buffers, commands, frames
from rds.bus.modules.dcs.answers import AnswerStream
from rds.bus.modules.dcs.commands import Report
from rds.bus.modules.dcs.frames import Answer, Info, Mode, Status
from rds.bus.modules.dcs.line import FieldLine
from rds.bus.modules.dcs.server import handle
from rds.core.errors import InputError


def test_the_times_that_the_thesis_prints() -> None:
    assert frames.SIZE * frames.byte_time(38_400) == pytest.approx(3.39e-3, abs=5e-6)
    assert commands.BUFFER * frames.byte_time(38_400) == pytest.approx(0.39, abs=1e-3)


def test_a_frame_without_answers_and_checksum_has_the_thirteen_bytes_of_the_thesis() -> None:
    frame = frames.encode(Info(Mode.INCREMENTS, answers=False, checked=False), frames.words([1, -2, 3, 0, 0, 32767]))
    assert frame.hex(" ") == "c8 01 00 fe ff 03 00 00 00 00 00 ff 7f"


@given(
    mode=st.sampled_from(Mode),
    number=st.integers(0, 3),
    answers=st.booleans(),
    checked=st.booleans(),
    values=st.lists(st.integers(-32768, 32767), max_size=6),
)
def test_frames_come_back_as_they_were(
    mode: Mode, number: int, answers: bool, checked: bool, values: list[int]
) -> None:
    info = Info(mode, number, answers, checked)
    found = frames.decode(frames.encode(info, frames.words(values)))
    assert found is not None and found[0] == info
    assert frames.decode_words(found[1]) == (*values, *[0] * (6 - len(values)))


@given(
    unit=st.integers(1, 15),
    number=st.integers(0, 3),
    status=st.integers(0, 255),
    counts=st.integers(-(2**31), 2**31 - 1),
    bit=st.integers(0, 55),
)
def test_an_answer_comes_back_and_one_wrong_bit_is_noticed(
    unit: int, number: int, status: int, counts: int, bit: int
) -> None:
    answer = Answer(unit, number, Status(status), counts)
    data = bytearray(frames.encode_answer(answer))
    assert frames.decode_answer(data) == answer
    data[bit // 8] ^= 1 << bit % 8
    assert frames.decode_answer(data) is None


@given(st.integers(1, 15), st.integers(0, 255), st.integers(-(2**31), 2**31 - 1), st.integers(0, 65535))
def test_a_report_comes_back(unit: int, status: int, counts: int, step: int) -> None:
    report = Report(unit, Status(status), counts, step)
    assert commands.decode_report(commands.encode_report(report)) == report


@given(st.integers(-127, 127))
def test_position_bytes(steps: int) -> None:
    assert commands.steps_of(commands.position_byte(steps)) == steps


def test_what_no_byte_holds_is_refused() -> None:
    with pytest.raises(InputError, match="128 BLU in one step; a position byte holds 127"):
        commands.position_byte(128)
    with pytest.raises(InputError, match="a serial line has at most 15 units"):
        commands.uid(16)
    with pytest.raises(InputError, match="7 commands; one frame carries 6"):
        frames.words([0] * 7)
    with pytest.raises(InputError, match=r"voltage 10\.5 V of slot 1 must be from -10 to 10 V"):
        frames.voltage_words([0.0, 10.5])


def test_identifiers_are_those_of_appendix_d() -> None:
    assert [commands.uid(unit) for unit in (2, 3, 4)] == [122, 123, 124]  # servantX, servantY, servantZ


def test_prepare_data_is_that_of_appendix_d() -> None:
    # 10 mm at 0.12 m/min: 20 BLU per 100 ms by the library, 50 bytes of them, after a remainder of 0
    assert buffers.prepare_data(10.0, 0.12, commands.HOST_TIME) == bytes([0] + [20] * 50)
    # 1.05 mm backward: 105 BLU are 5 and five times 20
    assert buffers.prepare_data(-1.05, 0.12, commands.HOST_TIME) == bytes([5 + 128] + [20 + 128] * 5)
    # the firmware carries each byte out in 10 ms: the same bytes are 1.2 m/min, ten times too fast
    assert buffers.prepare_data(10.0, 1.2) == buffers.prepare_data(10.0, 0.12, commands.HOST_TIME)
    assert buffers.prepare_data(0.0, 0.1) == b"\0"
    with pytest.raises(InputError, match=r"feed 0\.02 m/min rounds to no BLU in 0\.01 s; it must be above 0\.03 m/min"):
        buffers.prepare_data(1.0, 0.02)


def test_the_thesiss_axes_do_not_arrive_together_and_ours_do() -> None:
    import numpy as np

    x, y, _ = buffers.add_to_queue(3.0, 1.0, 0.0, 0.1)  # feeds of 15.8 and 5.3 BLU in 10 ms are rounded
    moving = [max(k for k, steps in enumerate(buffers.decoded(data)) if steps) for data in (x, y)]
    assert moving[0] != moving[1]
    samples = np.outer(np.arange(191) / 190.0, [3.0, 1.0])
    pulses = buffers.pulses_of(samples, [0.01, 0.01])
    assert pulses.sum(axis=0).tolist() == [300, 100]
    assert np.abs(np.cumsum(pulses, axis=0) * 0.01 - samples[1:]).max() <= 0.005 + 1e-12


def test_fillings_are_1500_bytes_each() -> None:
    assert [len(each) for each in buffers.fillings(bytes(3001))] == [1500] * 3


def test_two_wrong_bits_in_a_piece_of_data_are_seen_wherever_they_are() -> None:
    """A CRC-8 sees none that are 127 bits apart."""
    whole = commands.encode_data(commands.DATA, 2, 400, bytes(range(200)))
    assert commands.is_whole(whole) and len(whole) == commands.data_size(200)
    for apart in (1, 7, 127, 254, 1500):
        damaged = bytearray(whole)
        for bit in (60, 60 + apart):
            damaged[bit // 8] ^= 0x80 >> bit % 8
        assert not commands.is_whole(damaged), apart


def test_noise_makes_no_answers_that_nobody_sent() -> None:
    """Of the bytes of 20,000 answers one in a hundred has a turned bit: what comes through was sent."""
    random = np.random.default_rng(5)
    counts = random.integers(-90_000, 90_000, 20_000).tolist()
    sent = [Answer(2 + i % 3, i % 4, Status.NONE, count) for i, count in enumerate(counts)]
    stream, data = AnswerStream(), bytearray(b"".join(map(frames.encode_answer, sent)))
    for place in np.flatnonzero(random.random(len(data)) < 0.01):
        data[place] ^= 1 << int(random.integers(8))
    stream.add(bytes(data))
    found = list(iter(stream.next, None))
    assert len(found) > 0.9 * len(sent) and stream.damaged > 1000
    assert len(set(found) - set(sent)) <= 1


def test_lost_bytes_cost_two_answers() -> None:
    sent = [Answer(2 + i % 3, i % 4, Status.NONE, 100 * i) for i in range(9)]
    data = b"".join(map(frames.encode_answer, sent))
    stream = AnswerStream()
    stream.add(data[:10] + data[11:])
    assert list(iter(stream.next, None)) == [sent[0], *sent[3:]]


@pytest.mark.parametrize("said", ["unit ² reset", "unit ٢ off", "\0�", "noise nan", "unit -1 off", ""])
def test_what_no_hand_can_do_is_refused_and_ends_no_line(said: str) -> None:
    with pytest.raises(InputError):
        handle(said, FieldLine([], 9600.0), 0.0)
