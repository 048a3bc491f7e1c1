"""The budget of work is a count: the same each time, on a busy computer too, and not to be tampered with."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rds.core.types import LineSegment, Reference
from rds.grading.sandbox import Limits, Pool, WorkCounts
from rds.grading.sandbox.inside import counting, runs

Written = Callable[..., Path]
WORK = """
initial_state = [0.0]
def control(t, r, y, state, params):
    total = 0.0
    for n in range(ROUNDS):
        total += abs(r.position - y) * n
    return min(total, 1.0), [total]
"""


def counts(pool: Pool, path: Path, samples: int = 50) -> WorkCounts:
    """Of a run of as many samples."""
    with pool.open(path) as subject:
        subject.begin_control(T=1e-3)
        for k in range(samples):
            subject.control(k * 1e-3, Reference(k * 0.01, 0.0, 0.0), 0.0)
        return subject.counts


def test_more_work_is_more_events_in_proportion(pool: Pool, written: Written) -> None:
    few, more, most = (counts(pool, written(WORK.replace("ROUNDS", str(n)), "")).events or 0 for n in (0, 10, 20))
    assert few > 0
    assert more - few == most - more > 10 * 50 * 2  # rounds, samples, at least two lines each


# Later Pythons ask before they start a thread.
NO_THREAD = "can't start new thread" if sys.version_info < (3, 12) else "_thread.start"
CRAMMED = {
    "statements": "        " + "total = t * 2; " * 1000,
    "an expression": "        total = " + " + ".join(["t * 2"] * 1000),
    "instructions of no line": "        unplaced()",
    "a table of lines that was cut": "        untold()",
}
UNPLACED = """
def unplaced():
    n = 1000
    while n: n -= 1
count = len(unplaced.__code__.co_code) // 2
table = bytes(0x80 | 15 << 3 | min(8, count - at) - 1 for at in range(0, count, 8))  # "no location" for up to 8 each
untold_code = unplaced.__code__.replace(co_linetable=b"", co_exceptiontable=b"")
unplaced.__code__ = unplaced.__code__.replace(co_linetable=table)
def untold(): pass
untold.__code__ = untold_code
"""


FEWEST = dict.fromkeys(CRAMMED, 150)
if sys.version_info >= (3, 13):
    FEWEST["statements"] = 120  # of 3 instructions each instead of 4


@pytest.mark.parametrize("name", CRAMMED)
def test_work_is_not_hidden_between_lines(name: str, pool: Pool, written: Written) -> None:
    """A thousand small sums a sample, which on lines of their own would be a thousand events."""
    head = f"{UNPLACED}initial_state = ()\ndef control(t, r, y, state, params):\n    if t >= 0.0:\n"
    found = counts(pool, written(f"{head}{CRAMMED[name]}\n    return 1.0, state\n", ""), samples=3)
    assert (found.events or 0) > 3 * FEWEST[name], found


def test_work_is_not_hidden_in_a_function_that_is_new_each_time(pool: Pool, written: Written) -> None:
    text = "new = 'def work(t):\\n    total = t' + ' + t * 2' * 1000\ninitial_state = ()\n"
    text += "def control(t, r, y, state, params):\n    there = {}\n    exec(new, there)\n    there['work'](t)\n"
    found = counts(pool, written(f"{text}    return 1.0, state\n", ""), samples=3)
    assert (found.events or 0) > 3 * 150, found


def test_the_count_is_the_same_on_a_busy_computer(pool: Pool, written: Written) -> None:
    path = written(WORK.replace("ROUNDS", "20"), "")
    quiet = counts(pool, path)
    work = "import time\nwhile time.process_time() < 60: pass"  # an end of its own, should this test be killed
    busy = [subprocess.Popen([sys.executable, "-c", work]) for _ in range(4)]
    try:
        assert counts(pool, path) == counts(pool, path) == quiet
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert quiet.refused == ""


@pytest.mark.parametrize(
    ("attack", "said"),
    [
        ("import sys; sys.settrace(print)", "sys.settrace is not allowed"),
        ("import sys; sys.setprofile(print)", "sys.setprofile is not allowed"),
        ("import gc; gc.get_objects()", "gc.get_objects is not allowed"),
        ("import ctypes; ctypes.c_int.from_address(id(0))", "ctypes"),
        ("import os; os.fork()", "os.fork is not allowed"),
        ("import threading; threading.Thread(target=int).start()", NO_THREAD),
    ],
)
def test_who_reaches_for_the_counter_gets_no_count(attack: str, said: str, pool: Pool, written: Written) -> None:
    text = f"initial_state = ()\ndef control(t, r, y, state, params):\n    {attack}\n    return 1.0, state\n"
    found = counts(pool, written(text, ""), samples=2)
    assert found.events is None
    assert said in found.refused


def test_who_answers_otherwise_while_it_is_counted_gets_no_count(pool: Pool, written: Written) -> None:
    text = "import resource\ninitial_state = ()\ndef control(t, r, y, state, params):\n"
    text += "    return float(resource.getrlimit(resource.RLIMIT_NPROC)[0]), state\n"
    found = counts(pool, written(text, ""), samples=2)
    assert found == WorkCounts(2, None, "at t = 0.000 s it answered otherwise while it was counted")


FORGED = {
    "sys is patched": """
