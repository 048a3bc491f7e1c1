"""Counting the work of a call in events of the interpreter: lines, calls, returns, calls of compiled functions.

The same input gives the same count, on a busy computer too. What one compiled function does inside counts as one.
"""

from __future__ import annotations

import resource
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

from rds.grading.sandbox.inside import kernel
from rds.grading.sandbox.inside.channel import Channel

_FORBIDDEN = frozenset({"sys.settrace", "sys.setprofile", "sys._current_frames", "sys._getframe", "os.fork"})
_FORBIDDEN_PREFIXES = ("gc.", "ctypes.", "_thread.")


class Count:
    """Events so far. `around` wraps a function so that its events are counted."""

    def __init__(self) -> None:
        self.events = 0
        self.is_whole = True  # false once the tracer was found gone

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """`function`, counted."""
        return function

    def tell(self, channel: Channel) -> None:
        """Say what was counted."""
        channel.tell({"events": self.events, "is_whole": self.is_whole})


class _Tracing(Count):
    def __init__(self) -> None:
        super().__init__()
        self._guard = _Guard()
        sys.addaudithook(self._guard)

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        events, guard = 0, self._guard
        # by these names, which a submission cannot exchange
        settrace, setprofile, gettrace, getprofile = sys.settrace, sys.setprofile, sys.gettrace, sys.getprofile

        def line(frame: FrameType, event: str, arg: Any) -> Any:
            nonlocal events
            events += 1
            return line

        def call(frame: FrameType, event: str, arg: Any) -> None:
            nonlocal events
            events += 1

        def counted(*args: Any) -> Any:
            nonlocal events
            events = 0
            setprofile(call)
            settrace(line)
            guard.is_closed = True
            try:
                return function(*args)
            finally:
                guard.is_closed = False
                self.is_whole = self.is_whole and gettrace() is line and getprofile() is call
                settrace(None)
                setprofile(None)
                self.events += events

        return counted


class _Guard:
    """Audit hook: while a submission's work is counted, it may not reach for the counter, nor work elsewhere."""

    def __init__(self) -> None:
        self.is_closed = False

    def __call__(self, event: str, args: tuple[Any, ...]) -> None:
        if self.is_closed and (event in _FORBIDDEN or event.startswith(_FORBIDDEN_PREFIXES)):
            raise RuntimeError(f"{event} is not allowed in a run whose work is counted")


def work_alone() -> None:
    """No thread and no child from here on, in which work would not be counted."""
    kernel.limit(resource.RLIMIT_NPROC, 1)


def counter(is_on: bool) -> Count:
    """A counter for one run; it counts only if `is_on`."""
    return _Tracing() if is_on else Count()
