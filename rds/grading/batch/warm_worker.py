"""A worker process that gets ready while the command line is still read: it tries the sandbox's walls on the very
interpreter that its submissions are run in afterwards. Light to import, since all else waits for it.
"""

from __future__ import annotations

import pickle
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

from rds.core.parallel import processors, worker_count, worker_number
from rds.core.parallel.local import place
from rds.core.parallel.process import Work, WorkerProcess

if TYPE_CHECKING:
    from rds.grading.sandbox import Pool

_NEEDED = ("rds.grading.batch.work", "pyarrow.parquet", "rds.grading.cases.control", "rds.modes.simulation")
_NOTHING = pickle.dumps(None)  # an item that says nothing


@lru_cache(maxsize=1)
def begun() -> WorkerProcess:
    """The one process of this kind, started at the first call; `end` it, and clear this cache."""
    worker = WorkerProcess(Work(pickle.dumps(_tried), retries=0, time_limit=None), place(0))
    worker.ask_ahead(_NOTHING)
    return worker


def fault_of(worker: WorkerProcess) -> str | None:
    """None where the sandbox holds, else what is missing; as `rds.grading.sandbox.available`."""
    from rds.grading.sandbox import available

    outcome = worker.answer(_NOTHING).outcome(0)
    fault: str | None = outcome.value if outcome.ok else available()
    return fault


def _tried(_: None) -> str | None:
    """In the worker."""
    from rds.grading.sandbox import SandboxError

    with suppress(SandboxError):  # `own_fault` says it
        pool()
    for name in _NEEDED:  # while the interpreter starts
        import_module(name)
    return own_fault()


@lru_cache(maxsize=1)
def own_fault() -> str | None:
    """As `available`, in a worker: tried on the interpreter that submissions are then run in."""
    from rds.grading.sandbox import SandboxError

    try:
        return pool().fault()
    except SandboxError as error:
        return str(error)


@lru_cache(maxsize=1)
def pool() -> Pool:
    """A worker's pool, which ends with its process."""
    from rds.grading.sandbox import Pool

    return Pool(is_tried=True)


def shared_pool(jobs: int | None) -> Pool:
    """The same, once it is known how many are at work at the same time; None where only the worker knows."""
    number, count = worker_number(), jobs or worker_count()
    own = pool()
    if number is None or count is None:  # of a cluster, to which it has come later
        own.share(processors(), None)
    else:
        own.share(count, number)
    return own
