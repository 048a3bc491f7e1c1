"""A pure function over many items: on local processes, or on a dask cluster. Workers that die are replaced."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from typing import Any, TypeVar

from rds.core.errors import InputError
from rds.core.parallel.outcome import Outcome
from rds.core.parallel.process import Work, WorkerProcess
from rds.core.parallel.scheduler import Scheduler
from rds.core.progress import Progress

Item = TypeVar("Item")

RETRIES = 1


def processors() -> int:
    """How many processors this program may use."""
    usable = getattr(os, "sched_getaffinity", None)
    return len(usable(0)) if usable else os.cpu_count() or 1


def spread(
    function: Callable[[Item], Any],
    items: Iterable[Item],
    *,
    jobs: int | None = None,
    scheduler: str | Scheduler | None = None,
    retries: int = RETRIES,
    time_limit: float | None = None,
    progress: Progress | None = None,
    in_order: bool = True,
    first: WorkerProcess | None = None,
) -> Iterator[Outcome]:
    """The outcomes of `function(item)` as they become known: by rising index, or as they come if not `in_order`.

    Runs in `jobs` fresh local processes (default: one for each processor), or on the workers of the dask `scheduler`
    (a `Scheduler`, or its address: "tls://host:8786"; plain TCP only on this computer, unless it is `insecure`), which
    need the same rds installed. The function and the items are pickled (by cloudpickle: lambdas and notebook functions
    will do); the function must not depend on the process it runs in, so that the values are the same wherever that is.

    An exception becomes an outcome with its reason. Each item is at work in a process of its own, one at a time, also
    on a cluster: one that dies is replaced, and its item tried again `retries` times; so it is after `time_limit` s.
    What was on a computer of the cluster that is lost is done again. `progress(done, of)` is called in this thread.
    Closing the iterator, and Ctrl-C, end what is still at work. `first` is a local process that was started before, and
    is one of them.

    InputError if jobs and scheduler are both given, a number will not do, or no scheduler answers there within
    seconds; MachineError if the cluster loses all its workers for good.
    """
    if jobs is not None and scheduler is not None:
        raise InputError("jobs are local processes, and a scheduler has workers of its own; give one of them")
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs!r} must be at least 1")
    if retries < 0:
        raise InputError(f"retries = {retries!r} must be at least 0")
    todo = list(items)
    work = Work.of(function, retries, time_limit)
    if scheduler is not None:
        from rds.core.parallel.cluster import on_cluster

        found = on_cluster(work, todo, scheduler)
    else:
        from rds.core.parallel.local import on_processes

        found = on_processes(work, todo, min(jobs or processors(), max(len(todo), 1)), first)
    return (_in_order if in_order else _as_they_come)(found, len(todo), progress)


def _as_they_come(found: Iterator[Outcome], count: int, progress: Progress | None) -> Iterator[Outcome]:
    """Each outcome at once, so that what is known can be kept."""
    with closing(found):  # type: ignore[type-var]  # both are generators
        for done, outcome in enumerate(found, 1):
            yield outcome
            if progress:
                progress(done, count)


def _in_order(found: Iterator[Outcome], count: int, progress: Progress | None) -> Iterator[Outcome]:
    """The outcomes by rising index, each as soon as those before it are there."""
    waiting: dict[int, Outcome] = {}
    following = 0
    with closing(found):  # type: ignore[type-var]  # both are generators
        for done, outcome in enumerate(found, 1):
            if progress:
                progress(done, count)
            waiting[outcome.index] = outcome
            while following in waiting:
                yield waiting.pop(following)
                following += 1
