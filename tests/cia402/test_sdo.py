"""The drive's SDO server: transfers, aborts by their codes, and no frame that it can't bear."""

from __future__ import annotations

import struct
from binascii import crc_hqx

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.machines import load_machine

from .conftest import Abort, Rig


@pytest.mark.parametrize(
    "index, subindex, value, size, code",
    [
        (0x1018, 1, 1, 4, 0x06010002),  # read only
        (0x1234, 0, 1, 4, 0x06020000),  # no object
        (0x1018, 9, 1, 4, 0x06090011),  # no sub-index
        (0x6040, 0, 1, 4, 0x06070012),  # too long
        (0x607A, 0, 1, 2, 0x06070013),  # too short
        (0x605A, 0, 7, 2, 0x06090031),  # above its limit
        (0x6083, 0, 0, 4, 0x06090032),  # below its limit
        (0x6060, 0, 7, 1, 0x06090030),  # a mode that the drive doesn't have
        (0x6098, 0, 5, 1, 0x06090030),  # a homing method that it doesn't have
        (0x1003, 0, 3, 1, 0x06090030),  # only 0 clears the history
        (0x1005, 0, 0x40000080, 4, 0x06090030),  # it does not produce SYNC
        (0x1019, 0, 1, 1, 0x06090030),
    ],
)
def test_what_cannot_be_written_is_refused_with_its_code(
    rig: Rig, index: int, subindex: int, value: int, size: int, code: int
) -> None:
    with pytest.raises(Abort) as refused:
        rig.write(index, value, size, subindex)
    assert refused.value.code == code


def test_a_name_comes_in_segments(rig: Rig) -> None:
    answer = rig.sdo(struct.pack("<BHB4x", 0x40, 0x1008, 0))
    (size,) = struct.unpack_from("<I", answer, 4)
    text, toggle = b"", 0
    while True:
        answer = rig.sdo(bytes([0x60 | toggle]) + bytes(7))
        text += answer[1 : 8 - (answer[0] >> 1 & 7)]
        toggle ^= 0x10
        if answer[0] & 1:
            break
    assert text == b"RDS simulated axis" and len(text) == size
    with pytest.raises(Abort) as refused:
        rig.sdo(bytes([0x60 | toggle]) + bytes(7))
    assert refused.value.code == 0x05040001  # there is no transfer any more


def test_a_segmented_download_of_what_is_read_only_is_refused_before_it_begins(rig: Rig) -> None:
    with pytest.raises(Abort) as refused:
        rig.sdo(struct.pack("<BHBI", 0x21, 0x1008, 0, 8))
    assert refused.value.code == 0x06010002


def test_a_value_may_come_in_a_segment(rig: Rig) -> None:
    rig.sdo(struct.pack("<BHBI", 0x21, 0x6081, 0, 4))
    rig.sdo(bytes([0x01 | 3 << 1]) + struct.pack("<I", 4321) + bytes(3))
    assert rig.read(0x6081) == 4321


def test_stopped_means_deaf(rig: Rig) -> None:
    rig.nmt(2)
    assert rig.send(0x600 + rig.node, struct.pack("<BHB4x", 0x40, 0x1000, 0)) == []
    rig.nmt(128)
    assert rig.read(0x1000) == 0x00020192


def test_reset_brings_the_defaults_back(rig: Rig) -> None:
    rig.write(0x6081, 1, 4)
    rig.write(0x1017, 50, 2)
    rig.nmt(130)  # communication only
    assert rig.frames[-1][1:] == (0x700 + rig.node, b"\0")
    assert (rig.read(0x6081), rig.read(0x1017)) == (1, 0)
    rig.nmt(129)
    assert rig.read(0x6081) == 5000


@settings(max_examples=80, deadline=None)
@given(st.lists(st.binary(min_size=0, max_size=8), max_size=20))
def test_no_request_breaks_the_server(requests: list[bytes]) -> None:
    rig = Rig(load_machine("mini-cnc"))
    for request in requests:
        for identifier, data in rig.send(0x600 + rig.node, request):
            assert identifier < 0x800 and len(data) <= 8
    assert rig.read(0x1018, 2) == 0x402


@settings(max_examples=80, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0x000, 0x080, 0x202, 0x302, 0x602, 0x702, 0x77F, 0x7FF]),
            st.binary(max_size=8),
            st.floats(0, 0.05),
        ),
        max_size=30,
    )
)
def test_no_frame_breaks_the_drive(frames: list[tuple[int, bytes, float]]) -> None:
    rig = Rig(load_machine("mini-cnc"))
    rig.nmt(1)
    for identifier, data, pause in frames:
        rig.t += pause
        rig.send(identifier, data)
    rig.send(0x000, b"\x81\x00")
    assert rig.read(0x1018, 2) == 0x402


NAME = b"RDS simulated axis"


