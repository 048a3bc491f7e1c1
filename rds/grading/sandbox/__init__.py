"""Where submitted code runs: a process of its own that can reach nothing, and answers one sample at a time.

The names below are imported when they are first used: inside a sandbox this package is visible, and needs little of it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rds.grading.sandbox.errors import SandboxError, SubmissionError
    from rds.grading.sandbox.limits import Limits
    from rds.grading.sandbox.loaded_submission import Loaded, LoadedSubmission
    from rds.grading.sandbox.pool import Pool
    from rds.grading.sandbox.requirements import available
    from rds.grading.sandbox.work_counts import WorkCounts

__all__ = ["Limits", "Loaded", "LoadedSubmission", "Pool", "SandboxError", "SubmissionError", "WorkCounts", "available"]

_MODULES = {
    "Limits": "limits",
    "Loaded": "loaded_submission",
    "LoadedSubmission": "loaded_submission",
    "Pool": "pool",
    "SandboxError": "errors",
    "SubmissionError": "errors",
    "WorkCounts": "work_counts",
    "available": "requirements",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
