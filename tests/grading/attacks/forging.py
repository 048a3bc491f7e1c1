"""Answers and objects that are made to look like numbers: of numpy, of abstract classes, of the interpreter's own."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

from rds.grading.grade import Status
from tests.grading.attacks import Attack, in_control

LOAD, CONTRACT, KILLED, TIMED_OUT = Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT, Status.KILLED, Status.TIMED_OUT


def gives(expression: str, before: str = "", said: str = "finite number|returned|Exceeds") -> Attack:
    """Whose sixth answer is this, which is no voltage."""
    return Attack(in_control(f"import numpy as np\n{before}\nreturn {expression}, 6"), CONTRACT, said)


def passes(expression: str, before: str = "") -> Attack:
    """Whose sixth answer is this, which counts as the 1 V that it is."""
    return Attack(in_control(f"import numpy as np\n{before}\nreturn {expression}, 6"))


_ARRAY = "class A(np.ndarray):\n    {}\na = np.ones(1).view(A)"
_REAL = "import numbers\nclass R:\n    n = 0\n    def __float__(self):\n        R.n += 1\n        return {}\nnumbers.Real.register(R)"
_EVERY = "import numpy as np\ninitial_state = 0\n"

ATTACKS = {
    "a masked number": gives("np.ma.masked"),
    "a masked array of one": gives("np.ma.array([1.0], mask=[True])"),
    "a masked array whose mask is hidden": gives(
        "a", "class M(np.ma.MaskedArray):\n    mask = property(lambda s: False)\na = M(np.array([np.nan]), mask=[True])"
    ),
    "a date": gives("np.datetime64('2026-01-01')"),
    "a time span": gives("np.timedelta64(1, 's')"),
    "a record of one number": gives("np.zeros(1, [('u', float)])[0]"),
    "a table of records": gives("np.ones(1, [('u', float)]).view(np.recarray)"),
    "a half float that is no number": gives("np.float16('nan')"),
    "a long double beyond floats": gives("np.longdouble('1e4000')"),
    "a numpy boolean": gives("np.bool_(True)"),
    "a numpy text": gives("np.str_('1.0')"),
    "a void": gives("np.void(b'\\x00' * 8)"),
    "an array without entries": gives("np.ones((1, 0))"),
    "a signed zero's reciprocal": gives("1.0 / np.float64(-0.0)", "np.seterr(all='ignore')"),
    "a decimal": gives("Decimal('1')", "from decimal import Decimal"),
    "a decimal that is no number": gives("Decimal('sNaN')", "from decimal import Decimal"),
    "a fraction beyond floats": gives("Fraction(10 ** 400, 3)", "from fractions import Fraction"),
    "a real number that becomes none": gives("R()", _REAL.format("1.0 if R.n < 2 else float('nan')")),
    "a real number that becomes infinite": gives("R()", _REAL.format("1.0 if R.n < 2 else float('inf')")),
    "a real number that is a text": gives("R()", _REAL.format("'1.0'"), "finite number|returned|TypeError"),
    "a real number that leaves": gives("R()", _REAL.format("sys.exit(0)"), "SystemExit"),
    "a real number that never comes": Attack(
        in_control(f"{_REAL.format('[0 for _ in iter(int, 1)]')}\nreturn R(), 6"), TIMED_OUT, "no answer"
    ),
    "an array whose item is none": gives("a", _ARRAY.format("item = lambda s: None")),
    "an array whose item is a text": gives("a", _ARRAY.format("item = lambda s: '1'")),
    "an array whose item is infinite": gives("a", _ARRAY.format("item = lambda s: float('inf')")),
    "an array whose item is itself": gives("a", _ARRAY.format("item = lambda s: s")),
    "an array whose item leaves": gives("a", _ARRAY.format("item = lambda s: sys.exit(0)"), "SystemExit"),
    "an array whose item ends the process": Attack(
        in_control("import numpy as np\n" + _ARRAY.format("item = lambda s: os._exit(0)") + "\nreturn a, 6"),
        KILLED,
        "exit code 0",
    ),
    "an array whose mask leaves": gives("a", _ARRAY.format("mask = property(lambda s: sys.exit(0))"), "SystemExit"),
    "an array whose mask is a text": gives("a", _ARRAY.format("mask = 'masked'")),
    "an array whose kind is a lie": gives(
        "a",
        "class D:\n    kind = 'f'\nclass A(np.ndarray):\n    dtype = property(lambda s: D())\n    size = 1\na = np.array(['x'], object).view(A)",
        "finite number|returned|Type",
    ),
    "what only has the words of an array": gives(
        "A()", "class A:\n    size, mask = 1, False\n    class dtype: kind = 'f'\n    def item(self): return '1.0'"
    ),
    "an array at nobody's memory": Attack(
        in_control(
            "import numpy as np\nfrom numpy.lib.stride_tricks import as_strided\na = as_strided(np.ones(1), (1 << 30,), (4096,))\nreturn float(a[-1]), 6"
        ),
        KILLED,
        "SIGSEGV|SIGBUS",
    ),
    "an array of a description of memory": Attack(
        in_control(
            "import numpy as np\nclass P:\n    __array_interface__ = {'shape': (1,), 'typestr': '<f8', 'data': (8, False), 'version': 3}\nreturn np.asarray(P()), 6"
        ),
        KILLED,
        "SIGSEGV",
    ),
    "a number that is written over while it is sent": passes(
        "x", "import ctypes, threading\nx = np.float64(1.0)\nx = float(x)"
    ),
    "an integer of the class of truth": gives(
        "B(1)", "class B(int):\n    __class__ = bool\n    def __float__(self): return 1.0", "finite number|returned"
    ),
    "a float with slots of its own": passes(
        "F(1.0)", "class F(float):\n    __float__ = lambda s: 1.0\n    __reduce__ = __eq__ = __hash__ = None"
    ),
    "a float that says it is another": passes(
        "F(1.0)", "class F(float):\n    __class__ = str\n    __repr__ = __str__ = lambda s: 'nan'"
    ),
    "a matrix of one": passes("np.matrix([[1.0]])"),
    "a single precision number": passes("np.float32(1.0)"),
    "a small integer of numpy": passes("np.int8(1)"),
    "a view without the right to write": passes("np.broadcast_to(np.float64(1.0), (1, 1))"),
    "an array in the order of other computers": passes("np.array([1.0], '>f8')"),
    "a list in place of the pair": Attack(in_control("return [1.0, 6]")),
    "an iterator in place of the pair": Attack(in_control("return iter([1.0, 6])"), CONTRACT, "must return"),
    "a generator in place of the pair": Attack(
        in_control("return (each for each in (1.0, 6))"), CONTRACT, "must return"
    ),
    "a dict in place of the pair": Attack(in_control("return {1.0: 0, 6: 0}"), CONTRACT, "must return"),
    "an array in place of the pair": Attack(
        in_control("import numpy as np\nreturn np.array([1.0, 6.0])"), CONTRACT, "must return"
    ),
    "a pair of a thousand": Attack(in_control("return (1.0,) * 1000"), CONTRACT, "must return"),
    "a law that is a class": Attack(
        "class control:\n    def __new__(cls, t, r, y, state, params): return 1.0, state\n# def control(\n",
        LOAD,
        "is a class",
    ),
    "a law that is an object": Attack(
        "class C:\n    def __call__(self, t, r, y, state, params): return 1.0, state\ncontrol = C()  # def control(\n"
    ),
    "a law that is a partial": Attack(
        "from functools import partial\ndef law(gain, t, r, y, state, params): return gain, state\ncontrol = partial(law, 1.0)  # def control(\n"
    ),
    "a law whose code is exchanged while it runs": Attack(
        "def other(t, r, y, state, params):\n    return 1.0, state\ndef control(t, r, y, state, params):\n    control.__code__ = other.__code__\n    return 1.0, state\n"
    ),
    "a law whose defaults remember": Attack(
        "def control(t, r, y, state, params, kept=[]):\n    kept.append(y)\n    return 1.0, state\n"
    ),
    "a law that yields": Attack(
        "def control(t, r, y, state, params):\n    yield 1.0\n    yield state\n", LOAD, "generator|yield"
    ),
    "a law for any arguments": Attack("def control(*args, **more):\n    return 1.0, args[3]\n"),
    "a law that changes the reference of its neighbour": Attack(
        in_control(
            "import gc\nfor each in gc.get_objects():\n    if type(each).__name__ == 'LiveReference':\n        for part in (each.position, each.velocity, each.acceleration):\n            part.value = 0.0"
        )
    ),
    "a state that is all of numpy": Attack("import numpy\ninitial_state = numpy\n", CONTRACT, "cannot be copied"),
    "a state that grows": Attack(
        "initial_state = ()\ndef control(t, r, y, state, params):\n    return 1.0, state + (list(range(1000)),)\n"
    ),
    "a state that is a lock": Attack(
        "import threading\ninitial_state = threading.Lock()\n", CONTRACT, "cannot be copied"
    ),
    "a state that is an open file": Attack("initial_state = open(__file__)\n", CONTRACT, "cannot be copied"),
    "a state that lies when it is copied": Attack(
        "class S:\n    def __deepcopy__(self, memo): return 5\ninitial_state = S()\ndef control(t, r, y, state, params):\n    return (1.0 if state == 5 else 9.0), state\n"
    ),
    "checks of the loop that say yes": Attack(
        "import rds.modes.loop.laws as laws, rds.machines.converter as converter, numpy as np\nlaws.as_voltage = converter.as_voltage = lambda value: 1e300\nlaws.isfinite = lambda value: True\n"
    ),
    "masks that are never there": Attack(
        in_control(
            "import rds.machines.converter as c, rds.core.values as v, numpy as np\nv.is_masked = c.is_masked = lambda value: False\nreturn np.ma.array([float('nan')], mask=[True]), 6"
        ),
        CONTRACT,
        "finite",
    ),
    "a class that is registered as every number": Attack(
        "import numbers\nclass N(str): pass\nfor kind in (numbers.Number, numbers.Complex, numbers.Real, numbers.Rational, numbers.Integral): kind.register(N)\ninitial_state = 0\ndef control(t, r, y, state, params):\n    return (N('1') if state == 5 else 1.0), state + 1\n",
        CONTRACT,
        "finite number|TypeError|returned",
    ),
    "text that moves through the report": Attack(
        in_control(
            "raise ValueError('\\\\input{/etc/passwd} $(id) `id` {{7*7}} ${7*7} <%= 7 %> =cmd|x!A1 \\r\\n\\r\\nHTTP/1.1 \\x00\\x07\\x9b2J\\u2028\\u2029\\ufeff')"
        ),
        CONTRACT,
        r"(?s)\A[^\x00-\x1f\x9b\u2028\u2029]{,700}\Z",
    ),
    "printing what a terminal obeys": Attack(
        "print('\\x1b]8;;file:///etc/passwd\\x07x\\x1b]8;;\\x07\\x1bP\\x1b\\\\\\x9b31m\\x90q\\x9c\\x8d\\u202e\\u2066\\u061c\\ufff9', flush=True)\nimport sys\nsys.stderr.write('\\r\\b\\x7f\\x0b\\x0c\\x85')"
    ),
}
