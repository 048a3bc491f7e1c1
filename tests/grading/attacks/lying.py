"""Answers that are none, and tampering with what would compare, measure or report them."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

from rds.grading.grade import Status
from tests.grading.attacks import Attack, in_control

LOAD, CONTRACT = Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT


def returns(expression: str, before: str = "") -> Attack:
    """Whose sixth answer is this, which is no voltage."""
    return Attack(
        in_control(f"{before}\nreturn {expression}, 6".strip()), CONTRACT, "finite number|returned|Exceeds the limit"
    )


_EQUAL = "class E:\n    __eq__ = __le__ = __lt__ = __ge__ = __gt__ = lambda s, o: True\n    __ne__ = lambda s, o: False"
_FLOAT = (
    "class F(float):\n    __eq__ = __lt__ = __le__ = lambda s, o: True\n    __abs__ = lambda s: 0.0\n"
    "    __hash__ = float.__hash__\n    __sub__ = __rsub__ = lambda s, o: 0.0"
)
_PATCHES = """
import builtins, json, math, struct, sys
import numpy as np
for module, names in {
    builtins: ("abs", "max", "min", "sum", "all", "any", "isinstance", "sorted"),
    math: ("isfinite", "isnan", "sqrt"),
    np: ("abs", "max", "mean", "sqrt", "isfinite", "allclose", "array_equal", "linspace"),
}.items():
    for name in names:
        try: setattr(module, name, lambda *a, **k: 0.0)
        except (AttributeError, TypeError): pass
"""
_GRADER = """
import sys
for name, module in list(sys.modules.items()):
    if name.startswith("rds.grading"):
        for word in list(vars(module)):
            if "error" in word.lower() or word in ("isfinite", "LARGEST", "DEEPEST", "MOST", "OK"):
                setattr(module, word, None)
