"""Margins and poles measured from outside, beside those that are computed from the law's matrices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rds.core.load import load_student
from rds.core.types import Model
from rds.grading.assignment.assignment import Assignment, read_assignment
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.batch.grade_one import OpenSubmission
from rds.grading.criteria.applied_force import begin_of, force, free_stretch
from rds.grading.criteria.law_fit import LawFit
from rds.grading.criteria.linear import LinearLoop, NoLoop, closed
from rds.identification.robustness.margins import linear_law, loop_margins
from rds.models import library_model
from tests.grading.made import HEAD, RMS, SINE, assignment_in

TEXT = HEAD + SINE.replace("duration = 1.0", "duration = 3.0\n{plant}") + RMS

LAWS = {
    "proportional": """
def control(t, r, y, state, params):
    return 20.0 * (r.position - y), state
""",
    "filtered derivative": """
initial_state = [0.0, 0.0]

def control(t, r, y, state, params):
    last, slope = state
    error = r.position - y
    slope = slope + 0.2 * ((error - last) / 0.001 - slope)
    return 30.0 * error + 0.3 * slope + 0.567 * r.velocity, [error, slope]
""",
    "integral": """
initial_state = [0.0]

def control(t, r, y, state, params):
    error = r.position - y
    total = state[0] + 0.001 * error
    return 25.0 * error + 150.0 * total, [total]
""",
}


def found_in(folder: Path, law: str, plant: str = "") -> tuple[LinearLoop | NoLoop, Assignment]:
    assignment = read_assignment(assignment_in(folder, TEXT.replace("{plant}", plant), law))
    opened = OpenSubmission(folder / "solution.py", assignment, TrustedFiles())
    try:
        linear = assignment.cases[0].run(opened, 1, 0, ("linear",)).linear
    finally:
        opened.close()
    assert linear is not None
    return linear[0], assignment


@pytest.mark.parametrize("plant", ["", 'plant = "machine"'])
@pytest.mark.parametrize("law", LAWS)
def test_margins_from_outside_are_those_from_within(law: str, plant: str, tmp_path: Path) -> None:
    found, assignment = found_in(tmp_path, LAWS[law], plant)
    controller = load_student(tmp_path / "solution.py").controller()
    matrices = linear_law(replace(controller, initial_state=[0.0] * len(controller.initial_state or ())))
    assert isinstance(found, LinearLoop) and matrices is not None
    model: Model = assignment.cases[0].plants[0].base  # type: ignore[attr-defined]
    gain, phase, modulus, radius = loop_margins(matrices, [model], 0.001)[0]
    assert found.margins[0] == pytest.approx(gain, abs=0.05)
    assert found.margins[1] == pytest.approx(phase, abs=0.1)
    assert found.margins[2] == pytest.approx(modulus, abs=2e-3)
    assert abs(found.poles[0]) == pytest.approx(radius, abs=2e-5)
    w, locus = found.locus(1024)
    assert len(w) == len(locus) >= 512 and w[-1] == pytest.approx(np.pi / 0.001)


def test_damping_of_proportional_control_is_that_of_its_second_order_loop(tmp_path: Path) -> None:
    """tau s² + s + K Kp = 0: zeta = 1 / (2 sqrt(K Kp tau)), a little less for the sample's delay."""
    found, _ = found_in(tmp_path, LAWS["proportional"])
    assert isinstance(found, LinearLoop)
    model = library_model("linear-axis", tau=9.943e-3, K=1.764)
    zeta = 0.5 / np.sqrt(1.764 * 20.0 * model.params["tau"])
    w = np.sqrt(1.764 * 20.0 / model.params["tau"])
    assert found.least_damping == pytest.approx(zeta - 0.25 * w * 0.001, abs=0.01)


@pytest.mark.parametrize(
    "law, why",
    [
        ("def control(t, r, y, state, params):\n    return 1200.0 * (r.position - y), state\n", "not stable"),
        ("def control(t, r, y, state, params):\n    return 0.5 * r.velocity, state\n", "no loop"),
        (
            "def control(t, r, y, state, params):\n    return (8.0 if y < r.position else -8.0), state\n",
            "switches",
        ),
    ],
)
def test_what_has_no_linear_loop_has_no_margins(law: str, why: str, tmp_path: Path) -> None:
    found, _ = found_in(tmp_path, law)
    assert isinstance(found, NoLoop) and found.is_known and why in found.why, found


