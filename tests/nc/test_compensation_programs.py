"""Compensated part programs from text to canonical calls, against what LinuxCNC's rs274 printed (kept, and live)."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

from rds.nc import Dialect, ProgramError, interpret
from rds.nc.compensation.proof import Proof, proof
from rds.nc.compensation.proof_pieces import CONTOUR, ENTRY, EXIT
from rds.nc.language.canon_text import text

from .compensation_cases import Case, cases, needs_rs274, program, rs274

HERE = Path(__file__).parent / "compensation"
TOOLS = HERE / "tools.tbl"
PROGRAMS = sorted(HERE.glob("*.ngc"))
INCHES = Dialect(inch_machine=True)  # as rs274 by itself is


def unsigned(lines: list[str]) -> list[str]:
    """Without the signs of zeros, which are those of rounding errors."""
    return [line.replace("-0.0000", "0.0000") for line in lines]


def close(ours: str, theirs: str) -> bool:
    """The same call, but for the last of four decimals."""
    if ours == theirs:
        return True
    (name, _, values), (other, _, others) = ours.partition("("), theirs.partition("(")
    pairs = list(zip(values.rstrip(")").split(", "), others.rstrip(")").split(", "), strict=False))
    return name == other and all(a == b or abs(float(a) - float(b)) < 1.01e-4 for a, b in pairs)


@pytest.mark.parametrize("path", PROGRAMS, ids=[path.stem for path in PROGRAMS])
def test_programs_give_the_calls_that_linuxcnc_gave(path: Path) -> None:
    kept = path.with_suffix(".canon").read_text().splitlines()
    assert unsigned(list(text(interpret(path, tools=TOOLS, options=INCHES)))) == unsigned(kept)


@needs_rs274
@pytest.mark.parametrize("path", PROGRAMS, ids=[path.stem for path in PROGRAMS])
def test_what_is_kept_is_what_linuxcnc_gives(path: Path) -> None:
    printed, complaint = rs274(path.read_text(), TOOLS.read_text())
    assert not complaint
    assert printed == path.with_suffix(".canon").read_text()


STRICTER = ("only backward", "stopped at this inside corner", "too short for the cutter", "exit move")


@needs_rs274
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cases())
def test_random_programs_give_the_same_calls_or_are_refused(case: Case) -> None:
    source = program(case)
    printed, complaint = rs274(source)
    try:
        ours = unsigned(list(text(interpret(source))))
    except ProgramError as error:
        assert complaint or any(words in str(error) for words in STRICTER), error
        return
    assert not complaint, complaint
    theirs = unsigned(printed.splitlines())
    assert len(ours) == len(theirs)
    assert [pair for pair in zip(ours, theirs, strict=True) if not close(*pair)] == []


START = "G21 G17 G90 F100\nG0 X-20 Y0\n"
ON = START + "G41.1 D6\nG1 X0 Y0\n"
# program, then line, column and word of the fault, what is said of it, and whether LinuxCNC refuses the program too
REFUSALS = [
    (START + "G41.1\n", 3, 1, "G41.1", "D is missing", True),
    (START + "G41 D9\n", 3, 5, "D9", "9", True),
    (START + "G41 D1.5\n", 3, 5, "D1.5", "whole number", True),
    (START + "G41 D-1\n", 3, 5, "D-1", "negative", True),
    (START + "G41.1 D6 L2\n", 3, 10, "L2", "G18", True),
    (START + "G19 G41.1 D6\n", 3, 5, "G41.1", "G17 and G18", True),
    (ON + "G42.1 D6\n", 5, 1, "G42.1", "already", True),
    (ON + "G18\n", 5, 1, "G18", "plane", True),
    (ON + "G19\n", 5, 1, "G19", "plane", True),
    (ON + "G92 X0\n", 5, 1, "G92", "compensated", True),
    (ON + "G55\n", 5, 1, "G55", "compensated", True),
    (ON + "G28\n", 5, 1, "G28", "compensated", True),
    (ON + "G61\n", 5, 1, "G61", "compensated", True),
    (ON + "G53 G0 X9 Y9\n", 5, 1, "G53", "compensated", True),
    (ON + "T1 M6\n", 5, 4, "M6", "compensated", True),
    (START + "G41.1 D50\nG1 X0 Y0\n", 4, 4, "X0", "entry move is 20.0000 long", True),
    (START + "G41.1 D6\nG3 X-20 Y2 R1\n", 4, 4, "X-20", "entry arc", True),
    (START + "G41.1 D60\nN9 G3 X20 Y0 I20\n", 4, 7, "X20", "not less than the arc's radius 20", True),
    (ON + "G1 X30\nG3 X30 Y4 R2\n", 6, 4, "X30", "cutter's radius 3.0000 is not less", True),
    (ON + "G1 X10\nY4\nX0\n", 7, 1, "X0", "straight move of line 6 is too short", True),
    (ON + "G1 X10\nY4\nX0\nG40\n", 7, 1, "X0", "straight move of line 6 is too short", True),
    (ON + "X30\nY9\nX60\nY10\n G40\n", 9, 2, "G40", "straight move of line 8 is too short", True),
    (ON + "X30\nM0\nY30\n", 7, 1, "Y30", "stopped at this inside corner", False),
    (ON + "X30\nG40\nG2 X40 Y10 R10\n", 7, 1, "G2", "straight", True),
    (ON + "X30\nG40\nG1 X31\n", 7, 4, "X31", "exit move is 1.0000 long", False),
    (ON + "X30\nG40\nG0 Z10\n", 7, 4, "Z10", "exit move is 0.0000 long", False),
    (ON + "X30\nG40\nG28 X32\n", 7, 5, "X32", "exit move is 2.0000 long", False),
    (START + "G41.1 D6\nG1 Z-5\n", 4, 4, "Z-5", "entry move is 0.0000 long", True),
]


@pytest.mark.parametrize(
    ("source", "line", "column", "word", "says"),
    [row[:5] for row in REFUSALS],
    ids=[f"{row[3]}: {row[4]}" for row in REFUSALS],
)
def test_refusals_name_line_column_and_word_and_say_what_to_do(
    source: str, line: int, column: int, word: str, says: str
) -> None:
    with pytest.raises(ProgramError, match=says) as caught:
        for _ in interpret(source + "M2\n", tools=TOOLS, options=INCHES, name="part.ngc"):
            pass
    error = caught.value
    assert (error.file, error.line, error.column, error.word.upper()) == ("part.ngc", line, column, word)
    assert ";" in error.reason or "must be" in error.reason


@needs_rs274
@pytest.mark.parametrize("source, refused", [(row[0], row[5]) for row in REFUSALS])
def test_linuxcnc_refuses_the_same_but_for_what_it_gouges_with(source: str, refused: bool) -> None:
    _, complaint = rs274(source + "M2\n", TOOLS.read_text())
    assert bool(complaint) == refused, complaint


def test_the_move_after_g40_is_measured_in_the_units_and_offsets_of_now() -> None:
    list(interpret(ON + "X30\nG40\nG20\nG1 X2\nM2\n"))  # from 30 mm to 2 in
    list(interpret(ON + "X30\nG40\nG92 X100\nG1 X120\nM2\n"))
    with pytest.raises(ProgramError, match=r"exit move is 0\.1000 long"):
        list(interpret(ON + "X25.4\nG40\nG20\nG1 X1.1\nM2\n"))


@pytest.mark.parametrize("name", ["outside_square", "part", "inside_pocket", "plane_zx"])
def test_the_cutter_s_edge_follows_the_programmed_contour(name: str) -> None:
    """As `rds nc check --proof` measures it: zero but for rounding, on outside and inside contours, in both planes."""
    found = proof(HERE / f"{name}.ngc", tools=TOOLS, options=INCHES)
    assert len(found.stretches) == 1
    assert found.stretches[0].of(CONTOUR)
    assert found.stretches[0].of(ENTRY) and found.stretches[0].of(EXIT)
    assert found.max_deviation < 1e-6
    assert not [part for part in found.gouges() if part.role == CONTOUR]


def test_every_stretch_of_a_program_is_measured_apart() -> None:
    found = proof(HERE / "other_side.ngc", tools=TOOLS, options=INCHES)
    assert [stretch.radius for stretch in found.stretches] == pytest.approx([1.0, 2.5])
    assert found.max_deviation < 1e-6


def test_a_proof_across_a_change_of_units_is_refused() -> None:
    with pytest.raises(ProgramError, match="one length unit"):
        proof(HERE / "inches.ngc", tools=TOOLS, options=INCHES)


def test_the_documented_proof_runs_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = (HERE.parents[2] / "docs" / "cutter-compensation.md").read_text(encoding="utf-8")
    code = document.split("```python file=prove.py run\n")[1].split("```")[0]
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(code, "prove.py", "exec"), names)
    found = names["found"]
    assert isinstance(found, Proof)
    assert found.max_deviation < 1e-6
    assert found.gouges() == []
    assert (tmp_path / "proof.png").stat().st_size > 10_000


def test_a_short_exit_passes_where_it_is_allowed() -> None:
    short = ON + "X30\nG40\nG0 Z10\nM2\n"
    with pytest.raises(ProgramError, match="exit move"):
        list(interpret(short, tools=TOOLS, options=Dialect()))
    lines = list(text(interpret(short, tools=TOOLS, options=Dialect(any_exit=True))))
    assert any("STRAIGHT_TRAVERSE(30.0000, 0.0000, 10.0000" in line for line in lines), lines
