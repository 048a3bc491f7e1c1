"""Programs over every word of the dialect: call for call what LinuxCNC's rs274 makes of them."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.nc.random_programs import program
from tests.nc.rs274 import PROGRAMS, calls, kept, needs_rs274, ours, rs274


@pytest.mark.parametrize("path", kept(), ids=lambda path: path.stem)
def test_a_program_becomes_the_calls_that_rs274_made_of_it(path: Path) -> None:
    lines, complaint = ours(path)
    assert not complaint
    assert lines == path.with_suffix(".canon").read_text(encoding="utf-8").splitlines()


@needs_rs274
@pytest.mark.parametrize("path", kept(), ids=lambda path: path.stem)
def test_the_expected_calls_are_those_of_the_rs274_installed_here(path: Path) -> None:
    printed, complaint = rs274(path.read_bytes(), PROGRAMS)
    assert not complaint
    assert printed == path.with_suffix(".canon").read_text(encoding="utf-8").splitlines()


@needs_rs274
@settings(max_examples=30, suppress_health_check=list(HealthCheck))
@given(st.randoms(use_true_random=False))
def test_random_programs_become_the_same_calls_up_to_the_same_fault(r: Random) -> None:
    text = program(r)
    printed, complaint = rs274(text)
    lines, fault = ours(text)
    assert bool(fault) == bool(complaint), f"rs274: {complaint or 'accepts'}; here: {fault or 'accepted'}"
    assert calls(lines) == calls(printed)


# Accepted by rs274, though it passes over a word, forgets where the tool is, or does something else than is written.
STRICTER = {
    "P is negative": "G0 G4 P-2\nM2",
    "a tolerance is negative": "G64 P-2\nM2",
    "M6 with no T before": "M6\nM2",
    "R with a cutter's diameter": "G41.1 D1 R3\nM2",
    "L with a cutter's number": "G41 L3\nM2",
    "G92.1 while the cutter is compensated": "G41.1 D1 G92.1\nM2",
    "a name that is not closed": "o<p1 call [4]\nM2",
    "a character 0": "G0 X1 \x00Y2\nM2",
    "another subroutine's end": "o1 sub\no2 endsub\no1 endsub\no1 call\nM2",
    "RETURN under another subroutine's name": "o1 sub\no1 endsub\no2 sub\no1 return\no2 endsub\no2 call\nM2",
    "a probing move in inverse time without F": "G94 F100\nG93\nG38.3 X1\nM2",
    "a plane of axes that there are not": "G17.1\nM2",
    "an active comment": "(py,1)\nM2",
}
# Refused by rs274 or run otherwise, and right here.
BETTER = {
    "a DO loop after a BREAK": (
        "o1 while [1]\no1 break\no1 endwhile\no2 do\n#1=[#1+1]\nG0 X#1\no2 while [#1 lt 3]\nM2",
        "STRAIGHT_TRAVERSE(3.0000",
    ),
    "a REPEAT left by RETURN": (
        "#31=1\no1 sub\no2 repeat [3]\n#32=[#32+1]\no3 if [#31 eq 1]\no1 return\no3 endif\no2 endrepeat\n"
        "o1 endsub\no1 call\n#31=0 #32=0\no1 call\nG0 X#32\nM2",
        "STRAIGHT_TRAVERSE(3.0000",
    ),
    "a BREAK passed over by a CONTINUE": (
        "o1 do\n#1=[#1+1]\nG0 X#1\no1 continue\no1 break\no1 while [#1 lt 2]\nM2",
        "STRAIGHT_TRAVERSE(2.0000",
    ),
    "a tool offset when units change": ("G43.1 Z25.4\nG0 Z0\nG20\nG49\nG0 X0\nM2", "TRAVERSE(0.0000, 0.0000, 1.0000"),
    "the position after M6": ("T1\nG43.1 Z5\nM6\nG0 X1\nM2", "STRAIGHT_TRAVERSE(1.0000, 0.0000, -5.0000"),
    "tool 0 in the spindle": ("T1 M6\nT0 M6\nG0 X#5400 Y1\nM2", "STRAIGHT_TRAVERSE(0.0000, 1.0000"),
}


@pytest.mark.parametrize("text", STRICTER.values(), ids=STRICTER)
def test_nothing_is_passed_over_that_rs274_passes_over(text: str) -> None:
    assert ours(text.encode())[1]


@needs_rs274
@pytest.mark.parametrize("text", STRICTER.values(), ids=STRICTER)
def test_where_this_interpreter_is_stricter_rs274_accepts(text: str) -> None:
    assert not rs274(text.encode())[1]


@pytest.mark.parametrize(("text", "call"), BETTER.values(), ids=BETTER)
def test_what_rs274_does_otherwise_is_done_as_it_is_written(text: str, call: str) -> None:
    lines, complaint = ours(text.encode())
    assert not complaint
    assert any(call in line for line in lines)


@needs_rs274
@pytest.mark.parametrize(("text", "call"), BETTER.values(), ids=BETTER)
def test_rs274_does_do_it_otherwise(text: str, call: str) -> None:
    printed, complaint = rs274(text.encode())
    assert complaint or not any(call in line for line in printed)