import sys
kept = []
sys.settrace = sys.setprofile = kept.append
sys.gettrace = sys.getprofile = lambda: kept[-1]
""",
    "the counter is another": """
import sys
for name, module in list(sys.modules.items()):
    if name.startswith("rds.grading.sandbox"):
        for word in ("counted", "RunCount", "counter", "_counted", "_codes"):
            if hasattr(module, word): setattr(module, word, lambda *a: None)
""",
    "what is told is another": """
import json, os
dumps, write = json.dumps, os.write
json.dumps = lambda value, *a, **k: dumps({**value, "events": 1} if "events" in value else value, *a, **k)
os.write = lambda number, data: write(number, bytes(data).replace(b'"events"', b'"nothing"'))
""",
    "numbers are others": """
import builtins
builtins.float = lambda *a: 0.5
builtins.RuntimeError = KeyError
""",
    "it looks whether it is counted": """
import sys
if sys.gettrace() or sys.getprofile(): control = lambda t, r, y, state, params: (min(abs(r.position - y), 1.0), state)
""",
}


FIND = """
import sys
found = {}
def look(function):
    code, cells = getattr(function, "__code__", None), getattr(function, "__closure__", None)
    found.update(zip(getattr(code, "co_freevars", ()), cells or ()))
def forget():
    if "events" not in found: return
    start = found.setdefault("start", found["events"].cell_contents)
    found["events"].cell_contents = found["before"].cell_contents if "before" in found else start
"""
# by a way to the counter: what is done before the work, and at every sample
WAYS = {
    "the trace function of a frame": ("look(getattr(sys._getframe(), 'f_trace', None))", "forget()"),
    "the trace function of a frame in a run": (
        "",
        "sys._getframe().f_back.f_trace = None; sys._getframe().f_trace_lines = False; forget()",
    ),
    "the frames above it": (
        """
frame = sys._getframe()
while frame:
    for value in list(getattr(frame, "f_locals", {}).values()):
        if type(value).__name__ == "RunCount": [look(each) for each in value]
    frame = frame.f_back
""",
        "forget()",
    ),
    "what the loop is handed": (
        """
runs = sys.modules["rds.grading.sandbox.inside.runs"]
begun = runs._begun
def taken(channel, layout, order, counted):
    for each in counted or (): look(each)
    if counted: found["begin"] = counted.begin
    return begun(channel, layout, order, counted)
runs._begun = taken
""",
        "forget()\n    if 'begin' in found: found['begin']()",
    ),
    "the class that holds it": (
        """
def total(self):
    look(tuple.__getitem__(self, 3))
    forget()
    return tuple.__getitem__(self, 3)
sys.modules["rds.grading.sandbox.inside.counting"].RunCount.total = property(total)
""",
        "",
    ),
    "a generator's own frame": (
        """
def steps():
    frame = sys._getframe()
    while True:
        frame.f_trace_lines = False
        (yield)
        for n in range(99):
            total = n
step = steps()
next(step)
""",
        "next(step); return min(abs(r.position - y), 1.0), state",
    ),
    "a handler's frame": (
        """
import signal
def quiet(number, frame): frame.f_trace_lines = False
try: signal.signal(signal.SIGUSR1, quiet)
except RuntimeError: pass
else: found["raise"] = signal.raise_signal
""",
        """if 'raise' in found:
        found['raise'](signal.SIGUSR1)
        for n in range(99):
            total = n
        return min(abs(r.position - y), 1.0), state""",
    ),
    "the frames of an error": (
        """
import traceback
class Error:
    tb_lasti, tb_lineno = 0, 1
    tb_frame = property(lambda self: found["error"].tb_frame)
    tb_next = property(lambda self: found["error"].tb_frame and None)
