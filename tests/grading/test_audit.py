"""An assignment that zeroes an honest design or pays a cheat is refused, with the criterion that does it."""

from __future__ import annotations

import shutil
from pathlib import Path

from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.audit import audit
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.batch.grade_one import grade
from tests.grading.made import HEAD, RMS, SINE, assignment_in

STEP = SINE.replace('"sine"', '"step"').replace(
    'kind = "sinusoid"\namplitude = 2.0\nfrequency = 1.0', 'kind = "constant"\nvalue = 0.5'
)
MARGIN = """
[[criterion]]
name = "margin"
kind = "phase-margin"
cases = [{cases}]
points = 10
full = 50
none = 20
unit = "°"
"""
GATE = 'requires = ["margin"]\n'


SMOOTH = """
[[criterion]]
name = "smooth"
kind = "noise-voltage"
case = "sine"
points = 5
full = 0.8
none = 1.5
unit = "V"
"""


def found_in(folder: Path, text: str) -> tuple[list[str], list[str]]:
    assignment = read_assignment(assignment_in(folder, text.replace("duration = 1.0", "duration = 0.5")))
    reference = grade(assignment, folder / "solution.py", "student 1", TrustedFiles())
    assert reference.score == reference.max_score, [score.sentence for score in reference.criteria]
    return audit(assignment, TrustedFiles(), reference)


def test_margins_in_one_case_only_pay_a_relay_in_the_other(tmp_path: Path) -> None:
    faults, _ = found_in(tmp_path, HEAD + SINE + STEP + RMS + GATE + MARGIN.format(cases='"step"'))
    assert len(faults) == 1 and faults[0].startswith("rms: switching where no margin is measured")
    faults, notes = found_in(tmp_path, HEAD + SINE + STEP + RMS + GATE + MARGIN.format(cases='"step", "sine"'))
    assert not faults and len(notes) == 1 and "with white noise of 20 % of the limit earns" in notes[0]


def test_a_law_that_shakes_the_motor_is_told_where_it_is_paid(tmp_path: Path) -> None:
    text = HEAD + SINE + RMS + GATE + MARGIN.format(cases='"sine"') + SMOOTH
    faults, notes = found_in(tmp_path / "loose", text)
    assert not faults and len(notes) == 1 and notes[0].endswith("noise-voltage, which such a law does not pass: rms")
    faults, notes = found_in(tmp_path / "gated", text.replace(GATE, 'requires = ["margin", "smooth"]\n'))
    assert not faults and not notes


def test_a_gate_that_no_textbook_law_passes_is_a_fault(tmp_path: Path) -> None:
    tight = SMOOTH.replace("0.8", "0.02").replace("1.5", "0.03")
    text = HEAD + SINE + RMS.replace("0.05", "0.3") + 'requires = ["smooth"]\n' + tight
    assignment = read_assignment(assignment_in(tmp_path, text))
    reference = grade(assignment, tmp_path / "solution.py", "student 1", TrustedFiles())
    assert any(
        "smooth: an honest design earns nothing" in said for said in audit(assignment, TrustedFiles(), reference)[0]
    )


def test_a_relay_is_paid_where_nothing_requires_the_margin(tmp_path: Path) -> None:
    faults, _ = found_in(tmp_path, HEAD + SINE + RMS + MARGIN.format(cases='"sine"'))
    assert len(faults) == 2 and faults[0].startswith("rms: switching from limit to limit earns")
    assert faults[1].startswith("a table of the voltages of the visible cases earns 10 of 20 points")
    faults, notes = found_in(tmp_path, HEAD + SINE + RMS)
    assert not faults and "no criterion measures a margin" in notes[0]


def test_bands_that_are_too_tight_zero_what_students_build(tmp_path: Path) -> None:
    assignment = read_assignment(
        assignment_in(tmp_path, (HEAD + SINE + RMS).replace("duration = 1.0", "duration = 0.5"))
    )
    value = grade(assignment, tmp_path / "solution.py", "student 1", TrustedFiles()).criteria[0].value
    assert value is not None
    tight = RMS.replace("full = 0.05", f"full = {value + 1e-9}").replace("none = 0.5", f"none = {value + 2e-9}")
    faults, _ = found_in(tmp_path, HEAD + SINE + tight + GATE + MARGIN.format(cases='"sine"'))
    assert any(
        "rms: an honest design earns nothing (the reference solution with a dead band" in said for said in faults
    )


def test_a_table_of_answers_is_told(tmp_path: Path) -> None:
    tests = (
        '[[criterion]]\nname = "gains"\nkind = "unit-tests"\npoints = 8\nfull = 100\nnone = 0\nunit = "%"\n'
        '[[criterion.test]]\nfunction = "double"\nargs = [2.0]\nexpected = 4.0\n'
    )
    text = HEAD + SINE + RMS + GATE + MARGIN.format(cases='"sine"')
    law = "def double(x):\n    return 2.0 * x\n"
    for more, count in (("", 1), (tests.replace('"gains"', '"hidden"') + "[criterion.nothing]", 0)):
        whole = (
            text + tests + more.replace("[criterion.nothing]", "").replace("points = 8", "points = 8\nvisible = false")
        )
        folder = assignment_in(tmp_path / str(count), whole)
        solution = folder / "solution.py"
        solution.write_text(solution.read_text() + law)
        assignment = read_assignment(folder)
        reference = grade(assignment, solution, "student 1", TrustedFiles())
        faults, notes = audit(assignment, TrustedFiles(), reference)
        assert not any("notebook" in said for said in faults), "a notebook keeps functions that are tested"
        assert len([said for said in notes if said.startswith("double():")]) == count


def test_a_circle_that_is_not_gone_round_is_not_paid(tmp_path: Path) -> None:
    """It ends where it begins, and its time is short: only the path says that nothing was gone round."""
    shipped = Path(__file__).parents[2] / "examples" / "assignments" / "interpolator"
    shutil.copytree(shipped, tmp_path / "task", ignore=shutil.ignore_patterns("submissions"))
    text = (tmp_path / "task" / "assignment.toml").read_text()
    (tmp_path / "task" / "assignment.toml").write_text(text.replace('"feed-hidden", "path-hidden"]', '"feed-hidden"]'))
    assignment = read_assignment(tmp_path / "task")
    reference = grade(assignment, tmp_path / "task" / "solution.py", "student 1", TrustedFiles())
    (said,) = audit(assignment, TrustedFiles(), reference)[0]
    assert said.startswith("Time of another arc: one row of a full circle, and back earns 10 of 10 points")


def test_a_table_of_the_visible_segments_is_not_paid(tmp_path: Path) -> None:
    """Hidden segments must carry two thirds of the points; those of the shipped assignment do."""
    shipped = Path(__file__).parents[2] / "examples" / "assignments" / "interpolator"
    text = (shipped / "assignment.toml").read_text()
    found = []
    for number, visible in enumerate((3, 30)):
        folder = tmp_path / str(number)
        shutil.copytree(shipped, folder, ignore=shutil.ignore_patterns("submissions"))
        path = 'name = "path-line"\ntitle = "The line is straight"\nkind = "path-error"\ncase = "line"\npoints = '
        assert f"{path}3\n" in text
        (folder / "assignment.toml").write_text(text.replace(f"{path}3\n", f"{path}{visible}\n"))
        assignment = read_assignment(folder)
        reference = grade(assignment, folder / "solution.py", "student 1", TrustedFiles())
        found.append(audit(assignment, TrustedFiles(), reference)[0])
    assert found[0] == []
    assert len(found[1]) == 1 and "a table of the rows of the visible segments earns" in found[1][0]
