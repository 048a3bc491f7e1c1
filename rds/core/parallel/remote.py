"""What runs on the workers of a cluster: each of their threads has items done by a worker process of its own.

So an item that kills its process, or hangs, takes nothing with it: no other item, no other user's work, and not the
cluster's worker, whose scheduler would count the death against whatever lay there beside it.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from distributed import WorkerPlugin, get_worker

from rds.core.parallel.local import place
from rds.core.parallel.process import Reply, Work, WorkerProcess

IDLE = 60.0  # s without an item after which a process ends: who began the work may be dead


class WorkPlugin(WorkerPlugin):
    """On each of the cluster's workers the processes for one piece of work, until it is taken from there."""

    def __init__(self, work: Work, places: Mapping[str, tuple[int, int]]):
        self._work, self._places = work, places

    def setup(self, worker: Any) -> None:
        """Called by dask on each worker, also on those that come later."""
        self._lock = threading.Lock()
        self._seats: dict[int, _Seat] = {}  # by thread
        self._place = self._places.get(worker.address)  # none of one that has come later
        self._is_closed = False

    def teardown(self, worker: Any) -> None:
        """Called by dask when the work is over or the worker ends: so do the processes, whatever they are at."""
        with self._lock:
            self._is_closed = True
            seats = list(self._seats.values())
        for seat in seats:
            seat.process.end()

    def answer(self, data: bytes) -> Reply:
        """What comes of a pickled item, by the process of the thread that asks."""
        with self._lock:
            thread = threading.get_ident()
            if thread not in self._seats:
                self._seats[thread] = _Seat(self._work, self._environment(len(self._seats)))
            seat = self._seats[thread]
            if self._is_closed:
                seat.process.end()
        return seat.answer(data)

    def _environment(self, number: int) -> dict[str, str]:
        if self._place is None:
            return {}
        first, count = self._place
        return place(first + number, count)


def places(workers: Mapping[str, Mapping[str, Any]]) -> dict[str, tuple[int, int]]:
    """By address of a worker, of those that a scheduler lists: the number of its first thread on its computer, and how
    many threads all workers have there: these share its processors.
    """
    counts: dict[str, int] = {}
    numbers = {}
    for address, worker in workers.items():
        host = worker["host"]
        numbers[address] = host, counts.get(host, 0)
        counts[host] = counts.get(host, 0) + worker["nthreads"]
    return {address: (number, counts[host]) for address, (host, number) in numbers.items()}


class _Seat:
    """One thread's process, which does not stay for longer than `IDLE` without work."""

    def __init__(self, work: Work, environment: Mapping[str, str]):
        self.process = WorkerProcess(work, environment)
        self._busy = threading.Lock()
        self._timer: threading.Timer | None = None

    def answer(self, data: bytes) -> Reply:
        with self._busy:
            if self._timer is not None:
                self._timer.cancel()
            try:
                return self.process.answer(data)
            finally:
                self._timer = threading.Timer(IDLE, self._rest)
                self._timer.daemon = True
                self._timer.start()

    def _rest(self) -> None:
        if self._busy.acquire(blocking=False):  # else there is work again
            try:
                self.process.close()
            finally:
                self._busy.release()


def run_remotely(plugin: str, data: bytes) -> Reply:
    """What comes of an item by the plugin of that name."""
    found = get_worker().plugins[plugin]
    assert isinstance(found, WorkPlugin)
    return found.answer(data)
