"""Models, interpolators and functions that attack: what their answers are made of, and how many there are."""

# ruff: noqa: E501 - an attack is easier to read on the line on which it is written
from __future__ import annotations

from rds.grading.grade import Status
from tests.grading.attacks import Attack

OK, KILLED, TIMED_OUT, LOAD, CONTRACT = (
    Status.OK, Status.KILLED, Status.TIMED_OUT, Status.FAILED_TO_LOAD, Status.BROKE_CONTRACT,
)  # fmt: skip
_ANSWERS = """
import os, struct, sys, time
import numpy as np
there = []
for number in range(3, 64):
    try: os.fstat(number)
    except OSError: continue
    there.append(number)
answers = there[1]
"""
ADVANCE = "\ndef advance(x, u, T, params):\n    return x\n"
ROWS = "\ndef interpolate(segment, T, params):\n    for k in range(3): yield (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)\n"


def output(
    expression: str, before: str = "", status: Status = CONTRACT, said: str = "one number|finite|Error|Exit"
) -> Attack:
    """A model whose output is this."""
    return Attack(f"{_ANSWERS}{before}{ADVANCE}def output(t, x, u, params):\n    return {expression}\n", status, said)


def state(
    expression: str, before: str = "", status: Status = CONTRACT, said: str = "next x|finite|Error|Exit"
) -> Attack:
    """A model whose next state is this."""
    return Attack(f"{_ANSWERS}{before}\ndef advance(x, u, T, params):\n    return {expression}\n", status, said)


def rows(body: str, status: Status = CONTRACT, said: str = "row|numbers|Error|Exit") -> Attack:
    """An interpolator that does this."""
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    return Attack(f"{_ANSWERS}def interpolate(segment, T, params):\n{lines}\n", status, said)


def returned(
    expression: str, before: str = "", status: Status = CONTRACT, said: str = "numbers, texts and lists|failed|pipe"
) -> Attack:
    """A function `f` whose answer is this."""
    return Attack(f"{_ANSWERS}{before}\ndef f(x):\n    return {expression}\n", status, said)


