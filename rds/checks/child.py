"""A child process that is given a time limit, whose output is counted rather than kept, and that dies in time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import IO

_CHUNK = 65536
_PULSE = 0.1  # s
_KEPT = 400  # bytes of output, for the message
_GRACE = 2.0  # s for the pipes to run dry after the end


@dataclass
class Output:
    """What came out of one stream: how many lines, and how they began."""

    lines: int = 0
    start: bytes = b""

    def first_line(self) -> str:
        """The first line that is not empty, at most as long as what was kept."""
        lines = self.start.decode("utf-8", "replace").strip().splitlines()
        return lines[0] if lines else ""


@dataclass
class ChildEnd:
    """How a child came to its end; `code` is negative for a signal, None if it was stopped for its time."""

    code: int | None
    out: Output = field(default_factory=Output)
    err: Output = field(default_factory=Output)


def run_child(
    command: Sequence[str],
    time_limit: float,
    environment: Mapping[str, str],
    pulse: Callable[[], None] = lambda: None,
) -> ChildEnd:
    """Run `command` for `time_limit` s at most, with nothing on its stdin, and everything that it started.

    `pulse()` is called ten times a second meanwhile; what it raises ends the child.
    """
    posix = os.name == "posix"
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=dict(environment),
        start_new_session=posix,  # so that its children can be ended with it
    )
    ended = ChildEnd(None)
    assert process.stdout is not None and process.stderr is not None
    streams = ((process.stdout, ended.out), (process.stderr, ended.err))
    drains = [threading.Thread(target=_drain, args=pair, daemon=True) for pair in streams]
    for drain in drains:
        drain.start()
    try:
        deadline = time.monotonic() + time_limit
        while ended.code is None and time.monotonic() < deadline:
            pulse()
            with contextlib.suppress(subprocess.TimeoutExpired):
                ended.code = process.wait(_PULSE)
    finally:
        _end(process, posix)
        for drain in drains:
            drain.join(_GRACE)
    return ended


def _end(process: subprocess.Popen[bytes], posix: bool) -> None:
    if posix:
        with contextlib.suppress(ProcessLookupError, PermissionError):  # it is over, and left nothing behind
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()


def _drain(stream: IO[bytes], output: Output) -> None:
    with stream:
        while chunk := stream.read1(_CHUNK):  # type: ignore[attr-defined]
            output.lines += chunk.count(b"\n")
            output.start += chunk[: max(0, _KEPT - len(output.start))]
