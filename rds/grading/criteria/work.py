"""Work per sample, as a deterministic budget: events of Python (lines, calls, returns), not seconds."""

from __future__ import annotations

from rds.grading.cases.case import COUNTS, CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options

MEANING = "the work per sample"
UNIT = "events"
MORE_IS_WORSE = True
FOR = ("controller", "model", "interpolator")
NEEDS = (COUNTS,)


def measure(run: CaseRun, options: Options) -> float:
    """Events per sample (row of an interpolator), on average; the same on every computer, busy or not."""
    counts = run.counts
    if counts is None or counts.events is None:
        raise NotMeasured((counts.refused if counts else "") or "its work could not be counted")
    return counts.events / max(counts.calls if run.rows is None else len(run.rows), 1)
