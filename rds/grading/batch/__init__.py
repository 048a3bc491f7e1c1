"""A folder of submissions graded with one command: parallel, resumable, one row for each whatever happened to it."""

from __future__ import annotations

from rds.grading.batch.outcome import BatchOutcome
from rds.grading.batch.run import run_batch

__all__ = ["BatchOutcome", "run_batch"]
