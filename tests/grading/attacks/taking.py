"""Using up the computer: memory, processes, disk, output, descriptors; and staying behind."""

from __future__ import annotations

from dataclasses import replace

from rds.grading.grade import Status
from tests.grading.attacks import SHORT, Attack, in_control

KILLED, TIMED_OUT, LOAD, CONTRACT = Status.KILLED, Status.TIMED_OUT, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT
_DISK = "for n in range(9): open(f'/tmp/{n}', 'wb').write(bytes(1 << 20))"

_CHILDREN = """
import os, time
for _ in range(3):
    if os.fork() == 0: break
"""
_SHARED = (
    _CHILDREN
    + """
import ctypes, mmap
libc = ctypes.CDLL(None, use_errno=True)
libc.mmap.restype = ctypes.c_void_p
size = 100 << 20
at = libc.mmap(None, ctypes.c_size_t(size), 3, 0x21, -1, 0)
if at in (None, ctypes.c_void_p(-1).value): raise MemoryError("no shared memory")
ctypes.memset(at, 1, size)
libc.madvise(ctypes.c_void_p(at), ctypes.c_size_t(size), 4)  # out of sight, not given back
time.sleep(60)
"""
)
_LEADERLESS = (
    _CHILDREN
    + """
import ctypes, threading
if os.getpid() != 2:
    def hold():
        kept = bytearray(os.urandom(1 << 20)) * 100
        time.sleep(60)
    threading.Thread(target=hold).start()
    ctypes.CDLL(None).syscall(60, 0)  # the first thread ends; what the process holds is another's
time.sleep(60)
"""
)
_CREDIT = """
import os, time
for _ in range(5):
    if os.fork() == 0: time.sleep(60)  # each has less than a fork is allowed to begin with
os.fork()
kept = bytearray(os.urandom(1 << 20)) * 125
time.sleep(60)
"""
_DAEMON = """
import os, time, signal
for _ in range(2):
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            for number in (1, 2, 15): signal.signal(number, signal.SIG_IGN)
            os.chdir("/")
            while True: time.sleep(600)
        os._exit(0)
"""
_EXIT = """
import atexit, os, time
def again():
    if os.fork() == 0:
        os.setsid()
        time.sleep(600)
atexit.register(again)
os.register_at_fork(before=lambda: None)
class F:
    def __del__(self): again()
kept = F()
"""
_ARGV = """
import os
try: os.execve("/usr/bin/python3", ["x" * (1 << 20)] * 100, {})
except (OSError, MemoryError): pass
"""
_LOCKED = """
import ctypes
libc = ctypes.CDLL(None, use_errno=True)
assert libc.mlockall(3) == -1
assert libc.mlock(b"x" * 4096, 4096) == -1
"""
_SPIN_CHILDREN = """
import ctypes, platform, signal
number = {"x86_64": 13, "aarch64": 134}[platform.machine()]
ignore = (ctypes.c_ulong * 4)(1)
for seventeen in (17, (1 << 32) + 17):  # the kernel looks at the lower half
    assert ctypes.CDLL(None).syscall(number, ctypes.c_ulong(seventeen), ignore, None, ctypes.c_ulong(8)) == -1
for handler in (signal.SIG_IGN, signal.SIG_DFL, lambda *a: None):
    try: signal.signal(signal.SIGCHLD, handler)
    except PermissionError: continue
    raise SystemExit("children that are ignored are in no sum")
"""

