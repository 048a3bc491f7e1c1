"""A process that draws pictures: it imports matplotlib, which takes longer than to simulate 10 s, while a run computes.

Without it, as in a notebook or where there is no fork (Windows), pictures are drawn where they are wanted. Light to
import, and so without `multiprocessing`, whose import takes away a tenth of what is won.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from typing import IO, Any, NoReturn

from rds.core.private_files import keep_process_private
from rds.core.scheduling import end_with_parent

_READY = b"\n"


@dataclass
class _Process:
    number: int
    asked: IO[bytes]
    answers: IO[bytes]
    is_ready: bool = False
    is_busy: bool = False  # it draws what nobody has waited for yet


_process: _Process | None = None  # the one of this program


def begin(module: str) -> None:
    """Start the process, which imports `module`. Call it before a thread is started, and before a student's code."""
    global _process
    if _process is not None or not hasattr(os, "fork"):
        return
    asked, ask = os.pipe()
    answers, answer = os.pipe()
    number = os.fork()
    if number == 0:
        os.close(ask)
        os.close(answers)
        _draw(module, os.fdopen(asked, "rb"), os.fdopen(answer, "wb"))
    os.close(asked)
    os.close(answer)
    _process = _Process(number, os.fdopen(ask, "wb"), os.fdopen(answers, "rb"))


def ready() -> None:
    """Wait until the process, if there is one, has imported all it needs: then it does nothing until it is asked."""
    if _process is None or _process.is_ready:
        return
    with suppress(OSError, ValueError):  # ValueError: a file that the student's code closed
        _process.is_ready = _process.answers.read(1) == _READY
    if not _process.is_ready:
        _end()


def asked(module: str, function: str, *arguments: Any) -> Callable[[], Any]:
    """Let the function of that name in `module` be called; what is returned waits for its answer, and gives it.

    It is called in the process if there is one that does nothing else, and otherwise here, once the answer is wanted.
    """
    ready()
    process = _process
    if process is None or process.is_busy:
        return lambda: getattr(import_module(module), function)(*arguments)
    try:
        process.asked.write(pickle.dumps((module, function, arguments)))
        process.asked.flush()
        process.is_busy = True
    except Exception:  # it was killed, or this cannot be pickled
        _end()

    def answer() -> Any:
        if process.is_busy:
            try:
                drawn = pickle.load(process.answers)
                process.is_busy = False
                return drawn
            except Exception:  # it ended, and what ended it is raised below, unless somebody has killed it
                _end()
        return getattr(import_module(module), function)(*arguments)

    return answer


def _end() -> None:
    global _process
    if _process is not None:
        for stream in (_process.asked, _process.answers):
            with suppress(OSError):  # somebody has closed its descriptor
                stream.close()
    _process = None


def _draw(module: str, asked: IO[bytes], answers: IO[bytes]) -> NoReturn:
    """In the process: until nobody can ask any more, or something cannot be drawn."""
    with suppress(BaseException):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is for the run
        end_with_parent()
        keep_process_private()  # matplotlib keeps a list of fonts
        import_module(module)
        answers.write(_READY)
        answers.flush()
        while True:
            named, function, arguments = pickle.load(asked)
            answers.write(pickle.dumps(getattr(import_module(named), function)(*arguments)))
            answers.flush()
    os._exit(0)