def quiet():
    try: raise ValueError
    except ValueError as error: found["error"] = error.__traceback__
    for trace in (found["error"], Error()):
        for walk in (traceback.walk_tb, traceback._walk_tb_with_full_positions):
            try:
                for frame, _ in walk(trace):
                    frame.f_trace_lines = False
                    while frame.f_back: frame = frame.f_back
            except (AttributeError, RuntimeError): pass
""",
        "quiet()\n    for n in range(30): total = n * n\n    return min(abs(r.position - y), 1.0), state",
    ),
    "an audit hook": (
        "sys.addaudithook(lambda event, args: work() if event == 'mine' else None)",
        "before = done[0]; sys.audit('mine')\n    if done[0] > before: return min(abs(r.position - y), 1.0), state",
    ),
    "an event whose name works when it is looked up": (
        """
class Name(str):
    def __hash__(self):
        work()
        return 1
name = Name()
""",
        "before = done[0]; sys.audit('object.__getattr__', None, name)\n"
        "    if done[0] > before: return min(abs(r.position - y), 1.0), state",
    ),
    "a module whose name works when it is told": (
        """
class Name(str):
    def __format__(self, spec):
        work()
        return "x"
name = Name("_testcapi")
""",
        "before = done[0]\n    try: sys.audit('import', name)\n    except RuntimeError: pass\n"
        "    if done[0] > before: return min(abs(r.position - y), 1.0), state",
    ),
    "a handler that interrupts the count": (
        """
import signal
signal.signal(signal.SIGALRM, lambda number, frame: work())
""",
        "before = done[0]; signal.setitimer(signal.ITIMER_REAL, 1e-6)\n    while done[0] == before: pass\n"
        "    return min(abs(r.position - y), 1.0), state",
    ),
    "another interpreter": (
        """
try:
    import _xxsubinterpreters
    other = _xxsubinterpreters.create()
except (ImportError, RuntimeError): other = None
""",
        "if other is not None:\n        _xxsubinterpreters.run_string(other, 'for n in range(9): pass')\n"
        "        return min(abs(r.position - y), 1.0), state",
    ),
    "another sys": (
        """
import _imp
from importlib.machinery import BuiltinImporter, ModuleSpec
try: look(_imp.create_builtin(ModuleSpec("sys", BuiltinImporter)).gettrace())
except RuntimeError: pass
""",
        "forget()",
    ),
    "a module of Python's tests": (
        """
try: import _testcapi
except (ImportError, RuntimeError): pass
else: found["call"] = _testcapi.run_in_subinterp
""",
        "if 'call' in found: found['call']('for n in range(9): pass'); return min(abs(r.position - y), 1.0), state",
    ),
    "the number of a code that is gone": (
        """
import types
import rds.core.values
numbers, own = {}, work.__code__
for each in [*vars(rds.core.values).values()]:
    if isinstance(each, types.FunctionType) and each.__module__ == "rds.core.values":
        numbers[id(each.__code__)] = len(each.__code__.co_code)
        each.__code__ = each.__code__.replace(co_name="another")
