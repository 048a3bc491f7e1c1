"""The module description in the data download: there and back, and hostile bytes."""

from __future__ import annotations

import struct
import time
from contextlib import suppress
from dataclasses import replace
from math import cos, nan, sin
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs.codes import Kind
from rds.bus.modules.oacs.iso_tp import Receiver, Sender
from rds.bus.modules.oacs.module_data import read_modules
from rds.bus.modules.oacs.transfer import (
    JOINTS,
    LENGTH,
    LENGTH_2,
    SIDES,
    ModuleDescription,
    decode_description,
    encode_description,
)
from rds.core.errors import InputError, MachineError
from rds.machines import load_machine
from rds.machines.library import Interface

X = read_modules(load_machine("mrmt-oacs"))["X"].describe(12345)
positive = st.floats(0, 2.0**20, width=32)


def sides(name: str) -> st.SearchStrategy[Interface | None]:
    kinds, sizes = st.text("abc XYZ", min_size=1, max_size=16), st.floats(0.5, 1e4, width=32)
    return st.none() | st.builds(Interface, st.just(name), kinds, sizes, st.sampled_from(SIDES[1:]))


@st.composite
def descriptions(draw: st.DrawFn) -> ModuleDescription:
    lowest, initial, highest = sorted(draw(st.lists(st.floats(-1e4, 1e4, width=32), min_size=3, max_size=3)))
    angle = draw(st.floats(-3, 3))
    c, s = (struct.unpack("<f", struct.pack("<f", f(angle)))[0] for f in (cos, sin))
    shift = [draw(st.floats(-1e4, 1e4, width=32)) for _ in range(3)]
    return ModuleDescription(
        draw(st.sampled_from(Kind)),
        draw(st.sampled_from("XYZABCT")),
        draw(st.text("abcXYZ019 ", min_size=1, max_size=12)),
        draw(st.integers(0, (1 << 20) - 1)),
        draw(positive),
        draw(positive),
        lowest,
        highest if highest > lowest else 2.0**14,  # beyond the others, and exact in 32 bits
        initial,
        draw(st.floats(0.015625, 1024.0, width=32)),
        draw(positive),
        draw(positive),
        draw(positive),
        12.0,
        ((c, -s, 0.0, shift[0]), (s, c, 0.0, shift[1]), (0.0, 0.0, 1.0, shift[2]), (0.0, 0.0, 0.0, 1.0)),
        draw(st.sampled_from(JOINTS)),
        draw(sides("mounted_by")),
        draw(sides("carries_on")),
        draw(st.sampled_from(["", "RangeArm"])),
    )


@given(descriptions())
def test_there_and_back(description: ModuleDescription) -> None:
    assert decode_description(encode_description(description)) == description


def test_the_modules_of_the_thesis() -> None:
    assert X.matrix[0] == (1.0, 0.0, 0.0, 583.0) and X.matrix[2][3] == -111.0
    assert 1.0 / X.resolution == 169.0 and (X.lowest, X.highest) == (-150.0, 150.0)
    assert decode_description(encode_description(X)) == X
    for data in read_modules(load_machine("mrmt-oacs")).values():
        assert decode_description(encode_description(data.describe(1))).type_text == data.type_text


@given(st.binary(max_size=300))
def test_hostile_bytes_are_errors_and_nothing_else(data: bytes) -> None:
    with pytest.raises(MachineError):
        decode_description(data)


@given(st.binary(min_size=LENGTH - 5, max_size=LENGTH - 5))
def test_hostile_bytes_with_a_right_check_sum(rest: bytes) -> None:
    body = b"\x01" + rest
    with suppress(MachineError):
        decode_description(body + struct.pack("<I", crc32(body)))


@given(st.integers(0, LENGTH - 1), st.integers(0, 7))
def test_every_flipped_bit_is_noticed(place: int, bit: int) -> None:
    data = bytearray(encode_description(X))
    data[place] ^= 1 << bit
    with pytest.raises(MachineError):
        decode_description(data)


