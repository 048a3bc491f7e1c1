"""What went wrong in a run, in a sentence: the part, the instant and the student's own line."""

from __future__ import annotations

from rds.core.blame import student_error, student_line
from rds.core.errors import RdsError
from rds.modes.loop.plan import Plan


def fault(plan: Plan, error: BaseException, k: int | None) -> str:
    """Why the run ended at sample `k`; None for before the first."""
    at = "" if k is None else f" (at t = {k * plan.T:.3f} s)"
    if isinstance(error, RdsError):
        said = str(error)
        return said if " at t = " in said else f"{said}{at}"
    parts = [part for axis in plan.axes for part in (axis.controller, axis.model) if part is not None]
    paths = [part.source.path for part in parts if part.source.path]
    # of several students' files, the one through which the error came
    path = next((path for path in paths if student_line(error, path)), paths[0] if paths else None)
    return f"{student_error(error, path)}{at}"
