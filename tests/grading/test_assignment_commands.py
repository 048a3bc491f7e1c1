"""`rds grade self`, `check` and `hand-out`: what they say, what they keep to themselves, and their exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result as Ran
from typer.testing import CliRunner

from rds.cli.main import app
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.check_assignment import IDLE, WORK_SEEDS, check_assignment
from rds.grading.assignment.self_check import self_check
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.cases.case import CaseRun
from rds.grading.cases.control import ControlCase
from rds.grading.sandbox import Pool
from rds.grading.sandbox.loaded_submission import LoadedSubmission
from rds.grading.sandbox.work_counts import WorkCounts
from tests.grading.made import HEAD, RMS, SINE, SOLUTION, assignment_in

BLIND = HEAD.replace("title", 'self_check = "blind"\ntitle')
HIDDEN = (
    (SINE.replace('"sine"', '"secret case"').replace("amplitude = 2.0", "amplitude = 3.25") + "\n").replace(
        "duration = 1.0", "duration = 1.0\nvisible = false"
    )
    + RMS.replace('"rms"', '"hidden"').replace('"sine"', '"secret case"').replace("points = 10", "points = 7")
    + "visible = false\n"
)
SPY = """
def control(t, r, y, state, params):
    if r.position > 3.0:
        raise ValueError(f"the reference is {r.position}")
    print(r.position)
    return 30.0 * (r.position - y) + 0.567 * r.velocity, state
