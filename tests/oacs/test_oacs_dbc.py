"""One source of truth: DBC, words and cyclic frames agree, and so does firmware made from the DBC."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from enum import IntEnum
from pathlib import Path
from typing import Any

import pytest
from cantools.database.can.c_source import camel_to_snake_case, generate
from hypothesis import given
from hypothesis import strategies as st

from rds.bus.modules.oacs import codes as words
from rds.bus.modules.oacs import messages
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Answer

DATABASE = messages.load()
MODULES = {"Z": 2, "A": 3, "X": 4, "Drill": 5}


def camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def test_every_message_and_field_is_explained() -> None:
    for message in DATABASE.messages:
        assert message.comment and message.senders, message.name
        for signal in message.signals:
            explained = signal.comment or re.sub(r"\d$", "1", signal.name) in {s.name for s in message.signals}
            assert explained, f"{message.name}.{signal.name}"


@pytest.mark.parametrize("kind, base", messages.PER_NODE.items())
def test_the_modules_speak_the_same_bytes(kind: str, base: int) -> None:
    def shape(message: Any) -> list[Any]:
        return [
            (s.name, s.start, s.length, s.is_signed, s.conversion.scale, s.multiplexer_ids) for s in message.signals
        ]

    for name, node in MODULES.items():
        message = DATABASE.get_message_by_name(f"{kind}_{name}")
        assert message.frame_id == base + node
        assert shape(message) == shape(DATABASE.get_message_by_name(f"{kind}_X"))


@pytest.mark.parametrize(
    "message, field, enum",
    [
        ("Reply", "Code", words.MessageToHost),
        ("Reply", "Acknowledges", words.Acknowledges),
        ("Reply", "Result", words.Result),
        ("Command_X", "Move", words.Move),
        ("Command_X", "Parameter", words.Parameter),
        ("Status_X", "Mode", words.Mode),
        ("Identity", "KindCode", words.Kind),
    ],
)
def test_codes_are_those_of_the_words(message: str, field: str, enum: type[IntEnum]) -> None:
    choices = DATABASE.get_message_by_name(message).get_signal_by_name(field).choices or {}
    names = {member.value: camel(member.name) for member in enum}
    told = {value: str(name) for value, name in choices.items()}
    if enum is words.Kind:
        told = {value: name.removesuffix("Axis") for value, name in told.items()}
    assert told == names


def test_identifiers_are_those_of_the_frames() -> None:
    wanted = {
        "MoreVoltages": frames.MORE_VOLTAGES,
        "CycleCommand": frames.COMMAND,
        "DryCommand": frames.DRY_COMMAND,
        "SetUp": frames.SETUP,
        "Call": frames.CALL,
    }
    assert {name: DATABASE.get_message_by_name(name).frame_id for name in wanted} == wanted
    for name, node in MODULES.items():
        assert DATABASE.get_message_by_name(f"Answer_{name}").frame_id == frames.answer_identifier(node)
    cyclic = {frames.answer_identifier(node) for node in words.NODES} | set(wanted.values())
    ours = {base + node for base in messages.PER_NODE.values() for node in words.NODES} | {words.HOST, words.GENERAL}
    assert not cyclic & ours


@given(
    st.lists(st.floats(-10, 10), min_size=4, max_size=4),
    st.integers(0, frames.NUMBERS),
    st.sampled_from(["CycleCommand", "DryCommand", "MoreVoltages"]),
)
def test_commands_agree_bit_by_bit(voltages: list[float], number: int, name: str) -> None:
    message = DATABASE.get_message_by_name(name)
    data = frames.number_voltages(frames.encode_voltages(voltages), number)
    decoded = message.decode(data)
    told = tuple(value for field, value in sorted(decoded.items()) if field.startswith("Voltage"))
    assert told == frames.decode_voltages(message.frame_id, data)
    assert sum(value for field, value in decoded.items() if field.startswith("Number")) == number
    assert message.encode(decoded) == data


@given(st.integers(1, 1_000_000_000))  # µs: sample periods to 1000 s
def test_set_up_agrees_bit_by_bit(period: int) -> None:
    message = DATABASE.get_message_by_name("SetUp")
    data = frames.encode_setup(period * 1e-6)
    assert message.encode({"SamplePeriod": period, "Reserved": 0}) == data
    assert frames.decode_setup(message.frame_id, data) == pytest.approx(period * 1e-6)


@given(st.binary(min_size=8, max_size=8).map(lambda data: data[:5] + bytes([data[5] & 1]) + data[6:]))
def test_answers_agree_bit_by_bit(data: bytes) -> None:
    answer = frames.decode_answer(0x24, data)
    fields = DATABASE.get_message_by_name("Answer_X").decode(data, decode_choices=False)
    status = {"Enabled": frames.Status.ENABLED, "Watchdog": frames.Status.WATCHDOG}
    status |= {"DryRun": frames.Status.DRY_RUN, "Fault": frames.Status.FAULT, "Limit": frames.Status.LIMIT}
    status |= {"EmergencyStop": frames.Status.EMERGENCY, "NotSetUp": frames.Status.NOT_SET_UP}
    status |= {"Refused": frames.Status.REFUSED}
    bits = sum(bit for name, bit in status.items() if fields[name])
    assert Answer(fields["Counts"], bits, fields["Kind"], fields["Ticks"]) == answer
    assert DATABASE.get_message_by_name("Answer_X").encode(fields) == frames.encode_answer(answer) == data


MAIN = """
#include <stdio.h>
#include <string.h>
#include "oacs.h"
int main(void) {{
    unsigned n, size, value, i;
    uint8_t in[8], out[8];
    while (scanf("%u %u", &n, &size) == 2) {{
        for (i = 0; i < size; i++) {{ if (scanf("%x", &value) != 1) return 1; in[i] = (uint8_t)value; }}
        switch (n) {{
{cases}
        default: return 1;
        }}
    }}
    return 0;
}}
"""
CASE = """        case {n}: {{
            struct oacs_{m}_t s; memset(&s, 0, sizeof s); memset(out, 0, sizeof out);
            if (oacs_{m}_unpack(&s, in, size) != 0) return 2;
            if (oacs_{m}_pack(out, &s, size) != (int)size) return 3;
            for (i = 0; i < size; i++) printf("%02x", out[i]);
{prints}            printf("\\n"); break; }}"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler (gcc) here")
def test_firmware_made_from_the_dbc_agrees_with_python(tmp_path: Path) -> None:
    header, source, *_ = generate(DATABASE, "oacs", "oacs.h", "oacs.c", "fuzz.c")
    (tmp_path / "oacs.h").write_text(header)
    (tmp_path / "oacs.c").write_text(source)
    used = [message for message in DATABASE.messages if message.signals]
    cases = []
    for n, message in enumerate(used):
        name = camel_to_snake_case(message.name)
        prints = "".join(
            f'            printf(" %.17g", (double)oacs_{name}_{f}_decode(s.{f}));\n'
            for f in (camel_to_snake_case(signal.name) for signal in message.signals)
        )
        cases.append(CASE.format(n=n, m=name, prints=prints))
    (tmp_path / "main.c").write_text(MAIN.format(cases="\n".join(cases)))
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-o", "firmware", "main.c", "oacs.c"]
    compiled = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert compiled.returncode == 0, compiled.stderr

    chance, sent = random.Random(3), []
    for n, message in enumerate(used):
        for _ in range(50):
            raw = _random_fields(message, chance)
            sent.append((n, message, message.encode(raw, scaling=False, strict=False), raw))
    lines = "".join(f"{n} {len(data)} {data.hex(' ')}\n" for n, _, data, _ in sent)
    answers = subprocess.run(["./firmware"], input=lines, cwd=tmp_path, capture_output=True, text=True)
    assert answers.returncode == 0
    for (_, message, data, raw), line in zip(sent, answers.stdout.splitlines(), strict=True):
        back, *values = line.split()
        assert back == data.hex(), message.name
        physical = message.decode(data, decode_choices=False)
        for signal, value in zip(message.signals, values, strict=True):
            if signal.name in raw:
                assert float(value) == pytest.approx(physical[signal.name], rel=1e-6, abs=1e-9), signal.name


def _random_fields(message: Any, chance: random.Random) -> dict[str, Any]:
    """Raw values for the fields that one of the message's codes has; spare bits stay 0."""
    code = None
    if message.is_multiplexed():
        code = chance.choice(list(message.get_signal_by_name("Code").choices))
    fields: dict[str, Any] = {}
    for signal in message.signals:
        if signal.multiplexer_ids is not None and code not in signal.multiplexer_ids:
            continue
        low = -(1 << signal.length - 1) if signal.is_signed else 0
        value: Any = chance.randint(low, low + (1 << signal.length) - 1)
        if signal.conversion.is_float:
            value = float(chance.randint(-1000, 1000)) / 8
        fields[signal.name] = code if signal.name == "Code" and code is not None else value
    return fields
