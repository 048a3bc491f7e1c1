"""A configuration script at the head of a part program (dialect option ncc)."""

from __future__ import annotations

import io

import pytest
from machines.test_ncc import ERRORS, PAPER

from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.interpreter import Interpreter

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
