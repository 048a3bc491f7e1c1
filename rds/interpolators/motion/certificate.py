"""The certificate of a planned motion: every sample checked against the axes' limits and the programmed path."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import RdsError
from rds.interpolators.motion.deviation import allowed, deviation
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import TOLERANCE
from rds.interpolators.motion.samples import SampleBlock
from rds.interpolators.motion.segments import AXES

if TYPE_CHECKING:
    from rds.interpolators.motion.least_time import LeastTime
    from rds.interpolators.motion.limiting import LimitingCauses

KINDS = ("velocity", "acceleration", "jerk")
EXCESS = 1e-6  # by which a limit may be exceeded, relative
ROUNDING = 4.0 * np.finfo(float).eps  # of a position, relative: what differences of samples can see of it is allowed
OFF_PATH = 1e-6  # mm or degrees: what is shorter is not told apart on the path
NAMED = 5  # violations in an error
LISTED = 100  # violations that are kept; all are counted
BINS = 2048  # of the trace


@dataclass(frozen=True)
class Violation:
    """Where a sample is beyond a limit: the program's line, the sample's number, what it has and what it may have."""

    line: int
    sample: int
    kind: str  # "velocity", "acceleration", "jerk" or "deviation"
    axis: str  # empty for a deviation
    value: float
    limit: float

    def __str__(self) -> str:
        what = f"{self.kind} of {self.axis}" if self.axis else "deviation from the path"
        most = f"at most {self.limit:.6g} is allowed"
        return f"line {self.line}: {what} is {self.value:.6g} at sample {self.sample}; {most}"


@dataclass
class Worst:
    """The largest value of a kind, its share of the limit there, and where it is."""

    value: float = 0.0
    limit: float = 0.0
    share: float = 0.0
    line: int = 0
    sample: int = 0


@dataclass
class Certificate:
    """What `add` has seen of a motion's samples, against `limits`. Ended by `finish`, which adds that it stays at rest.

    The first, second and third differences of the samples over T, T², T³ are compared with velocity, acceleration and
    jerk of each axis (mm/s, mm/s², mm/s³; degrees), within 1e-6 and what rounding of the positions adds; the distance
    of each sample to the programmed path with the tolerance of its segment (`tolerance` mm or degrees where it has
    none), within 1e-6 mm.
    """

    limits: Limits
    tolerance: float = TOLERANCE
    promised: tuple[str, ...] = (*KINDS, "deviation")  # other kinds are measured, and no violations
    least_time: LeastTime | None = None  # of a planned motion: what is given to `plan` as well
    samples: int = 0
    T: float = 0.0
    count: int = 0  # violations
    violations: list[Violation] = field(default_factory=list)
    worst: dict[tuple[str, str], Worst] = field(default_factory=dict)  # by kind and axis; ("deviation", "")
    _last: np.ndarray = field(default_factory=lambda: np.empty((0, 6)))
    _line: int = 0
    _trace: list[np.ndarray] = field(default_factory=list)
    _bin: int = 16

    @property
    def ok(self) -> bool:
        """Whether every sample keeps every limit."""
        return self.count == 0

    def require(self, name: str) -> None:
        """RdsError with the first violations, by line of the program `name`, unless every limit is kept."""
        if self.ok:
            return
        first = [f"{name}: {violation}" for violation in self.violations[:NAMED]]
        more = [f"{name}: and {self.count - NAMED} more"] if self.count > NAMED else []
        raise RdsError("\n".join([f"{name}: the planned motion breaks its limits, and is not run", *first, *more]))

    @property
    def time(self) -> float:
        """s: samples times their period."""
        return self.samples * self.T

    @property
    def ratio(self) -> float | None:
        """How many times the least time that the path takes without a limit of the jerk; None where that is not known.

        Of the time from the first sample, at rest, to the last.
        """
        least = 0.0 if self.least_time is None else self.least_time.seconds
        return (self.samples - 1) * self.T / least if least > 0.0 else None

    def add(self, block: SampleBlock) -> None:
        """The next samples."""
        if not len(block):
            return
        self.T = block.T
        shares = self._differences(block.position, block.line, block.first)
        away = self._deviation(block)
        self._keep_trace(np.column_stack((*shares, away)))
        self._line = int(block.line[-1])
        self.samples = block.first + len(block)

    def finish(self) -> None:
        """The axes stay where the last sample is."""
        if len(self._last):
            still = np.repeat(self._last[-1:], 3, axis=0)
            self._differences(still, np.full(3, self._line), self.samples)
            self._last = np.empty((0, 6))

    def _differences(self, position: np.ndarray, line: np.ndarray, first: int) -> list[np.ndarray]:
        if not len(self._last):
            self._last = np.repeat(position[:1], 3, axis=0)
        run = np.concatenate((self._last, position))
        self._last = run[-3:].copy()
        scale = float(np.abs(run).max())
        shares = []
        for order, kind in enumerate(KINDS, 1):
            values = np.abs(np.diff(run, order, axis=0)[3 - order :]) / self.T**order
            limit = getattr(self.limits, kind)
            rounding = 2**order * ROUNDING * scale / self.T**order
            may = limit * (1.0 + EXCESS) + rounding
            known = np.where(limit > 0.0, limit, 1.0)
            share = np.where(limit > 0.0, values / known, np.where(values > rounding, np.inf, 0.0))
            shares.append(share)
            for i, axis in enumerate(AXES):
                if limit[i] > 0.0 or share[:, i].any():
                    over = values[:, i] > may[i]
                    self._note(kind, axis, values[:, i], np.full(len(values), limit[i]), over, line, first)
        return shares

    def _deviation(self, block: SampleBlock) -> np.ndarray:
        if not len(block.path):
            return np.zeros(len(block))
        own = block.segment - block.path_first
        length = block.path["length"]
        starts = np.concatenate(([0.0], np.cumsum(length)))[:-1]
        share = (block.distance - block.path_at - starts[own]) / np.where(length[own] > 0.0, length[own], 1.0)
        away = deviation(block.position, block.path, own, np.clip(share, 0.0, 1.0))
        may = allowed(block.path, self.tolerance)[own]
        over = away > may * (1.0 + EXCESS) + OFF_PATH
        self._note("deviation", "", away, may, over, block.line, block.first)
        return away

    def _note(
        self,
        kind: str,
        axis: str,
        values: np.ndarray,
        limit: np.ndarray,
        over: np.ndarray,
        line: np.ndarray,
        first: int,
    ) -> None:
        worst = self.worst.setdefault((kind, axis), Worst(limit=float(limit[0])))
        share = values / np.where(limit > 0.0, limit, np.inf) if kind != "deviation" else values / (limit + OFF_PATH)
        k = int(np.argmax(share))
        if share[k] > worst.share or (share[k] == worst.share and values[k] > worst.value):
            self.worst[kind, axis] = Worst(float(values[k]), float(limit[k]), float(share[k]), int(line[k]), first + k)
        if kind in self.promised and over.any():
            rows = np.flatnonzero(over)
            self.count += len(rows)
            for k in rows[: max(LISTED - len(self.violations), 0)]:
                found = Violation(int(line[k]), first + int(k), kind, axis, float(values[k]), float(limit[k]))
                self.violations.append(found)

    def _keep_trace(self, rows: np.ndarray) -> None:
        """The largest of each bin of samples; bins are joined in pairs when there are many."""
        edges = np.arange(0, len(rows), self._bin)
        self._trace.append(np.column_stack((np.diff(np.append(edges, len(rows))), np.maximum.reduceat(rows, edges))))
        if sum(map(len, self._trace)) > 2 * BINS:
            table = np.concatenate(self._trace)
            pairs = np.arange(0, len(table), 2)
            joined = np.maximum.reduceat(table, pairs)
            joined[:, 0] = np.add.reduceat(table[:, 0], pairs)
            self._trace, self._bin = [joined], 2 * self._bin

    def trace(self) -> np.ndarray:
        """Over time, the largest of some samples each: time s, share of velocity (6), acceleration (6), jerk (6),
        deviation.
        """
        if not self._trace:
            return np.empty((0, 20))
        table = np.concatenate(self._trace)
        table[:, 0] = (np.cumsum(table[:, 0]) - table[:, 0]) * self.T
        return table

    def to_dict(self) -> dict[str, Any]:
        """The certificate in plain values, for JSON: verdict, duration, worst of each axis with line and sample,
        faults.
        """
        axes: dict[str, dict[str, Any]] = {}
        for (kind, axis), worst in self.worst.items():
            if axis and self.limits.velocity[AXES.index(axis)] > 0.0:
                axes.setdefault(axis, {})[kind] = vars(worst).copy()
        return {
            "ok": self.ok,
            "promised": list(self.promised),
            "samples": self.samples,
            "sample_period": self.T,
            "time": self.time,
            "axes": axes,
            "deviation": vars(self.worst.get(("deviation", ""), Worst())).copy(),
            "violations": [vars(violation).copy() for violation in self.violations],
            "violation_count": self.count,
            "least_time": None if self.least_time is None else self.least_time.seconds,
            "times_least_time": self.ratio,
        }

    def sentence(self) -> str:
        """The certificate for people: verdict, and how close the motion comes to its limits."""
        if not self.ok:
            return f"The planned motion breaks its limits in {self.count} places; first: {self.violations[0]}."
        kept = [kind for kind in KINDS if kind in self.promised]
        share, axis, line, kind = max((*self._most(kind), kind) for kind in kept)
        away = self.worst.get(("deviation", ""), Worst())
        off = f"at most {away.value:.4f} mm off, in line {away.line}"
        words = f"{', '.join(kept[:-1])} and {kept[-1]}" if len(kept) > 1 else kept[0]
        said = (
            f"Certificate: all {self.samples} planned samples keep the {words} of every axis "
            f"(at most {100.0 * share:.1f} %: {kind} of {axis} in line {line})"
        )
        said += f" and the tolerance of the path ({off})." if "deviation" in self.promised else "."
        others = []
        for kind in KINDS:
            if kind not in kept:
                share, axis, line = self._most(kind)
                others.append(f"{kind} ({100.0 * share:.0f} % of the limit: {axis} in line {line})")
        others += [] if "deviation" in self.promised else [f"the path ({off})"]
        said = f"{said} Not promised: {', '.join(others)}." if others else said
        if (ratio := self.ratio) is None or self.least_time is None:
            return said
        return (
            f"{said} It takes {ratio:.3f} times the {self.least_time.seconds:.3f} s that velocity and acceleration "
            "alone allow along this path."
        )

    def _most(self, kind: str) -> tuple[float, str, int]:
        """The largest share of a kind's limit, its axis and line."""
        found = [(worst.share, axis, worst.line) for (what, axis), worst in self.worst.items() if what == kind]
        return max(found, default=(0.0, "none", 0))

    def plot(self, path: Any = None, explained: LimitingCauses | None = None) -> Any:
        """The matplotlib figure of the shares of the limits over time, with `explained` (limiting.py) also of the
        speeds along the path and what holds them back; saved at `path` if given.
        """
        from rds.interpolators.motion.certificate_plot import plot_certificate

        return plot_certificate(self, path, explained)


def certified(blocks: Iterable[SampleBlock], certificate: Certificate) -> Iterator[SampleBlock]:
    """The blocks, each checked as it passes; the certificate is finished after the last."""
    for block in blocks:
        certificate.add(block)
        yield block
    certificate.finish()