kept = []
for size in numbers.values():  # as large as one that has just gone, so that it lies where that lay
    room = bytes([9, 0]) * max((size - len(own.co_code)) // 2, 0)
    kept += [own.replace(co_code=own.co_code + room, co_name=f"w{n}") for n in range(20)]
for code in kept:
    if id(code) in numbers: work = types.FunctionType(code, globals())
""",
        "work(); return min(abs(r.position - y), 1.0), state",
    ),
}
LAZY = """
initial_state = 0
done = [0]
def work():
    done[0] += 1
    for n in range(30): total = n * n
def control(t, r, y, state, params):
    BODY
    work()
    return min(abs(r.position - y), 1.0), state
"""


def test_the_attacks_reach_for_the_counter_by_its_name() -> None:
    """Of a class that is called otherwise by now they would find nothing, and prove nothing."""
    name = counting.RunCount.__name__
    told = (WAYS["the frames above it"][0], WAYS["the class that holds it"][0], FORGED["the counter is another"])
    assert all(name in text for text in told) and callable(runs._begun)


@pytest.mark.parametrize("way", WAYS)
def test_no_way_leads_to_the_counter(way: str, pool: Pool, written: Written) -> None:
    """Work of 30 rounds is counted as such, or the count is refused."""
    before, body = WAYS[way]
    text = FIND + LAZY.replace("BODY", body or "pass") + before
    found = counts(pool, written(text, ""), samples=10)
    assert found.refused or (found.events or 0) > 10 * 30, found


def test_what_python_itself_asks_frames_for_is_there(pool: Pool, written: Written) -> None:
    text = """
import collections, enum, logging, signal, sys, traceback, typing, warnings
try: print_twice(traceback)
except NameError as error: traceback.print_exc(); known = error.__traceback__
assert traceback.extract_tb(known)[0][:3] == (__file__, 3, "<module>")
assert [line for _, line in traceback.walk_tb(known)] == [3]
logging.basicConfig(filename="log.txt", level=logging.DEBUG, format="%(funcName)s %(message)s")
frame, names = sys._getframe(), []
while frame is not None:
    names.append(frame.f_globals["__name__"])
    frame = frame.f_back
assert names[0] == __name__ and len(names) > 3
heard = []
signal.signal(signal.SIGUSR1, lambda number, frame: heard.append(number))
Pair = collections.namedtuple("Pair", "a b")
Mode = enum.Enum("Mode", "ON OFF")
Other = typing.NamedTuple("Other", [("a", int)])
T = typing.TypeVar("T")
assert Pair.__module__ == Mode.__module__ == Other.__module__ == T.__module__ == __name__
warnings.warn("only a word")
import array, zlib
initial_state = ()
def control(t, r, y, state, params):
    warnings.warn("another")
    signal.raise_signal(signal.SIGUSR1)
    logging.debug("a sample")
    assert open("log.txt").read().startswith("control a sample")
    try: [][0]
    except IndexError: logging.exception("no number")
    Inner = collections.namedtuple("Inner", "a")
    return float(Pair(1.0, Mode.ON).a), state
"""
    found = counts(pool, written(text, ""), samples=3)
    assert found.events and not found.refused


def test_nothing_is_allowed_while_a_handler_is_made_ready(pool: Pool, written: Written) -> None:
    """A finalizer may be run at any allocation, and between any two instructions."""
    text = """
import gc, signal
reached, kept, left, more, after = [], [], [0], [0], [0]
class Trap:
    def __del__(self):
        try: reached.append(len(gc.get_objects()))
        except RuntimeError: pass
        left[0] -= 1
        if left[0] > 0: set_trap()
def set_trap():
    kept.append([[] for _ in range(more[0])])
    trap = Trap()
    trap.me = trap
    del trap
    gc.set_threshold(gc.get_count()[0] + after[0] if after[0] else 1)
signal.signal(signal.SIGUSR1, lambda number, frame: None)
initial_state = ()
def control(t, r, y, state, params):
    for n in range(198):
        left[0], more[0], after[0] = 400, n // 66, n // 11 % 6
        kept.clear()
        gc.set_threshold(100000)
        gc.collect()
        set_trap()
        gc.set_threshold(gc.get_count()[0] + 1 + n % 11)
        signal.raise_signal(signal.SIGUSR1)
        left[0] = 0
        gc.set_threshold(100000)
    return float(bool(reached)), state  # without a count all is allowed
"""
    found = counts(pool, written(text, ""), samples=1)
    assert "answered otherwise while it was counted" in found.refused


def test_what_runs_when_garbage_is_collected_is_counted(pool: Pool, written: Written) -> None:
    """The count looks at each new function, which takes memory; a collection then would be within the count itself."""
    text = """
import gc
kept, done = [], [0]
def pause(): pass
def collected(phase, info):
    gc.disable()
    gc.callbacks.clear()
    for n in range(300): total = n
    done[0] += 1
initial_state = ()
def control(t, r, y, state, params):
    gc.collect()
    pause.__code__ = pause.__code__.replace(co_firstlineno=len(kept) + 1)
    kept.append(pause.__code__)
    gc.set_threshold(1)
    gc.callbacks.append(collected)
    gc.enable()
    pause()
    if done[0] < len(kept): collected("stop", {})
    gc.set_threshold(100000)
    return 1.0, state
"""
    found = counts(pool, written(text, ""), samples=10)
    assert (found.events or 0) > 10 * 300, found


def test_who_takes_away_what_is_not_seen_is_counted_all_the_same(pool: Pool, written: Written) -> None:
    """As doctest does, which puts back what `sys.gettrace` has said."""
    plain = WORK.replace("ROUNDS", "10")
    text = plain.replace("    total = 0.0\n", "    total = 0.0\n    sys.settrace(None), sys.setprofile(None)\n")
    found = counts(pool, written(f"import sys\n{text}", ""), samples=10)
    assert (found.events or 0) >= (counts(pool, written(plain, ""), samples=10).events or 0) > 10 * 10 * 2
    tested = 'import doctest\ndef twice(x):\n    """\n    >>> twice(2)\n    4\n    """\n    return 2 * x\n'
    tested += "doctest.testmod()\ndoctest.run_docstring_examples(twice, globals())\n"
    assert counts(pool, written(plain + tested, ""), samples=10) == counts(pool, written(plain, ""), samples=10)


def test_a_file_that_cannot_be_loaded_while_it_is_counted_is_told_why(pool: Pool, written: Written) -> None:
    found = counts(pool, written("import threading\nthreading.Thread(target=int).start()\n"), samples=1)
    assert found.events is None
    assert f"line 2, in <module>: RuntimeError: {NO_THREAD}" in found.refused


@pytest.mark.parametrize("name", FORGED)
def test_what_is_patched_while_it_is_loaded_lowers_no_count(name: str, pool: Pool, written: Written) -> None:
    work = WORK.replace("ROUNDS", "10")
    forged = counts(pool, written(work, FORGED[name]), samples=10)
    assert (forged.events or 0) >= (counts(pool, written(work, ""), samples=10).events or 0) > 10 * 10 * 2


def test_who_answers_in_place_of_the_counter_gets_no_count(pool: Pool, written: Written) -> None:
    """It finds the pipes and goes on by itself, but nobody has told it the seal."""
    text = """
import os, resource, struct
initial_state = ()
def control(t, r, y, state, params):
    if resource.getrlimit(resource.RLIMIT_NPROC)[0] == 1:
        there = [number for number in range(3, 64) if is_open(number)]
        for k in range(2): os.write(there[1], struct.pack("<QQd", k, 0, 1.0)); os.read(there[0], 48)
        os.write(there[1], struct.pack("<QQd", (1 << 64) - 1, 0, 1.0))
        os._exit(0)
    return 1.0, state
def is_open(number):
    try: os.fstat(number)
    except OSError: return False
    return True
"""
    assert counts(pool, written(text, ""), samples=2) == WorkCounts(
        2, None, "while it was counted: it wrote into the grader's pipe"
    )


def test_work_that_is_put_off_is_counted(pool: Pool, written: Written) -> None:
    """In what an answer does when it is looked at, and in rows that are all made at once."""
    text = """
initial_state = ()
class Later(float):
    def __float__(self):
        for n in range(100): pass
        return 1.0
def control(t, r, y, state, params): return Later(1.0), state
def interpolate(segment, T, params):
    rows = []
    for n in range(100): rows.append(([0.1], [0.0], [0.0]))
    return rows
"""
    path = written(text, "")
    assert (counts(pool, path, samples=5).events or 0) > 5 * 100
    with pool.open(path, kind="interpolator") as subject:
        assert len(list(subject.rows(LineSegment((0.0,), (1.0,), 1.0), 1e-3))) == 100
        assert (subject.counts.events or 0) > 2 * 100


def test_a_counted_run_may_not_take_much_longer_than_the_first(pool: Pool, written: Written) -> None:
    """Not ten times the limits, where the run itself took a hundredth of them."""
    with pool.open(written(""), Limits(cpu_seconds=30.0)) as subject:
        subject.begin_control()
        subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
        assert subject.counts.events
        assert 30.0 <= subject._generous().cpu_seconds < 100.0


def test_all_counted_runs_together_have_one_limit(pool: Pool, written: Written) -> None:
    """Who takes its time only while it is counted does so once, and not once more in each run of each case."""
    text = """
import resource, time
initial_state = ()
def control(t, r, y, state, params):
    if resource.getrlimit(resource.RLIMIT_NPROC)[0] == 1: time.sleep(0.45)
    return 1.0, state
"""
    with pool.open(written(text, ""), Limits(wall_seconds=0.1)) as subject:
        found = []
        for _ in range(3):
            subject.begin_control()
            subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
            found.append(subject.counts)
    assert found[0].events and found[2].events is None
    assert found[2].refused == "while it was counted: it took more than 1 s in all"


def test_models_and_interpolators_are_counted_too(pool: Pool, written: Written) -> None:
    text = "def derivatives(t, x, u, params): return [x[1], u[0] - x[1]]\n"
    with pool.open(written(text, ""), kind="model") as subject:
        subject.begin_model(T=1e-3)
        for _ in range(10):
            subject.advance(1.0)
        assert subject.count(5).calls == 5
        first = subject.counts
        assert first.calls == 10
        assert first.events is not None
        assert first.events > 40