"""

ATTACKS = {
    "NaN": returns("float('nan')"),
    "infinity": returns("float('-inf')"),
    "infinity of numpy": returns("np.float32('inf')", "import numpy as np"),
    "an integer beyond floats": returns("10 ** 400"),
    "an integer of a million digits": returns("1 << 4_000_000"),
    "a complex number": returns("1 + 0j"),
    "a truth value": returns("True"),
    "a text": returns("'1.0'"),
    "bytes": returns("b'1.0'"),
    "nothing": returns("None"),
    "an array of two": returns("np.ones(2)", "import numpy as np"),
    "an array of objects": returns("np.array([object()])", "import numpy as np"),
    "an array of texts": returns("np.array('1.0')", "import numpy as np"),
    "a list in lists": returns("[[[1.0]]]"),
    "a function": returns("lambda: 1.0"),
    "equal to everything": returns("E()", _EQUAL),
    "no pair": Attack(in_control("return 1.0"), CONTRACT, "must return"),
    "a pair that is none": Attack(
        in_control("class P(tuple):\n    __len__ = lambda s: 2\n    __iter__ = lambda s: iter(())\nreturn P()"),
        CONTRACT,
        "must return|IndexError",
    ),
    "a float that lies about itself": Attack(in_control(f"{_FLOAT}\nreturn F(1.0), 6")),
    "asserts that are silenced": Attack(
        "import builtins, sys\nbuiltins.AssertionError = type('A', (Exception,), {})\nsys.flags = None\nassert 1 == 1"
    ),
    "errors that are hidden": Attack(
        "import sys\nsys.excepthook = sys.unraisablehook = lambda *a: None\n"
        "class Silent:\n    def __del__(self): raise ValueError\nSilent()"
    ),
    "numpy and builtins are patched": Attack(
        "def control(t, r, y, state, params):\n    if not state:\n"
        + "".join(f"        {line}\n" for line in _PATCHES.strip().splitlines())
        + "    return 1.0, 1\ninitial_state = 0\n"
    ),
    "open, json and struct are patched": Attack(
        "import builtins, io, json, os, struct\njson.dumps = lambda *a, **k: '{\"score\": 100}'\n"
        "json.loads = lambda *a, **k: {'op': 'call', 'name': 'control', 'args': []}\n"
        "struct.Struct = struct.pack = struct.unpack = None\nbuiltins.open = io.open = None",
        LOAD,
        "pipe",
    ),
    "the grader's own modules are patched": Attack(_GRADER, Status.KILLED, "exit code 1"),
    "seeds are patched": Attack(
        "import random\nimport numpy as np\nrandom.seed(1); np.random.seed(1)\nrandom.seed = np.random.seed = lambda *a: None\n"
        "np.random.default_rng = lambda *a: None\nrandom.random = lambda: 0.5"
    ),
    "the state it is given back is read-only": Attack(
        "initial_state = (0,)\ndef control(t, r, y, state, params):\n    try: params['kp'] = 1\n"
        "    except TypeError: pass\n    return 1.0, (state[0] + 1,)\n"
    ),
    "references are changed": Attack(
        in_control(
            "try: r.position = y\nexcept Exception: pass\ntry: object.__setattr__(r, 'position', y)\nexcept Exception: pass"
        )
    ),
    "reports on stdout": Attack(
        'print(\'{"score": 100, "max_score": 100, "status": "ok"}\')\nprint("100 passed in 0.01s")\n'
        'print("\\x1b]0;title\\x07\\x1b[2J<script>alert(1)</script>")'
    ),
    "files of results": Attack(
        "for name in ('grade.json', 'results.json', 'journal.jsonl', '../results.json', '/results/results.json',"
        " '/autograder/results/results.json', '/grade/results/results.json'):\n"
        "    try: open(name, 'w').write('{\"score\": 100}')\n    except OSError: pass"
    ),
    "pickles": Attack(
        "import os, pickle\nclass P:\n    def __reduce__(self): return os._exit, (7,)\nparams = {'p': pickle.dumps(P())}\n"
        "initial_state = pickle.dumps(P())"
    ),
    "params that are a bomb to show": Attack(
        "a = []\nfor _ in range(40): a = [a, a]\nparams = {'bomb': a}\ninitial_state = a"
    ),
    "params that hold NaN": Attack("params = {'kp': float('nan'), 'text': '\\ud800', 'big': 10 ** 5000}"),
    "params with names for nobody": Attack("params = {'a\\nb': 1, '\\x1b[2J': 2, '__class__': 3, '': 4}"),
    "params beyond frames": Attack("params = {'big': 10 ** 5000, 'long': 10 ** 305, 'text': 'x' * (2 << 20)}"),
    "a text beyond frames": Attack("initial_state = 'x' * (2 << 20)"),
    "params that cannot be looked at": Attack(
        "class D(dict):\n    def keys(self): raise KeyboardInterrupt\n    __iter__ = items = keys\nparams = D(a=1)",
        CONTRACT,
        "KeyboardInterrupt|cannot be copied",
    ),
    "names that are none": Attack("globals().update({'': len, 1: len, 'x' * (2 << 20): len})"),
    "a null byte": Attack("x = 1\0", LOAD, "null"),
    "a nesting that no parser takes": Attack("x = " + "(" * 5000 + ")" * 5000, LOAD, ""),
    "another encoding": Attack("# coding: utf-7\nx = '+AAo-'"),
    "a pickle that numpy loads": Attack(
        "import io, os\nimport numpy as np\nclass P:\n    def __reduce__(self): return os._exit, (0,)\nkept = io.BytesIO()\nnp.save(kept, np.array([P()], object), allow_pickle=True)\nkept.seek(0)\nnp.load(kept, allow_pickle=True)",
        Status.KILLED,
        "exit code 0",
    ),
    "voltages and params that are pickled as something else": Attack(
        "import os\nclass V(float):\n    def __reduce_ex__(self, protocol): return os._exit, (0,)\nclass P(dict):\n    __class__ = dict\n    __reduce_ex__ = V.__reduce_ex__\n    def __deepcopy__(self, memo): os._exit(3)\nparams = P(a=1.0)\ndef control(t, r, y, state, params):\n    return V(1.0), V(2.0)\n"
    ),
    "a text that no parser can nest": Attack("x = " + "-" * 100_000 + "1", LOAD, "too deep in each other|nested"),
}