ATTACKS = {
    "a fork bomb": Attack(
        "import os\nwhile True:\n    try: os.fork()\n    except OSError: pass", TIMED_OUT, "no answer|time"
    ),
    "a bomb of threads": Attack(
        "import threading, time\nwhile True: threading.Thread(target=time.sleep, args=(600,)).start()", LOAD, "thread"
    ),
    "children whose time is in no sum": Attack(_SPIN_CHILDREN),
    "memory at once": Attack("x = bytearray(1 << 40)", LOAD, "MemoryError"),
    "memory bit by bit": Attack("x = []\nwhile True: x.append(bytearray(1 << 20))", LOAD, "MemoryError"),
    "memory in a sample": Attack(in_control("x = [0] * 10 ** 9"), CONTRACT, "MemoryError"),
    "memory of numpy": Attack("import numpy as np\nx = np.ones(10 ** 9)", LOAD, "MemoryError"),
    "memory shared and out of sight": Attack(_SHARED, LOAD, "no shared memory"),
    "memory of a process whose first thread ended": Attack(_LEADERLESS, KILLED, "MiB of memory"),
    "memory behind small children": Attack(_CREDIT, KILLED, "MiB of memory"),
    "a mapping of everything": Attack(
        "import mmap\nx = mmap.mmap(-1, 1 << 40, mmap.MAP_PRIVATE | 32)", LOAD, "memory|Error"
    ),
    "locked memory": Attack(_LOCKED),
    "a list that grows while it is shown": Attack("params = {'x': [0] * 200_000}"),
    "a full disk": Attack(_DISK, LOAD, "No space left|too large"),
    "a full disk in a sample": Attack(in_control(_DISK), CONTRACT, "No space left|too large"),
    "all inodes": Attack("for n in range(9999): open(f'/tmp/{n}', 'wb').close()", LOAD, "No space left"),
    "folders without end": Attack("import os\nwhile True:\n    os.mkdir('d'); os.chdir('d')", LOAD, "No space left"),
    "one sparse file": Attack(
        "with open('/tmp/x', 'wb') as f: f.truncate(1 << 40)",
        LOAD,
        "File too large",
    ),
    "all descriptors": Attack("x = [open('/dev/null') for _ in range(9999)]", LOAD, "Too many open files"),
    "pipes that are full": Attack(
        "import os\nx = [os.pipe() for _ in range(20)]\nfor _, w in x:\n    os.write(w, bytes(60_000))"
    ),
    "a flood on stdout": Attack("while True: print('x' * 9999)", KILLED, "printed more"),
    "a flood on stderr": Attack("import os\nwhile True: os.write(2, b'x' * 9999)", KILLED, "printed more"),
    "a flood in a sample": Attack(in_control("while True: os.write(1, bytes(9999))"), KILLED, "printed more"),
    "talk in every case": Attack("print('x' * 30_000)"),
    "warnings without end": Attack(
        "import warnings\nwarnings.simplefilter('always')\nwhile True: warnings.warn('x' * 9999)",
        KILLED,
        "printed more",
    ),
    "arguments without end": Attack(_ARGV),
    "daemons": Attack(_DAEMON),
    "daemons in a sample": Attack(in_control(_DAEMON)),
    "exit handlers and finalizers": Attack(_EXIT),
    "threads that go on": Attack("import threading, time\nthreading.Thread(target=time.sleep, args=(600,)).start()"),
    "core dumps": Attack("import ctypes\nctypes.string_at(1)", KILLED, "SIGSEGV"),
    "writing over the interpreter": Attack(
        "import ctypes\nctypes.memset(id(float), 255, ctypes.sizeof(ctypes.c_void_p) * 8)\nfloat('1')", KILLED, "SIG"
    ),
    "an integer that is another": Attack(
        "import ctypes\nctypes.memmove(id(1) + 24, b'\\x02', 1)\nimport time; time.sleep(60)",
        TIMED_OUT,
        "no answer|time",
    ),
    "calls of 32 bits": Attack(
        "import ctypes, mmap\ncode = mmap.mmap(-1, 4096, mmap.MAP_PRIVATE | 32, 7)\n"
        "code.write(bytes.fromhex('b814000000cd80c3'))\n"
        "ctypes.CFUNCTYPE(ctypes.c_int)(ctypes.addressof(ctypes.c_char.from_buffer(code)))()",
        KILLED,
        "SIGSYS",
    ),
    "answers just within the limit": Attack(
        "import time\ndef control(t, r, y, state, params):\n    time.sleep(0.3)\n    return 1.0, state\n",
        TIMED_OUT,
        "in all",
        replace(SHORT, wall_seconds=1.5),
    ),
    "many small sleeps": Attack(
        "import time\ndef control(t, r, y, state, params):\n    time.sleep(0.012)\n    return 1.0, state\n",
        TIMED_OUT,
        "in all",
        replace(SHORT, wall_seconds=0.4),
    ),
}
