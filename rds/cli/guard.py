"""A student's code must not end the command that runs it without a word.

Simulations run in the command's own process, so the command forks first: the child does everything, the parent waits.
Whatever the student's code does to the process - ends it, kills it, closes its files, leaves threads that never end -
the parent says what happened and gives the exit code. Where there is no fork (Windows) the command runs unguarded.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable
from typing import NoReturn

from rds.core.scheduling import end_with_parent

_LINGER = 2.0  # s that the child may take to end after its work is done
_SAID = b"done %d\n"
_INTERRUPTED = 130  # the exit code of what Ctrl-C ended, by the shell's custom


def guarded(command: Callable[[], int]) -> NoReturn:
    """Run `command` in a child process and exit with the code that it returns.

    Call it before anything heavy is imported or a thread is started.
    """
    if not hasattr(os, "fork"):
        sys.exit(command())
    sys.stdout.flush()
    sys.stderr.flush()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        os.setpgid(0, 0)  # so that a terminal's Ctrl-C comes once, from the parent
        end_with_parent()
        _work(command, writing)
    os.close(writing)
    _wait(child, reading)


def _work(command: Callable[[], int], writing: int) -> NoReturn:
    """The child: do it, say that it is done, end without asking anybody."""
    process = os.getpid()
    code = 1
    try:
        code = command()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except KeyboardInterrupt:
        code = _INTERRUPTED
    except BaseException:
        import traceback

        with contextlib.suppress(BaseException):
            traceback.print_exc()
    if os.getpid() != process:
        os._exit(0)  # a copy that the student's code made by os.fork(): its work is the original's
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()
    with contextlib.suppress(OSError):
        os.write(writing, _SAID % code)
    os._exit(code)


def _wait(child: int, reading: int) -> NoReturn:
    """The parent: pass signals on, wait for the word, give the exit code."""
    interrupted = 0  # by this signal

    def pass_on(number: int, _: object) -> None:
        nonlocal interrupted
        interrupted = number
        os.kill(child, number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, pass_on)
    said = b""
    while not said.endswith(b"\n"):
        try:
            part = os.read(reading, 64)
        except InterruptedError:
            continue
        if not part:
            break
        said += part
    if said.startswith(b"done "):
        code = int(said.split()[1])
        deadline = time.monotonic() + _LINGER
        while os.waitpid(child, os.WNOHANG) == (0, 0):
            if time.monotonic() > deadline:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                break
            time.sleep(0.01)
        if code == _INTERRUPTED:
            by = {0: "a KeyboardInterrupt", signal.SIGINT: "Ctrl-C"}
            by |= {number: number.name for number in (signal.SIGTERM, signal.SIGHUP)}
            sys.stderr.write(f"rds: stopped by {by[interrupted]}\n")
        os._exit(code)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        how = f"was ended by signal {-code} ({signal.Signals(-code).name})"
    else:
        how = f"ended with code {code} by itself, as os._exit() does, or closed its files"
    if interrupted:
        sys.stderr.write("rds: stopped\n")
        os._exit(_INTERRUPTED)
    sys.stderr.write(
        f"rds: the process that ran the student's code {how}; nothing was saved (a run against the clock goes "
        "on to its end, and keeps its record). control() and the model must only compute and return: remove what ends, "
        "kills or closes things\n"
    )
    sys.stderr.flush()
    os._exit(2)
