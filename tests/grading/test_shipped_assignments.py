"""The assignments in examples/: all submissions earn what they earned before, and students' copies are sound.

After a change that is meant to change scores: run `rds grade run` on an assignment, look at what has changed, and write
the new scores into `shipped_scores/`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.hand_out import hand_out
from rds.grading.batch.grade_one import grade, grade_with_runs
from rds.grading.batch.outcome import BatchOutcome
from rds.grading.batch.run import run_batch
from rds.grading.grade import Band, Status
from rds.grading.sandbox import Pool, available

HERE = Path(__file__).parent
ASSIGNMENTS = HERE.parents[1] / "examples" / "assignments"
NAMES = ("interpolator", "observer", "tracking")
COPIES = {"interpolator": {"mia", "rosa"}, "observer": {"anna", "greta"}, "tracking": {"ada", "fay"}}
HOSTILE = {
    "interpolator": {"uwe", "vera"},
    "observer": {"ines", "jonas"},
    "tracking": {"igor", "jin"},
}

pytestmark = pytest.mark.skipif(available() is not None, reason=str(available()))


@pytest.fixture(scope="module", params=NAMES)
def graded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, BatchOutcome]:
    """The twelve submissions of one assignment, graded as an instructor does."""
    folder = ASSIGNMENTS / request.param
    out = tmp_path_factory.mktemp("graded") / request.param
    return request.param, run_batch(folder, folder / "submissions", out, jobs=2)


def test_every_submission_earns_what_it_did(graded: tuple[str, BatchOutcome]) -> None:
    name, outcome = graded
    expected: dict[str, Any] = json.loads((HERE / "shipped_scores" / f"{name}.json").read_text())
    found = {
        student: {
            "status": str(made.status),
            "score": made.score,
            "criteria": {criterion.name: criterion.score for criterion in made.criteria},
        }
        for student, made in outcome.grades.items()
    }
    assert found == expected
    assert len(found) == 12


def test_the_class_is_spread_from_all_points_to_none(graded: tuple[str, BatchOutcome]) -> None:
    name, outcome = graded
    scores = {student: made.score for student, made in outcome.grades.items()}
    assert max(scores.values()) == 100.0
    assert sum(score == 0.0 for score in scores.values()) >= 4
    assert sum(0.0 < score < 100.0 for score in scores.values()) >= 3
    assert all(scores[student] < 50.0 for student in HOSTILE[name])
    assert any(made.late_days > 0.0 and made.score < made.before_penalty for made in outcome.grades.values())


@pytest.mark.parametrize(
    "body", ["for _ in range(3): yield segment.end, o, o", "yield segment.start, o, o", "yield o, o, o"]
)
def test_rows_that_interpolate_nothing_earn_little(body: str, tmp_path: Path, pool: Pool) -> None:
    path = tmp_path / "my_interpolator.py"
    head = "params = {'acceleration': 1.0}\ndef interpolate(segment, T, params):\n    o = [0.0] * len(segment.start)\n"
    path.write_text(f"{head}    {body}\n")
    made = grade(read_assignment(ASSIGNMENTS / "interpolator"), path, "ada", pool)
    assert made.status is Status.OK and made.score <= 16.0  # for ends that are where they should be


CIRCLES = {
    "stays near its start": "yield [p + 1e-6 for p in segment.start], o, o; yield segment.end, o, o",
    "goes there and back": "rows = rows[:60]; yield from rows + rows[::-1]; yield segment.end, o, o",
    "goes round the wrong way": "yield from rows[-2::-1]; yield segment.end, o, o",
}


@pytest.mark.parametrize("name", CIRCLES)
def test_a_circle_that_is_not_gone_round_earns_nothing(name: str, tmp_path: Path, pool: Pool) -> None:
    path = tmp_path / "my_interpolator.py"
    solution = (ASSIGNMENTS / "interpolator" / "solution.py").read_text()
    honest = solution.replace("def interpolate(", "def honest(")
    head = "def interpolate(segment, T, params):\n    rows, o = list(honest(segment, T, params)), [0.0] * 2\n"
    head += "    if tuple(segment.start) != tuple(segment.end):\n        yield from rows\n        return\n"
    path.write_text(f"{honest}\n\n{head}    {CIRCLES[name]}\n")
    made = grade(read_assignment(ASSIGNMENTS / "interpolator"), path, "ada", pool)
    lost = {each.name for each in made.criteria if each.score < each.max_score}
    assert made.status is Status.OK and {"path-hidden", "duration-circle"} <= lost and made.score <= 73.0


@pytest.mark.parametrize("name, margin, earned", [("tracking", "phase-margin", 0.0), ("observer", "modulus", 30.0)])
def test_a_good_law_that_shakes_the_motor_earns_nothing(
    name: str, margin: str, earned: float, tmp_path: Path, pool: Pool
) -> None:
    """White noise of ±3 V beside a good law moves the axis little, and its margins not at all.

    What is earned for functions that are no loop is kept.
    """
    path = tmp_path / "my_controller.py"
    solution = (ASSIGNMENTS / name / "solution.py").read_text()
    shaking = "\nimport random\n_law = control\n\ndef control(t, r, y, state, params):\n"
    shaking += "    u, state = _law(t, r, y, state, params)\n    return u + random.Random(t).uniform(-3, 3), state\n"
    path.write_text(solution + shaking)
    made = grade(read_assignment(ASSIGNMENTS / name), path, "ada", pool)
    assert made.status is Status.OK and made.score == earned
    assert next(each.band for each in made.criteria if each.name == margin) is Band.NONE
    assert next(each.value for each in made.criteria if each.name == margin) >= 0.5


def test_an_acceleration_that_is_not_the_grader_s_costs_points(tmp_path: Path, pool: Pool) -> None:
    path = tmp_path / "my_interpolator.py"
    text = (ASSIGNMENTS / "interpolator" / "solution.py").read_text()
    path.write_text(text.replace('params["acceleration"]', "100.0"))
    made = grade(read_assignment(ASSIGNMENTS / "interpolator"), path, "ada", pool)
    assert {each.name for each in made.criteria if each.score < each.max_score} == {"acceleration-elsewhere"}
    assert made.score <= 95.0


def test_an_interpolator_without_params_is_graded(tmp_path: Path, pool: Pool) -> None:
    """Who moves at constant speed needs no acceleration; the grader's own is given all the same."""
    path = tmp_path / "my_interpolator.py"
    text = (ASSIGNMENTS / "interpolator" / "solution.py").read_text()
    path.write_text("\n".join(line for line in text.split("\n") if not line.startswith("params =")))
    assignment = read_assignment(ASSIGNMENTS / "interpolator")
    ends = [each for each in assignment.criteria if each.kind == "end-point-error"]
    made = grade_with_runs(assignment, path, "ada", pool, criteria=ends).grade
    assert made.status is Status.OK and made.score == made.max_score > 0.0


