"""One submission graded: the same samples as every simulation, the same score every time, faults where they belong."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rds
from rds.grading.assignment.assignment import Assignment, read_assignment
from rds.grading.assignment.late_rules import LateRules
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.batch.grade_one import grade, grade_with_runs
from rds.grading.grade import Band, CriterionScore, Grade, Status
from rds.grading.review.applied import reviewed
from rds.grading.review.entries import Entry, Kind
from rds.grading.sandbox import Limits, Pool
from tests.grading.made import HEAD, RMS, SINE, SOLUTION, assignment_in

STATEFUL = """
params = {"Kp": 30.0, "Kd": 0.3, "Kv": 0.567, "filter": 0.004, "T": 0.001}
initial_state = [0.0, 0.0]

def control(t, r, y, state, params):
    last, slope = state
    error = r.position - y
    share = params["T"] / (params["filter"] + params["T"])
    slope = slope + share * ((error - last) / params["T"] - slope)
    return params["Kp"] * error + params["Kd"] * slope + params["Kv"] * r.velocity, [error, slope]
"""
STEP = """
[[case]]
name = "step"
axis = "X"
duration = 0.3
plant = "machine"
runs = 3
[case.reference]
kind = "constant"
value = 1.0
[case.vary]
tau = "±10 %"
K = "±5 %"
[[criterion]]
name = "settling"
kind = "settling-time"
case = "step"
points = 5
full = 0.15
none = 0.29
unit = "s"
"""
Make = Callable[..., Assignment]


@pytest.fixture
def made(tmp_path: Path) -> Make:
    def make(text: str, solution: str = SOLUTION) -> Assignment:
        return read_assignment(assignment_in(tmp_path / "assignment", text, solution))

    return make


def test_a_submission_with_signals_grades_as_without(made: Make, pool: Pool, tmp_path: Path) -> None:
    assignment = made(HEAD + SINE + RMS)
    told = 'signals = {"slope": "mm/s"}\n' + STATEFUL.replace("[error, slope]", '[error, slope], {"slope": slope}')
    plain, with_signals = (grade_with_runs(assignment, file(tmp_path, text), "ada", pool) for text in (STATEFUL, told))
    assert plain.grade.score == with_signals.grade.score
    for name, column in plain.runs[0].result.columns.items():
        assert np.array_equal(column, with_signals.runs[0].result[name]), name


def file(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "handed_in.py"
    path.write_text(text)
    return path


def test_the_samples_are_those_of_a_simulation_bit_for_bit(made: Make, pool: Pool, tmp_path: Path) -> None:
    path = file(tmp_path, STATEFUL)
    (run,) = grade_with_runs(made(HEAD + SINE + RMS), path, "ada", pool).runs
    reference = rds.sinusoid(amplitude=2.0, frequency=1.0)
    same = rds.Experiment(axis="X", duration=1.0, reference=reference, controller=str(path)).run()
    assert set(same) == set(run.result)
    for name in same:
        assert np.array_equal(same[name], run.result[name]), name
    assert run.result.metrics == same.metrics


def test_a_case_of_several_axes_keeps_their_states_apart(made: Make, pool: Pool, tmp_path: Path) -> None:
    text = HEAD + SINE.replace('axis = "X"', 'axes = ["X", "Y"]') + RMS
    path = file(tmp_path, STATEFUL)
    (run,) = grade_with_runs(made(text), path, "ada", pool).runs
    reference = rds.sinusoid(amplitude=2.0, frequency=1.0)
    same = rds.Experiment(axis=["X", "Y"], duration=1.0, reference=reference, controller=str(path)).run()
    for name in same:
        assert np.array_equal(same[name], run.result[name]), name


def test_the_same_file_has_the_same_grade_in_every_pool_and_without_one(made: Make, pool: Pool, tmp_path: Path) -> None:
    assignment = made(HEAD + SINE + STEP + RMS)
    path = file(tmp_path, STATEFUL)
    first = grade(assignment, path, "ada", pool)
    with Pool() as other:
        assert grade(assignment, path, "ada", other).to_json() == first.to_json()
    assert grade(assignment, path, "ada", TrustedFiles()).to_json() == first.to_json()
    assert Grade.from_json(json.loads(json.dumps(first.to_json()))) == first


def test_each_student_has_a_plant_of_their_own_and_the_worst_of_its_runs_counts(made: Make, tmp_path: Path) -> None:
    assignment, path, files = made(HEAD + STEP), file(tmp_path, STATEFUL), TrustedFiles()
    ada, bob = (grade_with_runs(assignment, path, student, files) for student in ("ada", "bob"))
    assert ada.grade.seed != bob.grade.seed
    responses = [run.result["X_measured"] for run in (*ada.runs, *bob.runs)]
    assert len({response.tobytes() for response in responses}) == 6
    times = [assignment.criteria[0].measure(run) for run in ada.runs]
    assert ada.grade.criteria[0].value == max(times)
    assert grade(assignment, path, "bob", files, seed=ada.grade.seed).criteria == ada.grade.criteria


def test_noise_and_disturbance_are_the_parent_s(made: Make, tmp_path: Path) -> None:
    more = "noise = 0.01\n[case.reference]"
    disturbance = '[case.disturbance]\nkind = "constant"\nvalue = 2.0\nstart = 0.5\n'
    kinds = (("noise-error", "mm"), ("noise-voltage", "V"), ("disturbance-error", "mm"))
    criteria = "".join(
        RMS.replace('"rms"', f'"{kind}"').replace("rms-error", kind).replace('"mm"', f'"{unit}"')
        for kind, unit in kinds
    )
    quiet = file(tmp_path, "def control(t, r, y, state, params):\n    return 0.0, state\n")
    assignment = made(HEAD + SINE.replace("[case.reference]", more) + disturbance + criteria)
    (run,) = grade_with_runs(assignment, quiet, "ada", TrustedFiles()).runs
    noise = run.result["X_measured"] - run.result["X_actual"]
    assert noise.std() == pytest.approx(0.01, rel=0.1)
    assert not run.result["X_actual"][:500].any()  # at rest until the disturbance begins
    assert run.result["X_actual"][520] > 0.0
    speed = np.diff(run.result["X_actual"][-100:]).mean() / 0.001
    assert speed == pytest.approx(1.764 * 2.0 - 0.539, rel=0.01)  # mm/s: K u - friction
    (again,) = grade_with_runs(assignment, quiet, "ada", TrustedFiles()).runs
    assert np.array_equal(again.result["X_measured"], run.result["X_measured"])


def test_a_fault_in_one_case_costs_that_case(made: Make, pool: Pool, tmp_path: Path) -> None:
    law = "    return (1 / 0 if r.position == 1.0 else 30 * (r.position - y)), state\n"
    text = "def control(t, r, y, state, params):\n" + law
    found = grade(made(HEAD + STEP + SINE + RMS), file(tmp_path, text), "ada", pool)
    assert found.status is Status.BROKE_CONTRACT
    assert found.reason.startswith("case step: ") and "ZeroDivisionError" in found.reason
    settling, rms = found.criteria
    assert (settling.band, settling.value, settling.score) == (Band.NONE, None, 0.0)
    assert rms.value is not None and rms.score == found.score > 0.0


@pytest.mark.parametrize(
    "text, status",
    [
        ("import os\nos._exit(0)\n", Status.KILLED),
        ("def kontrol(t, r, y, state, params):\n    return 0.0, state\n", Status.FAILED_TO_LOAD),
        ("", Status.FAILED_TO_LOAD),
        ("def control(t, r, y, state, params):\n    return float('nan'), state\n", Status.BROKE_CONTRACT),
        ("def control(t, r, y, state, params):\n    return '1', state\n", Status.BROKE_CONTRACT),
        ("import os\ndef control(t, r, y, state, params):\n    os._exit(0)\n", Status.KILLED),
    ],
)
def test_what_cannot_be_graded_has_no_points_and_a_reason(
    text: str, status: Status, made: Make, pool: Pool, tmp_path: Path
) -> None:
    found = grade(made(HEAD + SINE + STEP + RMS), file(tmp_path, text), "ada", pool)
    assert found.status is status and found.reason
    assert found.score == 0.0 and found.max_score == 15.0
    assert [each.band for each in found.criteria] == [Band.NONE, Band.NONE]
    assert all("could not be measured" in each.sentence for each in found.criteria)
    if status is Status.FAILED_TO_LOAD:  # why is said once, by the grade
        assert {each.sentence.partition(": ")[2] for each in found.criteria} == {"the file could not be loaded."}


def test_what_ended_it_is_said_where_it_happened(made: Make, pool: Pool, tmp_path: Path) -> None:
    law = "def control(t, r, y, state, params):\n    return os._exit(3) if r.position == 1.0 else 0.0, state\n"
    found = grade(made(HEAD + STEP + SINE + RMS), file(tmp_path, f"import os\n{law}"), "ada", pool)
    assert found.status is Status.KILLED and found.reason.startswith("case step: ")
    settling, rms = found.criteria
    assert "with exit code 3" in settling.sentence
    assert rms.sentence.endswith("could not be measured: the file had been ended before.")


def test_a_file_that_is_not_there_or_a_link(made: Make, pool: Pool, tmp_path: Path) -> None:
    assignment = made(HEAD + SINE + RMS)
    assert grade(assignment, tmp_path / "nothing.py", "ada", pool).status is Status.MISSING
    (tmp_path / "link.py").symlink_to(assignment.folder / "solution.py")
    found = grade(assignment, tmp_path / "link.py", "ada", pool)
    assert found.status is Status.REFUSED and found.sha256 == ""


def test_points_that_need_others(made: Make, tmp_path: Path) -> None:
    effort = RMS.replace('"rms"', '"effort"').replace("rms-error", "effort").replace('"mm"', '"V"')
    idle = file(tmp_path, "def control(t, r, y, state, params):\n    return 0.0, state\n")
    free = grade(made(HEAD + SINE + RMS + effort), idle, "ada", TrustedFiles())
    bound = grade(made(HEAD + SINE + RMS + effort + 'requires = ["rms"]\n'), idle, "ada", TrustedFiles())
    assert [each.score for each in free.criteria] == [0.0, 10.0]
    assert [each.score for each in bound.criteria] == [0.0, 0.0]
    assert bound.criteria[1].ungated == 10.0 and bound.criteria[1].gates == {"rms": 0.0}
    by_hand = Entry(Kind.POINTS, "ann", "ada", criterion="rms", value=5.0)
    assert reviewed(Grade.from_json(bound.to_json()), LateRules(), None, [by_hand]).score == 15.0
    assert (
        bound.criteria[1].value == 0.0 and "counts only where points are earned for rms" in bound.criteria[1].sentence
    )


MARGIN = """
[[criterion]]
name = "margin"
kind = "phase-margin"
cases = ["step", "sine"]
points = 10
full = 50
none = 20
unit = "°"
"""
TWO_CASES = HEAD + STEP + SINE + RMS + MARGIN.replace("[[", 'requires = ["margin"]\n[[')
GAIN = "def control(t, r, y, state, params):\n    return {gain} * (r.position - y) + 0.567 * r.velocity, state\n"


def test_a_gate_takes_by_degrees_and_only_in_its_own_case(made: Make, tmp_path: Path) -> None:
    """Half of a degree beyond the bound takes a part; a law that is wild in the step alone keeps its sine."""

    def rms(law: str) -> CriterionScore:
        found = grade(made(TWO_CASES), file(tmp_path, law), "ada", TrustedFiles())
        return next(score for score in found.criteria if score.name == "rms")

    assert rms(GAIN.format(gain=40.0)).gate == ""
    low = rms(GAIN.format(gain=260.0))  # 24 degrees
    assert low.gate == "margin" and 0.0 < low.score < 10.0 and "of that count" in low.sentence
    assert rms(GAIN.format(gain=900.0)).score == 0.0
    wild = GAIN.format(gain="(900.0 if r.velocity == 0.0 and r.position == 1.0 else 40.0)")
    assert rms(wild).score == 10.0


def test_what_cannot_be_measured_is_for_a_review_and_no_zero(made: Make, tmp_path: Path) -> None:
    coarse = "from math import floor\n" + GAIN.format(gain=40.0).replace("- y)", "- floor(y / 0.1) * 0.1)")
    found = grade(made(TWO_CASES), file(tmp_path, coarse), "ada", TrustedFiles())
    (review,) = found.for_review
    assert review.name == "margin" and review.value is None and "could not be measured" in review.sentence
    others = [score for score in found.criteria if score.name != "margin"]
    share = sum(each.score for each in others) / sum(each.max_score for each in others)
    assert review.score == pytest.approx(10.0 * share) and 0.1 < share <= 0.5
    gated = [score for score in others if score.gate == review.title]
    assert gated and all(0.0 < score.score <= 0.5 * score.max_score for score in gated)


@pytest.mark.parametrize(
    "beside", ["1e-9 * perf_counter_ns() % 1e-7", "1.2 * (round(y / 0.001) * 7919 % 101 / 50.0 - 1.0)"]
)
def test_who_makes_a_poor_margin_unmeasurable_gains_nothing(beside: str, made: Make, tmp_path: Path) -> None:
    """By a clock in its voltage, or by what no linear law comes near to."""
    poor = GAIN.format(gain=300.0)
    made_so = "from time import perf_counter_ns\n" + poor.replace(", state\n", f" + {beside}, state\n")
    assignment = made(TWO_CASES)
    plain = grade(assignment, file(tmp_path, poor), "ada", TrustedFiles())
    found = grade(assignment, file(tmp_path, made_so), "ada", TrustedFiles())
    assert [score.name for score in found.for_review] == ["margin"] and not plain.for_review
    assert found.score <= plain.score < 0.25 * plain.max_score, (found.score, plain.score)


def test_a_hard_link_is_refused(made: Make, tmp_path: Path) -> None:
    path = file(tmp_path, STATEFUL)
    (tmp_path / "other.py").hardlink_to(path)
    found = grade(made(HEAD + SINE + RMS), path, "ada", TrustedFiles())
    assert found.status is Status.REFUSED and "hard link" in found.reason


def test_weights_and_lateness(made: Make, tmp_path: Path) -> None:
    text = HEAD.replace("title", "due = 2026-11-30T23:59:00+01:00\ntitle") + SINE + RMS + "weight = 2.5\n"
    assignment = made(text + "[late]\npercent_per_day = 10\n")
    assert assignment.due is not None
    path = file(tmp_path, STATEFUL)
    found = grade(assignment, path, "ada", TrustedFiles(), submitted=assignment.due + timedelta(hours=30))
    assert found.before_penalty == found.max_score == 25.0
    assert found.score == 20.0 and found.late_days == 1.25
    assert any("20 % of the points" in note for note in found.notes)


def test_what_it_prints_is_a_note(made: Make, pool: Pool, tmp_path: Path) -> None:
    found = grade(made(HEAD + SINE + RMS), file(tmp_path, "print('here I am')\n" + SOLUTION), "ada", pool)
    assert found.status is Status.OK and "here I am" in found.notes[-1]


def test_what_it_prints_before_it_fails_to_load_is_a_note(made: Make, pool: Pool, tmp_path: Path) -> None:
    found = grade(made(HEAD + SINE + RMS), file(tmp_path, "print('as far as here')\nimport nowhere\n"), "ada", pool)
    assert found.status is Status.FAILED_TO_LOAD
    assert found.notes == ("It printed:\nas far as here\n",)


@pytest.mark.filterwarnings("ignore:overflow")  # of the model, which is meant to
def test_an_axis_that_runs_away_is_told(made: Make, tmp_path: Path) -> None:
    """The parent's own model diverges: no fault of the interface, and no value."""
    model = "def advance(x, u, T, params):\n    return [1e200 * (x[0] + 1e-9 * u), 0.0]\n"
    assignment = made(HEAD + SINE + RMS)
    (assignment.folder / "wild.py").write_text(model)
    text = HEAD + SINE + '[case.model]\nfile = "wild.py"\n' + RMS
    found = grade(made(text), file(tmp_path, STATEFUL), "ada", TrustedFiles())
    assert found.status is Status.OK and found.score == 0.0
    assert "the loop is not stable" in found.criteria[0].sentence