@pytest.mark.parametrize(
    "changes, told",
    [
        ({"lowest": 5.0, "highest": 5.0}, "lowest <= initial <= highest"),
        ({"counts_per_unit": 0.0}, "counts_per_unit"),
        ({"accuracy": nan}, "accuracy = nan must be finite"),
        ({"type_text": "Ü"}, "type_text"),
        ({"serial": 1 << 20}, "serial"),
        ({"joint": "q"}, "joint"),
        ({"matrix": ((2.0, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1.0))}, "rows 1 and 1 of the matrix"),
        ({"matrix": ((-1.0, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1.0))}, "mirrors"),
    ],
)
def test_impossible_modules_are_refused(changes: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        encode_description(replace(X, **changes))  # type: ignore[arg-type]


def test_a_newer_version_is_told_so() -> None:
    with pytest.raises(MachineError, match="version 3, this program reads versions 1 and 2; update"):
        decode_description(b"\x03" + encode_description(X)[1:])


def test_both_versions_are_read() -> None:
    """A module without interfaces sends the bytes of version 1, and a host that knows version 2 reads them."""
    first = replace(X, mounted_by=None, carries_on=None)
    second = read_modules(load_machine("mrmt-oacs"))["Z"].describe(7)
    assert (first.version, second.version) == (1, 2)
    assert len(encode_description(first)) == LENGTH and len(encode_description(second)) == LENGTH_2
    told = decode_description(encode_description(second))
    assert told.mounted_by == Interface("mounted_by", "column foot", 250.0, "female")
    assert (told.carries_on, told.accessory) == (Interface("carries_on", "bolted head", 120.0, "male"), "RangeArm")
    before = decode_description(encode_description(first))
    assert (before.mounted_by, before.carries_on, before.accessory) == (None, None, "")
    for changes, why in (
        ({"accessory": "a range arm that is long"}, "12 printable"),
        ({"mounted_by": Interface("mounted_by", "", 1.0, "male")}, "kind = '' of mounted_by"),
        ({"carries_on": Interface("carries_on", "bolted", 0.0, "male")}, "must have a size above 0"),
    ):
        with pytest.raises(InputError, match=why):
            encode_description(replace(X, **changes))  # type: ignore[arg-type]
    with pytest.raises(MachineError, match="has 128 bytes; version 2 has 188"):
        decode_description(b"\x02" + encode_description(first)[1:])


def test_a_host_that_stood_still_for_a_while_takes_the_frames_that_waited_for_it() -> None:
    payload = encode_description(X)
    module, host = Sender(2), Receiver(2)
    for frame in module.start(payload):
        host.feed(frame)
    for flow in host.pump():
        module.feed(flow)
    frames = module.pump()
    time.sleep(0.4)  # a busy computer's; ISO 15765-2 grants 1 s
    for frame in frames:
        host.feed(frame)
    host.pump()
    assert host.result() == payload and host.problem is None


def test_over_iso_tp() -> None:
    payload = encode_description(X)
    sender, receiver = Sender(4), Receiver(4)
    out = sender.start(payload)
    assert out[0][0] >> 4 == 1 and len(out) == 1, "the first frame waits for flow control"
    frames = 1
    while (got := receiver.result()) is None:
        for data in out:
            assert len(data) == 8
            receiver.feed(data)
        for data in receiver.pump():
            sender.feed(data)
        out = sender.pump()
        frames += len(out)
        assert frames < 100
    assert got == payload and not sender.waiting


@given(st.lists(st.binary(max_size=8), max_size=20))
def test_hostile_flow_control(frames: list[bytes]) -> None:
    sender = Sender(4)
    sender.start(bytes(100))
    for data in frames:
        sender.feed(data)
        assert len(sender.pump()) < 50
    assert sender.start(bytes(100))[0][:2] == bytes([0x10, 100]), "the next download begins from its beginning"
