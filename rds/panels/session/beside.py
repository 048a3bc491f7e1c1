"""Pictures and reports of a run, made in a process of their own at the lowest priority.

Drawing holds Python's lock for tenths of a second: in the page's own process, whatever somebody presses meanwhile
(Hold, Stop) would wait for it.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from typing import Any

from rds.core.errors import RdsError
from rds.core.parallel.process import Work, WorkerProcess
from rds.core.portable import portable


def made_beside(make: Callable[..., Any], *arguments: Any) -> Any:
    """`make(*arguments)` of a process of its own, which ends with the thread that asks. RdsError where it failed."""
    process = WorkerProcess(Work.of(_made, retries=0, time_limit=None), {})
    try:
        outcome = process.answer(portable((make, arguments))).outcome(0)
    finally:
        process.close()
    if outcome.failure is not None:
        raise RdsError(
            f"pictures and reports were not made: {outcome.reason}; the run's tables are kept, open it among the "
            "earlier runs"
        )
    return outcome.value


def _made(order: tuple[Callable[..., Any], tuple[Any, ...]]) -> Any:
    with contextlib.suppress(AttributeError, OSError):  # Windows has no such priorities
        os.nice(19)
    make, arguments = order
    return make(*arguments)