MODELS = {
    "a masked output": output("np.ma.array([1.0], mask=True)"),
    "masked": output("np.ma.masked"),
    "an output that is no number": output("float('nan')"),
    "an output without end": output("float('inf')"),
    "an output of text": output("'1.0'"),
    "two outputs": output("[0.0, 1.0]"),
    "a complex output": output("1j"),
    "nothing as output": output("None"),
    "an output beyond floats": output("10 ** 400"),
    "an output that leaves": output("sys.exit(0)"),
    "an output that ends the process": output("os._exit(0)", status=KILLED, said="exit code 0"),
    "an output that never comes": output("sum(iter(int, 1))", status=TIMED_OUT, said="no answer"),
    "an output that is a file": output("open(__file__)"),
    "a masked state": state("np.ma.array([0.0, 1.0], mask=[True, False])"),
    "a list of masked states": state("[np.ma.array([0.0], mask=True), 1.0]"),
    "a state of text": state("['0', '1']"),
    "a state that is a set": state("{0.0, 1.0}"),
    "a state of three": state("[0.0, 0.0, 0.0]", said="returns 3 values"),
    "a state of a billion": state("np.zeros(10 ** 9)", said="MemoryError"),
    "a state of objects": state("np.array([object(), None])"),
    "a state that becomes none while it runs": state("x * np.inf if x[0] else x + 1.0", said="finite"),
    "an array whose numbers are others when read": state(
        "a",
        "class A(np.ndarray):\n    def tolist(self): return ['x', 'y']\n    def astype(self, *a, **k): return self\n    def ravel(self): return self\na = np.zeros(2).view(A)",
        OK,
        "",
    ),
    "a state whose array is made on demand": state(
        "A()",
        "class A:\n    n = 0\n    def __array__(self, *a, **k):\n        A.n += 1\n        return np.full(2, np.nan if A.n > 1 else 0.0)\n    def __len__(self): return 2\n    def __getitem__(self, k): return (0.0, 0.0)[k]",
        said="finite|next x|numbers",
    ),
    "a first output forged as a text": output(
        'os.write(answers, b\'\\x10\\x00\\x00\\x00{"output": "1.0"}\') and time.sleep(9) or 0.0',
        said="first output|pipe",
    ),
    "a first output forged as true": output(
        "os.write(answers, b'\\x0e\\x00\\x00\\x00{\"output\":true}') and time.sleep(9) or 0.0", said="first output|pipe"
    ),
    "an initial state that is masked": Attack(
        f"{_ANSWERS}initial_state = np.ma.array([0.0, 1.0], mask=[True, False])\n{ADVANCE}", CONTRACT, "finite numbers"
    ),
    "an initial state without end": Attack(
        f"initial_state = [float('inf'), 0.0]\n{ADVANCE}", CONTRACT, "finite numbers"
    ),
    "derivatives that leave by recursion": Attack(
        "def derivatives(t, x, u, params):\n    return derivatives(t, x, u, params)\n",
        CONTRACT,
        "RecursionError|recursion",
    ),
    "derivatives that remember": Attack(
        "kept = []\ndef derivatives(t, x, u, params):\n    kept.append(t)\n    return [0.0, 0.0]\n", OK
    ),
    "a model that searches for what was measured": Attack(
        "import gc\ndef derivatives(t, x, u, params):\n    assert not [each for each in gc.get_objects() if type(each).__name__ in ('Result', 'ModelCase', 'Log')]\n    return [0.0, 0.0]\n",
        OK,
    ),
}
INTERPOLATORS = {
    "masked rows": rows("m = np.ma.array([0.0, 1.0], mask=[True, False])\nyield m, m, m", said="masked"),
    "a masked table": rows("yield np.ma.array(np.zeros((3, 2)), mask=True)", said="masked"),
    "rows of no number": rows("yield (np.nan, 0.0), (0.0, 0.0), (0.0, 0.0)"),
    "rows of text": rows("yield ('0', '0'), ('0', '0'), ('0', '0')"),
    "rows of three axes": rows("yield (0.0,) * 3, (0.0,) * 3, (0.0,) * 3"),
    "rows of different lengths": rows("yield (0.0, 0.0), (0.0,), (0.0, 0.0)"),
    "rows of complex numbers": rows("yield (0j, 0j), (0j, 0j), (0j, 0j)"),
    "rows of truth": rows("yield (True, True), (True, True), (True, True)"),
    "rows beyond floats": rows("yield (10 ** 400, 0), (0, 0), (0, 0)"),
    "rows beyond sums of squares": rows("yield (1e300, 0.0), (0.0, 0.0), (0.0, 0.0)", OK, ""),
    "rows without end": rows("while True: yield (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)", CONTRACT, "no end"),
    "rows without end in an iterator": rows("import itertools\nreturn itertools.repeat(((0.0, 0.0),) * 3)", CONTRACT, "no end"),
    "a row that never comes": rows("while True: pass\nyield", TIMED_OUT, "no answer"),
    "a row that sleeps": rows("time.sleep(60)\nyield", TIMED_OUT, "no answer"),
    "rows that end the process": rows("os._exit(0)\nyield", KILLED, "exit code 0"),
    "rows that are themselves": rows("a = []\na.append(a)\nyield a, a, a", CONTRACT, "row|numbers|Error"),
    "a generator of itself": rows("g = interpolate(segment, T, params)\nyield from g", CONTRACT, "recursion|Recursion"),
    "a generator that stops by an error": rows("yield (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)\nraise GeneratorExit", CONTRACT, "GeneratorExit"),
    "a generator that will not be closed": rows("while True:\n    try: yield (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)\n    except GeneratorExit: pass", CONTRACT, "no end"),
    "a text of rows": rows("return 'abc'", CONTRACT, "returned"),
    "a dict of rows": rows("return {1: 2}", CONTRACT, "returned"),
    "nothing": rows("return None", CONTRACT, "returned nothing"),
    "an iterator whose next is another": rows("class I:\n    def __iter__(self): return self\n    def __next__(self): return I()\nreturn I()", CONTRACT, "row"),
    "counts of rows that were not sent": rows("os.write(answers, struct.pack('<QQd', 0, 0, 1e6) + bytes(100000))\ntime.sleep(9)\nyield", CONTRACT, "pipe"),
    "half a row": rows("os.write(answers, struct.pack('<QQd', 0, 1, 2.5) + bytes(100000))\ntime.sleep(9)\nyield", CONTRACT, "pipe"),
    "an end with what is no number": rows("os.write(answers, struct.pack('<QQd', 0, 1, float('nan')) + bytes(100000))\ntime.sleep(9)\nyield", CONTRACT, "pipe|finite"),
    "a segment that is exchanged": rows("object.__setattr__(segment, 'end', segment.start)\nobject.__setattr__(segment, 'feed_rate', 1e9)\nyield (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)", OK, ""),
    "an array that answers for another shape": rows("class A(np.ndarray):\n    shape = property(lambda s: (3, 2))\n    def __len__(self): return 3\nyield np.zeros((5, 5)).view(A)", CONTRACT, "row|numbers|each"),
    "checks of rows that say yes": rows("import rds.grading.sandbox.inside.runs as r\nr.row_of = lambda row, axes: np.full((3, 2), np.nan)\nyield 1", CONTRACT, "finite"),
}  # fmt: skip
FUNCTIONS = {
    "a class as an answer": returned("type"),
    "a truth of numpy is a truth": returned("np.bool_(True)", status=OK, said=""),
    "not a number": returned("float('nan')"),
    "a list in itself": returned("a", "a = []\na.append(a)"),
    "lists without end": returned("a", "a = []\nfor _ in range(40): a = [a, a]"),
    "an integer of a million digits": returned("1 << 4_000_000"),
    "an integer of three hundred digits": returned("10 ** 298", status=OK, said=""),
    "a text of megabytes": returned("'x' * (2 << 20)", said="frame|bytes|failed|returned"),
    "half a character": returned("'\\ud800'"),
    "a dict of numbers as keys": returned("{1: 2}"),
    "a text that is equal to all": returned("S('x')", "class S(str):\n    __eq__ = lambda s, o: True\n    __hash__ = None"),
    "a float that is equal to all": returned("F(3.0)", "class F(float):\n    __eq__ = __le__ = __lt__ = lambda s, o: True\n    __abs__ = __sub__ = __rsub__ = lambda s, *o: 0.0\n    __hash__ = None", OK, ""),
    "an answer by the pipe": returned("os.write(answers, b'\\x0e\\x00\\x00\\x00{\"value\": [2]}') and None", status=OK, said=""),
    "an answer without the function": Attack(f"{_ANSWERS}f = 5\n", CONTRACT, "no function f"),
    "an answer as code": returned("(lambda: 1).__code__"),
    "an exception in place of an answer": returned("(_ for _ in ()).throw(KeyboardInterrupt)", said="KeyboardInterrupt"),
    "an answer that prints": returned("print('{\"value\": 1.0}') or 2.0", status=OK, said=""),
}  # fmt: skip
