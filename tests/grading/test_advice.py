"""What costs the most and which way to go: a law for each cause, and the sentence that its own run leads to."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.batch.grade_one import grade_with_runs
from rds.grading.feedback.advice import Advice, advice
from tests.grading.made import HEAD, SINE, assignment_in

STEP = """
[[case]]
name = "step"
axis = "X"
duration = 1.0
[case.reference]
kind = "constant"
value = 1.0
"""
PUSHED = """
[case.disturbance]
kind = "constant"
value = 1.0
"""
PROPORTIONAL = """
def control(t, r, y, state, params):
    return {gain} * (r.position - y) + {forward} * r.velocity, state
"""
BACKWARD = """
initial_state = 0.0
def control(t, r, y, state, params):
    error = r.position - y
    return {gain} * error + {damping} * (error - state) / 0.001, error
"""
DELAYED = """
initial_state = [0.0] * 5
def control(t, r, y, state, params):
    return 40.0 * (r.position - state[0]), [*state[1:], y]
"""


def criterion(kind: str, case: str, full: float, none: float, unit: str) -> str:
    return (
        f'[[criterion]]\nname = "{kind}"\ntitle = "What is asked"\nkind = "{kind}"\ncase = "{case}"\npoints = 10\n'
        f'full = {full}\nnone = {none}\nunit = "{unit}"\n'
    )


def told(folder: Path, words: str, law: str) -> Advice | None:
    """What the law's author is told, after it was graded."""
    assignment = read_assignment(assignment_in(folder / "task", HEAD + words, law))
    found = grade_with_runs(assignment, folder / "task/solution.py", "ada", TrustedFiles())  # type: ignore[arg-type]
    return advice(assignment, found.grade, found.runs)


RMS = criterion("rms-error", "sine", 1e-4, 1.0, "mm")
OVERSHOOT = criterion("overshoot", "step", 0.1, 100.0, "%")
SETTLING = criterion("settling-time", "step", 0.001, 1.0, "s")
STAYS = criterion("steady-state-error", "step", 1e-4, 1.0, "mm")
MARGIN = criterion("gain-margin", "step", 60.0, 0.0, "dB")
PHASE = criterion("phase-margin", "step", 89.0, 0.0, "°")
CAUSES = {
    "nothing ahead": (
        SINE + RMS,
        PROPORTIONAL.format(gain=30.0, forward=0.0),
        ("ms behind", "Add velocity feedforward"),
    ),
    "too much ahead": (SINE + RMS, PROPORTIONAL.format(gain=30.0, forward=1.5), ("ms ahead", "take less of it")),
    "goes too far": (STEP + OVERSHOOT, PROPORTIONAL.format(gain=150.0, forward=0.0), ("more damping", "less gain")),
    "swings": (STEP + SETTLING, BACKWARD.format(gain=40.0, damping=-1.0), ("swings", "more damping")),
    "is slow": (STEP + SETTLING, PROPORTIONAL.format(gain=30.0, forward=0.0), ("only slow", "Raise the gain")),
    "sticks": (STEP + SETTLING, PROPORTIONAL.format(gain=8.0, forward=0.0), ("stays there", "add integral action")),
    "is pushed aside": (
        STEP + PUSHED + STAYS,
        PROPORTIONAL.format(gain=20.0, forward=0.0),
        ("an offset", "add integral action"),
    ),
    "asks for the limit": (
        SINE + RMS,
        PROPORTIONAL.format(gain=1e5, forward=0.0),
        ("converter's limit", "less gain"),
    ),
    "little gain margin": (STEP + MARGIN, DELAYED, ("With less gain|With half the gain",)),
    "little phase margin": (
        STEP + PHASE,
        PROPORTIONAL.format(gain=150.0, forward=0.0),
        ("more damping, a derivative",),
    ),
    "makes voltage of noise": (
        SINE.replace("duration", "noise = 0.02\nduration") + criterion("noise-voltage", "sine", 1e-4, 1.0, "V"),
        PROPORTIONAL.format(gain=30.0, forward=0.567),
        ("30 V/mm: |30.1 V/mm: |29.9 V/mm: ", "filter it more"),  # the proportional gain itself
    ),
    "runs away from a sine": (
        SINE + RMS,
        PROPORTIONAL.format(gain=-30.0, forward=0.0),
        ("runs away", "Turn the sign", "`r.position - y`"),
    ),
    "runs away from a step": (STEP + SETTLING, PROPORTIONAL.format(gain=-30.0, forward=0.0), ("Turn the sign",)),
    "runs away, and has no margin": (STEP + PHASE, PROPORTIONAL.format(gain=-30.0, forward=0.0), ("Turn the sign",)),
    "hardly acts": (SINE + RMS, PROPORTIONAL.format(gain=0.0, forward=0.0), ("hardly acts", "raise the gain")),
}


@pytest.mark.parametrize("name", CAUSES)
def test_each_cause_is_told_with_its_remedy_and_its_picture(name: str, tmp_path: Path) -> None:
    words, law, expected = CAUSES[name]
    found = told(tmp_path, words, law)
    assert found is not None and found.sentence.startswith("What is asked costs the most: ")
    for part in expected:
        assert any(each in found.sentence for each in part.split("|")), found.sentence
    assert found.picture is not None and found.caption
