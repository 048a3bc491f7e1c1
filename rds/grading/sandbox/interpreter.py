"""A warm interpreter in bubblewrap, from outside: started once for a set of packages, it forks one cell per request."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import IO, Any

from rds.grading.sandbox.bubblewrap import view
from rds.grading.sandbox.errors import SandboxError
from rds.grading.sandbox.seccomp_filter import submission_filter, warm_filter

_START = 120.0  # s that python-control may take to be imported on a busy computer


class Interpreter:
    """Forks submissions' processes on request. `preload` are the packages that it has imported; `user` 0 is the caller.

    SandboxError, with what bubblewrap said, if it does not start.
    """

    def __init__(self, preload: Sequence[str], user: int = 0):
        self.preload = tuple(preload)
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed with this object
        self._socket, inner = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        visible = view()
        order = {
            "user": user,
            "sources": [str(bind.source) for bind in visible.binds],
            "places": [bind.place for bind in visible.binds],
            "hidden": visible.hidden,
            "preload": [module for name in preload for module in MODULES.get(name, (name,))],
        }
        with inner, _memory(json.dumps(order).encode()) as order_file, _memory(warm_filter()) as warm_file:
            self._process = _launch([each.fileno() for each in (inner, order_file, warm_file)], self._said)
        with _memory(submission_filter()) as file:
            self._send(b"filter", [file.fileno()])
        self._socket.settimeout(_START)
        self._is_ready = False
        self.resident_bytes = 0  # of a fork that has done nothing yet

    def wait(self) -> None:
        """Until it has imported its packages; SandboxError if it ends before."""
        if self._is_ready:
            return
        try:
            data = self._socket.recv(1024)
        except OSError:
            data = b""
        if not data:
            self._end()
            said = self._last_words()
            self._said.close()
            raise SandboxError(f"the sandbox did not start: {said}")
        self.resident_bytes = int(json.loads(data)["resident_bytes"])
        self._is_ready = True

    def fork(self, request: Mapping[str, Any], fds: Sequence[int]) -> None:
        """A new cell with the inner ends `fds` of its channels (`inside.warm.ChannelEnds`)."""
        self.wait()
        self._send(json.dumps(request).encode(), fds)

    @property
    def is_alive(self) -> bool:
        """Whether its process still runs."""
        return self._process.poll() is None

    def close(self) -> None:
        """End it, and with it every process below it."""
        self._end()
        self._said.close()

    def _end(self) -> None:
        self._socket.close()
        self._process.kill()  # of bubblewrap, with which the kernel ends all that is in its namespace
        self._process.wait()

    def _send(self, data: bytes, fds: Sequence[int]) -> None:
        try:
            socket.send_fds(self._socket, [data], list(fds))
        except OSError:
            raise SandboxError(f"the warm interpreter is gone: {self._last_words()}") from None

    def _last_words(self) -> str:
        if self._said.closed:
            return "it was closed"
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        return lines[-1][:300] if lines else "it said nothing"


MODULES: Mapping[str, tuple[str, ...]] = {
    "matplotlib": ("matplotlib.pyplot",),  # which python-control has imported anyway
    "scipy": ("scipy.signal", "scipy.linalg", "scipy.optimize", "scipy.integrate", "scipy.interpolate"),
}
"""What is imported of a package; the package itself if nothing is said."""


@contextmanager
def _memory(data: bytes) -> Iterator[IO[bytes]]:
    """A file that holds `data`, for a process that is handed its descriptor."""
    with tempfile.TemporaryFile() as file:
        file.write(data)
        file.flush()
        file.seek(0)
        yield file


def _launch(fds: Sequence[int], said: Any) -> subprocess.Popen[bytes]:
    words = [sys.executable, "-s", "-P", "-m", "rds.grading.sandbox.launch", *map(str, fds)]
    return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=said, stderr=said, pass_fds=tuple(fds))
