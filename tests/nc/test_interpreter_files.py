"""Tool tables and parameter files in LinuxCNC's formats, and what is wrong in them."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rds.nc import Dialect, ProgramError, interpret
from rds.nc.language.canon_text import text
from rds.nc.language.parameters import read_parameters
from rds.nc.language.tools import Tool, read_tools
from tests.nc.rs274 import TOOLS, needs_rs274, rs274

ANY_FILE = settings(max_examples=200, suppress_health_check=list(HealthCheck))


def test_a_tool_table_is_read(tmp_path: Path) -> None:
    path = tmp_path / "tool.tbl"
    path.write_text("; a comment\n\nT1  P3 D+6.000 Z-1.5e1 ; end mill 6 mm\nt12 p2 x1 y2 z3 a4 b5 c6 i10 j-20 q3\n")
    assert read_tools(path) == [
        Tool(1, 3, 6.0, (0.0, 0.0, -15.0, 0.0, 0.0, 0.0), comment="end mill 6 mm"),
        Tool(12, 2, 0.0, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 10.0, -20.0, 3),
    ]


def test_the_line_of_no_tool_takes_a_slot_as_in_linuxcnc(tmp_path: Path) -> None:
    path = tmp_path / "tool.tbl"
    path.write_text("T0 P0 Z9 ; no tool loaded\nT1 P1 Z5\n")
    calls = list(text(interpret("T1 M6 G43\nT0 M6\nG43\nM2\n", tools=read_tools(path))))
    slots = [call for call in calls if "CHANGE_TOOL" in call]
    lengths = [call.split()[4] for call in calls if "LENGTH_OFFSET" in call]
    assert "CHANGE_TOOL(2)" in slots[0] and "CHANGE_TOOL(0)" in slots[1]
    assert lengths == ["5.0000,", "0.0000,"]


@pytest.mark.parametrize(
    ("table", "line", "column", "word", "message"),
    [
        ("T1 P1 D6\nT2 P2 K6\n", 2, 7, "K6", "is no word of a tool table"),
        ("T1 P1 D\n", 1, 7, "D", "is no word of a tool table"),
        ("T1 P1 D6 D7\n", 1, 10, "D7", "comes twice"),
        ("T1 P1\nT1 P2\n", 2, 0, "T1", "comes twice"),
        ("T1.5 P1\n", 1, 1, "T1.5", "whole number"),
        ("T1 P1 D1e99\n", 1, 7, "D1e99", "too large"),
        ("T-1 P1\n", 1, 0, "", "needs its number T"),
        ("T1 D6\n", 1, 0, "", "needs its number T (from 1) and its pocket P"),
        ("T1 P1 U2\n", 1, 0, "", "no such axes"),
    ],
)
def test_what_is_wrong_in_a_tool_table_is_told(
    tmp_path: Path, table: str, line: int, column: int, word: str, message: str
) -> None:
    path = tmp_path / "tool.tbl"
    path.write_text(table)
    with pytest.raises(ProgramError) as caught:
        read_tools(path)
    assert (caught.value.file, caught.value.line, caught.value.column, caught.value.word) == (
        str(path),
        line,
        column,
        word,
    )
    assert message in caught.value.reason


def test_a_parameter_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "p.var"
    path.write_text("Parameter  Value\n\n5161\t1.500000 G28 of X\n# a note\n5220 2 ; G55\n\n5241\t-3\n")
    assert read_parameters(path) == {5161: 1.5, 5220: 2.0, 5241: -3.0}
    calls = list(text(interpret("G28\nM2", parameters=path)))
    assert "SET_G5X_OFFSET(2, -3.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)" in calls[1]
    assert "STRAIGHT_TRAVERSE(4.5000, 0.0000, 0.0000" in calls[7]


@pytest.mark.parametrize(
    ("kept", "line", "message"),
    [
        ("5161 1\n5160 2\n", 2, "ascending order"),
        ("5161 1\n5161 2\n", 2, "ascending order"),
        ("0 1\n", 1, "numbers go from 1 to 5601"),
        ("5161 nan\n", 1, "no finite number"),
        ("5161 1\n5162 1,5\n", 2, "'5162 1,5' is no setting"),
        ("5161 1\n5162 1 5\n", 2, "'5162 1 5' is no setting"),
        ("5161=1\n", 1, "'5161=1' is no setting"),
        ("5161 1\n5162\n", 2, "'5162' is no setting"),
        ("5161 1\nhome of X\n", 2, "'home of X' is no setting"),
        ("x5161 1\n", 1, "'x5161 1' is no setting"),
    ],
)
def test_what_is_wrong_in_a_parameter_file_is_told(tmp_path: Path, kept: str, line: int, message: str) -> None:
    path = tmp_path / "p.var"
    path.write_text(kept)
    with pytest.raises(ProgramError, match=message) as caught:
        read_parameters(path)
    assert (caught.value.file, caught.value.line) == (str(path), line)


def test_files_that_are_missing_are_told(tmp_path: Path) -> None:
    for read in (read_tools, read_parameters, lambda path: list(interpret(path))):
        with pytest.raises(ProgramError, match="cannot be read"):
            read(tmp_path / "none")


@ANY_FILE
@given(st.binary(max_size=200))
def test_any_file_is_a_table_or_a_fault(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "any"
    path.write_bytes(content)
    for read in (read_tools, read_parameters):
        try:
            read(path)
        except ProgramError as error:
            assert error.file == str(path)


@needs_rs274
def test_offsets_kept_in_a_file_are_those_of_rs274(tmp_path: Path) -> None:
    kept = "5161\t1\n5181\t-2\n5210\t1\n5211\t0.25\n5220\t3\n5261\t0.5\n5262\t-1\n5270\t30\n"
    program = "G0 X1 Y2\nG28\nG54\nX1\nG92.1\nT2 M6\nG43\nG30 Z1\nM2\n"
    printed, complaint = rs274(program.encode(), variables=kept)
    assert not complaint
    (tmp_path / "p.var").write_text(kept)
    (tmp_path / "tool.tbl").write_text(TOOLS)
    items = interpret(
        program, tools=tmp_path / "tool.tbl", parameters=tmp_path / "p.var", options=Dialect(inch_machine=True)
    )
    assert list(text(items)) == printed


def test_the_name_of_a_file_as_a_str_is_told_from_a_program(tmp_path: Path) -> None:
    (tmp_path / "part.ngc").write_text("M2\n")
    with pytest.raises(ProgramError, match=r"part\.ngc: is the name of a file.*give Path"):
        list(interpret(str(tmp_path / "part.ngc")))
    assert list(text(interpret(tmp_path / "part.ngc"))) == list(text(interpret("M2\n")))
