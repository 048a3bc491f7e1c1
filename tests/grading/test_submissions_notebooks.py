"""Notebooks: what their cells define becomes a file, and what runs, draws or explores stays out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.self_check import self_check
from rds.grading.grade import Status
from rds.grading.intake.items import Refusal
from rds.grading.intake.notebooks import converted
from rds.grading.sandbox import Pool
from tests.grading.batches import ASSIGNMENT, law, notebook
from tests.grading.made import assignment_in


def made(*cells: str) -> dict[str, object]:
    """The names that the converted notebook defines, by running it: these are our own."""
    names: dict[str, object] = {}
    exec(converted(notebook(*cells).encode()).code.decode(), names)
    return names


def test_only_what_the_controller_needs_is_kept() -> None:
    found = converted(
        notebook(
            "import numpy as np\nimport matplotlib.pyplot as plt\nimport rds",
            "params = {'Kp': 1.0}\nlimit = 5.0\nT, state, r = 1e-3, no_such, no_such",
            "%matplotlib inline\n!pip install x\nplt.figure()",
            "def clipped(u):\n    return np.clip(u, -limit, limit)",
            "def control(t, r, y, state, params):\n    return float(clipped(params['Kp'] * (r - y))), state",
            "params['Kp'] = 2.0\nparams.update(Kd=0.1)",
            "experiment = rds.Experiment(controller=control)\nexperiment.run().plot()",
        ).encode()
    )
    text = found.code.decode()
    assert not any(word in text for word in ("matplotlib", "Experiment", "no_such", "pip"))
    names: dict[str, object] = {}
    exec(text, names)
    assert names["params"] == {"Kp": 2.0, "Kd": 0.1}
    assert names["control"](0.0, 9.0, 0.0, None, {"Kp": 2.0}) == (5.0, None)  # type: ignore[operator]
    assert found.notes[0] == "cell 3: 2 of IPython's own commands left out"
    assert found.notes[1].startswith("of its 15 statements 7 define")
    assert "params['Kp'] = 2.0" in found.notes[2] and "plt" not in found.notes[2]


def test_lines_keep_their_numbers() -> None:
    text = converted(notebook("print(1)\nprint(2)", "x = 1\ndef control():\n    return x").encode()).code.decode()
    assert text.split("\n")[6] == "def control():"


def test_what_shares_a_line_with_what_is_graded_is_left_out_too() -> None:
    cell = "params = {'ü': 1.0}; plt.plot([1]); params['K'] = 2.0; plt.plot(\n    [1]); params['T'] = 3.0; plt.show()"
    text = converted(notebook("import matplotlib.pyplot as plt", cell, law()).encode(), ("params",)).code.decode()
    names: dict[str, object] = {}
    exec(text.partition("# cell 3")[0], names)
    assert names["params"] == {"ü": 1.0, "K": 2.0, "T": 3.0} and "plt" not in text


def test_a_fault_of_syntax_is_told_with_its_cell() -> None:
    cells = ("print(1)\nprint(2)", "x = 1\ndef control(t, r, y, state, params)\n    return x")
    found = converted(notebook(*cells).encode())
    assert found.notes[-1].startswith("line 7 is cell 2, line 2 of the notebook: expected ':'; mend it")
    assert found.code.decode().split("\n")[6].startswith("def control")  # as Python's own message has it


def test_a_cell_s_encoding_is_the_notebook_s() -> None:
    code = converted(notebook("# -*- coding: latin-1 -*-\nK = 'ü'\ndef control():\n    return K").encode()).code
    names: dict[str, object] = {}
    exec(compile(code, "submission.py", "exec"), names)
    assert names["K"] == "ü"


def test_code_that_a_parser_would_need_gigabytes_for_is_refused_before() -> None:
    with pytest.raises(Refusal, match=r"its code has 60000\d\d bytes, more than 524288"):
        converted(notebook("x=1\n" * 750_000, "x=1\n" * 750_000).encode())


def test_decorators_defaults_conditions_and_loops() -> None:
    names = made(
        "def twice(f):\n    return lambda *a: 2 * f(*a)",
        "K = 3\nif K > 2:\n    gain = 5\nelse:\n    gain = 6",
        "table = []\nfor n in range(3):\n    table.append(n * gain)",
        "unused = 1 / 0",
        "@twice\ndef control(x, g=gain):\n    return g * x + sum(table)",
    )
    assert names["control"](1) == 2 * (5 + 0 + 5 + 10)  # type: ignore[operator]
    assert "unused" not in names


def test_classes_and_names_in_them() -> None:
    names = made("base = 4", "class Filter:\n    order = base", "def control():\n    return Filter().order")
    assert names["control"]() == 4  # type: ignore[operator]


def test_a_percent_sign_that_is_none_of_ipython_s() -> None:
    assert made("a = 7\ncontrol = (a\n% 4)")["control"] == 3


def test_a_cell_of_another_language_is_left_out() -> None:
    assert "rm" not in made("%%bash\nrm = 1", "control = 1")


def test_what_a_function_of_the_notebook_changes_is_changed() -> None:
    names = made(
        "gains, laws, k = {}, {}, 1.0",
        "def tune():\n    global k\n    k = 30.0\n    fill(gains)",
        "def fill(table, more=None):\n    table['Kv'] = 0.5",
        "def register(f):\n    laws['mine'] = f\n    return f",
        "tune()",
        "_ = fill(gains)",
        "fill(other := {}); unused = 1 / 0",
        "@register\ndef law(e):\n    return k * e + gains['Kv']",
        "control = laws['mine']",
    )
    assert names["control"](2.0) == 60.5  # type: ignore[operator]
    assert "unused" not in names


def test_what_changes_a_parameter_but_needs_more_than_is_there_is_left_out_and_said() -> None:
    found = converted(
        notebook(
            "import rds\nparams = {'Kp': 1.0}",
            "def tried(k):\n    params['Kp'] = k\n    return rds.Experiment(controller=control).run()",
            "for k in (2.0, 4.0):\n    tried(k).plot()",
            "params['Kp'] = 3.0\ndef control(e):\n    return params['Kp'] * e",
        ).encode()
    )
    names: dict[str, object] = {}
    exec(found.code.decode(), names)
    assert names["control"](1.0) == 3.0  # type: ignore[operator]
    assert any("calls of tried() are left out" in note for note in found.notes)


@pytest.mark.parametrize(
    ("cell", "lines"),
    [
        ("files = !ls\nx, = %timeit -o 1\ncontrol = 1", 2),
        ("!pip install \\\n  numpy\ncontrol = 1", 2),
        ("%%time\n%matplotlib inline\ncontrol = 1", 2),
        ("\n%%capture out\ncontrol = 1", 1),
        ("    x = 0\n    %time x\n    control = x + 1", 1),
        ("text = '''\n%d\n'''\n%matplotlib inline\ncontrol = len(text) - 3", 1),
        ("def f():\n    !ls\n    return 1\ncontrol = f()", 1),
    ],
)
def test_ipython_s_commands(cell: str, lines: int) -> None:
    found = converted(notebook(cell).encode())
    assert f"cell 1: {lines} of IPython's own commands left out" in found.notes[0]
    assert made(cell)["control"] == 1


def test_code_that_python_cannot_read_is_kept_for_its_message() -> None:
    assert b"def control(:" in converted(notebook("def control(:").encode()).code


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\xff", "not UTF-8"),
        (b"{", "no notebook"),
        (b"[" * 100_000, "no notebook"),
        (b"def control(t, r, y, state, params):", "if it is Python, hand it in as .py"),
        (b"[]", "format 4"),
        (b'{"worksheets": []}', "format 4"),
        (b'{"cells": []}', "no code"),
        (b'{"cells": [{"cell_type": "code", "source": 5}]}', "no text"),
    ],
)
def test_what_is_no_notebook(data: bytes, said: str) -> None:
    with pytest.raises(Refusal, match=said):
        converted(data)


@pytest.mark.parametrize("text", ["(" * 5000, "-" * 50_000 + "1", "x = " + "[" * 150 + "]" * 150, "a." * 20_000 + "b"])
def test_code_made_to_crash_a_parser(text: str) -> None:
    assert converted(notebook(text).encode()).code


@given(st.recursive(st.none() | st.integers() | st.text(), lambda x: st.lists(x) | st.dictionaries(st.text(), x)))
def test_any_json_is_refused_or_converted(value: object) -> None:
    cells = {"cells": [{"cell_type": "code", "source": value}, value]}
    for each in (value, cells):
        try:
            converted(json.dumps(each).encode())
        except Refusal:
            continue


def test_a_notebook_can_be_tried_before_it_is_handed_in(tmp_path: Path, pool: Pool) -> None:
    task = read_assignment(assignment_in(tmp_path / "task", ASSIGNMENT, law()))
    (tmp_path / "mine.ipynb").write_text(notebook("import seaborn", law()))
    (tmp_path / "mine.py").write_text(law())
    tried = [self_check(task, tmp_path / name, "ada", pool) for name in ("mine.ipynb", "mine.py")]
    assert tried[0] == tried[1] and tried[0].status is Status.OK
    (tmp_path / "broken.ipynb").write_text("{")
    with pytest.raises(InputError, match=r"broken\.ipynb: it is no notebook"):
        self_check(task, tmp_path / "broken.ipynb", "ada", pool)


@pytest.mark.parametrize(
    "cell",
    [
        'q = params\nq["Kp"] = 30.0',
        'for d in [params]:\n    d["Kp"] = 30.0',
        'def inner(p):\n    p["Kp"] = 30.0\ndef outer(p):\n    inner(p)\nouter(params)',
        'def set_to(k):\n    params["Kp"] = k\ndef tune():\n    set_to(30.0)\ntune()',
        "from scipy.optimize import minimize_scalar\n"
        'def cost(k):\n    params["Kp"] = 30.0\n    return k * k\nminimize_scalar(cost)',
        'def local():\n    q = params\n    q["Kp"] = 30.0\nlocal()',
        "dict.update(params, Kp=30.0)",
        'from operator import setitem\nsetitem(params, "Kp", 30.0)',
        'params |= {"Kp": 30.0}',
        'from contextlib import nullcontext\nwith nullcontext(params) as p:\n    p["Kp"] = 30.0',
        "class Tuner:\n    def __init__(self, p):\n        self.p = p\n"
        '    def go(self):\n        self.p["Kp"] = 30.0\nt = Tuner(params)\nt.go()',
        "from scipy.optimize import minimize_scalar\n"
        "best = minimize_scalar(lambda k: (k - 30.0) ** 2)\nparams['Kp'] = float(round(best.x))",
        'from types import SimpleNamespace\nheld = SimpleNamespace(p=params)\nheld.p["Kp"] = 30.0',
    ],
)
def test_a_gain_that_is_set_in_any_ordinary_way_is_graded(cell: str) -> None:
    head = 'params = {"Kp": 1.0}\n\ndef control(t, r, y, state, params):\n    return params["Kp"] * y, state'
    run = "import rds\nexperiment = rds.Experiment(controller=control, params=params)\nexperiment.duration = 2.0"
    found = made(head, cell, run)
    assert found["params"] == {"Kp": 30.0}
    assert "experiment" not in found
