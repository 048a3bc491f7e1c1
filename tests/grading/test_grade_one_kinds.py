"""Models, interpolators, functions and part programs, graded."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import rds
from rds.grading.assignment.assignment import Assignment, read_assignment
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.assignment.unit_tests import difference
from rds.grading.batch.grade_one import grade, grade_with_runs
from rds.grading.grade import Grade, Status
from rds.grading.sandbox import Pool
from tests.grading.made import HEAD, RMS, SINE, assignment_in

FRICTIONLESS = """
params = {"tau": 9.943e-3, "K": 1.764}
initial_state = [0.0, 0.0]

def derivatives(t, x, u, params):
    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]
"""
SIGNAL = """
[[case]]
name = "square"
axis = "X"
duration = 2.0
[case.signal]
kind = "square"
amplitude = 2.0
frequency = 1.0
[case.model]
name = "linear-axis"
friction_plus = 0.0
friction_minus = 0.0
"""
FIT = """
[[criterion]]
name = "fit"
kind = "model-fit"
points = 10
full = 99.9
none = 0
unit = "%"
"""
PART = "G21 G90 G61 G54\nF300\nG1 X5 Y0\nG3 X5 Y0 I-5 J0\nG1 X0 Y0\nM2\n"


def both(assignment: Assignment, path: Path, pool: Pool) -> Grade:
    """The grade in the sandbox, which must be that without it."""
    found = grade(assignment, path, "ada", pool)
    assert grade(assignment, path, "ada", TrustedFiles()).to_json() == found.to_json()
    return found


def test_a_model_s_free_run_on_data_that_it_has_not_seen(tmp_path: Path, pool: Pool) -> None:
    head = HEAD.replace('"controller"', '"model"')
    folder = assignment_in(tmp_path, head + SIGNAL + FIT, FRICTIONLESS)
    exact = both(read_assignment(folder), folder / "solution.py", pool)
    assert exact.score == 10.0 and exact.criteria[0].value == pytest.approx(100.0, abs=0.1)  # the encoder's counts
    (folder / "half.py").write_text(FRICTIONLESS.replace("1.764", "0.882"))
    half = both(read_assignment(folder), folder / "half.py", pool)
    assert half.criteria[0].value is not None and half.criteria[0].value < 60.0


def test_a_model_on_a_log_file(tmp_path: Path, pool: Pool) -> None:
    axis = {"model": {"name": "linear-axis", "friction_plus": 0.0, "friction_minus": 0.0}}
    signal = {"kind": "square", "amplitude": 2.0, "frequency": 1.0}
    rds.Experiment(axis="X", duration=1.0, signal=signal, **axis).run().save(tmp_path / "log.csv")
    (tmp_path / "log.json").unlink(missing_ok=True)
    text = HEAD.replace('"controller"', '"model"') + '[[case]]\nname = "log"\nlog = "log.csv"\n' + FIT
    folder = assignment_in(tmp_path, text, FRICTIONLESS)
    found = both(read_assignment(folder), folder / "solution.py", pool)
    assert found.score == 10.0


def test_an_interpolator_is_measured_row_by_row(tmp_path: Path, pool: Pool) -> None:
    text = HEAD.replace('"controller"', '"interpolator"') + (
        '[[case]]\nname = "line"\nsample_period = 0.01\n'
        '[case.segment]\nkind = "line"\nstart = [0.0, 0.0]\nend = [3.0, 4.0]\nfeed_rate = 10.0\n'
        '[[criterion]]\nname = "end"\nkind = "end-point-error"\npoints = 1\nfull = 1e-9\nnone = 1.0\nunit = "mm"\n'
        '[[criterion]]\nname = "work"\nkind = "work"\npoints = 1\nfull = 100\nnone = 1000\nunit = "events"\n'
    )
    method = (
        "def interpolate(segment, T, params):\n    for k in range(1, 51):\n        yield (\n"
        "            [0.06 * k, 0.08 * k], [6.0, 8.0], [0.0, 0.0]\n        )\n"
    )
    folder = assignment_in(tmp_path, text, method)
    found = grade(read_assignment(folder), folder / "solution.py", "ada", pool)
    assert found.score == 2.0 and found.status is Status.OK
    assert found.criteria[1].value is not None and found.criteria[1].value < 30.0
    (folder / "endless.py").write_text(method.replace("range(1, 51)", "iter(int, 1)"))
    endless = grade(read_assignment(folder), folder / "endless.py", "ada", pool)
    assert endless.status is Status.BROKE_CONTRACT and "no end" in endless.reason and endless.score == 0.0


def test_functions_are_called_and_judged_here(tmp_path: Path, pool: Pool) -> None:
    test = '[[criterion.test]]\nfunction = "{}"\nargs = {}\nexpected = {}\ntolerance = {}\n'
    text = HEAD.replace('"controller"', '"functions"') + (
        '[[criterion]]\nname = "tests"\nkind = "unit-tests"\npoints = 8\nfull = 100\nnone = 0\nunit = "%"\n'
        + test.format("double", "[2.0]", "4.0", "1e-9")
        + test.format("double", "[[1.0, 2.0]]", "[2.0, 4.0]", "1e-9")
        + test.format("word", "[]", '"yes"', "0.0")
        + test.format("truth", "[]", "true", "0.0")
    )
    equal = "class E:\n    def __eq__(self, other):\n        return True\n"
    right = "import numpy as np\ndef double(x): return 2 * np.array(x)\ndef word(): return 'yes'\n"
    right += "def truth(): return True\n"
    folder = assignment_in(tmp_path, text, right)
    assert both(read_assignment(folder), folder / "solution.py", pool).score == 8.0
    (folder / "some.py").write_text("def double(x): return 2 * x\ndef word(): return 1 / 0\n")
    some = both(read_assignment(folder), folder / "some.py", pool)
    assert some.score == 2.0  # a list twice is no doubled list
    said = (
        "Not passed: double([1.0, 2.0]), word(), truth(). The first of them: it returned a list of 4, where a list of 2"
    )
    assert some.criteria[0].sentence.endswith(f" {said} is expected.")
    (folder / "fails.py").write_text("def double(x):\n    return x / 0\ndef word(): return 'no'\n")
    fails = both(read_assignment(folder), folder / "fails.py", pool).criteria[0].sentence
    assert "double() failed: " in fails and "line 2, in double: ZeroDivisionError" in fails
    (folder / "cheat.py").write_text(equal + "def double(x): return E()\nword = truth = lambda: E()\n")
    assert both(read_assignment(folder), folder / "cheat.py", pool).score == 0.0
    (folder / "none.py").write_text("def other(x): return x\ndef words(): return 'yes'\n")
    none = both(read_assignment(folder), folder / "none.py", pool)
    assert none.status is Status.FAILED_TO_LOAD and "double(), truth(), word()" in none.reason
    assert none.reason.endswith("; it has words(); did you mean word()?")


@pytest.mark.parametrize(
    ("answer", "expected", "said"),
    [
        ({"L": 1.0}, [1.0], "it returned a dict with the keys ['L'], where a list of 1 is expected"),
        ([1.0, [2.0]], [1.0, 2.0], "its value 1 is a list of 1, where a number is expected"),
        ([1.0, 2.5], [1.0, 2.0], "its value 1 is 2.5, off by more than 0.1"),
        (None, 1.0, "it returned None, where a number is expected"),
        (True, 1.0, "it returned a truth value, where a number is expected"),
        (10**299, 1.0, "off by more than 0.1"),
        ("no", "yes", "it returned 'no', and that is not right"),
        (False, True, "it returned False, and that is not right"),
        ({"a" * 99 + "b": 1.0}, {"a" * 99 + "c": 1.0}, "is expected"),
        ({"a": [1, 2.05]}, {"a": [1.0, 2]}, ""),
        (None, None, ""),
    ],
)
def test_what_is_wrong_with_an_answer_is_said(answer: object, expected: object, said: str) -> None:
    found = difference(answer, expected, 0.1)
    assert said in found and bool(found) is bool(said)


def test_a_part_program_on_coupled_axes_is_judged_by_its_contour(tmp_path: Path, pool: Pool) -> None:
    law = (
        "import numpy as np\ndef control(t, r, y, state, params):\n"
        "    return 30.0 * (r.position - y) + 0.55 * np.asarray(r.velocity), state\n"
    )
    text = HEAD + '[[case]]\nname = "sine"\nprogram = "part.ngc"\ncoupled = true\n'
    text += RMS.replace("rms-error", "contour-error") + RMS.replace('"rms"', '"max"').replace("rms-error", "max-error")
    tmp_path.joinpath("part.ngc").write_text(PART)
    folder = assignment_in(tmp_path, text, law)
    found = grade_with_runs(read_assignment(folder), folder / "solution.py", "ada", pool)
    (run,) = found.runs
    assert found.grade.score == 20.0
    assert run.result.meta["program"]["completed"] is True
    assert found.grade.criteria[0].value == pytest.approx(run.result["contour_error"].max(), rel=1e-8)
    assert 0.0 < run.result["contour_error"].max() < np.abs(run.result["X_reference"] - run.result["X_measured"]).max()
    assert sorted(path.name for path in folder.iterdir()) == ["assignment.toml", "part.ngc", "solution.py"]


def test_a_program_that_a_following_error_ended_earns_nothing_for_what_it_did_not_do(
    tmp_path: Path, pool: Pool
) -> None:
    law = "def control(t, r, y, state, params):\n    return (30.0 if t < 0.05 else -30.0) * (r.position - y), state\n"
    text = HEAD + '[[case]]\nname = "sine"\nprogram = "part.ngc"\n[case.following_error]\nferror = 0.5\n'
    text += RMS.replace('"rms"', '"max"').replace("rms-error", "max-error")
    tmp_path.joinpath("part.ngc").write_text(PART)
    folder = assignment_in(tmp_path, text, law)
    found = grade_with_runs(read_assignment(folder), folder / "solution.py", "ada", pool)
    assert found.grade.score == 0.0
    assert "[following_error]" in str(found.grade)


def test_numbers_beyond_measure_are_the_submission_s_fault_and_not_the_grader_s(tmp_path: Path, pool: Pool) -> None:
    line = '[case.segment]\nkind = "line"\nstart = [0.0]\nend = [1.0]\nfeed_rate = 10.0\n'
    errors = RMS.replace("rms-error", "path-error")
    for kind, text, law in (
        ("model", SIGNAL + FIT, "def advance(x, u, T, params):\n    return [1.7e308 if u < 0 else -1.7e308, 0.0]\n"),
        (
            "interpolator",
            '[[case]]\nname = "sine"\n' + line + errors,
            "def interpolate(segment, T, params):\n    for k in range(4):\n        yield [1.7e308], [0.0], [0.0]\n",
        ),
    ):
        folder = assignment_in(tmp_path / kind, HEAD.replace('"controller"', f'"{kind}"') + text, law)
        found = both(read_assignment(folder), folder / "solution.py", pool)
        assert found.status is Status.BROKE_CONTRACT and "1e+100" in found.reason and found.score == 0.0


def test_a_controller_that_asks_for_everything_is_graded(tmp_path: Path, pool: Pool) -> None:
    """Without limits of the converter the axis runs away; with them it only tracks badly."""
    law = "def control(t, r, y, state, params):\n    return (1.7e308 if r.position > y else -1.7e308), state\n"
    free = SINE + "[case.interface]\nsaturation = false\nquantization = false\n"
    for case in (SINE, free):
        criteria = RMS + RMS.replace('"rms"', '"effort"').replace("rms-error", "effort").replace('"mm"', '"V"')
        folder = assignment_in(tmp_path, HEAD + case + criteria, law)
        found = both(read_assignment(folder), folder / "solution.py", pool)
        assert found.status is Status.OK
        assert found.criteria[1].score == 0.0


def test_contours_far_from_the_path_stay_within_bounds(tmp_path: Path) -> None:
    idle = "def control(t, r, y, state, params):\n    return 0.0 * y, state\n"
    circle = SINE.replace('axis = "X"', 'axes = ["X", "Y"]\ncoupled = true')
    text = HEAD + circle.replace("duration = 1.0", "duration = 4.0") + RMS.replace("rms-error", "contour-error")
    folder = assignment_in(tmp_path, text, idle)
    assignment = read_assignment(folder)
    tracemalloc.start()
    grade(assignment, folder / "solution.py", "ada", TrustedFiles())
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1e9
