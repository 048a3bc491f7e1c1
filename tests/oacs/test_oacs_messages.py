"""Messages there and back, and what is said of those that are wrong."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs import codes as words
from rds.bus.modules.oacs import messages
from rds.core.errors import InputError, MachineError

DATABASE = messages.load()
KINDS = [*messages.PER_NODE, *messages.TO_ALL, "Identity"]


@st.composite
def any_message(draw: st.DrawFn) -> tuple[str, int, dict[str, Any]]:
    """A kind, a module and valid fields."""
    kind = draw(st.sampled_from(KINDS))
    node = draw(st.sampled_from(words.NODES)) if kind in messages.PER_NODE else 0
    message = messages._message(kind)
    code = draw(st.sampled_from(messages._codes_of(message))) if message.is_multiplexed() else None
    fields: dict[str, Any] = {}
    for signal in message.signals:
        if signal.multiplexer_ids is not None and code not in signal.multiplexer_ids:
            continue
        low, high = signal.minimum, signal.maximum
        if signal.name == "Code" and code is not None:
            value: Any = code
        elif signal.choices:
            value = draw(st.sampled_from([int(choice) for choice in signal.choices]))
        elif signal.conversion.is_float:
            value = draw(st.floats(width=32, allow_nan=False, allow_infinity=False))
        else:
            scale, offset = signal.conversion.scale, signal.conversion.offset
            whole = scale == 1 and offset == 0
            raw = (low, high) if whole else (round((low - offset) / scale), round((high - offset) / scale))
            value = draw(st.integers(*raw)) * scale + offset
        fields[signal.name] = value
    return kind, node, fields


@given(any_message())
def test_there_and_back(message: tuple[str, int, dict[str, Any]]) -> None:
    kind, node, fields = message
    frame = messages.encode(kind, node, **fields)
    decoded = messages.decode(*frame)
    assert decoded.kind == kind
    assert decoded.node == (fields["BoardID"] if kind == "Identity" else node)
    assert decoded.fields == pytest.approx(fields, rel=1e-9, abs=1e-9)


@given(st.integers(0, 0x7FF) | st.integers(0x1E000000, 0x1EFFFFFF), st.binary(max_size=8), st.booleans())
def test_hostile_frames_are_errors_and_nothing_else(identifier: int, data: bytes, extended: bool) -> None:
    try:
        messages.decode(identifier, data, extended)
    except MachineError as error:
        assert f"{identifier:#05x}" in str(error)


@pytest.mark.parametrize(
    "identifier, data, told",
    [
        (
            0x004,
            bytes([3, 9, 0, 0, 0, 0, 0, 0]),
            r"0x004 \[03 09 .*\] field Move of Command = 9 is unknown; known: 0 Stop",
        ),
        (0x004, bytes([200, 0, 0, 0, 0, 0, 0, 0]), "field Code = 200 is unknown in Command"),
        (0x004, b"\x03\x01", "has 2 bytes; Command has 8"),
        (0x000, b"", "no bytes"),
        (0x7FF, bytes(8), "is no message of the oacs dialect"),
        (
            0x134,
            bytes([1, 2, 0, 0, 0, 0, 0xC0, 0x7F]),
            "field ParameterValue of Parameter = nan is not a finite number",
        ),
        (0x154, b"\xff" * 8, None),
    ],
)
def test_errors_name_identifier_bytes_and_field(identifier: int, data: bytes, told: str | None) -> None:
    if told is None:
        messages.decode(identifier, data)
        return
    with pytest.raises(MachineError, match=told):
        messages.decode(identifier, data)


@pytest.mark.parametrize(
    "kind, fields, told",
    [
        ("Command", {"Code": 3, "Move": 1, "Speed": 3}, "no field 'Speed'"),
        ("Command", {"Move": 1}, "needs Code"),
        ("Command", {"Code": 3, "Move": 77}, "Move of Command = 77 is unknown"),
        ("Command", {"Code": 3, "Move": 1, "Value": 256}, r"Value of Command = 256 is outside 0 to 255"),
        ("Command", {"Code": 5, "Parameter": 1, "ParameterValue": float("nan")}, "must be a number"),
        ("Reply", {"Code": 3, "BoardID": 1}, "BoardID of Reply = 1 is outside 2 to 14"),
        ("Greeting", {}, "no message 'Greeting'"),
    ],
)
def test_wrong_fields_are_named(kind: str, fields: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        messages.encode(kind, 4, **fields)


def test_the_patterns_of_the_thesis() -> None:
    """Tables 6 and 7, with figures as binary bytes (appendix H) and letters as ASCII."""
    assert messages.encode("GeneralCall", Code=1).data == bytes([1, 0, 0, 0, 0, 0, 0, 0])
    assert messages.encode("GeneralCall", Code=1).identifier == 0x001
    start = messages.encode("Command", 4, Code=3, Move=1, Value=10, Direction=1)
    assert start == (0x004, bytes([3, 1, 10, 1, 0, 0, 0, 0]), False)
    assert messages.encode("Command", 4, Code=3, Move=2).data == bytes([3, 2, 0, 0, 0, 0, 0, 0])
    reply = messages.encode("Reply", Code=1, BoardID=4, **messages.letters("KindText", "ServM", 5))
    assert reply == (0x000, b"\x01\x04ServM\0", False)
    reply = messages.encode("Reply", Code=2, BoardID=5, **messages.letters("TypeText", "DrillT", 6))
    assert reply.data == b"\x02\x05DrillT"


@given(st.sampled_from(words.NODES), st.floats(0, 1e4), st.floats(0, 1e4))
def test_slots_of_two_modules_never_meet(node: int, at: float, base: float) -> None:
    slot = words.next_slot(node, at, base)
    assert at - 1e-6 <= slot <= max(at, base) + 2 * words.SLOT_GRID
    into = (slot - base) % words.SLOT_GRID
    distance = abs(into - words.slot_offset(node))
    assert min(distance, words.SLOT_GRID - distance) < 1e-6


def test_the_cyclic_path_never_loads_the_dbc() -> None:
    code = "import sys, rds.bus.modules.rds.drivers, rds.bus.modules.oacs.drivers, rds.bus.modules.oacs.module\n"
    code += "assert 'cantools' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