def upload_block(rig: Rig, block: int, lost: int | None = None) -> bytes:
    """The name by block transfer, with `block` segments at once; segment number `lost` of the first block is lost."""
    begun = rig.sdo(struct.pack("<BHBBB2x", 0xA4, 0x1008, 0, block, 0))
    assert begun[0] == 0xC6 and int.from_bytes(begun[4:8], "little") == len(NAME)
    request, data = bytes([0xA3]) + bytes(7), b""
    while True:
        heard: list[bytes] = []
        last = False
        for _, answer in rig.send(0x600 + rig.node, request):
            if answer[0] & 0xC3 == 0xC1 and not answer[0] & 0x20 and not heard and last is False and request[0] == 0xA2:
                assert int.from_bytes(answer[1:3], "little") == crc_hqx(data[: len(NAME)], 0)
                assert not rig.send(0x600 + rig.node, bytes([0xA1]) + bytes(7))
                return data[: len(data) - (answer[0] >> 2 & 7)]
            if lost == answer[0] & 0x7F:
                lost = None
                break
            heard.append(answer[1:])
            last = bool(answer[0] & 0x80)
        data += b"".join(heard)
        request = bytes([0xA2, len(heard), block]) + bytes(5)


@pytest.mark.parametrize("block, lost", [(127, None), (2, None), (1, None), (127, 2), (2, 1), (127, 3)])
def test_a_name_comes_in_a_block_whatever_is_lost_of_it(rig: Rig, block: int, lost: int | None) -> None:
    assert upload_block(rig, block, lost) == NAME


def download_block(rig: Rig, index: int, data: bytes, crc: int | None = None) -> None:
    begun = rig.sdo(struct.pack("<BHBI", 0xC6, index, 0, len(data)))
    assert begun[0] == 0xA4 and begun[4] == 127
    assert rig.sdo(bytes([0x81]) + data.ljust(7, b"\0"))[:3] == bytes([0xA2, 1, 127])
    code = crc_hqx(data, 0) if crc is None else crc
    assert rig.sdo(bytes([0xC1 | (7 - len(data)) << 2]) + code.to_bytes(2, "little") + bytes(5))[0] == 0xA1


def test_a_value_goes_in_a_block(rig: Rig) -> None:
    download_block(rig, 0x6065, (1234).to_bytes(4, "little"))
    assert rig.read(0x6065) == 1234


@pytest.mark.parametrize(
    "index, data, crc, code",
    [
        (0x6065, b"\1\2\3\4", 0x1234, 0x05040004),  # a wrong CRC
        (0x6065, b"\1\2", None, 0x06070013),  # too short
        (0x1018, b"\1\2\3\4", None, 0x06090011),  # no sub-index 0 that can be written, or read only
    ],
)
def test_a_block_that_cannot_be_is_refused(rig: Rig, index: int, data: bytes, crc: int | None, code: int) -> None:
    before = rig.read(0x6065)
    with pytest.raises(Abort) as refused:
        download_block(rig, index, data, crc)
    assert refused.value.code in (code, 0x06010002) and rig.read(0x6065) == before


@pytest.mark.parametrize("request_", [b"\xa4\x08\x10\x00\x00", b"\xa3", b"\xa2\x01\x7f", b"\xa1", b"\xc1"])
def test_a_block_out_of_its_order_is_refused(rig: Rig, request_: bytes) -> None:
    with pytest.raises(Abort) as refused:
        rig.sdo(request_.ljust(8, b"\0"))
    assert refused.value.code in (0x05040001, 0x05040002)
    assert rig.read(0x1000) == 0x20192


def test_an_ordinary_request_ends_a_block(rig: Rig) -> None:
    rig.sdo(struct.pack("<BHBBB2x", 0xA4, 0x1008, 0, 127, 0))
    assert rig.read(0x1000) == 0x20192
    with pytest.raises(Abort):
        rig.sdo(bytes([0xA3]) + bytes(7))


@pytest.mark.parametrize("request_", [b"\xc6\x65\x60\x00\x04", b"\xa4\x08\x10\x00\x7f"], ids=["download", "upload"])
def test_a_client_that_ends_in_the_middle_of_its_block_blocks_no_other(rig: Rig, request_: bytes) -> None:
    rig.sdo(request_.ljust(8, b"\0"))
    rig.wait(2.1, step=0.1)
    download_block(rig, 0x6065, (1234).to_bytes(4, "little"))
    assert rig.read(0x6065) == 1234


def test_a_block_may_take_its_time(rig: Rig) -> None:
    rig.sdo(struct.pack("<BHBI", 0xC6, 0x6065, 0, 4))
    rig.wait(1.9, step=0.1)
    assert rig.sdo(b"\x81\x04\x03\x02\x01\0\0\0")[:2] == b"\xa2\x01"


@pytest.mark.parametrize("index, size", [(0x6060, 1), (0x605A, 2), (0x6065, 4)])
def test_a_client_need_not_say_how_many_bytes_it_writes(rig: Rig, index: int, size: int) -> None:
    answer = rig.sdo(struct.pack("<BHBI", 0x22, index, 0, 6))
    assert answer == struct.pack("<BHB4x", 0x60, index, 0)
    assert rig.read(index) == 6
