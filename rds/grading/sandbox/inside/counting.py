"""Counting the work of a run in events of the interpreter: lines, calls, returns, calls of compiled functions.

The same input gives the same count, on a busy computer too. What one compiled function does inside counts as one.

The count is begun before the submission is loaded, and kept in closures that nothing a submission can import, patch or
be handed leads to: what it does to `sys`, `os`, `json` or to this package comes too late. Each answer carries a seal
that only these closures and the grader know, so that nobody else can answer for them.
"""

from __future__ import annotations

import os
import resource
import sys
from collections.abc import Callable, Iterator, Sequence
from types import CodeType, FrameType, ModuleType
from typing import Any, NamedTuple

from rds.grading.sandbox.door import Closed
from rds.grading.sandbox.inside import kernel
from rds.grading.sandbox.records import OK, TOTAL, Layout

_NEVER = frozenset({"sys.settrace", "sys.setprofile", "sys._current_frames", "sys._current_exceptions", "os.fork"})
_NEVER_BEGINS = ("gc.", "ctypes.", "_thread.")
_NOT_IN_RUNS = frozenset({"sys._getframe"})  # while it is loaded, named tuples look for their module by it
_FRAMES = frozenset({"tb_frame", "gi_frame", "cr_frame", "ag_frame"})


class Counted(NamedTuple):
    """One run's count. `begin` it before the submission's first work, `stop` it before anything is explained.

    `receive` takes the next question (number, doubles), `send` gives its answer (number, code, doubles), `total` the
    answer to the question TOTAL: the events, or -1 where the counter was found gone.
    """

    begin: Callable[[], None]
    receive: Callable[[], tuple[Any, ...]]
    send: Callable[..., None]
    total: Callable[[], None]
    stop: Callable[[], None]


def counted(questions: int, answers: int, layout: Layout, seal: int, own: Sequence[ModuleType]) -> Counted:
    """Count from now on. The modules `own` ask and answer, and are not counted themselves."""
    # by these names, which a submission cannot exchange
    settrace, setprofile, gettrace, getprofile = sys.settrace, sys.setprofile, sys.gettrace, sys.getprofile
    read, write, identity, as_float, refusal = os.read, os.write, id, float, RuntimeError
    unpack, pack, asked, answered = layout.question.unpack, layout.answer.pack, layout.question.size, layout.answer.size
    padding = [0.0] * (layout.answers - 1)
    codes = {code: None for module in (*own, sys.modules[__name__]) for code in _codes(module)}
    uncounted = frozenset(map(identity, codes))
    events, before, runs, is_open = 0, 0, False, False

    def line(frame: FrameType, event: str, arg: Any) -> Any:
        nonlocal events
        if identity(frame.f_code) in uncounted:
            return None
        events += 1
        return line

    def call(frame: FrameType, event: str, arg: Any) -> None:
        nonlocal events
        if identity(frame.f_code) not in uncounted:
            events += 1

    def guard(event: str, args: tuple[Any, ...]) -> None:
        """Audit hook, which nobody can take away again."""
        if is_open:
            return
        is_frame = event == "object.__getattr__" and args[1] in _frames
        if event in _never or event.startswith(_begins) or (runs and (event in _in_runs or is_frame)):
            raise refusal(f"{event} is not allowed in a run whose work is counted")

    _never, _begins, _in_runs, _frames = _NEVER, _NEVER_BEGINS, _NOT_IN_RUNS, _FRAMES

    def begin() -> None:
        nonlocal before, runs
        before, runs = events, True

    def receive() -> tuple[Any, ...]:
        data = read(questions, asked)
        while len(data) != asked:
            part = read(questions, asked - len(data))
            if not part:
                raise Closed
            data += part
        return unpack(data)

    def send(number: int, code: int, *values: float) -> None:
        if write(answers, pack(number, code ^ seal, *values)) != answered:
            raise Closed

    def total() -> None:
        is_whole = gettrace() is line and getprofile() is call
        send(TOTAL, OK, as_float(events - before) if is_whole else -1.0, *padding)

    def stop() -> None:
        nonlocal is_open
        is_open = True
        settrace(None)
        setprofile(None)

    found = Counted(begin, receive, send, total, stop)
    sys.gettrace = sys.getprofile = lambda: None  # it looks like a run that is not counted
    sys.addaudithook(guard)
    is_open = True
    setprofile(call)
    settrace(line)
    is_open = False
    return found


def work_alone() -> None:
    """No thread and no child from here on, in which work would not be counted."""
    kernel.limit(resource.RLIMIT_NPROC, 1)


def _codes(module: ModuleType) -> Iterator[CodeType]:
    """The code of all functions and methods that a module defines, and of those inside them."""
    for value in [*vars(module).values()]:
        if getattr(value, "__module__", None) == module.__name__:
            for each in [value, *vars(value).values()] if isinstance(value, type) else [value]:
                code = getattr(getattr(each, "__func__", each), "__code__", None)
                if isinstance(code, CodeType):
                    yield from _with_inner(code)


def _with_inner(code: CodeType) -> Iterator[CodeType]:
    yield code
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _with_inner(each)
