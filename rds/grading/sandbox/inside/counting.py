"""Counting the work of a run in events of the interpreter: lines, calls, returns, calls of compiled functions.

The same input gives the same count, on a busy computer too. What one compiled function does inside counts as one. A
line of a hundred instructions, as of many statements, counts as several, and so do instructions that have no line.

The count is begun before the submission is loaded, and kept in closures that nothing a submission can import, patch or
be handed leads to: what it does to `sys`, `os`, `json` or to this package comes too late. It can come by what calls
them (the trace function of a frame, the argument of a function that it has patched), and so these show nothing of what
is inside. Real frames, through which lines could be left uncounted, cannot be had. Each answer carries a seal that only
these closures and the grader know, so that nobody else can answer for them.
"""

from __future__ import annotations

import _imp
import _signal  # type: ignore[import-not-found] # signal.signal is a wrapper around it
import gc
import os
import resource
import sys
import traceback
from _functools import _lru_cache_wrapper  # type: ignore[import-not-found] # not functools': that may be Python
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from types import CodeType, FrameType, ModuleType, SimpleNamespace, TracebackType
from typing import Any, NamedTuple

from rds.grading.sandbox.inside import kernel
from rds.grading.sandbox.records import OK, TOTAL, Layout
from rds.grading.sandbox.shared_channel import ChannelClosed

_TRACES = frozenset({"sys.settrace", "sys.setprofile"})
_LOOKS = frozenset({"sys._getframe", "sys._current_frames", "sys._current_exceptions"})
_NOT_TRACED = frozenset({"sys.addaudithook", "sys.monitoring.register_callback", "cpython.PyInterpreterState_New"})
_NEVER = _TRACES | _LOOKS | _NOT_TRACED | {"os.fork"}
_NEVER_BEGINS = ("gc.", "ctypes.", "_thread.")
_FRAMES = frozenset({"tb_frame", "gi_frame", "cr_frame", "ag_frame"})
_NO_MODULES = ("_test", "_xx")  # of Python's own tests: they reach into the interpreter
_AS_A_LINE = 25  # instructions: of a line with very many, so many count as one more
_FULL_LINE, _NO_LINE = 200, 8  # bytes of instructions; on one line, and on none (where a function begins, say)


class RunCount(NamedTuple):
    """One run's count. `begin` it before the submission's first work, `stop` it before anything is explained.

    `receive` takes the next question (number, doubles), `send` gives its answer (number, code, doubles), `total` the
    answer to the question TOTAL: the events, or -1 where the counter was found gone.
    """

    begin: Callable[[], None]
    receive: Callable[[], tuple[Any, ...]]
    send: Callable[..., None]
    total: Callable[[], None]
    stop: Callable[[], None]


