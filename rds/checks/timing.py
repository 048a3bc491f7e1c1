"""Time per call against the sample period."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rds.checks import clauses
from rds.checks.report import Findings, Timing
from rds.core.thread_time import ThreadTime

COMFORT = 0.5  # of the period: above it, too little is left for input, output and the system
WORKING = 0.2  # of a call's time: with less work than that it waits


class Work:
    """How much of its time a function works, between each `begin` and `end` in the thread that made this."""

    def __init__(self) -> None:
        self._account = ThreadTime()
        self._span = self._worked = 0  # ns
        self._begun = (0, 0, 0)

    def begin(self) -> None:
        """The function is called."""
        self._begun = self._now()

    def end(self) -> None:
        """It has returned. Time in which others had the processor is not its own."""
        span, waited, worked = (now - begun for now, begun in zip(self._now(), self._begun, strict=True))
        self._span, self._worked = self._span + span - waited, self._worked + worked

    def waited(self) -> int:
        """ns so far in which others had the processor; what the first call waits is not its own."""
        return self._account.waited()

    def close(self) -> float:
        """The fraction of its time in which it worked."""
        self._account.close()
        return self._worked / max(1, self._span)

    def _now(self) -> tuple[int, int, int]:
        return time.perf_counter_ns(), self._account.waited(), time.thread_time_ns()


def judge_time(
    found: Findings, what: str, ns: Sequence[int], first_ns: int, busy: float, sample_period: float
) -> Timing | None:
    """Note in `found` what the times per call `ns` mean for `sample_period` (s), and sum them up.

    `first_ns` is the first call's, where compilation and imports show; `busy` the fraction of its time in which
    it worked.
    """
    if not ns:
        return None
    us = sorted(value / 1e3 for value in ns)
    timing = Timing(len(us), us[len(us) // 2], us[min(len(us) - 1, int(0.99 * len(us)))], us[-1])
    period = sample_period * 1e6
    if timing.p50 > period:
        waits = busy < WORKING
        remedy = "it waits: remove sleep, input and file access" if waits else "compute less, or once, outside of it"
        message = f"{what} takes {timing.p50:.0f} µs of a sample period of {period:.0f} µs; {remedy}"
        found.fault(clauses.TIME, message)
    elif timing.p50 > COMFORT * period:
        message = f"{what} takes {timing.p50:.0f} µs, more than {COMFORT:.0%} of the sample period of {period:.0f} µs"
        found.warn(clauses.TIME, f"{message}; compute what does not change once, outside of it")
    elif timing.p99 > period:
        message = f"1 in 100 calls of {what} takes {timing.p99:.0f} µs, more than the sample period of {period:.0f} µs"
        found.warn(clauses.TIME, f"{message}; spread the work over the samples")
    elif first_ns / 1e3 > period:
        message = f"the first call of {what} takes {first_ns / 1e3:.0f} µs, more than the sample period"
        found.warn(clauses.TIME, f"{message}; import and compile when the file is loaded, by calling it once there")
    return timing
