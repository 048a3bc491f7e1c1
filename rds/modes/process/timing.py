"""Was the sample period kept, and if not, whose fault was it?

Each sample's time has three owners: the system (waking the loop), the student (interpolate, compute and model) and the
bus (I/O). A late sample is the student's only if it would have been late on a system without any delay of its own.
That is decided by a replay of the run on such a system: every sample starts the moment it is due, or when the
one before it is complete; the student's code takes the time it took, less what the scheduler took from it;
I/O takes what it took in the fastest hundredth of the periods in which every module answered: that much the bus itself
needs, and what is more may be a computer that let the bus's programs wait (on a busy one, without real-time priority,
the median is several times as long). Where a module was silent, the loop waited for it in vain, and how long says
nothing about the bus. If the replay keeps the period and the run did not, the system alone (or the machine) could not
keep it, and the verdict is void: it says nothing about the student's code.

What the code's own time is, the kernel's accounts say (`core.thread_time`): what the scheduler took from it, a
process that was stopped, a page that came from the disk do not count. What they cannot say is whether a hypervisor
ran something else while the student's code seemed to run. Such stalls strike waiting as well. So a few overruns, or
no more of them than there were stalls of that length while waiting, are in doubt. Then the calls in question are made
again, off the clock and without effects outside (`process.second_look`), and the replay is repeated with the time
that they take then. The student's code is deterministic by contract: what was its own doing comes back, a stall does
not. Where it cannot be called again, an overrun that is several times as long as all that the system did in the run
is the code's own, and one that retired the instructions of several periods (`core.instructions`, where the kernel
counts them); where nothing is proved, the verdict is void.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rds.core.instructions import computing_times
from rds.core.types import Verdict
from rds.modes.process.environment import TICK, causes

STAGES = ("lateness", "io", "interpolate", "compute", "model")
LASTING = 9  # periods of silence, the shortest that ends a run (with a tenth, which has no row)
FEW = 3  # overruns that may be stalls even if nothing stalled while waiting
FASTEST = 1.0  # % of the exchanges with the bus, which the computer did not hold up
PERCENTILES = {"p50": 50.0, "p99": 99.0, "p999": 99.9}
BEYOND = 3.0  # times the longest stall of the system: an overrun that none of them explains
BIN_EDGES_US = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)


@dataclass(frozen=True)
class Timing:
    """Per-sample times of a run in ns, one array each, and the sample numbers they belong to."""

    sample: np.ndarray
    lateness: np.ndarray  # from due time to start
    io: np.ndarray
    interpolate: np.ndarray
    compute: np.ndarray
    model: np.ndarray
    taken: np.ndarray  # of the three before it: not run, and not by the code's own doing

    @property
    def total(self) -> np.ndarray:
        """From due time to completion, ns."""
        total: np.ndarray = self.lateness + self.io + self.interpolate + self.compute + self.model
        return total


@dataclass(frozen=True)
class Judgement:
    """A verdict, its reason in a sentence, what it rests on ("" where nothing more is to be said), and the counts."""

    verdict: Verdict
    reason: str
    evidence: str
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


def judge(
    timing: Timing,
    period: int,
    *,
    limit: int = 0,
    discarded: int = 0,
    stalls: int = 0,
    threads: int = 0,
    missing: int = 0,
    silent: int = 0,
    again: Callable[[np.ndarray], np.ndarray | None] | None = None,
    environment: Mapping[str, Any] | None = None,
) -> Judgement:
    """Met, missed or void (see the module's text).

    `limit` is how many late samples are allowed; `stalls` is how often the same clock, without the student's
    code, was late by more than a period in the rehearsal before the run; `threads` is how many threads the student's
    code left running; `missing` is how many answers had not come over the bus at the end of their period, `silent` in
    how many periods no answer of a module came at all. `again(which)` makes the run's calls once more and gives each
    one's time in ns, of the samples in question (`which`) at least, or None if it can't. `environment` is what is known
    of that of the run (see `environment`).
    """
    count = int(late_samples(timing, period).sum())
    lost = f"{count} of {len(timing.sample)} samples late"
    if discarded:
        lost += f", {discarded} period{'' if discarded == 1 else 's'} discarded"
    if count + discarded <= limit:
        return Judgement(Verdict.MET, _met(count, limit, len(timing.sample)), "", count, 0, discarded)
    io, usual_io = _exchange_times(timing.io, silent)
    student = timing.interpolate + timing.compute + timing.model
    own = student - np.minimum(timing.taken, student)
    alone = _late_alone(own + io, timing, period)
    if alone > limit and _is_doubtful(own + io, timing, period, stalls):
        # Not of code that starts threads: they would go on here.
        repeated = again(own + io > period) if again is not None and not threads else None
        if repeated is not None:
            own = np.minimum(own, repeated)
            alone = _late_alone(own + io, timing, period)
        elif not _is_proven(own + io, timing, period, stalls, environment or {}):
            alone = 0
    if alone > limit:
        reason = f"{_overrun(own, io, period, timing)} ({lost})"
        evidence = f"{alone} samples would have been late on a computer without delays of its own"
        return Judgement(Verdict.MISSED, reason, evidence, count, alone, discarded)
    if threads and not stalls:
        reason = (
            f"control() or the model left {threads} thread{'s' if threads > 1 else ''} running, which took the "
            f"processor from the loop ({lost})"
        )
        evidence = "without the student's code the same clock was on time"
        return Judgement(Verdict.MISSED, reason, evidence, count, alone, discarded)
    if silent >= LASTING and 2 * silent >= count + discarded:
        reason = (
            f"a module of the machine did not answer in time ({lost}). This says nothing about your code. "
            "Repeat it on a quieter computer; if it comes again, check the machine"
        )
        evidence = f"the loop waited for a silent module in {silent} periods"
        return Judgement(Verdict.VOID, reason, evidence, count, alone, discarded)
    busy = "the computer was busy" if not missing else "the computer or the bus was busy"
    answers = f", {missing} answer{'s' if missing > 1 else ''} did not come within the period" if missing else ""
    held = max(float(own_wait(timing, period).max(initial=0.0)), float(timing.taken.max(initial=0.0))) / 1e9
    slow = usual_io > period
    usual = f" ({usual_io / 1e6:.2f} ms at the median, {io / 1e6:.2f} ms at best)" if slow else ""
    longer = ", or with a longer period" if slow else ""
    known = "".join(f"; {cause}" for cause in causes(environment or {}, held))
    reason = f"{busy} ({lost}). This says nothing about your code. Repeat it on a quieter computer{longer}"
    evidence = (
        "the system woke the loop up to "
        f"{float(own_wait(timing, period).max(initial=0.0)) / 1e6:.2f} ms late with a period of {period / 1e6:g} ms, "
        f"took {float(timing.taken.sum()) / 1e6:.2f} ms from the running code, "
        f"and kept I/O waiting up to {float(timing.io.max(initial=0)) / 1e6:.2f} ms{usual}{answers}{known}"
    )
    return Judgement(Verdict.VOID, reason, evidence, count, alone, discarded)


def summary(timing: Timing, period: int) -> dict[str, Any]:
    """Per stage p50, p99, p999, max in µs; late samples, the longest run of them, and histograms of each stage."""
    stages: dict[str, Any] = {}
    for name in STAGES:
        values = getattr(timing, name) / 1e3
        if not len(values) or (name == "interpolate" and not values.any()):  # the run had no path to interpolate
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


def own_wait(timing: Timing, period: int) -> np.ndarray:
    """How late the system began each sample: from when it was due and the one before it complete, to its start, ns.

    Periods that were discarded because of it count: the sample that was due is the one after the last taken.
    """
    start = timing.sample * period + timing.lateness
    due = np.concatenate(([0], (timing.sample[:-1] + 1) * period))
    complete = np.concatenate(([0], timing.sample[:-1] * period + timing.total[:-1]))
    late: np.ndarray = np.maximum(start - np.maximum(due, complete), 0)
    return late


def _exchange_times(io: np.ndarray, silent: int) -> tuple[float, float]:
    """I/O times in ns, of the fastest hundredth and at the median; 0 where none is left.

    Those of `silent` periods, which last longest, do not count.
    """
    answered = np.sort(io)[: max(len(io) - silent, 0)]
    return (float(np.percentile(answered, FASTEST)), float(np.median(answered))) if len(answered) else (0.0, 0.0)


def _late_alone(work: np.ndarray, timing: Timing, period: int) -> int:
    """How many samples would be late on a system without delays; the first one is exempt."""
    late = replay(work, timing.sample, period)
    late[timing.sample == 0] = False
    return int(late.sum())


def _overruns(work: np.ndarray, period: int) -> int:
    return int((work > period).sum())


def _stalls(work: np.ndarray, timing: Timing, period: int) -> int:
    """How often the system, while the loop waited, stalled for as long as would make a usual sample late."""
    slack = period - float(np.median(work))
    return int((own_wait(timing, period) > (slack if slack > 0.0 else period)).sum())


def _is_doubtful(work: np.ndarray, timing: Timing, period: int, stalls: int) -> bool:
    """Whether the overruns may be stalls that struck while the student's code ran."""
    return _overruns(work, period) <= max(_stalls(work, timing, period) + stalls, FEW)


def _is_proven(work: np.ndarray, timing: Timing, period: int, stalls: int, environment: Mapping[str, Any]) -> bool:
    """Whether more calls overran than the system can have held up, or one for longer than it held anything up.

    Or one computed for longer, by its instructions: the usual calls may take up to `BEYOND` times as long for each.
    """
    if _overruns(work, period) > _stalls(work, timing, period) + stalls:
        return True
    if max(computing_times(environment.get("instructions", {})), default=0.0) > BEYOND * period:
        return True
    longest = environment.get("rehearsal", {}).get("lateness_max", np.inf if stalls else 0.0) * 1e3
    longest = max(longest, float(own_wait(timing, period).max()), float(timing.taken.max()))
    longest += (environment.get("stolen_ticks") or 0) * TICK * 1e9
    return bool(work.max() > period + BEYOND * longest)


def _overrun(own: np.ndarray, io: float, period: int, timing: Timing) -> str:
    """What took too long, in a sentence's end."""
    over = _overruns(own + io, period)
    of = f"of a sample period of {period / 1e6:g} ms"
    bus = f"the bus's I/O took {io / 1e6:.3f} ms at best"
    often = over > len(own) / 100
    took, where = (float(np.percentile(own, 99)), "the 99th percentile") if often else (float(own.max()), "most")
    code = f"{_whose(timing)} took {took / 1e6:.3f} ms at {where}"
    if io > period:
        return f"{code}, and {bus}, {of}" if took > period else f"{bus}, {of}"
    return f"{bus}, and {code}, {of}" if io > took else f"{code}, {of}"


def _whose(timing: Timing) -> str:
    """The code that ran in the samples; of an interpolator, what share of its time."""
    referring = float(timing.interpolate.sum())
    if not referring:
        return "control() and the model"
    share = referring / float((timing.interpolate + timing.compute + timing.model).sum())
    return f"the interpolator ({share:.0%} of it), control() and the model"


def _met(count: int, limit: int, samples: int) -> str:
    if count == 0:
        return f"all {samples} samples were complete within their period"
    return f"{count} of {samples} samples were late, which is within the limit of {limit}"
