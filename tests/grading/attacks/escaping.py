"""Getting out by the kernel: calls and flags that others forget, memory and time that no sum holds, other interpreters."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

import sys
from dataclasses import replace

from rds.grading.grade import Status
from tests.grading.attacks import DESCRIPTORS, SHORT, Attack, in_control

KILLED, TIMED_OUT, LOAD, CONTRACT = Status.KILLED, Status.TIMED_OUT, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT
_SLOW = replace(SHORT, cpu_seconds=1.0, wall_seconds=20.0, call_seconds=2.0, load_seconds=5.0)

_CALLS = """
import ctypes, errno, mmap, os, struct, sys, time
libc = ctypes.CDLL(None, use_errno=True)
libc.mmap.restype = libc.sbrk.restype = ctypes.c_void_p
libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]
def refused(number, *args):
    ctypes.set_errno(0)
    found = libc.syscall(ctypes.c_long(number), *[ctypes.c_ulong(each) if isinstance(each, int) else each for each in args])
    assert found == -1 and ctypes.get_errno() in (errno.EPERM, errno.ENOSYS), (number, args, found, ctypes.get_errno())
"""
_CALLS += DESCRIPTORS
_BURN = "def burn(s):\n    end = time.process_time() + s\n    while time.process_time() < end: pass\n"
_AT_ONCE = _CALLS + _BURN + "{}\ndef control(t, r, y, state, params):\n    time.sleep(0.1)\n    return 1.0, state\n"
_ALLOWED = """0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 28 32 33 34 35 36 37 38 39 56 57 58 60 61 62
63 72 74 75 76 77 78 79 80 81 82 83 84 87 89 95 96 97 98 99 100 102 104 107 108 109 110 111 112 115 118 120 121 124
125 127 128 130 131 140 143 145 146 147 157 158 186 200 201 202 204 217 218 219 228 229 230 231 234 247 257 258 262
263 264 267 269 270 271 273 274 285 292 293 295 296 302 309 316 318 324 332 334 435 436 439 449"""


def calls(body: str) -> Attack:
    """Which makes system calls while it is loaded, and tells by an assertion what was not refused."""
    return Attack(_CALLS + body)


def burning(body: str, said: str = "computing time") -> Attack:
    """Which has others compute for it while it sleeps: their time is its own."""
    return Attack(_AT_ONCE.format(body), TIMED_OUT, said, _SLOW)


ATTACKS = {
    # but those by which the kernel's own probes come back, which no filter sees: a process that makes them is ended
    "every system call that is not on the list": calls(
        f"allowed = {{{', '.join(_ALLOWED.split())}}}\nfor number in [*range(600), *range(1000, 1100), 4096, 1 << 20, 2**30 - 1]:\n    if number not in allowed | {{335, 336}}: refused(number, 0, 0, 0, 0, 0, 0)"
    ),
    "namespaces by clone, one bit at a time": calls(
        "for bit in (0x80, 0x20000, 0x2000000, 0x4000000, 0x8000000, 0x10000000, 0x20000000, 0x40000000):\n    refused(56, bit | 17, 0, 0, 0, 0); refused(56, (1 << 32) | bit | 17, 0, 0, 0, 0)"
    ),
    "namespaces by clone3": calls("refused(435, struct.pack('<11Q', 0x10000000, *[0] * 10), 88)"),
    "every option of prctl": calls(
        "for option in [*range(1, 90), 0x53564d41, 0x59616d61, 0xffffffff]:\n    if option not in (15, 16): refused(157, option, 1, 0, 0, 0)\nfor option in ((1 << 32) + 4, (1 << 32) + 15): refused(157, option, 1, 0, 0, 0)"
    ),
    "every request of ioctl": calls(
        "for fd in (0, 1, memory, answers):\n    for request in [*range(0x5400, 0x5480), 0x8901, 0x8903, 0x8904, 0x5413, 0x40045431, 0x80045430, 0xc0045878, 0x40049409, 0xc020660b, 0x5203, 0x5201, 0xffffffff, (1 << 32) + 0x541b]:\n        if request not in (0x5401, 0x541b, 0x5450, 0x5451): refused(16, fd, request, 0)"
    ),
    "every command of fcntl": calls(
        "for fd in (0, 1, memory, answers):\n    for command in [*range(4, 40), *range(1024, 1045), (1 << 32) + 4, (1 << 32) + 1031]:\n        if command != 1030: refused(72, fd, command, 0x800)"
    ),
    "a pipe that the grader waits at": calls(
        "import fcntl\nfor fd in (answers, questions, 1):\n    refused(72, fd, 4, 0)\n    refused(72, fd, 1031, 4096)"
    ),
    "limits of the process above it": calls(
        "for which in range(16):\n    refused(302, 1, which, struct.pack('<QQ', 0, 0), 0)\n    refused(302, os.getpid(), which, struct.pack('<QQ', 0, 0), 0)"
    ),
    "memory of huge pages": calls(
        "for extra in (0, 21 << 26, 30 << 26): refused(9, 0, 1 << 21, 3, 0x40022 | extra, 2**64 - 1, 0)"
    ),
    "memory that is shared in every way": calls(
        "for kind in (0x21, 0x01, 0x23, 0x03, 0x31, 0x8021, 0x80023):\n    if kind & 0x2f != 1: refused(9, 0, 1 << 20, 3, kind, 2**64 - 1, 0)"
    ),
    "pages that the kernel joins with others'": calls(
        "at = libc.mmap(None, 1 << 20, 3, 0x22, -1, 0)\nfor advice in (12, 13, 100, 101, 9, 22, 23): refused(28, at, 1 << 20, advice)"
    ),
    "memory that is pushed out of sight": Attack(
        "import ctypes, os, time\nlibc = ctypes.CDLL(None)\nfor _ in range(3):\n    if os.fork() == 0: break\nlibc.mmap.restype = ctypes.c_void_p\nsize = 100 << 20\nat = libc.mmap(None, ctypes.c_size_t(size), 3, 0x22, -1, 0)\nctypes.memset(at, 1, size)\nfor advice in (20, 21, 8): libc.madvise(ctypes.c_void_p(at), ctypes.c_size_t(size), advice)\nctypes.memset(at, 1, size)\ntime.sleep(60)\n",
        KILLED,
        "MiB of memory",
    ),
    "memory doubled by moving it": calls(
        "refused_ = 0\nlibc.mremap.restype = ctypes.c_void_p\nat = libc.mmap(None, 4096, 3, 1, memory, 0)\nfor _ in range(9):\n    found = libc.mremap(ctypes.c_void_p(at), 0, ctypes.c_size_t(1 << 20), 1)\n    assert found != at"
    ),
    "a sibling that computes": burning("if libc.syscall(56, 0x8000 | 17, 0, 0, 0, 0) == 0:\n    burn(60); os._exit(0)"),
    "children that tell nobody of their end": burning(
        "for _ in range(5):\n    if libc.syscall(56, 0, 0, 0, 0, 0) == 0: burn(0.5); os._exit(0)"
    ),
    "a chain of orphans that compute": burning(
        "if os.fork() == 0:\n    for _ in range(40):\n        burn(0.1)\n        if os.fork(): os._exit(0)\n    os._exit(0)"
    ),
    "threads that compute and end": burning(
        "import threading\ndef work():\n    for _ in range(40):\n        one = threading.Thread(target=burn, args=(0.1,)); one.start(); one.join()\nthreading.Thread(target=work, daemon=True).start()",
        "computing time|no answer",
    ),
    "a child that computes stopped and going": burning(
        "child = os.fork()\nif child == 0: burn(60)\nif os.fork() == 0:\n    while True:\n        os.kill(child, 19); time.sleep(0.0005); os.kill(child, 18); time.sleep(0.01)"
    ),
    "bells that are full": Attack(
        _CALLS
        + in_control(
            "for bell in (question_bell, answer_bell):\n    try: os.write(bell, struct.pack('<Q', 2**64 - 2))\n    except BlockingIOError: pass"
        )
    ),
    "bells that ring all the time": Attack(
        _CALLS
        + "import threading\ndef ring():\n    while True:\n        for bell in (question_bell, answer_bell):\n            try: os.write(bell, struct.pack('<Q', 1))\n            except OSError: pass\n        time.sleep(1e-4)\nthreading.Thread(target=ring, daemon=True).start()"
    ),
    "a list of locks that the kernel writes over the mailbox": Attack(
        _CALLS
        + "at = libc.mmap(None, 4096, 3, 1, memory, 0)\nhead = (ctypes.c_ulong * 3)(at + 64, 0, 0)\nrefused_ = libc.syscall(273, head, 24)\nlibc.syscall(218, ctypes.c_void_p(at + 32))"
    ),
    "a mailbox that is written past its end": calls(
        "for at in (4096, 5000, 1 << 20):\n    try: done = os.pwrite(memory, b'x' * 8192, at)\n    except OSError: continue\n    raise AssertionError(done)\nassert os.fstat(memory).st_size == 4096"
    ),
    "a program of its own from its folder": Attack(
        "import ctypes, glob, os, sys\nname = [n for top in ('/usr/lib/x86_64-linux-gnu', '/lib/x86_64-linux-gnu', '/usr/lib64') for n in glob.glob(top + '/libm.so.6')][0]\nopen('/tmp/own.so', 'wb').write(open(name, 'rb').read())\nos.chmod\ntry: ctypes.CDLL('/tmp/own.so')\nexcept OSError: pass\nelse: raise AssertionError('mapped from a folder that runs nothing')"
    ),
    "programs by every door": Attack(
        "import os, subprocess, pty, multiprocessing\nfor door in (lambda: subprocess.run(['/usr/bin/true']), lambda: os.posix_spawn('/usr/bin/true', ['true'], {}), lambda: os.popen('true').read() or 1 / 0, lambda: pty.openpty(), lambda: os.execl('/usr/bin/python3', 'x'), lambda: multiprocessing.Pool(2)):\n    try: door()\n    except (OSError, ZeroDivisionError, AttributeError, ImportError): continue\n    raise AssertionError(door)"
    ),
    "compilers and what gives machine code": Attack(
        "for name in ('numba', 'llvmlite', 'cffi', 'Cython', 'torch', 'jax', 'psutil', 'pyseccomp', 'seccomp', 'pybind11', 'gi', 'dbus', 'pyarrow', 'pandas', 'requests', 'pip', 'setuptools', 'IPython', 'zmq', 'can'):\n    try: __import__(name)\n    except ImportError: continue\n    raise AssertionError(name)"
    ),
    "machine code in memory that forks and asks": Attack(
        "import ctypes, mmap\ncode = mmap.mmap(-1, 4096, mmap.MAP_PRIVATE | 32, 7)\ncode.write(bytes.fromhex('b829000000bf02000000be01000000ba000000000f05c3'))\nf = ctypes.CFUNCTYPE(ctypes.c_long)(ctypes.addressof(ctypes.c_char.from_buffer(code)))\nassert f() == -1, f()"
    ),
    "files for the interpreter that comes next": Attack(
        "import os, sys\nversion = f'python{sys.version_info[0]}.{sys.version_info[1]}'\nfolder = f'/tmp/.local/lib/{version}/site-packages'\nassert not os.path.exists(folder)\nos.makedirs(folder)\nfor name in ('sitecustomize.py', 'usercustomize.py', 'x.pth', 'numpy.py', 'rds.py'):\n    for top in (folder, '/tmp'):\n        assert not os.path.exists(f'{top}/{name}'), name\n        open(f'{top}/{name}', 'w').write('import os; os._exit(3)')"
    ),
    "bytecode beside the modules": Attack(
        "import importlib.util, os, sys\nimport numpy, rds, json\nfor module in (numpy, rds, json):\n    place = importlib.util.cache_from_source(module.__file__)\n    for name in (place, module.__file__):\n        for act in (lambda: open(name, 'ab'), lambda: os.remove(name), lambda: os.truncate(name, 0), lambda: os.rename(name, name + 'x')):\n            try: act()\n            except OSError: continue\n            raise AssertionError(name)"
    ),
    "files without a name elsewhere": Attack(
        "import os\nfor top in ('/', '/opt', '/opt/rds', '/usr', '/dev', '/proc', '/etc'):\n    for flags in (os.O_TMPFILE | os.O_RDWR, os.O_CREAT | os.O_RDWR):\n        try: os.open(top if flags & os.O_TMPFILE == os.O_TMPFILE else top + '/x', flags, 0o600)\n        except OSError: continue\n        raise AssertionError(top)"
    ),
    "paths by descriptors of folders": Attack(
        "import os\nfor top in ('/', '/opt', '/opt/rds/rds'):\n    fd = os.open(top, os.O_PATH | os.O_DIRECTORY)\n    for up in ('..', '../..', '../../../..'):\n        inner = os.open(up, os.O_PATH | os.O_DIRECTORY, dir_fd=fd)\n        os.fchdir(inner)\n        assert not os.path.exists('etc/passwd') and not os.path.exists('home') and not os.path.exists('root'), os.listdir('.')\nos.chdir('/tmp')"
    ),
    "time slots and nearness": Attack(
        "import os\nfor act in (lambda: os.nice(-5), lambda: os.setpriority(0, 0, 5), lambda: os.sched_setaffinity(0, {0}), lambda: os.sched_setscheduler(0, 0, os.sched_param(0)), lambda: os.sched_setscheduler(0, 5, os.sched_param(0)), lambda: os.getpriority(0, 1) and None or os.setpriority(0, 1, 19)):\n    try: act()\n    except (PermissionError, ProcessLookupError): continue\n    raise AssertionError(act)"
    ),
    "a segment register of nothing": Attack(_CALLS + "libc.syscall(158, 0x1002, ctypes.c_ulong(0))", KILLED, "SIGSEGV"),
    "a stack that is somewhere else": Attack(
        "import ctypes\nlibc = ctypes.CDLL(None)\nlibc.longjmp((ctypes.c_ulong * 32)(*[7] * 32), 1)", KILLED, "SIG"
    ),
    "a handler on a stack of its own that faults": Attack(
        _CALLS
        + "import signal\nstack = struct.pack('<QiiQ', 8, 0, 0, 8192)\nlibc.sigaltstack(stack, None)\nimport faulthandler\nfaulthandler.enable()\nctypes.string_at(3)",
        KILLED,
        "SIGSEGV|SIG",
    ),
    "an interpreter within the interpreter": Attack(
        "import sys\ntry: import _xxsubinterpreters as sub\nexcept ImportError: import _interpreters as sub\nname = sub.create()\nsub.run_string(name, 'import os\\nassert not os.path.exists(\"/etc/passwd\")\\nwhile True: pass')"
        if sys.version_info < (3, 13)
        else "while True: pass",
        TIMED_OUT,
        "no answer",
    ),
    "signals that come by themselves": Attack(
        "import signal, time\ncount = 0\ndef handle(*a):\n    global count\n    count += 1\nsignal.signal(signal.SIGALRM, handle); signal.signal(signal.SIGVTALRM, handle); signal.signal(signal.SIGPROF, handle)\nsignal.setitimer(signal.ITIMER_REAL, 1e-3, 1e-3); signal.setitimer(signal.ITIMER_VIRTUAL, 1e-3, 1e-3); signal.setitimer(signal.ITIMER_PROF, 1e-3, 1e-3)"
    ),
    "a name of a process that looks like another": Attack(
        "import ctypes\nlibc = ctypes.CDLL(None)\nfor name in (b') R 1 1 (', b'99 (x) R 0', b'\\n\\n', b'\\xff\\xfe)', b'VmRSS:\\t0 kB'):\n    libc.prctl(15, name, 0, 0, 0)"
    ),
    "a name of a process that hides its time": burning(
        "libc.prctl(15, b'x) S 1 1 1 0 0', 0, 0, 0)\nif os.fork() == 0: burn(60)"
    ),
    "a name of a process that hides its memory": Attack(
        "import ctypes, os, time\nlibc = ctypes.CDLL(None)\nlibc.prctl(15, b'a\\nVmRSS:\\t0 kB\\nb', 0, 0, 0)\nfor _ in range(3):\n    if os.fork() == 0: break\nkept = bytearray(os.urandom(1 << 20)) * 100\ntime.sleep(60)\n",
        KILLED,
        "MiB of memory",
    ),
    "a fork at every sample": Attack(
        "import os\ndef control(t, r, y, state, params):\n    if os.fork() == 0: os._exit(0)\n    os.wait()\n    return 1.0, state\n"
    ),
    "a window of a file that shrinks": Attack(
        "import mmap, os\nf = open('/tmp/x', 'w+b'); f.truncate(8192)\nm = mmap.mmap(f.fileno(), 8192)\nf.truncate(0)\nm[5000]",
        KILLED,
        "SIGBUS",
    ),
    "a library without its functions": Attack(
        "import ctypes\nlibc = ctypes.CDLL(None)\nfor name in ('write', 'read', '_exit'):\n    at = ctypes.cast(getattr(libc, name), ctypes.c_void_p).value\n    page = at & ~4095\n    if libc.mprotect(ctypes.c_void_p(page), 8192, 7) == 0: ctypes.memset(at, 0xcc, 8)",
        KILLED,
        "SIGTRAP|SIGSEGV|SIG",
    ),
}
