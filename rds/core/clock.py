"""When samples are due in real time, and what is done about the late ones."""

from __future__ import annotations

import time
from dataclasses import dataclass

# Sleeping wakes tens of microseconds late on an ordinary kernel, so the last stretch is spun. It stays well
# below the share of a core that the kernel grants to real-time processes (sched_rt_runtime_us, 95 %).
SPIN_NS = 200_000


@dataclass(frozen=True)
class LatePolicy:
    """What to do when a sample is late: the modes of LabVIEW's timed loop, and stopping.

    `discard` drops the periods that passed meanwhile, otherwise they are processed one after the other at once;
    `keep_phase` holds on to the original due times, otherwise the schedule starts anew from the late sample;
    `stop_after` ends the run after that many late samples in a row (0: never); the first sample does not count.
    """

    discard: bool = False
    keep_phase: bool = True
    stop_after: int = 0


class RealTimeClock:
    """Absolute due times in integer nanoseconds on the monotonic clock: origin + k·period."""

    def __init__(self, period_ns: int, policy: LatePolicy | None = None, spin_ns: int = SPIN_NS):
        self.period = period_ns
        self.policy = policy or LatePolicy()
        self.now = time.perf_counter_ns
        self._spin = min(spin_ns, period_ns // 4)
        self._origin = self.now() + period_ns
        self._late_in_a_row = 0

    def start(self) -> None:
        """Sample 0 is due one period from now."""
        self.start_at(0)

    def start_at(self, k: int) -> None:
        """Sample `k` is due one period from now."""
        self._origin = self.now() + (1 - k) * self.period
        self._late_in_a_row = 0

    def wait(self, k: int) -> int:
        """Wait until sample `k` is due; the sample to take now: later than `k` where periods are discarded."""
        now = self.now
        due = self._origin + k * self.period
        at = now()
        if at < due:
            sleep = due - at - self._spin
            if sleep > 0:
                time.sleep(sleep * 1e-9)
            while now() < due:
                pass
            return k
        if self.policy.discard:
            missed = (at - due) // self.period
            k += missed
            due += missed * self.period
        if not self.policy.keep_phase:
            self._origin += at - due
        return k

    def lateness(self, k: int, at: int) -> int:
        """How long after its due time sample `k` is at the instant `at`, ns."""
        return at - self._origin - k * self.period

    def finish(self, k: int, at: int) -> bool:
        """Sample `k` was complete at the instant `at`; true if that was one late sample too many in a row."""
        if self.lateness(k, at) <= self.period:
            self._late_in_a_row = 0
            return False
        self._late_in_a_row += k > 0
        return 0 < self.policy.stop_after <= self._late_in_a_row
