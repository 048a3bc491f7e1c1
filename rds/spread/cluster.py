"""Items on the workers of a dask cluster."""

from __future__ import annotations

import contextlib
import logging
import queue
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rds.core.errors import InputError, MachineError
from rds.core.portable import portable
from rds.spread.outcome import Failure, Outcome
from rds.spread.remote import run_remotely
from rds.spread.worker import reason_of

CONNECT = 5.0  # s that a scheduler may take to answer
PATIENCE = 30.0  # s without any worker before the cluster counts as lost
_LOOK = 1.0  # s between two looks at the workers


def on_cluster(function: Callable[[Any], Any], items: Sequence[Any], scheduler: str) -> Iterator[Outcome]:
    """The outcomes as they come; see `spread`. Connects at once, so that a wrong address is refused at once."""
    return _outcomes(_connected(scheduler), portable(function), items, scheduler)


def _connected(scheduler: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError("a scheduler needs dask.distributed (pip install 'rds[cluster]')") from error
    loud = logging.getLogger("distributed")
    before = loud.level
    loud.setLevel(logging.CRITICAL)  # what it would say of a failed connection is said below
    try:
        client = Client(scheduler, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"scheduler {scheduler!r}: no dask scheduler answers within {CONNECT:g} s ({error}); start one with "
            "`dask scheduler`, and give its address, such as tcp://192.168.0.10:8786"
        ) from error
    finally:
        loud.setLevel(before)
    if not client.scheduler_info()["workers"]:
        client.close()
        raise InputError(f"scheduler {scheduler!r} has no workers; start some with `dask worker {scheduler}`")
    return client


def _outcomes(client: Any, function: bytes, items: Sequence[Any], scheduler: str) -> Iterator[Outcome]:
    done: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
    try:
        futures = [client.submit(run_remotely, function, portable(item), pure=False) for item in items]
        for index, future in enumerate(futures):
            future.add_done_callback(lambda future, index=index: done.put((index, future)))
        seen = time.monotonic()
        for _ in items:
            while True:
                with contextlib.suppress(queue.Empty):
                    index, future = done.get(timeout=_LOOK)
                    break
                if client.scheduler_info()["workers"]:
                    seen = time.monotonic()
                elif time.monotonic() - seen > PATIENCE:
                    raise MachineError(f"scheduler {scheduler!r} has had no workers for {PATIENCE:g} s; start some")
            yield _outcome(index, future)
    finally:
        client.close()


def _outcome(index: int, future: Any) -> Outcome:
    error = future.exception()
    if error is None:
        raised, answer = future.result()
        return Outcome(index, failure=Failure.RAISED, reason=answer) if raised else Outcome(index, answer)
    if type(error).__name__ == "KilledWorker":
        tries = getattr(error, "allowed_failures", 0) + 1
        reason = f"its worker process ended, each of {tries} times it was tried"
        return Outcome(index, failure=Failure.DIED, reason=reason, attempts=tries)
    return Outcome(index, failure=Failure.RAISED, reason=reason_of(error))
