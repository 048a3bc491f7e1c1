"""A submission as the grader sees it: one question at a time, answers that have been checked, and what it used up."""

from __future__ import annotations

import base64
import os
import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any, NoReturn

from rds.core.types import ArcSegment, Reference, Segment
from rds.grading.grade import Status
from rds.grading.sandbox import records
from rds.grading.sandbox.budget import Budget
from rds.grading.sandbox.cell import Cell
from rds.grading.sandbox.errors import SubmissionError
from rds.grading.sandbox.interpreter import Interpreter
from rds.grading.sandbox.limits import Limits
from rds.grading.sandbox.output import printable
from rds.grading.sandbox.processors import Processors
from rds.grading.sandbox.run import Run, reason
from rds.grading.sandbox.submission import Submission
from rds.grading.sandbox.supervise import Supervisor
from rds.grading.sandbox.work_counts import WorkCounts, count_again

KINDS = ("controller", "model", "interpolator", "functions")


@dataclass(frozen=True)
class Loaded:
    """What a submission says that it defines: plain, bounded, and not to be believed."""

    defines: tuple[str, ...]
    params: Mapping[str, Any] = field(default_factory=dict)
    initial_state: Any = None
    error: str = ""  # why params or initial_state could not be shown; the submission could be loaded all the same


