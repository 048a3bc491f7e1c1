"""Assignments and runs made for tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rds.grading.cases import CaseRun
from rds.results import Result

T = 0.001

HEAD = """
title = "Tracking"
kind = "controller"
files = ["my_controller.py"]
secret = "not told to anybody"
solution = "solution.py"
"""
SINE = """
[[case]]
name = "sine"
axis = "X"
duration = 1.0

[case.reference]
kind = "sinusoid"
amplitude = 2.0
frequency = 1.0
"""
RMS = """
[[criterion]]
name = "rms"
kind = "rms-error"
case = "sine"
points = 10
full = 0.05
none = 0.5
unit = "mm"
"""
SOLUTION = """
def control(t, r, y, state, params):
    return 30.0 * (r.position - y) + 0.567 * r.velocity, state
"""


def assignment_in(folder: Path, text: str, solution: str = SOLUTION) -> Path:
    """An assignment's folder with this text and this solution."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "assignment.toml").write_text(text, encoding="utf-8")
    (folder / "solution.py").write_text(solution, encoding="utf-8")
    return folder


def run_of(
    columns: Mapping[str, Any], period: float | None = None, facts: Mapping[str, Any] | None = None, **more: Any
) -> CaseRun:
    """A run of axis X whose samples are these columns, every `T` s."""
    length = len(next(iter(columns.values())))
    meta = {"axes": ["X"], "sample_period": T, "period": {"X": period}}
    table = {"time": np.arange(length) * T, **columns}
    return CaseRun("case", 0, Result(table, {}, meta), facts=facts, **more)
