"""Changing what the worker itself stands on: its descriptors, its processes, its limits, the interpreter it runs in."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

from rds.grading.grade import Status
from tests.grading.attacks import DESCRIPTORS, Attack, in_control

KILLED, TIMED_OUT, LOAD, CONTRACT = Status.KILLED, Status.TIMED_OUT, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT

_ENDS = "import ctypes, fcntl, mmap, os, resource, signal, struct, sys, threading, time\n" + DESCRIPTORS


def at_the_sixth(body: str) -> Attack:
    """Which goes on answering 1 V."""
    return Attack(_ENDS + in_control(body))


def ends(body: str, status: Status, said: str) -> Attack:
    """Which comes to an end at its sixth sample."""
    return Attack(_ENDS + in_control(body), status, said)


ATTACKS = {
    "answers before the questions": Attack(
        _ENDS + "for k in range(200): os.write(answers, struct.pack('<QQd', k, 0, 1.0))", CONTRACT, "pipe"
    ),
    "answers of the next samples": Attack(
        _ENDS
        + "shared = mmap.mmap(memory, 4096)\n"
        + in_control(
            "for k in range(6, 99): os.write(answers, struct.pack('<QQd', k, 0, 1.0))\nshared[2048:2072] = struct.pack('<QQd', 6, 0, 1.0)\nshared[256:264] = struct.pack('<Q', 6); time.sleep(9)"
        ),
        CONTRACT,
        "pipe",
    ),
    "a frame of four gigabytes": Attack(
        _ENDS + "os.write(answers, b'\\xff\\xff\\xff\\xff{'); time.sleep(9)", CONTRACT, "pipe"
    ),
    "a frame that never ends": Attack(
        _ENDS + "os.write(answers, b'\\x00\\x00\\x01\\x00{'); time.sleep(9)", TIMED_OUT, "no answer"
    ),
    "the ends of the pipes exchanged while loading": Attack(
        _ENDS + "os.dup2(answers, questions)", KILLED, "exit code 1"
    ),
    "prints into the grader's pipe": Attack(
        _ENDS + "os.dup2(answers, 1); print('x' * 99, flush=True); time.sleep(9)", CONTRACT, "pipe"
    ),
    "answers into its own output": Attack(_ENDS + "os.dup2(1, answers)", TIMED_OUT, "no answer"),
    "its own pipes closed while loading": Attack(_ENDS + "os.close(questions)", KILLED, "exit code 1"),
    "a child that goes on in its place": ends("if os.fork(): os._exit(0)\ntime.sleep(9)", KILLED, "exit code 0"),
    "a child that shares its memory": at_the_sixth("ctypes.CDLL(None).vfork()"),
    "a child that stops it again and again": at_the_sixth(
        "if os.fork() == 0:\n    for _ in range(99): os.kill(2, 19); os.kill(2, 18)\n    os._exit(0)"
    ),
    "limits of its own at nothing": at_the_sixth(
        "for which in (resource.RLIMIT_AS, resource.RLIMIT_FSIZE, resource.RLIMIT_NPROC): resource.setrlimit(which, (0, 0))"
    ),
    "no computing time of its own": ends(
        "resource.setrlimit(resource.RLIMIT_CPU, (0, 0))\nwhile True: pass", KILLED, "SIGKILL"
    ),
    "its file and folder gone": Attack(
        "import os\nos.remove('/tmp/submission.py'); os.mkdir('/tmp/d'); os.chdir('/tmp/d'); os.rmdir('/tmp/d')"
    ),
    "its file renamed to ours": Attack("import os\nos.rename('/tmp/submission.py', '/tmp/rds.py')"),
    "output closed": Attack("import os\nos.close(1); os.close(2)"),
    "output taken away": Attack("import sys\nsys.stdout = sys.stderr = None"),
    "no module left": Attack("import sys\nsys.modules.clear()"),
    "no builtin left": Attack(
        "import builtins\nfor name in [n for n in vars(builtins) if n[0] != '_']: delattr(builtins, name)",
        LOAD,
        "NameError",
    ),
    "no import left": Attack(
        "import sys\nclass Finder:\n    def find_spec(self, *a): raise ImportError('no')\nsys.meta_path.insert(0, Finder())\nsys.path_hooks.clear(); sys.path.clear()"
    ),
    "other codecs": Attack(
        "import codecs\nfor name in ('strict', 'replace', 'surrogatepass'): codecs.register_error(name, lambda error: ('1', error.end))\ncodecs.register(lambda name: None)"
    ),
    "a profiler that raises": Attack(
        "import sys\ndef profile(*a): raise KeyboardInterrupt\nsys.setprofile(profile)", LOAD, "KeyboardInterrupt"
    ),
    "an audit hook that raises": Attack(
        "import sys\ndef hook(*a): raise SystemExit\nsys.addaudithook(hook)", LOAD, "SystemExit"
    ),
    "a garbage collector that raises": Attack(
        "import gc, sys\nsys.unraisablehook = lambda *a: None\ngc.set_threshold(1)\ngc.callbacks.append(lambda *a: 1 / 0)"
    ),
    "a recursion limit of nothing": Attack("import sys\nsys.setrecursionlimit(50)"),
    "a thread that never lets go": Attack(
        "import sys, threading\nsys.setswitchinterval(1000)\nthreading.Thread(target=sum, args=(iter(int, 1),), daemon=True).start()",
        TIMED_OUT,
        "no answer",
    ),
    "an exception without a class": ends(
        "class M(type):\n    __name__ = property(lambda s: 1 / 0)\nclass E(Exception, metaclass=M):\n    __class__ = property(lambda s: 1 / 0)\nraise E",
        KILLED,
        "exit code 1",
    ),
    "exceptions in a ring": ends(
        "a, b = ValueError('a'), ValueError('b')\na.__cause__, b.__cause__ = b, a\na.__context__, b.__context__ = b, a\nraise a",
        CONTRACT,
        "ValueError: a",
    ),
    "a state whose end is the process's": ends(
        "class State:\n    def __del__(self): os._exit(0)\nState()", KILLED, "exit code 0"
    ),
    "a module that is another": Attack("import sys\nsys.modules[__name__] = None\ndef __getattr__(name): 1 / 0"),
    "the code of our loop exchanged": Attack(
        "import sys\ndef other(*a): return None\nruns = sys.modules['rds.grading.sandbox.inside.runs']\nfor value in list(vars(runs).values()):\n    try: value.__code__ = other.__code__\n    except (AttributeError, ValueError): pass",
        TIMED_OUT,
        "no answer",
    ),
    "another struct in our modules": Attack(
        "import sys\nclass S:\n    size = 24\n    def __init__(self, *a): pass\n    def pack(self, *a): return b'\\xff' * 24\n    def unpack(self, data): return (0,) * 9\nfor module in list(sys.modules.values()):\n    if getattr(module, '__name__', '').startswith('rds') and hasattr(module, 'struct'): module.struct = type('M', (), {'Struct': S})",
        KILLED,
        "exit code 1",
    ),
    "a write of one byte at a time": Attack(
        "import os\nwrite = os.write\nos.write = lambda to, data: write(to, data[:1])"
    ),
    "a read of nothing": Attack("import os\nos.read = lambda of, count: bytes(count)", KILLED, "exit code 1"),
    "a check of numbers that says yes": Attack(
        "import sys\nfor module in list(sys.modules.values()):\n    if hasattr(module, 'isfinite'): vars(module)['isfinite'] = lambda value: True\n    if hasattr(module, 'as_voltage'): module.as_voltage = lambda *a, **k: float('nan')",
        CONTRACT,
        "not finite",
    ),
    "the mailbox made larger": Attack(
        _ENDS
        + "for grow in (lambda: os.ftruncate(memory, 1 << 20), lambda: os.posix_fallocate(memory, 0, 1 << 22)):\n    try: grow()\n    except OSError: continue\n    raise SystemExit('grown')"
    ),
    "a hole in the mailbox": at_the_sixth(
        "ctypes.CDLL(None).fallocate(memory, 3, ctypes.c_long(0), ctypes.c_long(4096))"
    ),
    "a call that is pending in our loop": ends(
        "made = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(lambda _: -1)\nsys.kept = made\nctypes.pythonapi.Py_AddPendingCall(made, None)",
        CONTRACT,
        "SystemError",
    ),
    "an interpreter that is finalized": ends("ctypes.pythonapi.Py_Finalize()", KILLED, "SIGSEGV|SIGABRT|exit code"),
}