class LoadedSubmission:
    """One loaded submission. Each run that is begun has a fresh cell: nothing of one case is left for another.

    Every method raises SubmissionError where the submission breaks its interface, exceeds a limit or ends its process,
    and SandboxError where the computer fails. After a SubmissionError the next run can still be begun.
    """

    def __init__(
        self,
        submission: Submission,
        kind: str,
        limits: Limits,
        interpreter: Callable[[], Interpreter],
        supervisor: Supervisor,
        processors: Processors,
    ):
        if kind not in KINDS:
            raise ValueError(f"kind {kind!r} is none of {', '.join(KINDS)}")
        self.limits = limits
        self._submission, self._kind = submission, kind
        self._interpreter, self._supervisor, self._processors = interpreter, supervisor, processors
        self._budget = Budget(limits)
        self._counting = Budget(limits)  # what all counted runs together have used up
        self._printed: list[str] = []
        self._said_loading = b"", 0  # what it printed when it was first loaded, and how many bytes that were
        self._cell: Cell | None = None
        self._is_fresh = False  # whether nothing of the submission's was run in the cell but its loading
        self.loaded = Loaded(())
        self._run: Run | None = None
        self._order: Mapping[str, Any] = {}
        self._counts: WorkCounts | None = None
        self._affinity = os.sched_getaffinity(0)
        os.sched_setaffinity(0, processors.own)
        try:
            self._load()
        except SubmissionError as error:
            self.close()
            error.printed = self.output
            raise
        except BaseException:
            self.close()
            raise

    def begin_control(
        self,
        params: Mapping[str, Any] | None = None,
        initial_state: Any = None,
        T: float = 1e-3,
        axes: Sequence[str] = ("X",),
    ) -> None:
        """A fresh run of the controller with samples of `T` s; `params` go before its own, as does `initial_state`.

        With more than one of `axes` it drives them together, and gets arrays in that order.
        """
        order = {"op": "control", "params": dict(params or {}), "initial_state": initial_state, "T": T}
        self._begin({**order, "axes": len(axes), "names": list(axes)}, records.control_layout(len(axes)), T)

    def control(self, t: float, r: Reference | Sequence[Any], y: float | Sequence[float]) -> float | tuple[float, ...]:
        """One sample: `t` = k T s, the reference (mm, mm/s, mm/s²), the measured position; the voltage, V.

        Of several axes each is a sequence in axis order. ValueError if `t` is not the next sample's.
        """
        run = self._run
        if run is None or run.what != "control":
            run = self._running("control")
        if t != run.k * run.T:
            raise ValueError(f"t = {t!r} s is not sample {run.k} of {run.T} s; the samples of a run come in order")
        if run.is_single:
            voltage: float = run.ask(t, r[0], r[1], r[2], y)[2]  # type: ignore[arg-type]
            return voltage
        return run.ask(t, *r[0], *r[1], *r[2], *y)[2:]  # type: ignore[misc]

    def begin_model(self, params: Mapping[str, Any] | None = None, T: float = 1e-3) -> float:
        """A fresh run of the model with samples of `T` s; its output before the first sample."""
        answer = self._begin({"op": "model", "params": dict(params or {}), "T": T}, records.MODEL, T)
        output = answer.get("output") if isinstance(answer, dict) else None
        if not isinstance(output, int | float) or isinstance(output, bool):
            self._running("model").give_up("its first output is not a number")
        return float(output)

    def advance(self, u: float) -> float:
        """One sample of the constant voltage `u`, V; the output after it."""
        return float(self._running("model").ask(u)[2])

    def rows(
        self, segment: Segment, T: float, params: Mapping[str, Any] | None = None, most: int = 1_000_000
    ) -> Iterator[tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]]:
        """A fresh run of the interpolator: rows of (position, velocity, acceleration), a value of each axis, mm, s.

        SubmissionError after more than `most` rows.
        """
        axes = len(segment.start)
        kind = "arc" if isinstance(segment, ArcSegment) else "line"
        parts = {name: getattr(segment, name) for name in segment.__dataclass_fields__}
        order = {"op": "rows", "segment": {"kind": kind, **parts}, "params": dict(params or {}), "T": T}
        self._begin(order, records.rows_layout(axes), T)
        run = self._running("rows")
        taken = 0
        while True:
            _, _, count, *values = run.ask()
            if count != int(count) or not 0 <= count <= records.ROWS:
                run.give_up("it wrote into the grader's pipe")
            for at in range(0, int(count) * 3 * axes, 3 * axes):
                taken += 1
                if taken > most:
                    run.give_up(f"its interpolator has no end, or is far too slow: more than {most} rows")
                p, v, a = (tuple(values[at + i * axes : at + (i + 1) * axes]) for i in range(3))
                yield p, v, a
            if run.has_ended:
                return

    def call(self, name: str, args: Sequence[Any] = ()) -> Any:
        """What its function `name` returns for plain `args`: numbers, texts, lists and dicts of them.

        Calls of one subject follow each other in one cell, until a run is begun.
        """
        cell = self._cell
        if cell is None or cell.is_closed or self._run is not None:
            cell = self._load()
        self._is_fresh = False
        order = {"op": "call", "name": name, "args": list(args)}
        answer = cell.exchange(order, self.limits.call_seconds)
        if isinstance(answer, dict) and "error" in answer:
            raise SubmissionError(Status.BROKE_CONTRACT, reason(answer["error"]))
        if not isinstance(answer, dict) or "value" not in answer:
            self._give_up(cell, Status.BROKE_CONTRACT, "it wrote into the grader's pipe")
        return answer["value"]

    @property
    def defines(self) -> tuple[str, ...]:
        """The names of what it says can be called in it."""
        return self.loaded.defines

    @property
    def counts(self) -> WorkCounts:
        """Of the whole run that was begun last; see `count`."""
        if self._counts is None:
            self._counts = self.count()
        return self._counts

    def count(self, most_samples: int | None = None) -> WorkCounts:
        """The figures of the run that was begun last, in its first `most_samples` samples (all if None).

        The same questions are asked once more, in a fresh cell that counts. The run itself is over after that.
        """
        run, order = self._run, self._order
        if run is None:
            return WorkCounts(0, refused="no run was begun")
        self._leave()
        generous, budget = self._generous(), self._counting
        budget.limits = generous
        seal = secrets.randbits(63)
        first = run.recorded(most_samples)
        try:
            cell = self._load(budget, {**order, "seal": seal})
            self._answer(cell, {**order, "through_memory": False}, generous.call_seconds, Status.BROKE_CONTRACT)
            again = Run(cell, run.what, run.layout, run.T, seal=seal)
            return count_again(first, again)
        except SubmissionError as error:
            return WorkCounts(len(first), refused=f"while it was counted: {error.reason}")
        finally:
            self._leave()
            self._printed.pop()  # the same once more
            self._run, self._order = run, order

    @property
    def said_loading(self) -> str:
        """What it printed when it was loaded: `output` begins with it, and does not repeat it."""
        return printable(self._said_loading[0].decode(errors="replace"))

    @property
    def output(self) -> str:
        """What it has printed in the cells that have ended, and in this one so far."""
        return "".join([*self._printed, self._cell.printed if self._cell else ""])

    def close(self) -> None:
        """End its processes."""
        self._leave()
        os.sched_setaffinity(0, self._affinity)

    def __enter__(self) -> LoadedSubmission:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _running(self, what: str) -> Run:
        if self._run is None or self._run.what != what:
            raise ValueError(f"no run of {what} was begun; begin one first")
        return self._run

    def _begin(self, order: Mapping[str, Any], layout: records.Layout, T: float) -> dict[str, Any]:
        cell = self._cell
        if cell is None or cell.is_closed or not self._is_fresh:
            cell = self._load()
        self._is_fresh, self._counts = False, None
        through_memory = self._processors.apart and order["op"] != "rows"
        whole = {**order, "through_memory": through_memory}
        answer = self._answer(cell, whole, self.limits.call_seconds, Status.BROKE_CONTRACT)
        self._run, self._order = Run(cell, str(order["op"]), layout, T, through_memory), order
        return answer

    def _generous(self) -> Limits:
        """For all runs that are counted: these take some 30 times as long as what it took before, and no more."""
        took = 5.0 + 200.0 * self._budget.cpu_before
        limits = {name: getattr(self.limits, name) for name in ("cpu_seconds", "wall_seconds")}
        longer = {name: min(10.0 * most, max(most, took)) for name, most in limits.items()}
        calls = {name: 10.0 * getattr(self.limits, name) for name in ("call_seconds", "load_seconds")}
        return replace(self.limits, **longer, **calls)

    def _load(self, budget: Budget | None = None, counted: Mapping[str, Any] | None = None) -> Cell:
        """A fresh cell, with the submission loaded in it; `counted` is the order of the run whose work is counted."""
        self._leave()
        interpreter = self._interpreter()  # its start is not the submission's time
        self._cell = cell = Cell(interpreter, budget or self._budget, self._supervisor, self._processors.inner)
        self._run, self._is_fresh = None, True
        text = base64.b64encode(self._submission.data).decode()
        order = {"kind": self._kind, "name": self._submission.name, "text": text, "counted": counted}
        answer = self._answer(cell, order, cell.turn_limit, Status.FAILED_TO_LOAD)
        defines, params, problem = (answer.get(key) for key in ("defines", "params", "problem"))
        if not isinstance(defines, list) or not isinstance(params, dict) or not isinstance(problem, str):
            self._give_up(cell, Status.FAILED_TO_LOAD, "it wrote into the grader's pipe")
        names = tuple(name for name in defines if isinstance(name, str) and name.isidentifier())
        self.loaded = Loaded(names, params, answer.get("initial_state"), reason(problem) if problem else "")
        self._tell_loading_once(cell)
        return cell

    def _tell_loading_once(self, cell: Cell) -> None:
        """What the file prints whenever it is loaded is told for the first time only."""
        text, count = cell.printed_so_far()
        known, known_count = self._said_loading
        if count == known_count and known.startswith(text):  # what is over the limit is cut earlier each time
            cell.output.skip()
        elif not known_count:
            self._said_loading = text, count

    def _answer(self, cell: Cell, order: Mapping[str, Any], seconds: float, blame: Status) -> dict[str, Any]:
        answer = cell.exchange(order, seconds)
        if not isinstance(answer, dict):
            self._give_up(cell, blame, "it wrote into the grader's pipe")
        if "error" in answer:
            self._give_up(cell, blame, reason(answer["error"]))
        return answer

    def _give_up(self, cell: Cell, status: Status, why: str) -> NoReturn:
        cell.kill(status, why)
        cell.fail()

    def _leave(self) -> None:
        """End the cell, and keep what it printed."""
        if self._run is not None:
            self._run.close()
        if self._cell is not None:
            self._cell.close()
            self._printed.append(self._cell.output.text)
            self._cell = None
