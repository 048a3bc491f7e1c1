"""Work with a user's code in it, which can be ended where it is: a loop without an end in it hears of no request."""

from __future__ import annotations

import contextlib
import ctypes
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

T = TypeVar("T")
PATIENCE = 1.0  # s in which work that was asked to end may do so by itself
LIMIT = 60.0  # s for one step of a user's code, such as running a file's top level, or one call
_POLL = 0.05  # s


class Endless(BaseException):
    """Raised in a user's code that was asked to end and did not. No Exception, which such code may catch and go on."""

    def __init__(self, seconds: float | None = None) -> None:
        when = "when it was asked to end" if seconds is None else f"after {seconds:g} s"
        super().__init__(f"it was still here {when}; look for a loop without an end")


def interruptible(
    work: Callable[[], T],
    asked: Callable[[], bool],
    steps: Callable[[], Any] = lambda: None,
    patience: float = PATIENCE,
) -> T:
    """`work()` in a thread of its own, and its answer or error.

    Once `asked()` is true, and `steps()` has not changed for `patience` s, Endless is raised in it, at the line where
    it is, until it ends. A single call into compiled code that takes long ends only when that returns.
    """
    answer: list[T] = []
    errors: list[BaseException] = []

    def go() -> None:
        try:
            answer.append(work())
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=go, name="rds interruptible", daemon=True)
    thread.start()
    last, since = steps(), time.monotonic()
    while thread.is_alive():
        thread.join(_POLL)
        now, step = time.monotonic(), steps()
        if step != last or not asked():
            last, since = step, now
        elif now - since > patience:
            _raise_in(thread, Endless)
            since = now
    if answer:
        return answer[0]
    raise errors[0] if errors else Endless()  # none where it was interrupted once more while it ended


@contextlib.contextmanager
def limited(steps: Callable[[], Any] = lambda: None, seconds: float | None = None) -> Iterator[None]:
    """Endless is raised in what is done here, at the line where it is, once `steps()` has not changed for `seconds`.

    By default for `LIMIT`. A single call into compiled code that takes long ends only when that returns. Where no
    thread can be started there is no limit.
    """
    limit = LIMIT if seconds is None else seconds
    here, ended, lock = threading.current_thread(), threading.Event(), threading.Lock()
    was_late = False

    class Overdue(Endless):
        def __init__(self) -> None:
            super().__init__(limit)

    def look() -> None:
        nonlocal was_late
        last, since = steps(), time.monotonic()
        while not ended.wait(min(max(since + limit - time.monotonic(), _POLL), limit)):
            now, step = time.monotonic(), steps()
            if step != last:
                last, since = step, now
            elif now - since >= limit:
                with lock:
                    if not ended.is_set():
                        was_late = True
                        _raise_in(here, Overdue)
                since = now - limit + PATIENCE  # once more if the code has caught it

    def over() -> None:
        with lock:
            ended.set()

    watcher = threading.Thread(target=look, name="rds limit", daemon=True)
    with contextlib.suppress(RuntimeError):
        watcher.start()
    try:
        yield
    finally:
        try:
            over()
        finally:  # The error may have come within `over`: unless it is set, the watcher raises it for ever.
            over()
            if was_late:
                _take_back(here)


class _TakenBack(BaseException):
    """Stands in for an error that came too late."""


def _take_back(here: threading.Thread) -> None:
    """Another error in place of one that has not been raised yet in this thread, caught at once.

    Taking it back by NULL, as Python offers, leaves CPython 3.11 believing that an error is due: under a debugger or a
    profiler it then looks for it for ever.
    """
    try:
        _raise_in(here, _TakenBack)
        while True:
            time.sleep(0.0)
    except _TakenBack:
        pass


def _raise_in(thread: threading.Thread, error: type[BaseException]) -> None:
    if thread.ident is not None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(error))


class SignalEvent(threading.Event):
    """An event that a signal's handler may set in the thread that waits for it.

    A handler runs between two steps of whatever its thread does. `threading.Event.set` takes a lock there that the
    interrupted `wait` or `set` may hold: the thread would wait for itself without end, and hear no further signal.
    """

    def __init__(self) -> None:
        super().__init__()
        self._was_set = False

    def set(self) -> None:
        """No lock, so that nothing can be waited for."""
        self._was_set = True

    def clear(self) -> None:
        """Not set any more."""
        self._was_set = False

    def is_set(self) -> bool:
        """Whether somebody has set it."""
        return self._was_set

    def wait(self, timeout: float | None = None) -> bool:
        """Until it is set, or `timeout` s have passed; noticed within 0.05 s."""
        end = None if timeout is None else time.monotonic() + timeout
        while not self._was_set:
            left = _POLL if end is None else min(_POLL, end - time.monotonic())
            if left <= 0.0:
                break
            time.sleep(left)
        return self._was_set


def ending_signals() -> list[signal.Signals]:
    """What ends a program in order: Ctrl-C, a polite kill, and a closed terminal, which under nohup is ignored."""
    found = [signal.SIGINT, signal.SIGTERM]
    hangup = getattr(signal, "SIGHUP", None)  # not on Windows
    if hangup is not None and signal.getsignal(hangup) is not signal.SIG_IGN:
        found.append(hangup)
    return found


@contextlib.contextmanager
def set_by_signals(stop: threading.Event) -> Iterator[None]:
    """Each of `ending_signals` sets the event, so that what waits for it ends in order. In a main thread only."""
    before = {number: signal.signal(number, lambda *_: stop.set()) for number in ending_signals()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
