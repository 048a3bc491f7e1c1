"""Was the sample period kept, and if not, whose fault was it?

Each sample's time has three owners: the system (waking the loop), the student (compute and model) and the bus
(I/O). A late sample is the student's only if it would have been late on a system without any delay of its own.
That is decided by a replay of the run on such a system: every sample starts the moment it is due, or when the
one before it is complete; the student's code takes the time it took, less what the scheduler took from it;
I/O takes its median. If the replay keeps the period and the run did not, the system alone could not keep it,
and the verdict is void: it says nothing about the student's code.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rds.core.types import Verdict

STAGES = ("lateness", "io", "compute", "model")
PERCENTILES = {"p50": 50.0, "p99": 99.0, "p999": 99.9}
BIN_EDGES_US = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)


@dataclass(frozen=True)
class Timing:
    """Per-sample times of a run in ns, one array each, and the sample numbers they belong to."""

    sample: np.ndarray
    lateness: np.ndarray  # from due time to start
    io: np.ndarray
    compute: np.ndarray
    model: np.ndarray
    taken: np.ndarray  # of compute and model: not run although ready to, the scheduler's doing

    @property
    def total(self) -> np.ndarray:
        """From due time to completion, ns."""
        return self.lateness + self.io + self.compute + self.model


@dataclass(frozen=True)
class Judgement:
    """A verdict and its reason in a sentence, with the counts it rests on."""

    verdict: Verdict
    reason: str
    late: int
    late_without_system: int
    discarded: int

    def to_json(self) -> dict[str, Any]:
        """As a plain dict."""
        return asdict(self)


def late_samples(timing: Timing, period: int) -> np.ndarray:
    """Which samples were not complete one `period` (ns) after they were due; the first one is exempt."""
    late = timing.total > period
    late[timing.sample == 0] = False
    return late


def replay(work: np.ndarray, sample: np.ndarray, period: int) -> np.ndarray:
    """Which samples would be late, in order, if each started when due or when the one before it was complete.

    `work` is each sample's own time in ns. With discarded periods the numbers in `sample` leave gaps.
    """
    late = np.zeros(len(work), dtype=bool)
    free = 0.0
    for i, (own, k) in enumerate(zip(work.tolist(), sample.tolist(), strict=True)):
        due = k * period
        free = max(free, due) + own
        late[i] = free > due + period
    return late


def judge(timing: Timing, period: int, *, limit: int = 0, discarded: int = 0, stalls: int = 0) -> Judgement:
    """Met, missed or void (see the module's text).

    `limit` is how many late samples are allowed; `stalls` is how often the same clock, without the student's
    code, was late by more than a period in the rehearsal before the run.
    """
    late = late_samples(timing, period)
    count = int(late.sum())
    ms = period / 1e6
    if count + discarded <= limit:
        return Judgement(Verdict.MET, _met(count, limit, len(late)), count, 0, discarded)
    io = float(np.median(timing.io))
    student = timing.compute + timing.model
    own = student - np.minimum(timing.taken, student)
    blamed = replay(own + io, timing.sample, period)
    blamed[timing.sample == 0] = False
    alone = int(blamed.sum())
    if alone > limit and _beyond_doubt(timing, own, period, stalls):
        part = "the bus's I/O" if io > period else "control() and the model"
        typical = io if io > period else float(np.percentile(own, 99))
        reason = (
            f"{count} of {len(late)} samples were late, and {alone} would have been on a system without delays: "
            f"{part} took {typical / 1e6:.3f} ms {'at the median' if io > period else 'at the 99th percentile'} "
            f"of the {ms:g} ms sample period"
        )
        return Judgement(Verdict.MISSED, reason, count, alone, discarded)
    longest = float(_own_wait(timing, period).max(initial=0.0)) / 1e6
    reason = (
        f"{count} of {len(late)} samples were late{f' and {discarded} periods discarded' if discarded else ''}, "
        f"but by the system's own doing: it woke the loop up to {longest:.2f} ms late with a period of {ms:g} ms, "
        f"took {float(timing.taken.sum()) / 1e6:.2f} ms from the running code, "
        f"and kept I/O waiting up to {float(timing.io.max(initial=0)) / 1e6:.2f} ms; "
        "the run says nothing about the controller: repeat it on a quieter machine"
    )
    return Judgement(Verdict.VOID, reason, count, alone, discarded)


def summary(timing: Timing, period: int) -> dict[str, Any]:
    """Per stage p50, p99, p999, max in µs; late samples, the longest run of them, and histograms of each stage."""
    stages: dict[str, Any] = {}
    for name in STAGES:
        values = getattr(timing, name) / 1e3
        if not len(values):
            continue
        stages[name] = {key: float(np.percentile(values, p)) for key, p in PERCENTILES.items()}
        stages[name]["max"] = float(values.max())
        stages[name]["histogram"] = np.histogram(values, bins=[*BIN_EDGES_US, np.inf])[0].tolist()
    late = late_samples(timing, period)
    return {
        **stages,
        "histogram_edges_us": list(BIN_EDGES_US),
        "late": int(late.sum()),
        "longest_late_run": longest_run(late),
        "samples": len(late),
    }


def longest_run(flags: np.ndarray) -> int:
    """The largest number of true values in a row."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _own_wait(timing: Timing, period: int) -> np.ndarray:
    """The part of each sample's lateness that is not a backlog of the sample before it, ns."""
    complete = timing.sample * period + timing.total
    backlog = np.maximum(complete[:-1] - timing.sample[1:] * period, 0)
    return np.maximum(timing.lateness - np.concatenate(([0], backlog)), 0)


def _beyond_doubt(timing: Timing, own: np.ndarray, period: int, stalls: int) -> bool:
    """Whether code that overran did so more often than the system itself stalled for as long.

    A virtual machine that is not given its processor shows a stall inside the student's code as running time.
    Such stalls strike waiting and computing alike, so they show in the waits as well.
    """
    overruns = int((own[1:] > period).sum())
    waits = int((_own_wait(timing, period) > period).sum()) + stalls
    return overruns > waits or overruns == 0


def _met(count: int, limit: int, samples: int) -> str:
    if count == 0:
        return f"all {samples} samples were complete within their period"
    return f"{count} of {samples} samples were late, which is within the limit of {limit}"
