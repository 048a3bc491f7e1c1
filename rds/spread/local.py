"""Items on local processes: one item at a time for each, and a fresh process in place of one that has died.

Each process has a thread here that hands it items and waits for answers over its pipes. Processes are started fresh
and in sessions of their own: nothing of this process's state gets into a result, and Ctrl-C reaches this process only,
which then ends them.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rds.core.portable import portable
from rds.spread.outcome import Failure, Outcome
from rds.spread.pipe import receive, send

# Several processes share the processors already: threads of a matrix library would only get in each other's way.
NUMBER = "RDS_WORKER"  # in its environment, which of its kind a process is
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def on_processes(
    function: Callable[[Any], Any], items: Sequence[Any], jobs: int, retries: int, time_limit: float | None
) -> Iterator[Outcome]:
    """The outcomes as they come; see `spread`."""
    todo: queue.SimpleQueue[int | None] = queue.SimpleQueue()
    for index in [*range(len(items)), *[None] * jobs]:
        todo.put(index)
    done: queue.SimpleQueue[Outcome | BaseException] = queue.SimpleQueue()
    start = pickle.dumps(list(sys.path)), portable(function)
    workers = [_Worker(number, start, items, todo, done, retries, time_limit) for number in range(jobs)]
    try:
        for worker in workers:
            worker.thread.start()
        for _ in items:
            outcome = _next(done)
            if isinstance(outcome, BaseException):
                raise outcome
            yield outcome
    finally:
        for worker in workers:
            worker.end()


def worker_number() -> int | None:
    """In a local worker its number, from 0: a process that takes the place of another has the same. Else None."""
    number = os.environ.get(NUMBER, "")
    return int(number) if number.isdecimal() else None


def _next(done: queue.SimpleQueue[Any]) -> Any:
    while True:  # a wait without end would not hear of Ctrl-C on every system
        with contextlib.suppress(queue.Empty):
            return done.get(timeout=0.2)


class _Worker:
    """A process and the thread that looks after it."""

    def __init__(
        self,
        number: int,
        start: tuple[bytes, bytes],
        items: Sequence[Any],
        todo: queue.SimpleQueue[int | None],
        done: queue.SimpleQueue[Outcome | BaseException],
        retries: int,
        time_limit: float | None,
    ):
        self._number, self._start, self._items, self._todo, self._done = number, start, items, todo, done
        self._tries, self._time_limit = retries + 1, time_limit
        self._process: subprocess.Popen[bytes] | None = None
        self._ending = False
        self._lock = threading.Lock()  # between starting a process and the end
        self.thread = threading.Thread(target=self._work, name="rds spread", daemon=True)

    def end(self) -> None:
        """End the process, whatever it is at, and wait for it and the thread."""
        with self._lock:
            self._ending = True
            if self._process is not None:
                self._process.kill()
        if self.thread.ident is not None:
            self.thread.join()

    def _work(self) -> None:
        try:
            while not self._ending and (index := self._todo.get()) is not None:
                self._done.put(self._outcome(index))
        except BaseException as error:
            if not self._ending:
                self._done.put(error)
        finally:
            self._close()

    def _outcome(self, index: int) -> Outcome:
        data = portable(self._items[index])
        failure, reason = Failure.DIED, ""
        for attempt in range(1, self._tries + 1):
            overdue = threading.Event()
            try:
                raised, answer = pickle.loads(self._asked(data, overdue))
            except (OSError, EOFError, pickle.UnpicklingError):
                failure, reason = self._why(overdue)
                if self._ending:
                    break
                continue
            if raised:
                return Outcome(index, failure=Failure.RAISED, reason=answer, attempts=attempt)
            return Outcome(index, answer, attempts=attempt)
        times = f", each of {self._tries} times it was tried" if self._tries > 1 else ""
        return Outcome(index, failure=failure, reason=f"{reason}{times}", attempts=self._tries)

    def _asked(self, data: bytes, overdue: threading.Event) -> bytes:
        """The process's answer to an item. OSError or EOFError if the process ends."""
        process = self._running()
        assert process.stdin is not None and process.stdout is not None
        timer = None
        if self._time_limit is not None:

            def late() -> None:
                overdue.set()
                process.kill()

            timer = threading.Timer(self._time_limit, late)
            timer.daemon = True
        send(process.stdin, data)
        if timer is not None:
            timer.start()
        try:
            return receive(process.stdout)
        finally:
            if timer is not None:
                timer.cancel()

    def _why(self, overdue: threading.Event) -> tuple[Failure, str]:
        """Why there was no answer; the process is gone then."""
        code = self._close()
        if overdue.is_set():
            return Failure.OVERDUE, f"it took longer than {self._time_limit:g} s"
        said = f"signal {-code}" if code < 0 else f"exit code {code}"
        return Failure.DIED, f"its worker process ended ({said}); memory may have run out, or compiled code crashed"

    def _running(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._ending:
                raise OSError("ended")
            if self._process is None:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "rds.spread.worker"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env=os.environ | _ONE_THREAD | {NUMBER: str(self._number)},
                    start_new_session=True,
                )
                assert self._process.stdin is not None
                for part in self._start:
                    send(self._process.stdin, part)
            return self._process

    def _close(self) -> int:
        """End the process, if there is one; its exit code."""
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return 0
        with contextlib.suppress(OSError):
            if process.stdin:
                process.stdin.close()  # where it still lives, it ends by itself
        try:
            process.wait(0.5)
        except subprocess.TimeoutExpired:
            process.kill()
        code = process.wait()
        if process.stdout:
            process.stdout.close()
        return code
