"""A configuration script at the head of a part program (dialect option ncc)."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from machines.test_ncc import ERRORS, PAPER

from rds.machines import load_machine
from rds.nc.check import check_program
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.interpreter import Interpreter
from rds.nc.setup import Setup

PROGRAM = "G21 G90\nG1 X5 F100\nM2\n"


def calls(text: str, ncc: bool = True) -> tuple[list[str], Interpreter]:
    made = Interpreter(io.BytesIO(text.encode()), options=Dialect(ncc=ncc), name="own.ngc")
    try:
        return [str(item) for item in made.run()], made
    finally:
        made.close()


@pytest.mark.parametrize("head", ["(a head)\n", "%\n"])
def test_a_program_with_a_script_is_the_program_behind_it(head: str) -> None:
    tail = "%\n" if head.startswith("%") else ""
    alone, without = calls(head + "\n" * 8 + "(cut)\n" + PROGRAM + tail)
    both, interpreter = calls(head + PAPER + ERRORS + "(cut)\n" + PROGRAM + tail)
    assert without.configuration is None
    assert interpreter.configuration is not None and len(interpreter.configuration.links) == 3
    assert len(both) == len(alone) - ("(a" in head)  # a comment before the script belongs to the script


@pytest.mark.parametrize(
    ("text", "ncc", "line", "says"),
    [
        (PAPER.replace("N005 BUILD\n", "") + PROGRAM, True, 5, "G21 G90 before BUILD"),
        (PAPER + ERRORS.replace("N008 BUILD\n", "") + PROGRAM, True, 8, "G21 G90 before BUILD"),
        (PAPER.replace("LN2", "LN3", 1) + PROGRAM, True, 2, "LN3 out of order: LN2 is missing"),
        (PAPER + "G21\nN009 BUILD\nM2\n", True, 7, "stands at the program's head"),
        (PAPER + PROGRAM, False, 1, "read the program with the option ncc"),
        ("G21\nBUILD\nM2\n", False, 2, "read the program with the option ncc"),
    ],
)
def test_what_is_wrong(text: str, ncc: bool, line: int, says: str) -> None:
    with pytest.raises(ProgramError) as refusal:
        calls(text, ncc)
    assert says in str(refusal.value)
    assert refusal.value.line == line


def test_each_line_of_a_script_that_the_option_does_not_switch_on_is_one_fault(tmp_path: Path) -> None:
    """It was told word by word: RF01 LN1 XA0 is no line of G-code in a dozen ways."""
    part = tmp_path / "part.ngc"
    part.write_text(PAPER + "G21 G90\nM2\n")
    found, _ = check_program(part, load_machine("mrm-mill"), Setup())
    assert [fault.line for fault in found.faults] == [1, 2, 4, 5]  # a line with # is passed over
    assert all("--with ncc" in fault.reason for fault in found.faults)
