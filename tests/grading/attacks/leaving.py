"""Ending what it should not: its own process, others, the grader; and not ending when it should."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

import sys

from rds.grading.grade import Status
from tests.grading.attacks import Attack, in_control

KILLED, TIMED_OUT, LOAD, CONTRACT = Status.KILLED, Status.TIMED_OUT, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT

_IGNORE = """
import signal
for number in range(1, 65):
    try: signal.signal(number, signal.SIG_IGN)
    except (OSError, ValueError): pass
"""
_OTHERS = """
import os, signal
reached = []
for number in [*range(-400, -2), *range(3, 3000)]:
    try:
        os.kill(number, 9)
        reached.append(number)
    except (ProcessLookupError, PermissionError): pass
assert reached == [], reached
"""

ATTACKS = {
    "sys.exit while loading": Attack("import sys; sys.exit(0)", LOAD, "SystemExit"),
    "sys.exit in a sample": Attack(in_control("sys.exit(0)"), CONTRACT, "SystemExit"),
    "quit": Attack("raise SystemExit('all tests passed')", LOAD, "SystemExit"),
    "os._exit with success": Attack("import os; os._exit(0)", KILLED, "exit code 0"),
    "os._exit in a sample": Attack(in_control("os._exit(0)"), KILLED, "exit code 0"),
    "an exception of no known kind": Attack(
        in_control("raise type('Unknown', (BaseException,), {})()"), CONTRACT, "Unknown"
    ),
    "an exception of no known kind while loading": Attack("raise GeneratorExit('done')", LOAD, "GeneratorExit: done"),
    "as if somebody pressed Ctrl-C": Attack(in_control("raise KeyboardInterrupt"), CONTRACT, "KeyboardInterrupt"),
    "stops itself, as Ctrl-Z would": Attack(
        in_control("import signal\nos.kill(os.getpid(), signal.SIGSTOP)"), TIMED_OUT, "no answer"
    ),
    "stops all that it can reach": Attack(
        in_control("import signal\nos.kill(-1, signal.SIGSTOP)"), CONTRACT, "No such"
    ),
    "an exception named like a page, whose text is long": Attack(
        in_control(
            "name = '<script>alert(1)</script>\\x1b[2J=HYPERLINK(1)'\nraise type(name, (Exception,), {'__str__': lambda s: '\\u202e</pre><img src=x>' * 10**5})()"
        ),
        CONTRACT,
        r"(?s)\A[^\x1b\u202e]{,700}\Z",  # cut, and without what moves a cursor
    ),
    "an exception whose text leaves": Attack(
        in_control("class Odd(Exception):\n    def __str__(self): raise SystemExit\nraise Odd"), CONTRACT, "Odd"
    ),
    "an exception whose text fails": Attack(
        in_control("class Odd(Exception):\n    def __str__(self): raise ValueError\nraise Odd"), CONTRACT, "Odd"
    ),
    "an exception whose text never ends": Attack(
        in_control("class Odd(Exception):\n    def __str__(self):\n        while True: pass\nraise Odd"),
        TIMED_OUT,
        "no answer",
    ),
    "abort": Attack("import os; os.abort()", KILLED, "SIGABRT"),
    "kill itself": Attack(in_control("os.kill(os.getpid(), 9)"), KILLED, "SIGKILL"),
    "kill everybody": Attack("import os, time\nif os.fork(): os.kill(-1, 9)\ntime.sleep(60)", TIMED_OUT, "no answer"),
    "kill its group": Attack("import os; os.killpg(0, 9)", KILLED, "SIGKILL"),
    "kill the init above it": Attack(
        "import os\nfor number in range(1, 65):\n    if number != 19:\n        os.kill(1, number)\nimport time; time.sleep(0.05)"
    ),
    "kill the grader by its parent's number": Attack("import os\nassert os.getppid() == 1\nos.kill(os.getppid(), 9)"),
    "kill others by their numbers": Attack(_OTHERS),
    "stop itself": Attack(in_control("os.kill(os.getpid(), 19)"), TIMED_OUT, "no answer"),
    "end the first thread and leave another": Attack(
        "import ctypes, threading, time\nthreading.Thread(target=time.sleep, args=(600,)).start()\n"
        "ctypes.CDLL(None).syscall(60, 0)",
        TIMED_OUT,
        "no answer",
    ),
    "close every descriptor": Attack(in_control("os.closerange(0, 64); time.sleep(600)"), TIMED_OUT, "no answer"),
    "ignore every signal": Attack(_IGNORE + "while True: pass", TIMED_OUT, "no answer|computing time"),
    "handlers that go on": Attack(
        "import signal\nfor number in (15, 24, 14, 2): signal.signal(number, lambda *a: None)\nwhile True: pass",
        TIMED_OUT,
        "no answer|computing time",
    ),
    "endless loop while loading": Attack("while True: pass", TIMED_OUT, "no answer"),
    "endless loop in a sample": Attack(in_control("while True: pass"), TIMED_OUT, "no answer"),
    "sleep in a sample": Attack(in_control("time.sleep(600)"), TIMED_OUT, "no answer"),
    "endless loop in compiled code": Attack("sum(iter(int, 1))", TIMED_OUT, "no answer"),
    "an endless product": Attack("x = 7 ** (10 ** 9)", TIMED_OUT, "no answer"),
    "a regular expression that never ends": Attack(
        "import re; re.match(r'(a+)+$', 'a' * 60 + 'b')", TIMED_OUT, "no answer"
    ),
    "a loop in params": Attack(
        "class P(dict):\n    def keys(self):\n        while True: pass\n    items = __iter__ = keys\nparams = P(a=1)",
        TIMED_OUT,
        "no answer",
    ),
    "a loop in a finalizer": Attack(
        in_control("class F:\n    def __del__(self):\n        while True: pass\nF()"), TIMED_OUT, "no answer"
    ),
    "a loop in a clean-up of the import": Attack(
        "import atexit, sys\ndef hold():\n    while True: pass\natexit.register(hold)\nsys.exit()", LOAD, "SystemExit"
    ),
    "a loop in the answer's conversion": Attack(
        in_control(
            "class U:\n    def __float__(self):\n        while True: pass\n    __index__ = __array__ = __float__\nreturn U(), 6"
        ),
        CONTRACT,
        "finite number",
    ),
    "recursion": Attack(in_control("f = lambda: f()\nf()"), CONTRACT, "RecursionError"),
    "recursion without a limit": Attack(
        "import sys; sys.setrecursionlimit(10 ** 9)\nclass R:\n    def __getattr__(self, name): return getattr(self, name)\nR().x",
        *((KILLED, "SIGSEGV") if sys.version_info < (3, 12) else (LOAD, "RecursionError")),  # since, C has a limit
    ),
    "recursion in the answer": Attack(in_control("a = []\na.append(a)\nreturn a, 6"), CONTRACT, "finite number"),
    "clocks that stand still": Attack(
        "import time\ntime.time = time.monotonic = time.perf_counter = time.process_time = lambda: 0.0\n"
        "time.sleep = lambda s: None\nwhile time.time() < 1.0: pass",
        TIMED_OUT,
        "no answer",
    ),
    "raise its own limits": Attack(
        "import resource\nfor which in range(16):\n    try: resource.setrlimit(which, (-1, -1))\n"
        "    except (ValueError, OSError): pass\nwhile True: pass",
        TIMED_OUT,
        "no answer|computing time",
    ),
    "alarms": Attack(
        "import signal; signal.setitimer(signal.ITIMER_REAL, 1e-4, 1e-4)\nwhile True: pass", KILLED, "SIGALRM"
    ),
}
