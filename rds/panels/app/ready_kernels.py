"""Kernels from a process that has imported what every page needs: each is a fork of it, there at once.

Importing IPython and the panels takes about as long as importing the server. So the process is started first, and both
import at the same time. Then it waits, with one thread of Python and no loop: the server sends a line of JSON for each
kernel that it wants, and gets a line with the number of its process. The end of the channel ends it, and its kernels.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rds.core.parallel.forked import ForkedProcess, fork_quietly
from rds.core.scheduling import end_with_parent

LAUNCHER = ["-m", "rds.panels.app.kernel"]  # after the interpreter: how Jupyter starts such a kernel otherwise
_LONGEST = 64  # bytes of a process's number
_PATIENCE = 60.0  # s for the imports, on a busy computer


class ReadyKernels:
    """The server's end of it. Where the system has no handles of processes (other than Linux), it has no kernels."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._answers = False
        self._turn = threading.Lock()  # pages may ask at the same time
        if not hasattr(os, "pidfd_open"):
            return
        self._channel, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                cwd=Path(__file__).parent,  # not the student's folder, whose files would be found before the libraries
                pass_fds=[theirs.fileno()],
                start_new_session=True,  # Ctrl-C is the server's
            )
        self._channel.settimeout(_PATIENCE)
        self._answers = True

    def start(self, command: Sequence[str], env: Mapping[str, str], cwd: str | Path) -> ForkedProcess | None:
        """The kernel that `command` would start; None if it cannot come from here."""
        if list(command[1:3]) != LAUNCHER:
            return None
        told = {"arguments": list(command[3:]), "env": dict(env), "cwd": str(cwd)}
        with self._turn:
            if not self._answers:
                return None
            try:
                self._channel.sendall(json.dumps(told).encode() + b"\n")
                answer = self._channel.recv(_LONGEST)  # a number is too short to come in parts
            except OSError:
                answer = b""
            self._answers = bool(answer)  # it has died, or hangs: what it says later is nobody's
        try:
            return ForkedProcess(int(answer)) if answer else None
        except OSError:  # the kernel has ended already
            return None

    def close(self) -> None:
        """End it; kernels that Jupyter has not ended by then end within a second."""
        process, self._process = self._process, None
        self._answers = False
        if process is not None:
            self._channel.close()
            process.terminate()
            process.wait()


def main() -> None:
    """What the process does, with the number of its end of the channel as its argument."""
    del sys.path[0]  # the folder of this file; a kernel puts the one that it works in there
    channel = socket.socket(fileno=int(sys.argv[1]))
    try:
        from rds.panels.app.kernel import launch
    except ImportError:  # the server says what is not installed
        return
    with contextlib.suppress(Exception):  # whatever it is, the page says so
        from rds.bus.tools.mf4 import put_off_asammdf
        from rds.panels.registry import PANELS

        put_off_asammdf()
        for name in PANELS.names():
            PANELS.module(name)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # a kernel that has ended is gone at once
    parent = os.getpid()
    told = _fork_for_each(channel)
    if told is None:
        return
    end_with_parent()  # whatever a user's code holds; ipykernel looks now and then, in Python
    from rds.panels.session.background_pictures import begin_beside

    begin_beside()
    if os.getppid() == parent:
        launch([*told["arguments"], f"--IPKernelApp.parent_handle={parent}"])


def _fork_for_each(channel: socket.socket) -> dict[str, Any] | None:
    """In each forked process what it was told, ready to be a kernel; None in this one, at the end of the channel."""
    from rds.panels.session.background_pictures import IDLE, import_for_pictures

    gc.freeze()  # what all kernels have: no kernel goes through it, and so has a copy of it
    with channel, channel.makefile("r", encoding="utf-8") as lines:
        while line := lines.readline():
            pid = fork_quietly()
            if pid == 0:
                told: dict[str, Any] = json.loads(line)
                break
            channel.sendall(f"{pid}\n".encode())
            if not select.select([channel], [], [], IDLE)[0]:
                import_for_pictures()
                _get_compiled_ready()
                gc.freeze()
        else:
            return None
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    os.environ.clear()
    os.environ.update(told["env"])
    os.chdir(told["cwd"])
    if (numpy := sys.modules.get("numpy")) is not None:
        numpy.random.seed()  # or all kernels would draw the same
    return told


def _get_compiled_ready() -> None:
    """What numba does before it loads its first kernel from the disk: half a second of the first check of a program."""
    with contextlib.suppress(Exception):  # it is not installed, or another one
        from numba.core.registry import cpu_target

        cpu_target.typing_context.refresh()
        cpu_target.target_context.refresh()


if __name__ == "__main__":
    main()
