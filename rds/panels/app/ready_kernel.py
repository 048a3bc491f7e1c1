"""A kernel's process that has imported what every page needs before it is asked for.

Importing IPython and the panels takes about as long as importing the server. So the process is started first, and is
told its connection over its standard input, as a line of JSON, once the server has one. An end of input instead ends
it: the server has ended.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

LAUNCHER = ["-m", "ipykernel_launcher"]  # after the interpreter: how Jupyter starts such a kernel otherwise


class ReadyKernel:
    """One process, until it is taken or closed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parent,  # not the student's folder, whose files would be found before the libraries
            env=os.environ | {"JPY_PARENT_PID": str(os.getpid())},  # it ends with this process
            start_new_session=True,
        )

    def take(self, command: Sequence[str], env: Mapping[str, str], cwd: str | Path) -> subprocess.Popen[str] | None:
        """Let it become the kernel that `command` would start; None if it cannot, or has been taken."""
        if list(command[1:3]) != LAUNCHER:
            return None
        process, self._process = self._process, None
        if process is None or process.poll() is not None:
            return None
        assert process.stdin is not None
        told = {"arguments": list(command[3:]), "env": dict(env), "cwd": str(cwd)}
        try:
            with process.stdin:
                process.stdin.write(json.dumps(told) + "\n")
        except OSError:  # it has died meanwhile
            process.kill()
            process.wait()
            return None
        return process

    def close(self) -> None:
        """End it, unless it has been taken."""
        process, self._process = self._process, None
        if process is not None:
            process.terminate()
            process.communicate()


def main() -> None:
    """What the process does."""
    del sys.path[0]  # the folder of this file; the kernel puts the one that it works in there
    try:
        from ipykernel.kernelapp import IPKernelApp
    except ImportError:  # the server says what is not installed
        return
    with contextlib.suppress(Exception):  # whatever it is, the page says so
        from rds.panels import PANELS, shell  # noqa: F401

        for name in PANELS.names():
            PANELS.module(name)
    line = sys.stdin.readline()
    if not line:
        return
    told = json.loads(line)
    os.environ.clear()
    os.environ.update(told["env"])
    os.chdir(told["cwd"])
    IPKernelApp.launch_instance(argv=told["arguments"])


if __name__ == "__main__":
    main()
