"""The ready set-ups: their scripts are run as the platforms run them, in a folder that stands for the container."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rds.grading.exports import one_submission
from rds.grading.exports.one_submission import CONTAINERS, grade_in, main
from rds.grading.intake.submissions import HandedIn, collect
from rds.grading.sandbox import available
from tests.grading.made import HEAD, RMS, SINE, SOLUTION, assignment_in
from tests.grading.test_exports import GRADESCOPE, PRAIRIELEARN, hold_against

SETUPS = Path(__file__).resolve().parents[2] / "examples" / "grading-setups"
LATE = HEAD + "due = 2026-11-20T23:59:00+01:00\n\n[late]\npercent_per_day = 10.0\n"
ABOUT = {
    "gradescope": {"created_at": "2026-11-21T12:00:00.123456-08:00", "users": [{"email": "ada@x.edu", "id": 5}]},
    "prairielearn": {"variant_seed": 12345},
}
SCHEMAS = {"gradescope": GRADESCOPE, "prairielearn": PRAIRIELEARN}
SCRIPTS = {"gradescope": "run_autograder", "prairielearn": "run.sh"}
needs_sandbox = pytest.mark.skipif(available() is not None, reason=str(available()))


def container_in(root: Path, platform: str, code: str = SOLUTION) -> Path:
    """What the platform puts into its container."""
    container = CONTAINERS[platform]
    assignment_in(root / container.assignment, LATE + SINE + RMS)
    for name in (container.submission, "results", Path(container.about).parent):
        (root / name).mkdir(parents=True, exist_ok=True)
    (root / container.submission / "my_controller.py").write_text(code)
    (root / container.about).write_text(json.dumps(ABOUT[platform]))
    return root


@needs_sandbox
@pytest.mark.parametrize(("platform", "score"), [("gradescope", 9.0), ("prairielearn", 1.0)])
def test_the_script_leaves_results(platform: str, score: float, tmp_path: Path) -> None:
    root = container_in(tmp_path, platform)
    environment = dict(os.environ, PYTHON=sys.executable, AUTOGRADER=str(root), GRADE=str(root))
    script = SETUPS / platform / SCRIPTS[platform]
    done = subprocess.run([str(script)], env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    data = json.loads((root / "results/results.json").read_text())
    hold_against(SCHEMAS[platform], data)
    assert data["score"] == pytest.approx(score)  # late on Gradescope, which says when; a share on PrairieLearn
    assert len(data["tests"]) == 1


@needs_sandbox
def test_a_folder_called_like_the_assignment_does_not_hide_the_file_beside_it(tmp_path: Path) -> None:
    root = container_in(tmp_path, "gradescope")
    beside = root / CONTAINERS["gradescope"].submission / Path(CONTAINERS["gradescope"].assignment).name
    beside.mkdir()
    (beside / "notes.txt").write_text("what I tried")
    assert json.loads(grade_in("gradescope", root).read_text())["score"] == pytest.approx(9.0)


@needs_sandbox
def test_folders_without_end_are_not_followed(tmp_path: Path) -> None:
    root = container_in(tmp_path, "gradescope")
    inner = root / CONTAINERS["gradescope"].submission
    for _ in range(600):
        inner /= "d"
        inner.mkdir()
    assert json.loads(grade_in("gradescope", root).read_text())["score"] == pytest.approx(9.0)


@needs_sandbox
@pytest.mark.parametrize("platform", SCRIPTS)
def test_what_was_handed_in_is_not_imported_by_the_grader(platform: str, tmp_path: Path) -> None:
    """Wherever the platform starts the script."""
    root = container_in(tmp_path, platform)
    handed_in = root / CONTAINERS[platform].submission
    (handed_in / "csv.py").write_text("raise SystemExit('the grader runs what was handed in')")
    environment = dict(os.environ, PYTHON=sys.executable, AUTOGRADER=str(root), GRADE=str(root))
    script = SETUPS / platform / SCRIPTS[platform]
    done = subprocess.run([str(script)], env=environment, cwd=handed_in, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "score" in json.loads((root / "results/results.json").read_text())


@needs_sandbox
def test_what_cannot_be_loaded_costs_no_attempt(tmp_path: Path) -> None:
    data = json.loads(grade_in("prairielearn", container_in(tmp_path, "prairielearn", "def (")).read_text())
    assert data["gradable"] is False and "failed to load" in data["format_errors"][0]


@needs_sandbox
@pytest.mark.parametrize("beside", [False, True])
def test_a_pipe_is_what_the_student_handed_in_and_no_failure_of_the_grader(beside: bool, tmp_path: Path) -> None:
    root = container_in(tmp_path, "gradescope")
    handed_in = root / CONTAINERS["gradescope"].submission / "my_controller.py"
    if beside:
        os.mkfifo(handed_in.with_name("notes.txt"))
    else:
        handed_in.unlink()
        os.mkfifo(handed_in)
    data = json.loads(grade_in("gradescope", root).read_text())
    assert data["score"] == pytest.approx(9.0 if beside else 0.0)
    assert beside or "it is a pipe (FIFO)" in data["output"]


@needs_sandbox
def test_a_file_that_would_fill_the_disk_is_not_copied(tmp_path: Path) -> None:
    root = container_in(tmp_path, "gradescope")
    data = root / CONTAINERS["gradescope"].submission / "data.bin"
    data.touch()
    os.truncate(data, 1 << 40)
    assert json.loads(grade_in("gradescope", root).read_text())["score"] == pytest.approx(9.0)


@pytest.mark.parametrize("folder", ["Abgaben/Lovelace_Ada_ada_1234", "Submissions/Team 3", "2026-01-05-10-12-33"])
@pytest.mark.parametrize(("platform", "student"), [("gradescope", "ada@x.edu"), ("prairielearn", "variant-12345")])
def test_nobody_is_another_student_by_the_names_of_folders(
    platform: str, student: str, folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[HandedIn] = []
    monkeypatch.setattr(one_submission, "run_batch", lambda task, given, *_, **__: found.extend(collect(given).rows))
    root = container_in(tmp_path, platform)
    handed_in = root / CONTAINERS[platform].submission
    (handed_in / folder).mkdir(parents=True)
    (handed_in / "my_controller.py").rename(handed_in / folder / "my_controller.py")
    grade_in(platform, root)
    assert [(row.student, row.name) for row in found] == [(student, "my_controller.py")]
    assert (found[0].time is not None) is (platform == "gradescope")


@pytest.mark.parametrize("platform", SCRIPTS)
def test_without_a_sandbox_nothing_is_run_and_nobody_gets_a_zero(
    platform: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rds.grading.batch.run.available", lambda: "bubblewrap is missing: apt install bubblewrap")
    root = container_in(tmp_path, platform)
    data = json.loads(grade_in(platform, root).read_text())
    hold_against(SCHEMAS[platform], data)
    assert "score" not in data
    assert "bubblewrap is missing" in data["output"] + str(data.get("format_errors"))


@pytest.mark.parametrize(
    ("damage", "left"), [("about", "{"), ("about", '{"users": {"7": "ada"}}'), ("assignment", ""), ("submission", "")]
)
def test_an_answer_is_there_whatever_is_missing(damage: str, left: str, tmp_path: Path) -> None:
    root = container_in(tmp_path, "gradescope")
    path = root / getattr(CONTAINERS["gradescope"], damage)
    shutil.rmtree(path) if path.is_dir() else path.write_text(left)
    (root / "results/results.json").write_text('{"score": 100}')  # as an earlier one might have left it
    data = json.loads(grade_in("gradescope", root).read_text())
    assert "score" not in data and "nothing was graded" in data["output"]


def test_calls_that_will_not_do(tmp_path: Path) -> None:
    assert main(["blackboard", str(tmp_path)]) == 2
    assert main([]) == 2


@pytest.mark.parametrize("script", ["gradescope/setup.sh", "gradescope/run_autograder", "prairielearn/run.sh"])
def test_scripts_are_scripts(script: str) -> None:
    path = SETUPS / script
    assert os.access(path, os.X_OK)
    shell = path.read_text().splitlines()[0].split()[-1].rpartition("/")[2]
    subprocess.run([shell, "-n", str(path)], check=True)


def test_the_question_is_json() -> None:
    options = json.loads((SETUPS / "prairielearn/info.json").read_text())["externalGradingOptions"]
    assert options["enabled"] is True and options["timeout"] <= 600
