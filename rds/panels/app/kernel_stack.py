"""Where a user's code is in a kernel that does not answer: it is asked by a signal, which needs no Python to be heard.

Python's faulthandler answers from the signal itself, so also where one call into compiled code holds the interpreter.
"""

from __future__ import annotations

import faulthandler
import os
import re
import signal
import time
from pathlib import Path
from typing import Any

from rds.core.traceback_frames import is_installed

_FRAME = re.compile(r'^  File "(.+)", line (\d+) in (.+)$')
_PATIENCE = 3.0  # s for an answer, on a busy computer
_QUIET = 0.5  # s without another line, after which an answer is taken for whole
_POLL = 0.02  # s
_MOST = 1 << 20  # bytes of an answer that are read


def answer_asks(folder: Path) -> None:
    """Let this process say where its threads are whenever `ask` asks it. Does nothing where signals cannot do that."""
    if not hasattr(faulthandler, "register"):
        return
    begun = folder / f"{os.getpid()}.new"
    # it stays open: the signal's handler writes to its descriptor
    descriptor = os.open(begun, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND | os.O_CLOEXEC, 0o600)
    faulthandler.register(signal.SIGUSR1, descriptor, all_threads=True)
    begun.rename(folder / str(os.getpid()))  # only who has this file is asked: the signal would end others


def ask(process: Any, folder: Path) -> str | None:
    """The line of a user's own code that `process` (a Popen) is at, as in "file.py, line 3, in control()".

    Empty where it is in none, or cannot say; None if it is over, or has not shown a page. Takes some hundredths of a
    second, and _PATIENCE at most.
    """
    said = folder / str(process.pid)
    if process.poll() is not None:
        return None
    if not said.is_file():
        return None if hasattr(faulthandler, "register") else ""
    os.truncate(said, 0)
    process.send_signal(signal.SIGUSR1)
    begun = heard = time.monotonic()
    text = ""
    while (now := time.monotonic()) - begun < _PATIENCE and not (text and now - heard > _QUIET):
        time.sleep(_POLL)
        before, text = text, _read(said)
        if line := own_line(text):  # what comes after it is of other threads
            return line
        if text != before:
            heard = now
    return ""


def _read(said: Path) -> str:
    """The whole lines that are there: they come in pieces."""
    with said.open("rb") as stream:
        return stream.read(_MOST).rpartition(b"\n")[0].decode("utf-8", "replace")


def own_line(threads: str) -> str:
    """The innermost line of a user's own file in what faulthandler writes of all threads; empty if there is none."""
    for line in threads.splitlines():
        if (found := _FRAME.match(line)) and not found[1].startswith("<") and not is_installed(found[1]):
            return f"{Path(found[1]).name}, line {found[2]}, in {found[3]}{'' if found[3].startswith('<') else '()'}"
    return ""
