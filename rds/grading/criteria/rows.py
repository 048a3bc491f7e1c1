"""An interpolator's rows as arrays: the samples of the path, with the segment's start before them."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun


def positions(run: CaseRun) -> np.ndarray:
    """(samples, axes), mm; sample 0 is the start of the segment."""
    return np.column_stack([run.result[f"{axis}_reference"] for axis in run.result.axes])


def velocities(run: CaseRun) -> np.ndarray:
    """By differences of the positions, (samples - 1, axes), mm/s: what the axes are sent, whatever the rows say."""
    return np.diff(positions(run), axis=0) / run.result.sample_period
