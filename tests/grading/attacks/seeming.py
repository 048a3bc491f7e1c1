"""Seeming to be what it is not: values, pairs, errors, code and copies that are others when they are looked at again."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

from rds.grading.grade import Status
from tests.grading.attacks import Attack

KILLED, TIMED_OUT, LOAD, CONTRACT = Status.KILLED, Status.TIMED_OUT, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT

ATTACKS = {
    "a voltage that is another at each look": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        class U(float):\n            n = 0\n            def __float__(self):\n                U.n += 1\n                return 1.0 if U.n < 3 else 1e9\n            def __eq__(self, o): return True\n            __hash__ = None\n            def __lt__(self, o): return True\n            __gt__ = __le__ = __ge__ = __lt__\n        return U(1.0), 6\n    return 1.0, state + 1\n"
    ),
    "a complex voltage": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        return 1 + 0j, 6\n    return 1.0, state + 1\n",
        CONTRACT,
        "finite number",
    ),
    "an array whose number ends the process": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        import numpy as np\n        class X:\n            def __float__(self): os._exit(0)\n        return np.array([X()], object), 6\n    return 1.0, state + 1\n",
        CONTRACT,
        "finite number|voltage array",
    ),
    "a state that is copied without end": Attack(
        "class S:\n    def __deepcopy__(self, memo):\n        while True: pass\n    __copy__ = __deepcopy__\ninitial_state = S()\n",
        TIMED_OUT,
        "no answer",
    ),
    "params without end": Attack(
        "import collections.abc\nclass P(dict):\n    def keys(self):\n        n = 0\n        while True:\n            n += sum(range(10000))\n            yield str(n)\n    __iter__ = keys\n    def __getitem__(self, k): return 1.0\n    def items(self): return ((k, 1.0) for k in self.keys())\nparams = P(a=1)\n",
        TIMED_OUT,
        "no answer",
    ),
    "a law that wraps itself": Attack(
        "def control(t, r, y, state, params):\n    return 1.0, state\ncontrol.__wrapped__ = control\n"
    ),
    "a law that nobody awaits": Attack(
        "async def control(t, r, y, state, params):\n    return 1.0, state\n", LOAD, "asynchronous"
    ),
    "a syntax error of another file": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        raise SyntaxError('x', ('f', 'no number', object(), ['text'], {}, 3.5)) if False else SyntaxError('x', ('/etc/shadow', 10 ** 30, -5, 'x' * 10 ** 6))\n    return 1.0, state + 1\n",
        CONTRACT,
        "SyntaxError",
    ),
    "a syntax error that is none": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        e = SyntaxError('x')\n        e.filename, e.lineno, e.offset, e.text = 5, 'no', object(), 7\n        raise e\n    return 1.0, state + 1\n",
        CONTRACT,
        "SyntaxError: x",
    ),
    "exceptions in exceptions": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        e = ValueError('x')\n        for _ in range(5000): e = ExceptionGroup('g', [e])\n        raise e\n    return 1.0, state + 1\n",
        CONTRACT,
        "ExceptionGroup",
    ),
    "an exception with notes of megabytes": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        e = ValueError('x')\n        e.__notes__ = ['n' * 10 ** 6] * 20\n        raise e\n    return 1.0, state + 1\n",
        CONTRACT,
        "ValueError: x",
    ),
    "an exception with a thousand causes": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        e = ValueError('x')\n        for _ in range(20000):\n            f = ValueError('y'); f.__cause__ = e; e = f\n        raise e\n    return 1.0, state + 1\n",
        CONTRACT,
        "ValueError: y",
    ),
    "code that claims to be ours": Attack(
        "def control(t, r, y, state, params):\n    return 1.0, state\ndef other(t, r, y, state, params):\n    return 1.0, state\nimport os\ncontrol.__code__ = other.__code__.replace(co_filename='/opt/rds/rds/grading/sandbox/inside/worker.py', co_firstlineno=2**31-1)\n"
    ),
    "calls of the x32 interface": Attack(
        "import ctypes, mmap\ncode = mmap.mmap(-1, 4096, mmap.MAP_PRIVATE | 32, 7)\ncode.write(bytes.fromhex('b8290000400f05c3'.replace('29000040','29000040')))\nf = ctypes.CFUNCTYPE(ctypes.c_long, ctypes.c_int, ctypes.c_int, ctypes.c_int)(ctypes.addressof(ctypes.c_char.from_buffer(code)))\nassert f(2, 1, 0) < 0\n",
        KILLED,
        "SIGSYS",
    ),
    "a processor that is given away without end": Attack(
        "import os\nwhile True: os.sched_yield()\n", TIMED_OUT, "no answer"
    ),
    "random numbers without end": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        f = open('/dev/urandom', 'rb', buffering=0)\n        while True: f.read(1 << 20)\n    return 1.0, state + 1\n",
        TIMED_OUT,
        "no answer",
    ),
    "children that nobody waits for": Attack(
        "import os\nfor _ in range(4000):\n    try:\n        if os.fork() == 0: os._exit(0)\n    except OSError: break\n"
    ),
    "a fault that is handled again and again": Attack(
        "import faulthandler, signal, ctypes\nfaulthandler.enable()\nsignal.signal(11, lambda *a: None)\nctypes.string_at(1)\n",
        TIMED_OUT,
        "no answer",
    ),
    "a text that claims to be a pair": Attack(
        "import os, sys, time\ninitial_state = 0\ndef control(t, r, y, state, params):\n    if state == 5:\n        class S(str):\n            def __len__(self): return 2\n            def __iter__(self): return iter([1.0, 6])\n        return S('ab')\n    return 1.0, state + 1\n",
        CONTRACT,
        "must return",
    ),
    "a pair of three": Attack(
        "class P(tuple):\n    def __len__(self): return 2\n    def __iter__(self): return iter((1.0, None))\n    def __getitem__(self, k): return (1.0, None)[k]\ndef control(t, r, y, state, params):\n    return P((1e9, None, 3))\n"
    ),
    "bytes that are no text": Attack("import os\nos.write(1, b'\\xff\\xfe\\xc3' * 50)\nos.write(2, b'\\x00' * 50)\n"),
    "a module that leaves at every look": Attack(
        "import sys\nclass M(type(sys)):\n    def __getattribute__(self, n): raise SystemExit\nsys.modules[__name__] = M('x')\n"
    ),
}