def test_hidden_state_does_not_pass_from_case_to_case(made: Make, pool: Pool, tmp_path: Path) -> None:
    text = (
        "calls = []\ndef control(t, r, y, state, params):\n    calls.append(t)\n    return 0.001 * len(calls), state\n"
    )
    second = SINE.replace('"sine"', '"again"') + RMS.replace('"rms"', '"b"').replace('"sine"', '"again"')
    first, again = grade_with_runs(made(HEAD + SINE + RMS + second), file(tmp_path, text), "ada", pool).runs
    assert np.array_equal(first.result["X_command"], again.result["X_command"])


def test_work_is_the_same_whenever_it_is_counted(made: Make, pool: Pool, tmp_path: Path) -> None:
    text = RMS.replace('"rms"', '"work"').replace("rms-error", "work").replace('"mm"', '"events"')
    assignment = made(HEAD + SINE + text.replace("full = 0.05", "full = 30").replace("none = 0.5", "none = 60"))
    values = {grade(assignment, file(tmp_path, STATEFUL), "ada", pool).criteria[0].value for _ in range(2)}
    assert len(values) == 1 and 5.0 < float(values.pop() or 0.0) < 30.0


def test_another_secret_draws_other_plants(made: Make) -> None:
    assignment = made(HEAD + SINE + RMS)
    assert replace(assignment, secret="another secret").seed("ada") != assignment.seed("ada")


