"""A worker process from outside: it answers one item at a time, and a fresh one takes its place when it dies.

It is started fresh and in a session of its own: nothing of this process's state gets into a result, and Ctrl-C reaches
this process only, which then ends it. It dies with the thread that started it, so that one thread must do all asking.

Our own, because a pool of `concurrent.futures` is broken as a whole when one of its processes dies, as a
student's code may make it.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rds.core.parallel.outcome import Failure, Outcome, reason_of
from rds.core.parallel.pipe import FUNCTION, ITEM, receive, send
from rds.core.portable import portable

# Several processes share the processors already: threads of a matrix library would only get in each other's way.
_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


@dataclass(frozen=True)
class Work:
    """What worker processes are started with: the pickled function, and how often and how long (s) an item is tried."""

    function: bytes
    retries: int
    time_limit: float | None

    @classmethod
    def of(cls, function: Callable[[Any], Any], retries: int, time_limit: float | None) -> Work:
        """The work of calling `function`."""
        return cls(portable(function), retries, time_limit)


@dataclass(frozen=True)
class Reply:
    """What came of one item, still pickled, so that it can travel through processes that do not know its classes."""

    data: bytes = b""
    failure: Failure | None = None
    reason: str = ""
    attempts: int = 1

    def outcome(self, index: int) -> Outcome:
        """The outcome of item number `index`."""
        if self.failure is not None:
            return Outcome(index, failure=self.failure, reason=self.reason, attempts=self.attempts)
        try:
            raised, answer = pickle.loads(self.data)
        except Exception as error:  # a class that does not unpickle here
            raised, answer = True, reason_of(error)
        if raised:
            return Outcome(index, failure=Failure.RAISED, reason=answer, attempts=self.attempts)
        return Outcome(index, answer, attempts=self.attempts)


class WorkerProcess:
    """The process; `environment` goes over this one's. The first one may be there already (`forked_worker()`)."""

    def __init__(self, work: Work, environment: Mapping[str, str], begun: Any = None):
        self._work, self._environment, self._begun = work, {**_ONE_THREAD, **environment}, begun
        self._process: subprocess.Popen[bytes] | None = None
        self._told: Work | None = None  # whose function the process was sent
        self._is_ready = False  # whether it has said that it has it
        self._ahead: bytes | None = None  # the item that it was sent before anybody waits for the answer
        self._ending = False
        self._lock = threading.Lock()  # between starting a process and the end

    def answer(self, data: bytes) -> Reply:
        """What comes of a pickled item; tried again when the process dies or the time is over."""
        tries = self._work.retries + 1
        failure, reason = Failure.DIED, ""
        for attempt in range(1, tries + 1):
            overdue = threading.Event()
            try:
                return Reply(self._asked(data, overdue), attempts=attempt)
            except (OSError, EOFError):
                failure, reason = self._why(overdue)
            if self._ending:
                break
        times = f", each of {tries} times it was tried" if tries > 1 else ""
        return Reply(failure=failure, reason=f"{reason}{times}", attempts=tries)

    def ask_ahead(self, data: bytes) -> None:
        """Start on a pickled item at once, of which `answer` is going to be asked first."""
        with contextlib.suppress(OSError):
            process = self._running()
            assert process.stdin is not None
            send(process.stdin, ITEM + data)
            self._ahead = data

    def take(self, work: Work) -> None:
        """From the next item on do other work, in the same process."""
        self._work = work

    def end(self) -> None:
        """End the process for good, whatever it is at; from any thread."""
        with self._lock:
            self._ending = True
            if self._process is not None:
                self._process.kill()
                self._process.wait()

    def close(self) -> int:
        """End the process, if there is one; its exit code. Another one is started when it is asked again."""
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

    def _asked(self, data: bytes, overdue: threading.Event) -> bytes:
        """The process's answer to an item. OSError or EOFError if the process ends."""
        process = self._running()
        assert process.stdin is not None and process.stdout is not None
        if not self._is_ready:
            receive(process.stdout)  # what it takes to start, on a busy computer, is not the item's time
            self._is_ready = True
        timer = None
        if self._work.time_limit is not None:

            def late() -> None:
                overdue.set()
                process.kill()

            timer = threading.Timer(self._work.time_limit, late)
            timer.daemon = True
        if self._ahead != data:
            send(process.stdin, ITEM + data)
        self._ahead = None
        if timer is not None:
            timer.start()
        try:
            answer = receive(process.stdout)
        finally:
            if timer is not None:
                timer.cancel()
                timer.join()  # it may be ending the process right now, of which the next item would die
        if overdue.is_set():
            raise EOFError("answered too late")
        return answer

    def _why(self, overdue: threading.Event) -> tuple[Failure, str]:
        """Why there was no answer; the process is gone then."""
        code = self.close()
        if overdue.is_set():
            return Failure.OVERDUE, f"it took longer than {self._work.time_limit:g} s"
        said = f"signal {-code}" if code < 0 else f"exit code {code}"
        return Failure.DIED, f"its worker process ended ({said}); memory may have run out, or compiled code crashed"

    def _running(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._ending:
                raise OSError("ended")
            if self._process is None:
                self._process, self._begun = self._begun, None
                self._process = self._process or subprocess.Popen(
                    [sys.executable, "-P", "-m", "rds.core.parallel.worker"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env=os.environ | self._environment,
                    start_new_session=True,
                )
                self._told = self._ahead = None
                assert self._process.stdin is not None
                send(self._process.stdin, pickle.dumps(list(sys.path)))
            if self._told is not self._work:
                assert self._process.stdin is not None
                self._told, self._is_ready = self._work, False
                send(self._process.stdin, FUNCTION + self._work.function)
            return self._process