def counted(questions: int, answers: int, layout: Layout, seal: int, own: Sequence[ModuleType]) -> RunCount:
    """Count from now on. The modules `own` ask and answer, and are not counted themselves."""
    # by these names, which a submission cannot exchange
    settrace, setprofile, gettrace, getprofile = sys.settrace, sys.setprofile, sys.gettrace, sys.getprofile
    getframe, create, attributes, as_int, text = sys._getframe, _imp.create_builtin, SimpleNamespace, int, str
    set_handler, is_function = _signal.signal, callable
    collect, collects = gc.collect, gc.isenabled()
    starts, last_part, exactly, length, call_tracing = str.startswith, str.rpartition, type, len, sys.call_tracing
    plain = str.__str__  # of a text of a class of its own, without the methods of that class
    read, write, identity, as_float, refusal = os.read, os.write, id, float, RuntimeError
    each_of, from_there, following, traces = iter, islice, next, TracebackType
    unpack, pack, asked, answered = layout.question.unpack, layout.answer.pack, layout.question.size, layout.answer.size
    padding = [0.0] * (layout.answers - 1)
    # with the codes themselves: that of a function which is exchanged would make room for another with its number
    uncounted = {identity(code): code for module in (*own, sys.modules[__name__]) for code in _codes(module)}
    there = frozenset(sys.builtin_module_names) & sys.modules.keys()
    events, since, before, runs, is_open, may_look, may_see, may_trace = 0, 0, 0, False, False, False, False, False
    known: dict[int, tuple[CodeType, bool]] = {}
    secret: int | None = seal

    def line(frame: FrameType, event: str, arg: Any) -> Any:
        nonlocal events, since
        code = frame.f_code
        if identity(code) in uncounted:
            return None
        if event == "opcode":
            since += 1
            if since < _AS_A_LINE:
                return tracing
        elif event == "call" and hides_work(code):
            frame.f_trace = tracing  # Python 3.13 looks for it here; else this call would not be traced by opcodes
            frame.f_trace_opcodes = True
        events += 1
        since = 0
        return tracing

    def hides_work(code: CodeType) -> bool:
        """Whether lines alone say too little of it: they hold very much, or instructions have none."""
        number = identity(code)
        if number not in known:
            sizes: dict[int | None, int] = {None: 0}
            hides, told = False, 0
            for first, end, at in code.co_lines():
                size = sizes[at] = sizes.get(at, 0) + end - first
                told += end - first
                hides |= size > (_NO_LINE if at is None else _FULL_LINE)
            hides |= told != length(code.co_code)  # its table of lines was cut
            known[number] = code, hides  # with the code itself, as above
        return known[number][1]

    def call(frame: FrameType, event: str, arg: Any) -> None:
        nonlocal events
        if identity(frame.f_code) not in uncounted:
            events += 1

    def guard(event: str, args: tuple[Any, ...]) -> None:
        """Audit hook, which nobody can take away again."""
        nonlocal may_look, may_see, may_trace
        if is_open:
            return
        if may_see and event == "object.__getattr__":
            may_see = False
            return
        if may_trace and event == "sys.settrace":
            may_trace = False
            return
        if may_look and event == "sys._getframe":
            may_look = False
            return
        # anybody can raise an event: a text of a class of its own would work when it is looked up
        is_frame = event == "object.__getattr__" and exactly(args[1]) is text and args[1] in _frames
        is_inner = event == "import" and starts(last_part(args[0], ".")[2], _inner)
        if is_frame or is_inner or event in _never or event.startswith(_begins):
            raise refusal(f"{args[1] if is_frame else plain(args[0]) if is_inner else event} {_said}")

    _never, _begins, _frames, _inner = _NEVER, _NEVER_BEGINS, _FRAMES, _NO_MODULES
    _said = "is not allowed in a run whose work is counted"

    def look(depth: int = 0) -> SimpleNamespace | None:
        """What named tuples, loggers and their like look for in frames, and not the frames."""
        nonlocal may_look
        level = as_int(depth) + 1
        may_look = True
        frame: FrameType | None = getframe(level)
        frames = []
        while frame is not None:
            frames.append(frame)
            frame = frame.f_back
        found = None
        while frames:
            frame = frames.pop()
            found = attributes(
                f_globals=frame.f_globals,
                f_code=frame.f_code,
                f_lineno=frame.f_lineno,
                f_lasti=frame.f_lasti,
                f_back=found,
            )
        return found

    def walk(tb: Any, whole: bool) -> Iterator[Any]:
        """What `traceback` looks for in the frames of an error, and not the frames; with their places if `whole`."""
        nonlocal may_see
        found: list[Any] = []
        while exactly(tb) is traces:
            may_see = True  # nothing of anybody's runs before the guard has seen it
            frame = tb.tb_frame
            may_see = False
            code, at, place = frame.f_code, tb.tb_lasti, None
            if whole:
                place = following(from_there(code.co_positions(), at // 2, None), None) if at >= 0 else None
                place = place if place and place[0] is not None else (tb.tb_lineno, *(place or (None,) * 4)[1:])
            shown = attributes(f_globals=frame.f_globals, f_code=code, f_lineno=tb.tb_lineno, f_lasti=at)
            found += ((shown, place if whole else tb.tb_lineno),)
            tb = tb.tb_next
        return each_of(found)

    def create_new(spec: Any) -> Any:
        """A module of the interpreter's own, but none a second time: it would have all that was exchanged in it."""
        name = spec.name
        if exactly(name) is not text or name in there:
            raise refusal(f"another {name} {_said}")
        return create(attributes(name=name))  # type: ignore[arg-type] # nothing else of it is read

    def handle(number: int, handler: Any) -> Any:
        """In place of `signal.signal`: no handler is given a frame, nor works uncounted within the count."""

        def interrupt(number: int) -> None:
            nonlocal may_trace
            if secret is not None:
                may_trace = True  # no finalizer runs meanwhile: garbage is collected between questions only
                try:
                    settrace(tracing)  # Python 3.11 needs it beside `call_tracing`
                finally:
                    may_trace = False
            handler(number, None)

        if is_function(handler):
            return set_handler(number, _hidden(lambda number, frame: call_tracing(interrupt, (number,))))
        return set_handler(number, handler)

    def begin() -> None:
        nonlocal before, runs
        if not runs:  # who begins again would take away what was counted
            before, runs = events, True

    def set_collects(value: bool) -> None:
        nonlocal collects
        collects = value

    def receive() -> tuple[Any, ...]:
        if collects:
            collect(0)
        data = read(questions, asked)
        while len(data) != asked:
            part = read(questions, asked - len(data))
            if not part:
                raise ChannelClosed
            data += part
        return unpack(data)

    def send(number: int, code: int, *values: float) -> None:
        if secret is None or write(answers, pack(number, code ^ secret, *values)) != answered:
            raise ChannelClosed

    def total() -> None:
        is_whole = gettrace() is tracing and getprofile() is calling
        send(TOTAL, OK, as_float(events - before) if is_whole else -1.0, *padding)

    def stop() -> None:
        """Everything is allowed from here on, but no further answer."""
        nonlocal is_open, secret
        is_open, secret = True, None
        settrace(None)
        setprofile(None)

    def quiet(set_it: Callable[..., None]) -> Any:
        """In place of `sys.settrace`: to take away what is not seen, as doctest does, takes nothing away."""

        def take(function: Any, /) -> None:
            if function is not None:
                set_it(function)  # refused by the guard

        return _hidden(take)

    tracing, calling = _hidden(line), _hidden(call)
    found = RunCount(*[_hidden(each) for each in (begin, receive, send, total, stop)])
    sys.gettrace = sys.getprofile = lambda: None  # it looks like a run that is not counted
    sys.settrace, sys.setprofile = quiet(settrace), quiet(setprofile)
    sys._getframe, _imp.create_builtin, _signal.signal = _hidden(look), _hidden(create_new), _hidden(handle)
    vars(traceback).update(
        walk_tb=_hidden(lambda tb: walk(tb, False)),
        _walk_tb_with_full_positions=_hidden(lambda tb: walk(tb, True)),
        _compute_suggestion_error=_hidden(
            lambda *_: None
        ),  # of a name that is not there: it looks for others in a frame
    )
    # Collected by itself, garbage would have its finalizers, and `gc.callbacks`, run within the trace function, where
    # nothing is counted.
    gc.disable()
    gc.enable, gc.disable = _hidden(lambda: set_collects(True)), _hidden(lambda: set_collects(False))
    gc.isenabled = _hidden(lambda: collects)
    sys.addaudithook(guard)
    is_open = True
    getframe().f_trace_opcodes = True  # from Python 3.12 on, none has it that is traced before the first one does
    setprofile(calling)
    settrace(tracing)
    is_open = False
    return found


def _hidden(function: Callable[..., Any]) -> Any:
    """What calls `function` and has no attribute that leads to it, as a function's own closure would.

    It is a cache without room, in C; without a name, as nobody calls `functools.update_wrapper`.
    """
    return _lru_cache_wrapper(function, 0, False, None)


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