def test_what_it_says_of_a_hidden_case_is_for_the_instructor(made: Make, pool: Pool, tmp_path: Path) -> None:
    law = "    print('saw', r.position)\n    return 1 / (r.position - 7.125), state\n"
    spy = file(tmp_path, "def control(t, r, y, state, params):\n" + law)
    text = HEAD + STEP.replace("runs = 3", "visible = false").replace("value = 1.0", "value = 7.125") + SINE + RMS
    found = grade(made(text), spy, "ada", pool)
    shown = json.dumps(found.to_json() | {"details": {}})
    assert "saw 7.125" not in shown and "ZeroDivisionError" not in shown and "saw 0.0" in shown
    assert found.status is Status.BROKE_CONTRACT and found.reason == "in a case that is hidden: broke the contract"
    assert "saw 7.125" in found.details["hidden_output"]
    assert "ZeroDivisionError" in found.details["hidden_reason"]
    whole = grade(made('feedback = "all"\n' + text), spy, "ada", pool)
    assert "ZeroDivisionError" in whole.reason and "saw 7.125" in whole.notes[-1]


def test_what_it_prints_while_it_is_loaded_is_told_once(made: Make, pool: Pool, tmp_path: Path) -> None:
    told = SOLUTION.replace("    return", "    if t == 0.0: print('begun')\n    return")
    text = HEAD + SINE + RMS + STEP
    found = grade(made(text), file(tmp_path, "print('as it is loaded')\ninitial_state = 0\n" + told), "ada", pool)
    assert found.notes == ("It printed:\nas it is loaded\nbegun\nbegun\nbegun\nbegun\n",)


