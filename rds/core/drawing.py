"""A process that draws pictures: it imports matplotlib, which takes longer than to simulate 10 s, while a run computes.

Without it, as in a notebook or where there is no fork (Windows), pictures are drawn where they are wanted. Light to
import, and so without `multiprocessing`, whose import takes away a tenth of what is won.
"""

from __future__ import annotations

import os
import pickle
import signal
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
    global _process
    if _process is None or _process.is_ready:
        return
    with suppress(OSError, ValueError):  # ValueError: a file that the student's code closed
        _process.is_ready = _process.answers.read(1) == _READY
    if not _process.is_ready:
        _process = None


def drawn(module: str, function: str, *arguments: Any) -> Any:
    """What the function of that name in `module` returns: called in the process if there is one, else here."""
    global _process
    ready()
    if _process is not None:
        try:
            _process.asked.write(pickle.dumps((module, function, arguments)))
            _process.asked.flush()
            is_drawn, answer = pickle.load(_process.answers)
            if is_drawn:
                return answer
        except Exception:  # it was killed, or this cannot be pickled: no reason to have no picture
            _process = None
    return getattr(import_module(module), function)(*arguments)


def _draw(module: str, asked: IO[bytes], answers: IO[bytes]) -> NoReturn:
    """In the process: until nobody can ask any more."""
    with suppress(BaseException):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is for the run
        end_with_parent()
        keep_process_private()  # matplotlib keeps a list of fonts
        import_module(module)
        answers.write(_READY)
        answers.flush()
        while True:
            answers.write(pickle.dumps(_answer(asked)))
            answers.flush()
    os._exit(0)


def _answer(asked: IO[bytes]) -> tuple[bool, Any]:
    """Whether it could be drawn, and what: an error is raised where the same is tried again, with its own traceback."""
    try:
        module, function, arguments = pickle.load(asked)
        return True, getattr(import_module(module), function)(*arguments)
    except EOFError:
        raise
    except Exception:
        return False, None