def test_only_the_copy_is_pointed_out_and_costs_nothing(graded: tuple[str, BatchOutcome]) -> None:
    name, outcome = graded
    pairs = json.loads((outcome.folder / "similarity.json").read_text())["pairs"]
    assert [{pair["first"], pair["second"]} for pair in pairs] == [COPIES[name]]
    assert {outcome.grades[student].score for student in COPIES[name]} == {100.0}


@pytest.mark.parametrize("name", NAMES)
def test_the_solution_earns_all_points_of_the_students_copy(name: str, tmp_path: Path, pool: Pool) -> None:
    assignment = read_assignment(ASSIGNMENTS / name)
    assert assignment.max_score == 100.0
    files = hand_out(assignment, tmp_path / "students")
    assert {path.name for path in files} >= {"assignment.toml", "handout.md", assignment.files[0]}
    assert not {"solution.py", "contour.ngc"} & {path.name for path in files}
    copy = read_assignment(tmp_path / "students")
    assert copy.max_score + copy.hidden.points == 100.0
    solved = grade(copy, ASSIGNMENTS / name / "solution.py", "self", pool)
    assert solved.status is Status.OK and solved.score == copy.max_score


@pytest.mark.parametrize("name", NAMES)
def test_the_handout_tells_all_visible_points(name: str) -> None:
    """Each visible criterion's points are in a row of the handout's table, and the hidden ones' sum in the last."""
    assignment = read_assignment(ASSIGNMENTS / name)
    handout = assignment.path(assignment.handout)
    assert handout is not None
    rows = [line.split("|")[1] for line in handout.read_text().split("## What counts")[1].split("\n") if "|" in line]
    told = [float(number) for row in rows[2:] for number in row.split("+")]
    shown = {case.name for case in assignment.cases if case.is_visible}
    visible = [each.max_score for each in assignment.criteria if each.is_visible and set(each.cases) <= shown]
    assert sum(told) == 100.0
    assert sum(visible) == sum(told) - (told[-1] if name != "observer" else told[-1] + 25.0)


def test_a_batch_is_not_begun_twice(graded: tuple[str, BatchOutcome]) -> None:
    name, outcome = graded
    with pytest.raises(InputError, match="resume"):
        run_batch(ASSIGNMENTS / name, ASSIGNMENTS / name / "submissions", outcome.folder)
