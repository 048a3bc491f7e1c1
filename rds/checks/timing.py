"""Time per call against the sample period."""

from __future__ import annotations

from collections.abc import Sequence

from rds.checks import clauses
from rds.checks.report import Findings, Timing

COMFORT = 0.5  # of the period: above it, too little is left for input, output and the system
WORKING = 0.2  # of a call's time: with less work than that it waits, even on a machine that others use


def judge_time(
    found: Findings, what: str, ns: Sequence[int], first_ns: int, busy: float, sample_period: float
) -> Timing | None:
    """Note in `found` what the times per call `ns` mean for `sample_period` (s), and sum them up.

    `first_ns` is the first call's, where compilation and imports show; `busy` the fraction of its time in which
    the processor worked on it.
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
