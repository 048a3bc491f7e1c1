"""The cross-test of inverse dynamics: the parameters of one log, and the force error that they leave on another.

The procedure is that of the fit (`fit/inverse_dynamics.py`), with nothing estimated: velocity and acceleration of the
other log by the same filters, the equation with the parameters as they are, and

    error = 100 |g u - model| / |g u|

over the rows that move. It needs no free run, so feedback hides nothing of it and adds nothing to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rds.identification.logs.log import Log
from rds.identification.validate.candidate import Candidate, check_units

# relative force errors that the authors of a data set state for their own fit to it: by the name of the log, the
# structure and its options
PUBLISHED: Mapping[tuple[str, str, tuple[str, ...]], tuple[float, str]] = {
    ("DATA_EMPS", "axis-mass", ()): (4.0834, "Janot, Gautier and Brunot 2019"),
    ("DATA_EMPS", "axis-mass", ("per-direction",)): (3.1117, "Janot, Gautier and Brunot 2019"),
}


@dataclass(frozen=True)
class CrossTestResult:
    """One log: what the model leaves of its force (%), beside what the same structure leaves that is fitted to it."""

    log: str
    percent: float
    fitted_percent: float
    rows: int
    published_percent: float | None = None
    published_by: str = ""

    @property
    def times(self) -> float:
        """How many times what the log's own fit leaves."""
        return self.percent / self.fitted_percent if self.fitted_percent > 0.0 else float("inf")

    def to_json(self) -> dict[str, Any]:
        """As JSON's own types."""
        return asdict(self)


def cross_test(candidate: Candidate, logs: Sequence[Log]) -> list[CrossTestResult]:
    """The force errors of the model on these logs.

    InputError for a structure whose equation is not linear, or a log that the filters cannot take.
    """
    from rds.identification.fit.inverse_dynamics import force_error, regress_logs

    found = []
    for log in logs:
        check_units(candidate, log)
        percent, rows = force_error(log, candidate.structure, candidate.values, {})
        own = regress_logs([log], candidate.structure, {}).regression.relative_percent
        key = (log.name, candidate.structure.name, candidate.structure.options)
        published, by = PUBLISHED.get(key, (None, ""))
        found.append(CrossTestResult(log.name, percent, own, rows, published, by))
    return found