@pytest.mark.parametrize(
    "voltage, is_known", [("20.0 * (r.position - y)", False), ("8.0 * (1 - 2 * (r.position < y))", True)]
)
def test_who_answers_otherwise_in_a_second_run_is_for_a_review_unless_a_relay(
    voltage: str, is_known: bool, tmp_path: Path
) -> None:
    law = f"import os\ndef control(t, r, y, state, params):\n    return {voltage} + os.urandom(1)[0] / 1e4, state\n"
    found, _ = found_in(tmp_path, law)
    assert isinstance(found, NoLoop) and found.is_known == is_known, found
    assert ("switches" if is_known else "a seed") in found.why
    if not is_known:  # what it is paid until somebody has looked
        same, _ = found_in(tmp_path, law.replace("os.urandom(1)[0]", "0.0"))
        assert isinstance(same, LinearLoop) and found.nearest is not None
        assert found.nearest.margins == pytest.approx(same.margins, rel=0.03)


@pytest.mark.parametrize("gain", [1e3, 1e6, 1e12, 1e300])
def test_a_loop_that_grows_within_a_few_samples_has_no_margins(gain: float) -> None:
    """A cubic law under a force is such a loop, and was a fault of the grader's own."""
    fit = LawFit(np.array([1.0]), np.array([gain]), 0.0)
    found = closed(fit, library_model("linear-axis", tau=0.01, K=1.7), 1e-3)
    assert isinstance(found, NoLoop)
    assert found.is_known


@pytest.mark.parametrize(
    "gain, why, is_known",
    [(-0.40, "", True), (-0.20, "takes longer than 16.4 s to die down", False), (1e-3, "does not die down", True)],
)
def test_a_deviation_must_die_down_to_a_thousandth_within_16_seconds(gain: float, why: str, is_known: bool) -> None:
    """A slow loop goes as exp(K gain t): at 16 s to 2e-5 and 4e-3 of its largest, and upwards."""
    fit = LawFit(np.array([1.0]), np.array([gain]), 0.0)
    found = closed(fit, library_model("linear-axis", tau=0.01, K=1.7), 1e-3)
    if isinstance(found, NoLoop):
        assert why and why in found.why and found.is_known == is_known
    else:
        assert not why and len(found.position) == 1 << 14
        assert abs(found.position[-1] / found.position.max()) == pytest.approx(np.exp(1.7 * gain * 16.4), rel=0.2)


WAVE = 3.0 * np.sin(0.1 * np.arange(1000.0))  # V, of a converter of 10 V


@pytest.mark.parametrize(
    "at_limit, expected",
    [
        (slice(0, 0), (0, 1000)),
        (slice(0, 300), (300, 1000)),
        (slice(700, 1000), (0, 700)),
        (slice(299, 300), (0, 1000)),  # a spike: what goes before it counts
        (slice(700, 701), (0, 1000)),
        (slice(0, 800), (0, 1000)),  # what is left is less than a fourth
    ],
)
def test_the_force_acts_where_the_law_is_at_no_limit(at_limit: slice, expected: tuple[int, int]) -> None:
    command = WAVE.copy()
    command[at_limit] = 9.01
    assert free_stretch(command, np.arange(1000.0), 10.0) == expected


@pytest.mark.parametrize("moves", [True, False])
def test_a_limit_of_the_laws_own_is_a_voltage_held_while_the_axis_moves(moves: bool) -> None:
    command = WAVE.copy()
    command[:400] = 4.0
    position = np.arange(1000.0) * moves
    assert free_stretch(command, position, 10.0) == ((399, 1000) if moves else (0, 1000))


def test_the_force_overcomes_the_friction_and_leaves_the_law_its_range() -> None:
    """0.25 V hold the axis; beside that 0.4 to 1.2 times 8 % of 10 V; where 0.1 V are left, 1 % of the range."""
    model = library_model("linear-axis", tau=0.01, K=2.0, friction_plus=0.5, friction_minus=-0.2)
    command = np.where(np.arange(3000) < 1500, 0.0, 8.9)
    made = force(model, command, (10.0, 10.0), (100, 2900), 1)
    assert begin_of((0, 3000), 3000) == 60 and begin_of((100, 2900), 3000) == 100
    assert not made[:100].any() and made[100:2900].all() and not made[2900:].any()
    free, tight = np.abs(made[100:1400]), np.abs(made[1500:2900])
    assert 0.25 + 0.32 <= free.min() < 0.65 and 1.1 < free.max() <= 0.25 + 0.96
    assert tight == pytest.approx(0.1)
    assert np.diff(np.flatnonzero(np.diff(np.abs(made[100:1400])))).min() >= 4
    assert (made > 0.0).any() and (made < 0.0).any()
