"""The same clock and the same I/O without the student's code, just before a run: what the system alone can do."""

from __future__ import annotations

from typing import Any

from rds.core.clock import RealTimeClock
from rds.core.contracts import Drivers


def rehearse(clock: RealTimeClock, drivers: Drivers | None, seconds: float) -> dict[str, Any]:
    """Keep the period for `seconds`, exchanging zero volts with the machine, and report how well it went.

    Returns the number of `samples`, the `stalls` (woken more than a period late), and the lateness and I/O time
    at the median and at most, in µs.
    """
    samples = max(int(seconds * 1e9 / clock.period), 20)
    late, io = [], []
    clock.start()
    for k in range(samples):
        clock.wait(k)
        started = clock.now()
        if drivers is not None:
            drivers.exchange()
        late.append(clock.lateness(k, started))
        io.append(clock.now() - started)
        if clock.lateness(k, clock.now()) > clock.period:  # a backlog is not a stall
            clock.start_at(k + 1)
    late.sort()
    io.sort()
    return {
        "samples": samples,
        "stalls": sum(value > clock.period for value in late),
        "lateness_p50": late[samples // 2] / 1e3,
        "lateness_max": late[-1] / 1e3,
        "io_p50": io[samples // 2] / 1e3,
        "io_max": io[-1] / 1e3,
    }
