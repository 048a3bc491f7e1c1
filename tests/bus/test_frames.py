"""Codecs: what goes in comes out, what can't be is refused with its reason."""

from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.hub import wire
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Answer, Kind, Status
from rds.core.errors import InputError, MachineError

voltage = st.floats(-10.0, 10.0)


@given(st.lists(voltage, max_size=4))
def test_voltages_come_back_within_half_a_unit(voltages: list[float]) -> None:
    decoded = frames.decode_voltages(0x10, frames.encode_voltages(voltages))
    for sent, got in zip(voltages, decoded, strict=False):
        unit = frames.VOLTS_PER_UNIT
        assert abs(sent - got) <= (unit / 2 if sent < 10 - unit / 2 else unit)
    assert decoded[len(voltages) :] == (0.0,) * (4 - len(voltages))


@given(st.integers(-8192, 8191))
def test_levels_of_a_14_bit_converter_are_exact(level: int) -> None:
    volts = level * 20.0 / 16384
    assert frames.decode_voltages(0x10, frames.encode_voltages([volts]))[0] == volts


@pytest.mark.parametrize("bad", [nan, inf, 10.001, -10.001])
def test_impossible_voltages_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match="slot 1"):
        frames.encode_voltages([0.0, bad])


@given(st.lists(voltage, max_size=4), st.integers(0, frames.NUMBERS))
def test_a_command_carries_its_number_beside_its_voltages(voltages: list[float], number: int) -> None:
    plain = frames.encode_voltages(voltages)
    numbered = frames.number_voltages(plain, number)
    assert frames.decode_number(plain) == 0 and frames.decode_number(numbered) == number
    assert frames.decode_voltages(0x10, numbered) == frames.decode_voltages(0x10, plain)
    assert frames.number_voltages(numbered, 0) == plain


def test_the_scale_is_that_of_a_file_with_other_digits() -> None:
    """1/600 with seven digits, or 3 times 0.1, is the same axis; 0.8 % more, another unit or another range is not."""
    assert frames.scale("mm", 1 / 600, 10) == frames.scale("mm", 0.00166667, 10.0)
    assert frames.scale("mm", 0.3, 10.0) == frames.scale("mm", 3 * 0.1, 10.0)
    others = [("mm", 0.001008, 10.0), ("deg", 0.001, 10.0), ("mm", 0.001, 5.0)]
    assert frames.scale("mm", 0.001, 10.0) not in {frames.scale(*each) for each in others}


@given(st.integers(1, 95), st.integers(0, frames.SERIALS - 1), st.integers(0, 2**32 - 1), st.integers(0, 65535))
def test_identities_come_back_and_differ_in_their_identifiers(node: int, serial: int, process: int, scale: int) -> None:
    identity = frames.Identity(node, serial, process, scale=scale)
    assert frames.decode_identity(*frames.encode_identity(identity)) == identity
    assert frames.encode_identity(identity)[0] != frames.encode_identity(identity._replace(serial=serial ^ 1))[0]


def test_five_voltages_are_too_many() -> None:
    with pytest.raises(InputError, match="5 voltages"):
        frames.encode_voltages([0.0] * 5)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 255).map(Status), st.sampled_from(Kind), st.integers(0, 65535))
def test_answers_come_back(counts: int, status: Status, kind: Kind, ticks: int) -> None:
    answer = Answer(counts, status, kind, ticks)
    assert frames.decode_answer(0x22, frames.encode_answer(answer)) == answer


@given(st.integers(-(2**40), 2**40), st.integers(0, 2**20))
def test_counters_wrap_round(counts: int, ticks: int) -> None:
    answer = frames.decode_answer(0x22, frames.encode_answer(Answer(counts, 0, 0, ticks)))
    assert (answer.counts - counts) % 2**32 == 0 and (answer.ticks - ticks) % 2**16 == 0


@given(st.floats(1e-6, 1000.0))
def test_sample_period_comes_back_within_half_a_microsecond(period: float) -> None:
    assert abs(frames.decode_setup(0x12, frames.encode_setup(period)) - period) <= 0.5001e-6


@pytest.mark.parametrize("bad", [0.0, -1.0, nan, 5000.0])
def test_impossible_periods_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match=r"sample_period = .* must be"):
        frames.encode_setup(bad)


@pytest.mark.parametrize("decode", [frames.decode_voltages, frames.decode_setup, frames.decode_answer])
@given(data=st.binary(max_size=64).filter(lambda b: len(b) != 8))
def test_a_wrong_length_names_identifier_and_bytes(decode: object, data: bytes) -> None:
    with pytest.raises(MachineError, match=f"0x012 carries {len(data)} bytes"):
        decode(0x12, data)  # type: ignore[operator]


@pytest.mark.parametrize("node", [0, -1, 0x60, 5000])
def test_nodes_out_of_range_are_refused(node: int) -> None:
    with pytest.raises(InputError, match="from 1 to 95"):
        frames.answer_identifier(node)


filters = st.builds(
    wire.Filter, st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1), st.sampled_from([None, True, False])
)


@given(st.lists(filters, max_size=40))
def test_filters_come_back(wanted: list[wire.Filter]) -> None:
    packed = wire.encode_filters(wanted)
    records = [packed[i : i + wire.RECORD] for i in range(0, len(packed), wire.RECORD)]
    assert [f for record in records for f in wire.decode_filters(record)] == wanted


@given(st.binary(min_size=8, max_size=8))
def test_any_key_is_a_frame_or_an_error_and_never_a_crash(key: bytes) -> None:
    try:
        identifier, extended = wire.check_frame(key)
    except wire.WireError as error:
        assert len(str(error)) <= wire.DATA, "a reason must fit a goodbye"
    else:
        assert 0 <= identifier <= (0x1FFFFFFF if extended else 0x7FF)


@given(st.binary(min_size=80, max_size=80))
def test_any_greeting_is_understood_or_refused(record: bytes) -> None:
    for decode in (wire.decode_hello, wire.decode_filters, wire.decode_welcome):
        try:
            decode(record)
        except wire.WireError as error:
            assert decode is wire.decode_welcome or len(str(error)) <= wire.DATA