"""
WEAK = "def control(t, r, y, state, params):\n    return 6.0 * (r.position - y), state\n"


def rds(*arguments: object) -> Ran:
    return CliRunner().invoke(app, ["grade", *map(str, arguments)])


def test_visible_criteria_are_told_with_value_and_margin(tmp_path: Path, pool: Pool) -> None:
    folder = assignment_in(tmp_path, HEAD + SINE + RMS + HIDDEN)
    (tmp_path / "mine.py").write_text(WEAK)
    ran = rds("self", folder, tmp_path / "mine.py", "--json")
    told = json.loads(ran.stdout)
    (line,) = told["criteria"]
    assert ran.exit_code == 1 and told["ok"] is False
    assert told["left_out"] == {"criteria": 1, "points": 7.0}
    assert line["result"] == "fail" and line["value"] > 0.5
    assert line["margin"] == pytest.approx(100.0 * (0.5 - line["value"]) / 0.45)
    good = rds("self", folder, folder / "solution.py", "--json")
    assert good.exit_code == 0 and json.loads(good.stdout)["criteria"][0]["result"] == "pass"


def test_hidden_criteria_are_told_by_their_margin_only(tmp_path: Path) -> None:
    folder = assignment_in(tmp_path, BLIND + SINE + RMS + HIDDEN)
    found = self_check(read_assignment(folder), folder / "solution.py", "self", TrustedFiles())
    hidden = found.lines[1]
    assert not found.ok and hidden.word == "partly" and not hidden.is_visible
    assert (hidden.value, hidden.unit, hidden.bounds, hidden.sentence) == (None, "", "", "")
    assert hidden.margin is not None and hidden.margin % 5.0 == 0.0


def test_a_file_learns_nothing_of_a_hidden_case(tmp_path: Path, pool: Pool) -> None:
    folder = assignment_in(tmp_path, BLIND + SINE + RMS + HIDDEN)
    (tmp_path / "spy.py").write_text(SPY)
    for arguments in ((), ("--json",)):
        ran = rds("self", folder, tmp_path / "spy.py", *arguments)
        assert ran.exit_code == 1
        for word in ("secret case", "3.0", "3.25", "the reference is", "ValueError"):
            assert word not in ran.output
        assert "in a case that is hidden" in ran.output


def test_off_is_off_and_a_file_must_be_there(tmp_path: Path) -> None:
    folder = assignment_in(tmp_path, HEAD.replace("title", 'self_check = "off"\ntitle') + SINE + RMS)
    ran = rds("self", folder, folder / "solution.py", "--trust-my-file")
    assert ran.exit_code == 2 and "no self-check" in ran.output
    folder = assignment_in(tmp_path, HEAD + SINE + RMS)
    ran = rds("self", folder, tmp_path / "nothing.py", "--trust-my-file")
    assert ran.exit_code == 2 and "no such file" in ran.output
    ran = rds("self", folder, tmp_path, "--trust-my-file")
    assert ran.exit_code == 2 and "it is a folder, or no regular file" in ran.output
    ran = rds("self", folder / "solution.py", folder, "--trust-my-file")
    assert ran.exit_code == 2 and "it is no assignment; name the folder with assignment.toml first" in ran.output


def test_going_without_the_sandbox_is_said_loudly(tmp_path: Path) -> None:
    folder = assignment_in(tmp_path, HEAD + SINE + RMS)
    ran = rds("self", folder, folder / "solution.py", "--trust-my-file")
    assert ran.exit_code == 0
    assert "WARNING: --trust-my-file: your file runs WITHOUT the sandbox" in ran.stderr


def test_a_fault_that_every_criterion_has_is_told_once(tmp_path: Path) -> None:
    folder = assignment_in(tmp_path, HEAD + SINE + RMS + RMS.replace('"rms"', '"again"'))
    (tmp_path / "broken.py").write_text("def control(t, r, y, state, params):\n    return foo, state\n")
    ran = rds("self", folder, tmp_path / "broken.py", "--trust-my-file")
    assert ran.exit_code == 1 and ran.stdout.count("name 'foo' is not defined") == 1


def test_where_the_sandbox_is_missing_nothing_runs_in_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.grading.sandbox.requirements.available", lambda: "bubblewrap is missing; apt install it")
    folder = assignment_in(tmp_path, HEAD + SINE + RMS)
    ran = rds("self", folder, folder / "solution.py")
    assert ran.exit_code == 2 and "apt install it" in ran.output and "--trust-my-file" in ran.output


def test_a_sound_assignment_passes_its_check(tmp_path: Path, pool: Pool) -> None:
    ran = rds("check", assignment_in(tmp_path, HEAD + SINE + RMS), "--seeds", "2", "--json")
    told = json.loads(ran.stdout)
    assert ran.exit_code == 0 and told["ok"] is True and told["faults"] == []
    (row,) = told["criteria"]
    assert row["least"] == row["largest"] and row["margin"] > 100.0 and row["idle"] == 0.0
    shown = rds("check", tmp_path, "--seeds", "1").output
    assert "the assignment can be given out" in shown
    assert "rds: trying PI control with anti-windup" in shown  # it takes a minute, and says what it is at


@pytest.mark.parametrize(
    "text, solution, said",
    [
        (HEAD + SINE + RMS, WEAK, "does not earn full points for 2 of 2 students, such as student 1"),
        (HEAD + SINE + RMS, "import os\n", "the reference solution fails for student 1: failed to load"),
        (HEAD + SINE + RMS.replace("rms-error", "effort").replace('"mm"', '"V"'), WEAK, "does nothing earns 10 of 10"),
        (HEAD + SINE + RMS.replace("points = 10", "points = 0"), SOLUTION, "no points to earn"),
    ],
)
def test_an_unfit_assignment_does_not(text: str, solution: str, said: str, tmp_path: Path) -> None:
    found = check_assignment(read_assignment(assignment_in(tmp_path, text, solution)), TrustedFiles(), 2)
    assert not found.ok
    assert any(said in fault for fault in found.faults), found.faults


def test_what_is_the_same_for_everybody_is_run_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = SINE.replace('"sine"', '"drawn"') + '[case.vary]\ntau = "±10 %"\n'
    text = HEAD + SINE + drawn + RMS + RMS.replace('"rms"', '"varied"').replace('"sine"', '"drawn"')
    assignment = read_assignment(assignment_in(tmp_path, text))
    ran, run = [], ControlCase.run

    def counted(case: ControlCase, *arguments: Any) -> CaseRun:
        ran.append(case.name)
        return run(case, *arguments)

    monkeypatch.setattr(ControlCase, "run", counted)
    monkeypatch.setattr("rds.grading.assignment.check_assignment.audit", lambda *_: ([], []))  # runs of its own
    same, varied = check_assignment(assignment, TrustedFiles(), 5).criteria
    assert same.least == same.largest and varied.least is not None and varied.largest is not None
    assert varied.least < varied.largest
    # for the first student, once more, and for what does nothing; the drawn one for the four others too
    assert (ran.count("sine"), ran.count("drawn")) == (3, 7)


def test_work_is_counted_for_the_first_students_only(
    tmp_path: Path, pool: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = SINE.replace("1.0\n\n", "0.1\n\n") + '[case.vary]\ntau = "±10 %"\n'
    work = RMS.replace("rms-error", "work").replace("0.05", "50").replace("0.5", "500").replace("mm", "events")
    counts, count = [], LoadedSubmission.count

    def counted(subject: LoadedSubmission) -> WorkCounts:
        counts.append(count(subject))
        return counts[-1]

    monkeypatch.setattr(LoadedSubmission, "count", counted)
    assignment = read_assignment(assignment_in(tmp_path, HEAD + case + work))
    (row,) = check_assignment(assignment, pool, WORK_SEEDS + 3).criteria
    assert row.margin is not None and row.margin > 100.0
    assert len(counts) == WORK_SEEDS + 2  # for the first student once more, and for what does nothing


def test_an_assignment_without_a_solution_cannot_be_checked(tmp_path: Path, pool: Pool) -> None:
    text = (HEAD + SINE + RMS).replace('solution = "solution.py"', "")
    ran = rds("check", assignment_in(tmp_path, text))
    assert ran.exit_code == 2 and "solution is missing" in ran.output


@pytest.mark.parametrize("kind", IDLE)
def test_what_does_nothing_keeps_its_interface(kind: str, tmp_path: Path) -> None:
    from rds.core.load import load_student

    if kind != "functions":
        path = tmp_path / "idle.py"
        path.write_text(IDLE[kind])
        assert load_student(path).interfaces == (kind,)


def test_the_hand_out_is_an_assignment_that_students_can_try(tmp_path: Path) -> None:
    text = HEAD.replace("title", 'handout = "text.md"\ntitle') + SINE + RMS + HIDDEN
    folder = assignment_in(tmp_path / "a", text)
    (folder / "text.md").write_text("What to do.\n")
    ran = rds("hand-out", folder, "-o", tmp_path / "out", "--json")
    assert ran.exit_code == 0
    assert [Path(name).name for name in json.loads(ran.stdout)["files"]] == ["assignment.toml", "text.md"]
    tried = rds("self", tmp_path / "out", folder / "solution.py", "--trust-my-file", "--json")
    assert tried.exit_code == 0
    assert json.loads(tried.stdout)["left_out"] == {"criteria": 1, "points": 7.0}


def test_bad_words_are_refused_with_exit_code_2(tmp_path: Path) -> None:
    folder = assignment_in(tmp_path, HEAD + SINE + RMS.replace("rms-error", "rms"))
    own = folder / "solution.py"
    for command in (("check", folder), ("self", folder, own, "--trust-my-file"), ("hand-out", folder, "-o", "x")):
        ran = rds(*command)
        assert ran.exit_code == 2 and "line" in ran.output and "rms-error" in ran.output
