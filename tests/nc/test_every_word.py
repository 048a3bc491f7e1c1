"""Every G word to 99.9 and every M word to 199 is obeyed as rs274 does, or refused with its place and a remedy."""

from __future__ import annotations

import re

import pytest

from rds.nc.language.blocks import G_GROUPS, M_GROUPS, TURNING
from rds.nc.language.tool_centre import TCP
from tests.nc.rs274 import calls, needs_rs274, ours, rs274

BEFORE = "G21 F100 S100 T1\n"
# What a word needs beside it; the others stand alone.
NEEDS = {
    "G1": "X5",
    "G2": "X5 I2.5",
    "G3": "X5 R4",
    "G4": "P0.5",
    "G5": "X1 Y1 I1 J1 P1 Q1",
    "G5.1": "X1 Y1 I1 J1",
    "G5.2": "X1 Y1 P1 L3",
    "G5.3": "",
    "G10": "L2 P1 X1",
    "G28": "X1",
    "G30": "Y1",
    "G33": "Z1 K1",
    "G33.1": "Z1 K1",
    **dict.fromkeys(("G38.2", "G38.3", "G38.4", "G38.5"), "X9"),
    "G41": "D2",
    "G42": "D2",
    "G41.1": "D1",
    "G42.1": "D1",
    "G43": "H2",
    "G43.1": "Z1",
    "G43.2": "H1",
    "G52": "X1",
    "G53": "G0 X1",
    "G64": "P0.1 Q0.05",
    "G73": "Z-1 R1 Q0.5",
    "G74": "Z-1 R1",
    "G76": "P1 Z1 I1 J1 K2",
    "G81": "Z-1 R1",
    "G82": "Z-1 R1 P1",
    "G83": "Z-1 R1 Q0.5",
    "G84": "Z-1 R1",
    "G85": "Z-1 R1",
    "G86": "Z-1 R1 P1",
    "G87": "Z-1 R1 I1 J1 K1",
    "G88": "Z-1 R1 P1",
    "G89": "Z-1 R1 P1",
    "G92": "X5 A3",
    "G96": "S9",
    "G97": "S9",
    "M19": "R1",
    **dict.fromkeys(("M50", "M51", "M52", "M53", "M62", "M63", "M64", "M65"), "P1"),
    "M61": "Q1",
    "M66": "P1 L0",
    "M67": "E1 Q1",
    "M68": "E1 Q1",
}
TURNED = [f"G{code / 10:g}" for code in sorted(TURNING)]
NEEDS |= dict.fromkeys(TURNED, "Q1")
# What stands before a word that goes on from something.
FIRST = {
    "G5.3": "G5.2 X1 Y1 P1\nX2 Y0 P1\n",
    "G74": "M4\n",
    **dict.fromkeys(("G33", "G33.1", "G76", "G84", "G86", "G87", "G88"), "M3\n"),
    "M72": "M70\n",
    **dict.fromkeys(TURNED, "O1 SUB\nG0 X1 Z-1\nG1 X1.5 Z-2\nX2 Z-2.5\nO1 ENDSUB\nG18 G0 X3 Z3\n"),
}
# Words of rs274 outside the dialect, with what makes them whole there: refused here all the same.
OUTSIDE = {"G17.1": "", "G18.1": "", "G19.1": "", "M98": "P1", "M100": "", "M199": ""}
KNOWN = [f"G{code / 10:g}" for code in sorted(G_GROUPS) if code != TCP] + [f"M{code}" for code in sorted(M_GROUPS)]
EVERY = [*(f"G{code / 10:g}" for code in range(1000)), *(f"M{code}" for code in range(200))]
OTHERS = [word for word in EVERY if word not in KNOWN]


def program(word: str) -> bytes:
    return f"{BEFORE}{FIRST.get(word, '')}{word} {NEEDS.get(word, OUTSIDE.get(word, ''))}\nM2\n".encode()


def test_each_word_is_known_or_refused_with_line_column_word_and_remedy() -> None:
    assert len(KNOWN) + len(OTHERS) == 1200 and set(OUTSIDE) <= set(OTHERS) and set(NEEDS) <= set(KNOWN)
    for word in KNOWN:
        assert ours(program(word))[1] == "", word
    assert re.match(r"program:2:4: M98: .+ stands first on its line; ", ours(b"G21\nG0 M98 P1\nM2")[1])
    for word in OTHERS:
        if word == "M98":
            continue  # calls a program where it stands first
        said = ours(program(word))[1]
        assert re.fullmatch(rf"program:2:1: {re.escape(word)}: .+; .+", said), (word, said)


def test_each_letter_is_known_or_refused() -> None:
    for letter in "abcdefghijklmnopqrstuvwxyz@^$":
        said = ours(f"G21 G0 X1\n{letter}7\nM2".encode())[1]
        if letter in "abcxyzfgsmtno@^":  # N and O stand first here: numbers of a line and of a program
            assert said == "", letter
        else:
            assert re.match(rf"program:2:1: {re.escape(letter.upper())}7?: .+; .+", said), (letter, said)


@needs_rs274
@pytest.mark.parametrize("word", [word for word in KNOWN if word not in TURNED])  # whose moves are our own
def test_a_known_word_is_obeyed_as_rs274_does(word: str) -> None:
    printed, complaint = rs274(program(word))
    lines, said = ours(program(word))
    assert (complaint, said) == ("", "")
    assert calls(lines) == calls(printed)
