"""A worker process that is a fork of this one: there at once, with all that this process has imported."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import warnings
from collections.abc import Callable
from typing import IO

from rds.core.parallel.worker import serve
from rds.core.scheduling import end_with_parent


class ForkedProcess:
    """What is used of `subprocess.Popen`, for a process that was forked, maybe by another one."""

    stdin: IO[bytes] | None = None
    stdout: IO[bytes] | None = None
    stderr: IO[bytes] | None = None

    def __init__(self, pid: int):
        """ProcessLookupError if it has ended already."""
        self.pid = pid
        self.returncode: int | None = None
        self._handle = os.pidfd_open(pid)

    def poll(self) -> int | None:
        """None while it runs; then its exit code, or 0 where that is its parent's to know."""
        if self.returncode is None and self._ended(0.0):
            self.returncode = 0
            with contextlib.suppress(ChildProcessError):
                self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
            os.close(self._handle)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end, at most `timeout` s: subprocess.TimeoutExpired after that."""
        if self.returncode is None and not self._ended(timeout):
            raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
        return self.poll() or 0

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(self._handle, number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)

    def _ended(self, timeout: float | None) -> bool:
        poll = select.poll()
        poll.register(self._handle, select.POLLIN)
        return bool(poll.poll(None if timeout is None else timeout * 1e3))


def fork_quietly() -> int:
    """`os.fork` in a process whose only other threads are numpy's, which have no work yet."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def forked_worker(when_idle: Callable[[], None], idle: float) -> ForkedProcess:
    """A worker process to be handed to `WorkerProcess`; it ends with the thread that calls this.

    It calls `when_idle` if it is asked nothing for `idle` s. Not to be called where threads of Python are: the fork
    might find a lock of theirs held.
    """
    questions, asking = os.pipe()
    listening, answers = os.pipe()
    pid = fork_quietly()
    if pid == 0:
        with contextlib.suppress(BaseException):  # nothing of what is the other process's may happen here too
            os.close(asking)
            os.close(listening)
            os.setsid()  # Ctrl-C is for the other one
            end_with_parent()
            if not select.select([questions], [], [], idle)[0]:
                when_idle()
            serve(os.fdopen(questions, "rb"), os.fdopen(answers, "wb"))
        os._exit(0)
    os.close(questions)
    os.close(answers)
    process = ForkedProcess(pid)
    process.stdin, process.stdout = os.fdopen(asking, "wb"), os.fdopen(listening, "rb")
    return process
