"""What all cases share: how they are told to run, and what a run leaves for the criteria."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np

    from rds.grading.criteria.linear import LinearLoop, NoLoop
    from rds.grading.sandbox.work_counts import WorkCounts
    from rds.results import Result

COUNTS, LINEAR = "counts", "linear"
"""What a criterion may need besides the run itself: the count of its work, and the linearized loop."""

Row = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]


class Answers(Protocol):
    """A loaded submission, as `sandbox.LoadedSubmission` is: see there."""

    @property
    def output(self) -> str: ...

    @property
    def defines(self) -> tuple[str, ...]: ...

    @property
    def counts(self) -> WorkCounts: ...

    def begin_control(self, params: Any, initial_state: Any, T: float, axes: Any) -> None: ...

    def control(self, t: float, r: Any, y: Any) -> Any: ...

    def begin_model(self, params: Any, T: float) -> float: ...

    def advance(self, u: float) -> float: ...

    def rows(self, segment: Any, T: float, params: Any, most: int) -> Iterator[Row]: ...

    def call(self, name: str, args: Any) -> Any: ...


class Submitted(Protocol):
    """A submission that can be asked. `subject(n)` is loaded when it is first asked for; n > 0 for
    further axes. `functions()` is the submission as a plain module."""

    def subject(self, number: int = 0) -> Answers: ...

    def functions(self) -> Answers: ...


@dataclass(frozen=True)
class CaseRun:
    """One run of one case: its samples as a table, and what was found of it besides.

    Of a controller: the columns of every result; with noise, `X_actual` is what the encoder would have read without
    it. Of a model: `X_measured` is the hidden data, `X_modelled` the submission's free run. Of an interpolator:
    `position`, `velocity`, `acceleration` are in `rows`, shape (rows, 3, axes).
    `fault` says why it has no more samples than it has; empty after a whole run.
    """

    case: str
    number: int
    result: Result
    fault: str = ""
    counts: WorkCounts | None = None
    linear: tuple[LinearLoop | NoLoop, ...] | None = None  # of each axis
    facts: Mapping[str, Any] | None = None  # of the case: when a disturbance begins, the converter's limits, ...
    rows: np.ndarray | None = None

    def fact(self, name: str) -> Any:
        """A fact of the case, None where it has none of that name."""
        return (self.facts or {}).get(name)


class Case(Protocol):
    """One case of an assignment: its words, and how a submission is run on it."""

    @property
    def name(self) -> str: ...

    @property
    def title(self) -> str: ...

    @property
    def is_visible(self) -> bool: ...

    @property
    def runs(self) -> int: ...

    @property
    def unit(self) -> str:
        """Of the axis."""

    @property
    def can_be_linearized(self) -> bool: ...

    @property
    def is_drawn(self) -> bool:
        """Whether its plants or its noise are each student's own: else its runs are the same for everybody."""

    @property
    def files(self) -> tuple[str, ...]:
        """That it reads, counted from the assignment's folder."""

    def run(self, submitted: Submitted, seed: int, number: int, needs: Iterable[str]) -> CaseRun:
        """Run number `number` of the student whose seed is `seed`. SubmissionError by the submission's doing."""
