"""Items on local processes: each has a thread here that hands it items and waits for its answers."""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Iterator, Sequence
from typing import Any

from rds.core.parallel.outcome import Outcome
from rds.core.parallel.process import Work, WorkerProcess
from rds.core.portable import portable

_NUMBER, _COUNT = "RDS_WORKER", "RDS_WORKERS"  # in its environment, which of how many a process is


def place(number: int, count: int | None = None) -> dict[str, str]:
    """The environment of worker `number`, from 0, of `count` that are at work on its computer at the same time."""
    return {_NUMBER: str(number)} | ({} if count is None else {_COUNT: str(count)})


def on_processes(work: Work, items: Sequence[Any], jobs: int, first: WorkerProcess | None) -> Iterator[Outcome]:
    """The outcomes as they come; see `spread`."""
    todo: queue.SimpleQueue[int | None] = queue.SimpleQueue()
    for index in [*range(len(items)), *[None] * jobs]:
        todo.put(index)
    done: queue.SimpleQueue[Outcome | BaseException] = queue.SimpleQueue()
    processes = [WorkerProcess(work, place(number, jobs)) for number in range(jobs)]
    if first is not None:
        first.take(work)
        processes[0] = first
    workers = [_Worker(process, items, todo, done) for process in processes]
    try:
        for worker in workers:
            worker.thread.start()
        for _ in items:
            yield following(done)
    finally:
        for worker in workers:
            worker.end()


def worker_number() -> int | None:
    """In a worker its number, from 0: a process that takes the place of another has the same. Else None."""
    return _said(_NUMBER)


def worker_count() -> int | None:
    """In a worker how many are at work on its computer at the same time; None where nobody knows."""
    return _said(_COUNT)


def _said(name: str) -> int | None:
    text = os.environ.get(name, "")
    return int(text) if text.isdecimal() else None


def following(done: queue.SimpleQueue[Any]) -> Any:
    """The next of what threads have put there, once it is there; exceptions are raised."""
    while True:  # a wait without end would not hear of Ctrl-C on every system
        with contextlib.suppress(queue.Empty):
            found = done.get(timeout=0.2)
            break
    if isinstance(found, BaseException):
        raise found
    return found


class _Worker:
    """A process and the thread that asks it."""

    def __init__(
        self,
        process: WorkerProcess,
        items: Sequence[Any],
        todo: queue.SimpleQueue[int | None],
        done: queue.SimpleQueue[Outcome | BaseException],
    ):
        self._process, self._items, self._todo, self._done = process, items, todo, done
        self._ending = False
        self.thread = threading.Thread(target=self._work, name="rds spread", daemon=True)

    def end(self) -> None:
        """End the process, whatever it is at, and wait for it and the thread."""
        self._ending = True
        self._process.end()
        if self.thread.ident is not None:
            self.thread.join()

    def _work(self) -> None:
        try:
            while not self._ending and (index := self._todo.get()) is not None:
                self._done.put(self._process.answer(portable(self._items[index])).outcome(index))
        except BaseException as error:
            if not self._ending:
                self._done.put(error)
        finally:
            self._process.end()  # it has nothing to do any more, and would take its time to end by itself
            self._process.close()
