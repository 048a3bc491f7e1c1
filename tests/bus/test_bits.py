"""Bits on the wire: against a second implementation written here, against captured frames, against published bounds."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.medium.bit_string import bit_string, crc
from rds.bus.medium.bits import (
    CRC15,
    CRC17,
    CRC21,
    FD_SIZES,
    INTERFRAME,
    LONGEST_ERROR,
    SHORTEST_ERROR,
    Bits,
    error_frame,
    frame_bits,
    frame_time,
    least_bits,
    longest,
    most_bits,
    shortest,
)
from rds.core.errors import InputError

# --- a second, naive implementation: lists of bits, polynomial division by hand


def number(value: int, width: int) -> list[int]:
    return [value >> (width - 1 - place) & 1 for place in range(width)]


def divide(bits: list[int], polynomial: int, degree: int) -> list[int]:
    divisor = number(polynomial, degree + 1)
    rest = bits + [0] * degree
    for place in range(len(bits)):
        if rest[place]:
            for offset, bit in enumerate(divisor):
                rest[place + offset] ^= bit
    return rest[-degree:]


def stuff(bits: list[int]) -> list[int]:
    out: list[int] = []
    for bit in bits:
        out.append(bit)
        if len(out) >= 5 and len(set(out[-5:])) == 1:
            out.append(1 - bit)
    return out


def naive_classic(identifier: int, data: bytes, extended: bool, remote: bool, dlc: int) -> str:
    bits = [0]
    if extended:
        whole = number(identifier, 29)
        bits += [*whole[:11], 1, 1, *whole[11:], int(remote), 0, 0]
    else:
        bits += [*number(identifier, 11), int(remote), 0, 0]
    bits += number(dlc, 4)
    for byte in data:
        bits += number(byte, 8)
    bits += divide(bits, 0xC599, 15)
    return "".join(map(str, stuff(bits) + [1, 0, 1] + [1] * 7))


def naive_fd(identifier: int, data: bytes, extended: bool, switch: bool, passive: bool) -> tuple[str, int]:
    """The bits, and how many of them are fast."""
    whole = number(identifier, 29 if extended else 11)
    front = [0, *whole, 0, 0] if not extended else [0, *whole[:11], 1, 1, *whole[11:], 0]
    front += [1, 0, int(switch)]
    back = [int(passive), *number(FD_SIZES.index(len(data)), 4)]
    for byte in data:
        back += number(byte, 8)
    slow = len(stuff(front))
    bits = stuff(front + back)
    if stuff([*front, *back[:-1]]) == bits[:-2]:  # the last data bit alone brought a stuff bit: it is not sent
        bits.pop()
    stuffed = len(bits) - len(front + back)
    gray = {0: "000", 1: "001", 2: "011", 3: "010", 4: "110", 5: "111", 6: "101", 7: "100"}[stuffed % 8]
    count = [*map(int, gray), gray.count("1") % 2]
    polynomial, degree = (0x3685B, 17) if len(data) <= 16 else (0x302899, 21)
    # a register that starts with its highest bit set is a one so many places before the message
    covered = bits + count
    start = [0] * len(covered)
    register = divide(covered, polynomial, degree)
    preset = divide([1, *start[1:]], polynomial, degree) if start else []
    check = [a ^ b for a, b in zip(register, preset, strict=True)]
    for place, bit in enumerate(count + check):
        if place % 4 == 0:
            bits.append(1 - bits[-1])
        bits.append(bit)
    if (len(count) + len(check)) % 4 == 0:
        bits.append(1 - bits[-1])
    fast = len(bits) + 1 - slow if switch else 0
    return "".join(map(str, [*bits, 1, 0, 1] + [1] * 7)), fast


identifiers = st.booleans().flatmap(
    lambda extended: st.tuples(st.integers(0, 0x1FFFFFFF if extended else 0x7FF), st.just(extended))
)
# long runs of equal bits are where stuffing happens
byte = st.one_of(st.sampled_from([0x00, 0xFF, 0x0F, 0xF0, 0x1F, 0xF8, 0x83, 0x7C]), st.integers(0, 255))


def contents(sizes: tuple[int, ...]) -> st.SearchStrategy[bytes]:
    return st.sampled_from(sizes).flatmap(lambda size: st.lists(byte, min_size=size, max_size=size)).map(bytes)


@given(identifiers, contents(tuple(range(9))))
def test_classic_frames_bit_for_bit(identifier: tuple[int, bool], data: bytes) -> None:
    expected = naive_classic(*identifier[:1], data, identifier[1], False, len(data))
    string = bit_string(identifier[0], data, extended=identifier[1])
    assert string.bits == expected
    assert frame_bits(identifier[0], data, identifier[1]) == Bits(len(expected)) == string.measure()


@given(identifiers, st.integers(0, 8))
def test_remote_frames_bit_for_bit(identifier: tuple[int, bool], dlc: int) -> None:
    expected = naive_classic(identifier[0], b"", identifier[1], True, dlc)
    assert bit_string(identifier[0], extended=identifier[1], remote=True, dlc=dlc).bits == expected
    assert frame_bits(identifier[0], b"", identifier[1], True, dlc=dlc).total == len(expected)


@given(identifiers, contents(FD_SIZES), st.booleans(), st.booleans())
def test_fd_frames_bit_for_bit(identifier: tuple[int, bool], data: bytes, switch: bool, passive: bool) -> None:
    expected, fast = naive_fd(identifier[0], data, identifier[1], switch, passive)
    flags = {"extended": identifier[1], "fd": True, "bitrate_switch": switch, "error_state": passive}
    string = bit_string(identifier[0], data, **flags)
    assert string.bits == expected
    assert frame_bits(identifier[0], data, **flags) == Bits(len(expected) - fast, fast) == string.measure()


@given(identifiers, contents(FD_SIZES), st.booleans(), st.booleans())
def test_every_frame_is_within_its_bounds(identifier: tuple[int, bool], data: bytes, fd: bool, switch: bool) -> None:
    extended, size, fd = identifier[1], len(data), fd or len(data) > 8
    switch = switch and fd
    bits = frame_bits(identifier[0], data, extended, fd=fd, bitrate_switch=switch)
    least, most = least_bits(size, extended, fd, switch), most_bits(size, extended, fd, switch)
    assert least.nominal <= bits.nominal <= most.nominal
    assert least.total <= bits.total <= most.total


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("size", FD_SIZES)
def test_the_bit_rate_switch_changes_no_number_of_bits(size: int, extended: bool) -> None:
    """The slow ones are those to BRS, with a stuff bit after every fourth but the first, and the last nine."""
    before = 36 if extended else 17
    least, most = least_bits(size, extended, True, True), most_bits(size, extended, True, True)
    assert (least.total, most.total) == (least_bits(size, extended, True).total, most_bits(size, extended, True).total)
    assert (least.nominal, most.nominal) == (before + 9, before + (before - 2) // 4 + 9)


@pytest.mark.parametrize("size", range(9))
def test_published_bounds_of_classic_frames(size: int) -> None:
    assert (shortest(size), longest(size)) == (47 + 8 * size, 55 + 10 * size)
    assert (shortest(size, True), longest(size, True)) == (67 + 8 * size, 80 + 10 * size)
    for g, extended in ((34, False), (54, True)):
        assert longest(size, extended) == g + 8 * size + 13 + (g + 8 * size - 1) // 4


def test_published_bounds_of_fd_frames() -> None:
    """The Linux kernel's include/linux/can/length.h (since 6.5) for 64 bytes: 579, 598; stuffed 712, 736.

    Its 736 is one more than here: it counts a stuff bit after the last data bit, where ISO 11898-1, 10.5 has only
    the fixed one.
    """
    assert [least_bits(64, extended, True).total + INTERFRAME for extended in (False, True)] == [579, 598]
    assert [most_bits(64, extended, True).total + INTERFRAME for extended in (False, True)] == [712, 735]


# --- captured frames. Run lengths of equal bits from the start bit (dominant) to the end of frame, which are 8
# recessive bits with the ACK delimiter.

CLASSIC_CAPTURES = [
    # sigrok-dumps, can/microchip_mcp2515dm-bm: MCP2515 at 125 kbit/s, sampled at 4 MHz
    (0x110, False, "0011", "31315141515121322252211118"),
    (0x222, False, "0011223344", "21313152115151113121313222113122221212111118"),
    (0x550, False, "aabbccddeeff0a0b", "11111111512131111111111314222213141315134111521325242118"),
    (0x14611234, True, "00010203", "111132321131213211511151515121511151221512151218"),
    # sigrok-dumps, can/nmea2000/lowrance_ep_60r_garmin_gps_17x: a boat's bus at 250 kbit/s
    (0x19FA0400, True, "0414451bfcd1320c", "12251113511151513151315211313111321513221131222153211112421318"),
    (0x1DFF1601, True, "217c7cf963ffffff", "13151511311251313152411545353112351515151511113131112218"),
    (0x15FF1001, True, "430000ffffffffff", "1111151511315151113141425151511515151515151515233121111218"),
    (0x09F20101, True, "82ffffffffffffff", "212533513151213131521515151515151515151515115121115218"),
    (0x19FA0400, True, "35f0ffffffffffff", "122511135111515131531115551515151515151515152311251218"),
]


def runs(bits: str) -> str:
    return "".join(str(len(run)) for run in bits.replace("01", "0 1").replace("10", "1 0").split())


@pytest.mark.parametrize(("identifier", "extended", "data", "captured"), CLASSIC_CAPTURES)
def test_captured_classic_frames(identifier: int, extended: bool, data: str, captured: str) -> None:
    content = bytes.fromhex(data)
    assert runs(bit_string(identifier, content, extended=extended).bits) == captured
    assert frame_bits(identifier, content, extended).total == sum(map(int, captured))


# sigrok-dumps, can/can_fd/arbitrary_traffic: PEAK PCAN-USB Pro, ISO mode, identifier 0x42, data 0, 1, 2, ...,
# 1 Mbit/s (sample point 75 %) and 2 Mbit/s (80 %), sampled at 100 MHz; the time from the first edge of the start bit
# to the end of the ACK slot, ns, and the same 8-byte frames bit for bit.
FD_CAPTURES = [
    (False, False, 8, 125_120, "524131315151513151115122525121115351132211111111111323112118"),
    (True, False, 8, 147_090, "515122515111412131515151315111512252512111535113144122132111111218"),
    (False, True, 8, 72_180, "524131111151515131511151225251211153511322131111121112141218"),
    (True, True, 8, 94_180, "51512251511141211111515151315111512252512111535113141121231112232118"),
    (False, False, 64, 594_190, None),
    (True, False, 64, 616_150, None),
    (False, True, 64, 306_710, None),
    (True, True, 64, 328_710, None),
]


@pytest.mark.parametrize(("extended", "switch", "size", "time", "captured"), FD_CAPTURES)
def test_captured_fd_frames(extended: bool, switch: bool, size: int, time: int, captured: str | None) -> None:
    data = bytes(range(size))
    bits = frame_bits(0x42, data, extended, fd=True, bitrate_switch=switch)
    after_ack = 8  # ACK delimiter and end of frame
    to_ack = Bits(bits.nominal - after_ack, bits.fast).time(1_000_000, 2_000_000)
    # the time scale of the first column of the captures is 10 ns; the acknowledging node's edges come later
    assert 0 < time - to_ack < 250
    if captured is not None:
        assert runs(bit_string(0x42, data, extended=extended, fd=True, bitrate_switch=switch).bits) == captured


def test_check_values_of_the_generators() -> None:
    """CRC-15/CAN and, with their registers preset to zero, CRC-17 and CRC-21/CAN-FD over "123456789".

    Source: G. Cook, Catalogue of parametrised CRC algorithms.
    """
    bits = "".join(f"{byte:08b}" for byte in b"123456789")
    assert crc(bits, CRC15, 15) == 0x059E
    assert crc(bits, CRC17, 17) == 0x04F03
    assert crc(bits, CRC21, 21) == 0x0ED841


# --- times, errors, refusals


def test_times() -> None:
    assert frame_time(0x222, bytes.fromhex("0011223344"), bitrate=125_000) == (90 - 3) * 8000
    assert frame_time(0x222, bytes.fromhex("0011223344"), bitrate=125_000, interframe=True) == 90 * 8000
    assert Bits(30, 100).time(500_000, 2_000_000) == 30 * 2000 + 100 * 500
    assert Bits(30, 100).time(500_000) == 130 * 2000
    assert Bits(1).time(3_000_000) == 334  # rounded up


def test_an_error_ends_the_frame_and_frees_the_bus_17_to_23_bits_later() -> None:
    string = bit_string(0x123, b"\x55")
    for others in (0, 6):
        broken = string.broken_off(20, others)
        assert broken.startswith(string.bits[:21] + "000000")
        assert len(broken) == 21 + error_frame(others) + INTERFRAME
    assert error_frame() + INTERFRAME == SHORTEST_ERROR == 17
    assert LONGEST_ERROR == 31  # with the other nodes' flags, and the wait of an error-passive sender
    with pytest.raises(InputError, match="bit 500"):
        string.broken_off(500)
    with pytest.raises(InputError, match="not by 7"):
        error_frame(7)


def test_fields_are_where_they_are_said_to_be() -> None:
    string = bit_string(0x222, bytes.fromhex("0011223344"))
    assert string.field("identifier").value == 0x222
    assert [string.field(f"data {place}").value for place in range(5)] == [0, 0x11, 0x22, 0x33, 0x44]
    assert "".join(f"{field.name} " for field in string.fields).startswith("start identifier rtr ide fdf dlc data 0")
    assert string.fields[0].start == 0 and string.fields[-1].stop == len(string.bits)
    assert all(first.stop == second.start for first, second in zip(string.fields, string.fields[1:], strict=False))
    assert all(string.bits[place] != string.bits[place - 1] for place in string.stuffed)
    with pytest.raises(InputError, match="no field 'esi'"):
        string.field("esi")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"identifier": 0x800}, "0 to 0x7ff"),
        ({"identifier": 1 << 29, "extended": True}, "0 to 0x1fffffff"),
        ({"identifier": -1}, "0 to 0x7ff"),
        ({"identifier": 1, "data": bytes(9)}, "0 to 8 bytes"),
        ({"identifier": 1, "data": bytes(2), "dlc": 3}, "2 bytes with dlc 3"),
        ({"identifier": 1, "data": bytes(9), "fd": True}, "no size of a CAN FD frame"),
        ({"identifier": 1, "remote": True, "fd": True}, "no remote frames"),
        ({"identifier": 1, "remote": True, "data": b"1"}, "carries no data"),
        ({"identifier": 1, "bitrate_switch": True}, "CAN FD frames only"),
        ({"identifier": 1, "fd": True, "data": bytes(12), "dlc": 8}, "dlc 8"),
    ],
)
def test_frames_that_cannot_exist_are_refused(arguments: dict, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        frame_bits(**arguments)
    with pytest.raises(InputError, match=reason):
        bit_string(**arguments)


def test_bounds_of_sizes_that_cannot_exist_are_refused() -> None:
    with pytest.raises(InputError, match="0 to 8 bytes"):
        longest(9)
    with pytest.raises(InputError, match="no size of a CAN FD frame"):
        most_bits(9, fd=True)
