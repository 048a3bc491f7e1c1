"""How many instructions the student's calls retire, where the kernel gives a counter (perf_event_open(2), Linux).

A call that is held up takes longer and retires no more instructions; one that computes more retires more. So a count
proves what time alone cannot: that a call was long by its own doing. Fewer prove nothing, because a call that waits for
memory, for the kernel or for a file retires few.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import sys
from struct import pack
from typing import Any

HARDWARE, SOFTWARE = 0, 1  # PERF_TYPE_..., <linux/perf_event.h>
INSTRUCTIONS = 1  # PERF_COUNT_HW_INSTRUCTIONS
TASK_CLOCK = 1  # PERF_COUNT_SW_TASK_CLOCK, ns: counts where there is no hardware counter
_EXCLUDE_KERNEL, _EXCLUDE_HYPERVISOR = 1 << 5, 1 << 6  # which others than root may not count
_CLOSE_ON_EXEC = 8  # PERF_FLAG_FD_CLOEXEC
_SYSTEM_CALL = {"x86_64": 298, "aarch64": 241, "riscv64": 241}
_KEPT = 1000  # overruns whose count is kept


class InstructionCounter:
    """Counts of the thread that makes it. `reason` says why there is no counter, else it is empty."""

    def __init__(self, period: int, kind: int = HARDWARE, what: int = INSTRUCTIONS):
        self._period = period  # ns: a call that takes longer has overrun
        self.reason, self._file = "", -1
        self._begun = self._usual = self._usual_time = 0
        self._overruns: list[int] = []
        number = _SYSTEM_CALL.get(platform.machine()) if sys.platform == "linux" else None
        if number is None:
            self.reason = f"not known on {platform.system()} {platform.machine()}"
            return
        # struct perf_event_attr in its first form, of 64 bytes
        attributes = pack("IIQQQQQ16x", kind, 64, what, 0, 0, 0, _EXCLUDE_KERNEL | _EXCLUDE_HYPERVISOR)
        library = ctypes.CDLL(None, use_errno=True)
        self._file = library.syscall(number, attributes, 0, -1, -1, _CLOSE_ON_EXEC)
        if self._file < 0:
            code = ctypes.get_errno()
            self.reason = f"perf_event_open fails with {errno.errorcode.get(code, code)} ({os.strerror(code)})"

    def begin(self) -> None:
        """A call begins."""
        if self._file >= 0:
            self._begun = self._count()

    def end(self, took: int) -> None:
        """It has ended, and took so many ns, without what the scheduler took from it."""
        if self._file < 0:
            return
        count = self._count() - self._begun
        if took <= self._period:
            self._usual += count
            self._usual_time += took
        elif len(self._overruns) < _KEPT:
            self._overruns.append(count)

    def close(self) -> None:
        """Let go of the counter."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def to_json(self) -> dict[str, Any]:
        """For the record of a run: of the usual calls instructions and ns in all, of each overrun its instructions."""
        if self.reason:
            return {"not_available": self.reason}
        return {"usual": self._usual, "usual_ns": self._usual_time, "overruns": self._overruns}

    def _count(self) -> int:
        return int.from_bytes(os.read(self._file, 8), sys.byteorder)


def computing_times(counted: dict[str, Any]) -> list[float]:
    """How long each overrun has computed, ns, if an instruction takes as long as in the usual calls; [] if not counted.

    `counted` is what `InstructionCounter.to_json` told.
    """
    usual, time = counted.get("usual", 0), counted.get("usual_ns", 0)
    return [count * time / usual for count in counted.get("overruns", [])] if usual else []
