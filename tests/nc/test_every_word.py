"""Every G word to 99.9 and every M word to 199 is obeyed as rs274 does, or refused with its place and a remedy."""

from __future__ import annotations

import re

import pytest

from rds.nc.language.blocks import G_GROUPS, M_GROUPS
from tests.nc.rs274 import calls, needs_rs274, ours, rs274

BEFORE = "G21 F100 S100 T1\n"
# What a word needs beside it; the others stand alone.
NEEDS = {
    "G1": "X5",
    "G2": "X5 I2.5",
    "G3": "X5 R4",
    "G4": "P0.5",
    "G10": "L2 P1 X1",
    "G28": "X1",
    "G30": "Y1",
    "G41": "D2",
    "G42": "D2",
    "G41.1": "D1",
    "G42.1": "D1",
    "G43": "H2",
    "G43.1": "Z1",
    "G53": "G0 X1",
    "G64": "P0.1 Q0.05",
    "G92": "X5 A3",
}
# Words of rs274 outside the dialect, with what makes them whole there: refused here all the same.
OUTSIDE = {
    "G5": "X1 Y1 I1 J1 P1 Q1",
    "G5.1": "X1 Y1 I1 J1",
    "G5.2": "X1 Y1 P1 L3",
    "G5.3": "",
    "G7": "",
    "G8": "",
    "G17.1": "",
    "G18.1": "",
    "G19.1": "",
    "G33": "Z1 K1",
    "G33.1": "Z1 K1",
    "G38.2": "X9",
    "G38.3": "X9",
    "G38.4": "X9",
    "G38.5": "X9",
    "G43.2": "H1",
    "G52": "X1",
    "G73": "Z-1 R1 Q0.5",
    "G76": "P1 Z1 I1 J1 K1",
    "G74": "Z-1 R1",
    "G81": "Z-1 R1",
    "G82": "Z-1 R1 P1",
    "G83": "Z-1 R1 Q0.5",
    "G84": "Z-1 R1",
    "G85": "Z-1 R1",
    "G86": "Z-1 R1 P1",
    "G88": "Z-1 R1 P1",
    "G89": "Z-1 R1 P1",
    "G96": "S9",
    "G97": "S9",
    "G98": "",
    "G99": "",
    "M19": "R1",
    "M48": "",
    "M49": "",
    "M50": "P1",
    "M51": "P1",
    "M52": "P1",
    "M53": "P1",
    "M61": "Q1",
    "M62": "P1",
    "M63": "P1",
    "M64": "P1",
    "M65": "P1",
    "M66": "P1 L0",
    "M67": "E1 Q1",
    "M68": "E1 Q1",
    "M70": "",
    "M71": "",
    "M72": "",
    "M73": "",
    "M98": "P1",
    "M99": "",
    "M100": "",
    "M199": "",
}
KNOWN = [f"G{code / 10:g}" for code in sorted(G_GROUPS)] + [f"M{code}" for code in sorted(M_GROUPS)]
EVERY = [*(f"G{code / 10:g}" for code in range(1000)), *(f"M{code}" for code in range(200))]
OTHERS = [word for word in EVERY if word not in KNOWN]


def program(word: str) -> bytes:
    return f"{BEFORE}{word} {NEEDS.get(word, OUTSIDE.get(word, ''))}\nM2\n".encode()


def test_each_word_is_known_or_refused_with_line_column_word_and_remedy() -> None:
    assert len(KNOWN) + len(OTHERS) == 1200 and set(OUTSIDE) <= set(OTHERS) and set(NEEDS) <= set(KNOWN)
    for word in KNOWN:
        assert ours(program(word))[1] == "", word
    for word in OTHERS:
        said = ours(program(word))[1]
        assert re.fullmatch(rf"program:2:1: {re.escape(word)}: .+; .+", said), (word, said)


def test_each_letter_is_known_or_refused() -> None:
    for letter in "abcdefghijklmnopqrstuvwxyz@^$":
        said = ours(f"G21 G0 {letter}7\nM2".encode())[1]
        if letter in "abcxyzfsmt":
            assert said == "", letter
        else:
            assert re.match(rf"program:1:8: {re.escape(letter.upper())}7?: .+; .+", said), (letter, said)


@needs_rs274
@pytest.mark.parametrize("word", KNOWN)
def test_a_known_word_is_obeyed_as_rs274_does(word: str) -> None:
    printed, complaint = rs274(program(word))
    lines, said = ours(program(word))
    assert (complaint, said) == ("", "")
    assert calls(lines) == calls(printed)
