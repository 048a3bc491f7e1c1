"""No bytes crash or hang what reads programs, tool tables and parameter files; what once did is kept in fuzz_cases/."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.nc import Dialect

from .fuzz_targets import TARGETS, same

CASES = sorted((Path(__file__).parent / "fuzz_cases").iterdir())


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_what_was_found_before(case: Path) -> None:
    TARGETS[case.name.partition("-")[0]](case.read_bytes())


def test_blanks_between_blocks_count_to_no_block() -> None:
    program = b"G0 X1" + b" " * 100 + b";" + b" " * 240 + b"X2;" + b" " * 9 + b"\nM2;\n"
    assert same(program, Dialect(program_numbers=True))["fault"] is None


# Pieces of the language, in any order and number.
VALUES = ["1", "-2.5", ".5", "0", "#1", "#<a>", "[1+2]", "[#1 MOD 2]", "SIN[30]", "ATAN[1]/[2]", "EXISTS[#<a>]", "#[1"]
LETTERS = "XYZABCIJKRFSTDHLPQNGMOE"
CODES = [
    *(
        "G0",
        "G1",
        "G2",
        "G3",
        "G4",
        "G10L2P1",
        "G17",
        "G18",
        "G20",
        "G28",
        "G30.1",
        "G40",
        "G41",
        "G42.1",
        "G43",
        "G43.1",
    ),
    *(
        "G49",
        "G53",
        "G55",
        "G61",
        "G64",
        "G80",
        "G90",
        "G91",
        "G90.1",
        "G92",
        "G92.3",
        "G93",
        "G94",
        "G95",
        "G81 R1 Z-1",
        "G83 R1 Z-1 Q.5",
        "G98",
        "G7",
        "G5.2 P1",
        "G5.3",
        "G33 K1",
        "G76 P1 I1 J1 K2",
        "G38.2",
        "G52",
        "M70",
        "M72",
        "M73",
        "M98 P5",
        "M99",
        "O5",
        "@2",
        "^30",
        "M0",
    ),
    *(
        "M2",
        "M3",
        "M6",
        "M8",
        "M30",
        "%",
        "/",
        "(a)",
        "(MSG, b)",
        "(PRINT, #1)",
        "(",
        ";c",
        "#1=",
        "#<a>=",
        "N10",
        "GR1",
        "T1",
        "D2",
    ),
    *("O1 SUB", "O1 ENDSUB", "O1 CALL", "O1 RETURN [2]", "O2 IF [#1]", "O2 ELSE", "O2 ENDIF", "O3 WHILE [#1 LT 3]"),
    *("O3 ENDWHILE", "O3 DO", "O3 BREAK", "O3 CONTINUE", "O4 REPEAT [3]", "O4 ENDREPEAT", "#1=[#1+1]", "F100", "G1X"),
]
words = st.one_of(
    st.sampled_from(CODES),
    st.builds("".join, st.tuples(st.sampled_from(LETTERS), st.sampled_from(VALUES))),
    st.text(st.characters(codec="utf-8"), max_size=2),
)
texts = st.lists(st.lists(words, max_size=5).map(" ".join), max_size=14).map("\n".join)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 3), texts, st.booleans())
def test_programs_of_pieces(dialect: int, text: str, ends: bool) -> None:
    TARGETS["program"](bytes([dialect]) + text.encode() + (b"\nM2\n" if ends else b""))


@pytest.mark.parametrize("target", TARGETS)
@settings(max_examples=100, deadline=None)
@given(data=st.binary(max_size=300))
def test_any_bytes(target: str, data: bytes) -> None:
    TARGETS[target](data)


fields = st.one_of(
    st.builds(
        "".join, st.tuples(st.sampled_from("TPXYZABCUVWDIJQ;t"), st.sampled_from(["1", "-2.5", "9e9", "nan", ""]))
    ),
    st.sampled_from(
        ["5220", "5221", "1", "5601", "5602", "-1", "1_0", "２", "1e400", "inf", "0x1", "1.5", "5161", "3", "5210"]
    ),
)
tables = st.lists(st.lists(fields, max_size=4).map(" ".join), max_size=6).map("\n".join)


@pytest.mark.parametrize("target", ["tool_table", "parameter_file"])
@settings(max_examples=100, deadline=None)
@given(text=tables)
def test_tables_of_pieces(target: str, text: str) -> None:
    TARGETS[target](text.encode())