def test_what_it_says_while_a_hidden_case_is_counted_is_withheld(made: Make, pool: Pool, tmp_path: Path) -> None:
    work = RMS.replace('"rms"', '"work"').replace("rms-error", "work").replace('"mm"', '"events"')
    counted = "resource.getrlimit(resource.RLIMIT_NPROC)[0] == 1"
    tells = SOLUTION.replace("    return", f"    if {counted}: raise ValueError(r)\n    return") + "import resource\n"
    found = grade(
        made(HEAD + SINE.replace("[[case]]", "[[case]]\nvisible = false") + work), file(tmp_path, tells), "ada", pool
    )
    assert found.criteria[0].score == 0.0
    assert "hidden" in found.criteria[0].sentence and "Reference" not in found.criteria[0].sentence
    assert "Reference" in found.details["cases"]["sine"]["counts"][0]["refused"]


class _Killed:
    """A pool whose first submissions are ended by SIGKILL when they are loaded, as somebody outside might do it."""

    def __init__(self, pool: Pool, times: int):
        self._pool, self.left = pool, times
        self.counts_work = pool.counts_work

    @contextmanager
    def open(self, path: str | Path, limits: Limits | None, kind: str) -> Iterator[Any]:
        with self._pool.open(path, limits, kind) as subject:
            if self.left:
                self.left -= 1
                init = subject._cell._process  # type: ignore[union-attr]
                own = Path(f"/proc/{init}/task/{init}/children").read_text().split()
                os.kill(int(own[0]), signal.SIGKILL)
            yield subject


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are found in /proc on Linux alone")
def test_a_single_kill_of_a_submission_s_own_process_costs_nobody_points(tmp_path: Path, pool: Pool) -> None:
    """It could have killed itself, but then does so again: once is no zero, twice is its own doing."""
    folder = assignment_in(tmp_path, HEAD + SINE + RMS)
    assignment, path = read_assignment(folder), folder / "solution.py"
    once = _Killed(pool, 1)
    assert grade(assignment, path, "ada", once) == grade(assignment, path, "ada", pool)
    assert once.left == 0
    twice = grade(assignment, path, "ada", _Killed(pool, 2))
    assert (twice.status, twice.score) == (Status.KILLED, 0.0) and "SIGKILL" in twice.reason
