"""Pictures and reports of a run, made in a process of their own at the lowest priority.

Drawing holds Python's lock for tenths of a second: in the page's own process, whatever somebody presses meanwhile
(Hold, Stop) would wait for it. A page's process is forked with the page's kernel, and makes one after another; without
such a one each is made in a process that is started for it, which takes some seconds longer.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import threading
from collections.abc import Callable
from typing import Any

from rds.core.errors import RdsError
from rds.core.parallel.forked import ForkedProcess, forked_worker
from rds.core.parallel.outcome import Outcome
from rds.core.parallel.process import Work, WorkerProcess
from rds.core.portable import portable

IDLE = 3.0  # s without anything to do, after which what pictures need is imported: a page may just be opening


class _Forked:
    """The process that was forked with this one, until it dies."""

    def __init__(self) -> None:
        self.process: ForkedProcess | None = None
        self._worker: WorkerProcess | None = None
        self._turn = threading.Lock()

    def answer(self, order: bytes) -> Outcome | None:
        """What comes of it; None where there is no such process, or none any more."""
        with self._turn:
            if self._worker is None:
                if self.process is None:
                    return None
                self._worker, self.process = WorkerProcess(_work(), {}, self.process), None
            reply = self._worker.answer(order)
            if reply.failure is not None:
                self._worker = None
            return reply.outcome(0)


_FORKED = _Forked()  # of this process, as its threads are


def begin_beside() -> None:
    """Fork the process that draws for this one, which has no thread of Python yet."""

    def get_ready() -> None:
        _give_way()
        import_for_pictures()

    _FORKED.process = forked_worker(get_ready, IDLE)


def import_for_pictures() -> None:
    """Import what draws, as kernels of Jupyter have it."""
    os.environ.setdefault("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    with contextlib.suppress(Exception):
        import ipympl.backend_nbagg  # noqa: F401

        import rds.modes.experiment.report
        import rds.results.plots  # noqa: F401


def made_beside(make: Callable[..., Any], *arguments: Any) -> Any:
    """`make(*arguments)` of a process of its own, which ends with the thread that asks. RdsError where it failed."""
    order = portable((make, arguments))
    outcome = _FORKED.answer(order)
    if outcome is None:
        process = WorkerProcess(_work(), {})
        try:
            outcome = process.answer(order).outcome(0)
        finally:
            process.close()
    _hand_memory_back()  # of this process too: a run's samples, and what they were sent as
    if outcome.failure is not None:
        raise RdsError(
            f"pictures and reports were not made: {outcome.reason}; the run's tables are kept, open it among the "
            "earlier runs"
        )
    return outcome.value


def _work() -> Work:
    return Work.of(_made, retries=0, time_limit=None)


def _made(order: tuple[Callable[..., Any], tuple[Any, ...]]) -> Any:
    _give_way()
    make, arguments = order
    try:
        return make(*arguments)
    finally:
        gc.collect()
        _hand_memory_back()


def _hand_memory_back() -> None:
    """What glibc keeps of memory that is free again, in case it is wanted soon, goes back to the system."""
    with contextlib.suppress(AttributeError, OSError, TypeError):  # another system's library has no such call
        ctypes.CDLL(None).malloc_trim(0)


def _give_way() -> None:
    with contextlib.suppress(AttributeError, OSError):  # Windows has no such priorities
        os.nice(19)
