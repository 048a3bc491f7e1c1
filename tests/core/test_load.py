"""A student's file, function or namespace loaded: what it fills, and every way in which it can be wrong."""

from __future__ import annotations

import hashlib
import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from rds.checks import check_controller
from rds.core.errors import ContractError, InputError, Notice
from rds.core.load import from_function, from_namespace, load_student, missing_param, student_error
from rds.core.types import Reference

CONTROL = "def control(t, r, y, state, params):\n    return 0.0, state\n"


@pytest.fixture
def write(tmp_path):
    """Write a file into a folder of its own, and give its path."""

    def write(text: str | bytes, name: str = "mine.py") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def failure(path) -> str:
    with pytest.raises(InputError) as caught:
        load_student(path)
    return str(caught.value)


@pytest.mark.parametrize("text", ["x = " + "-" * 100_000 + "1", "x = " + "1+" * 100_000 + "1", "x = a" + ".a" * 60_000])
def test_what_the_parser_has_no_room_for_is_told_as_such(text, write):
    assert re.search(r"Python 3\.\d+ cannot read it: brackets, operators or `elif` lie too deep", failure(write(text)))


def test_the_file_is_known_by_its_path_text_and_digest(write):
    path = write(CONTROL)
    student = load_student(path)
    assert student.interfaces == ("controller",)
    assert student.source.path == str(path.resolve())
    assert student.source.text == CONTROL
    assert student.source.sha256 == hashlib.sha256(CONTROL.encode()).hexdigest()


@pytest.mark.parametrize(
    ("text", "interfaces"),
    [
        (CONTROL, ("controller",)),
        ("def derivatives(t, x, u, params): return [x[1], u[0]]", ("model",)),
        ("def advance(x, u, T, params): return x\ndef output(t, x, u, params): return x[0]", ("model",)),
        ("def interpolate(segment, T, params): yield", ("interpolator",)),
        (CONTROL + "def interpolate(segment, T, params): yield", ("controller", "interpolator")),
        ("import control\nfrom scipy import interpolate\ndef derivatives(t, x, u, params): return x", ("model",)),
        ("control = lambda t, r, y, state, params: (0.0, state)", ("controller",)),
        ("from functools import partial\ncontrol = partial(max, key=None)\n" + CONTROL, ("controller",)),
    ],
)
def test_interfaces_are_told_by_their_functions(write, text, interfaces):
    assert load_student(write(text)).interfaces == interfaces


def test_a_helper_with_the_name_of_an_interface_is_left_alone(write):
    student = load_student(write(CONTROL + "def interpolate(table, x): return table[x]\ndef output(u): return u\n"))
    assert student.interfaces == ("controller",)
    assert set(student.misfits) == {"interpolate", "output"}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("x = 1\ny = (2\n", ["mine.py:2", "syntax error", "never closed", "`y = (2`"]),
        ("x = 1\n\0", ["mine.py:2", "null bytes"]),
        (b"x = 1\ny = 2\nz = '\xff'\n", ["mine.py:3", "UTF-8"]),
        (b"z = '\xe9'\n", ["mine.py:1", "UTF-8"]),
        ("# coding: rot13\n", ["mine.py", "'rot13' that it declares; save it as UTF-8"]),
        ("# coding: punycode\nx = 1\n", ["mine.py", "'punycode' that it declares"]),
        (b"# coding: ascii\nx = '\xc3\xa9'\n", ["mine.py", "'ascii' that it declares"]),
        ("def f():\n    return 1 / 0\n\nf()\n", ["mine.py:2", "in f: ZeroDivisionError", "`return 1 / 0`"]),
        ("import sys\nsys.exit(3)\n", ["mine.py:2", "remove the exit"]),
        ("import no_such_module_here\n", ["mine.py:1", "install no_such_module_here"]),
        ("async " + CONTROL, ["mine.py:1", "control() is asynchronous", "not `async def`"]),
        ("async def interpolate(segment, T, params): yield 1", ["mine.py:1", "interpolate() is asynchronous"]),
        (CONTROL.replace("return", "yield"), ["mine.py:1", "control() is a generator", "not `yield`"]),
        ("from .other import gain\n", ["mine.py:1", "without the dot", "in one file"]),
        ("import rds.no_such_module\n", ["mine.py:1", "move what runs experiments under"]),
        ("x = 1", ["mine.py", "control(t, r, y, state, params)", "interpolate(segment, T, params)"]),
        (CONTROL.replace("control", "controll"), ["controll(); did you mean control()?"]),
        (CONTROL.replace("control", "Control"), ["Control(); did you mean control()?"]),
        ("def derivative(t, x, u, params): return x", ["did you mean derivatives()?"]),
        ("class Law:\n    def control(self, t, r, y, state, params): return 0, state\n", ["class Law has a method"]),
        (
            f"if __name__ == '__main__':\n    {CONTROL.strip().splitlines()[0]} return 0, state\n",
            ["in line 2", "left margin"],
        ),
        ("import control\n", ["imported module"]),
        ("control = 3.0\n", ["control` is 3.0, not a function"]),
        (
            "def control(t, r, y, state): return 0, state",
            ["mine.py:1", "params missing", "def control(t, r, y, state, "],
        ),
        ("def control(t, r, y, s, p, extra): return 0, s", ["mine.py:1", "'extra'"]),
        ("def control(t, r, y, state, *, params): return 0, s", ["mine.py:1", "cannot be called"]),
        ("def derivatives(x, t, u, params): return x", ["`x` in place 1, where it will be given `t`"]),
        ("params = [1.0]\n" + CONTROL, ["params is [1.0] (list)", "dict of defaults"]),
        ("def output(t): return t\ndef derivatives(t, x, u, params): return x", ["output(t) cannot be called"]),
    ],
)
def test_what_is_wrong_is_said_with_its_place(write, text, parts):
    message = failure(write(text))
    assert all(part in message for part in parts), message


def test_a_missing_file_a_folder_and_a_notebook_are_refused(tmp_path, write):
    assert "no such file" in failure(tmp_path / "none.py")
    assert "a folder" in failure(tmp_path)
    assert "notebook" in failure(write("{}", "mine.ipynb"))


def test_a_byte_order_mark_and_a_declared_encoding_are_read(write):
    assert load_student(write(b"\xef\xbb\xbf" + CONTROL.encode())).interfaces
    assert load_student(write(b"# -*- coding: latin-1 -*-\ns = '\xe9'\n" + CONTROL.encode())).interfaces


def test_each_load_is_a_fresh_copy_and_leaves_nothing_in_the_way(write):
    write("count = 0\n", "helper_of_mine.py")
    path = write("import helper_of_mine\nhelper_of_mine.count += 1\nn = helper_of_mine.count\n" + CONTROL)
    search_path = list(sys.path)
    first, second = load_student(path), load_student(path)
    assert first.functions["control"].__globals__["n"] == second.functions["control"].__globals__["n"] == 1
    assert first.functions["control"].__module__ != second.functions["control"].__module__
    assert "helper_of_mine" not in sys.modules and "mine" not in sys.modules
    assert sys.path == search_path
    assert not list(path.parent.glob("__pycache__"))


def test_a_file_of_the_student_does_not_shadow_a_library(write):
    write("raise RuntimeError('shadowed')\n", "statistics.py")
    write("raise RuntimeError('shadowed')\n", "numpy.py")
    path = write("import numpy, statistics\nparams = {'mean': statistics.mean([1.0, 3.0])}\n" + CONTROL)
    sys.modules.pop("statistics", None)
    assert load_student(path).params == {"mean": 2.0}


def test_the_search_path_is_restored_after_an_error(write):
    search_path = list(sys.path)
    failure(write("import sys\nsys.path.insert(0, 'x')\n1 / 0\n"))
    assert sys.path == search_path
    assert not [name for name in sys.modules if name.startswith("rds_student_mine") and "1 / 0" in name]


def test_dataclasses_with_postponed_annotations_work(write):
    text = "from __future__ import annotations\nfrom dataclasses import dataclass\n\n"
    text += "@dataclass\nclass State:\n    z: float = 0.0\n\ninitial_state = State()\n" + CONTROL
    assert load_student(write(text)).controller().initial_state.z == 0.0


def test_a_controller_has_its_own_params_and_state(write):
    student = load_student(write("params = {'gain': [1.0]}\ninitial_state = [0.0]\n" + CONTROL))
    law = student.controller(params={"gain": [2.0]})
    assert law.params == {"gain": [2.0]} and law.source.sha256 == student.source.sha256
    law.initial_state.append(1.0)
    assert student.initial_state == [0.0] and student.params == {"gain": [1.0]}


def test_an_unknown_parameter_lists_the_known_ones(write):
    student = load_student(write("params = {'gain': 1.0, 'limit': 10.0}\n" + CONTROL))
    with pytest.raises(InputError, match="'gian'; known parameters: gain, limit"):
        student.controller(params={"gian": 2.0})


def test_a_missing_initial_state_is_noticed_before_the_run(write):
    text = "def control(t, r, y, state, params):\n    return state[0], state\n"
    with pytest.raises(
        ContractError, match=r"no initial_state.*line 2, in control.*define it, as in `initial_state = "
    ):
        load_student(write(text)).controller()
    assert load_student(write("initial_state = [0.0]\n" + text)).controller().initial_state == [0.0]
    lazy = "initial_state = None\n" + text.replace("state[0], state", "0.0 if state is None else state[0], [y]")
    assert load_student(write(lazy)).controller().initial_state is None  # and not the empty state: it is written there
    assert check_controller(write(lazy)).ok


@pytest.mark.parametrize(("looks", "is_params"), [("p['slow']", True), ("GAINS['slow']", False)])
def test_only_a_key_that_is_missing_in_params_is_to_be_defined_there(write, looks, is_params):
    """A slip in the key of a table of the student's own was to become a parameter, which helps nothing."""
    body = f"    p = params\n    return {looks}, state\n"
    file = write("GAINS = {'fast': 30.0}\ndef control(t, r, y, state, params):\n" + body)
    assert ("define it, as in `params = {'slow': 1.0}`" in str(check_controller(file))) is is_params
    if is_params:
        with pytest.raises(ContractError, match="looks for 'slow', which is not in params"):
            load_student(file).controller()
    else:
        load_student(file).controller()  # whoever runs it reports it


@pytest.mark.parametrize("fails", ["r - y", "control.no_such", "len(params['gain'])", "float('x')"])
def test_a_controller_that_fails_whatever_its_state_is_not_told_to_have_another(write, fails):
    text = f"params = {{'gain': 1.0}}\ndef control(t, r, y, state, params): return {fails}, state\n"
    law = load_student(write(text)).controller()
    with pytest.raises((TypeError, AttributeError, ValueError)):
        law.control(0.0, Reference(0.0, 0.0, 0.0), 0.0, law.initial_state, law.params)


@pytest.mark.parametrize("needs", ["state[0]", "state['i']", "[1.0][int(state)]"])
def test_a_controller_that_lacks_its_state_is_told_so(write, needs):
    with pytest.raises(ContractError, match="no initial_state"):
        load_student(write(f"def control(t, r, y, state, params): return {needs}, state\n")).controller()


def test_a_reference_that_is_taken_for_a_number_says_what_its_numbers_are():
    with pytest.raises(TypeError) as caught:
        Reference(0.0, 0.0, 0.0) - 1.0  # type: ignore[operator]
    assert "r.position" in student_error(caught.value)


def test_an_array_that_is_taken_for_a_number_is_explained():
    with pytest.raises(TypeError) as caught:
        float(np.array([1.0, 2.0]))
    assert "(of an array of one number, such as a model's u, [0] is the number)" in student_error(caught.value)


def test_a_generator_that_another_one_ends_is_blamed_on_its_line(write):
    student = load_student(
        write("def interpolate(segment, T, params):\n    while True:\n        yield next(iter(()))\n")
    )
    with pytest.raises(RuntimeError) as caught:
        next(student.functions["interpolate"](None, 1e-3, {}))
    said = student_error(caught.value, student.source)
    assert said.startswith("mine.py, line 3, in interpolate: RuntimeError: generator raised StopIteration")


def test_there_is_no_controller_in_a_model(write):
    with pytest.raises(ContractError, match="no controller"):
        load_student(write("def derivatives(t, x, u, params): return x")).controller()


def law_of_a_cell(t, r, y, state, params):
    return params["gain"] * (r.position - y), state


def test_a_function_from_a_cell():
    student = from_function(law_of_a_cell, params={"gain": 2.0})
    law = student.controller()
    assert law.params == {"gain": 2.0} and law.control is law_of_a_cell
    assert "def law_of_a_cell" in student.source.text
    assert student.source.sha256 == hashlib.sha256(student.source.text.encode()).hexdigest()


@pytest.mark.parametrize(
    ("function", "interface"),
    [
        (lambda t, x, u, params: x, "model"),
        (lambda x, u, T, params: x, "model"),
        (lambda a, b, c: (), "interpolator"),
    ],
)
def test_an_unnamed_function_is_told_by_its_arguments(function, interface):
    assert from_function(function).interfaces == (interface,)


@pytest.mark.parametrize("function", [lambda a, b: 0, lambda a, b, c, d: 0])
def test_a_function_that_could_be_anything_is_refused(function):
    with pytest.raises(ContractError, match="cannot tell which interface"):
        from_function(function)


def test_a_namespace_and_a_module():
    namespace = {"control": law_of_a_cell, "params": {"gain": 2.0}, "initial_state": [0.0], "other": 3}
    module = types.ModuleType("lesson")
    vars(module).update(namespace)
    for given in (namespace, module):
        student = from_namespace(given)
        assert student.interfaces == ("controller",) and student.initial_state == [0.0]
        assert "law_of_a_cell" in student.source.text


def test_an_error_is_reduced_to_the_students_line(write):
    write("def halve(x):\n    return x / 0\n", "parts_of_mine.py")
    text = "import json\nfrom parts_of_mine import halve\n\n\ndef control(t, r, y, state, params):\n"
    path = write(text + "    if t > 1:\n        json.loads('{')\n    return halve(y), state\n")
    control = load_student(path).functions["control"]
    with pytest.raises(ValueError) as caught:
        control(2.0, None, 1.0, (), {})
    said = student_error(caught.value, path)
    assert said.startswith("mine.py, line 7, in control: JSONDecodeError: ") and said.endswith("`json.loads('{')`")
    with pytest.raises(ZeroDivisionError) as division:
        control(0.0, None, 1.0, (), {})
    assert student_error(division.value, path).startswith("parts_of_mine.py, line 2, in halve: ZeroDivisionError")
    assert student_error(division.value).startswith("parts_of_mine.py, line 2")


def test_an_error_without_a_line_or_a_message_still_says_what_it_is():
    class Mute(Exception):
        def __str__(self):
            raise RuntimeError

    assert student_error(ValueError("x")) == "ValueError: x"
    assert "cannot be printed" in student_error(Mute())
    assert len(student_error(ValueError("x" * 10_000))) < 400


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ("30.0 * (r.position - y) ^ 2", r"for \^: .* \(a power is written \*\*\)"),
        ("r.postion - y", r"attribute 'postion' \(r.position, r.velocity and r.acceleration are its numbers\)"),
        ("state[1]", r"index out of range \(the first value is \[0\]; of `state`, initial_state says how many"),
        ("y[0]", r"not subscriptable \(it is one number, as r.position and y are"),
        ("(30,0) * (r.position - y)", r"float' \(a list or tuple stands where a number belongs; 30,0 is a tuple"),
        ("y / (t - 0.0)", r"division by zero \(in the first call t is 0; divide by the sample period"),
        ("(n := n + 1)", r"variable 'n' .* \(a function forgets its variables after each call"),
        ("r.position - y.position", r"attribute 'position' \(r has it; y is the position itself\)"),
    ],
)
def test_a_slip_in_a_formula_is_told_with_its_remedy(tmp_path: Path, answer: str, said: str) -> None:
    file = tmp_path / "law.py"
    file.write_text(f"def control(t, r, y, state, params):\n    return {answer}, state\n")
    with pytest.raises((AttributeError, TypeError, LookupError, ArithmeticError, NameError)) as broken:
        load_student(file).functions["control"](0.0, Reference(1.0, 0.0, 0.0), 0.5, (), {})
    assert re.search(said, student_error(broken.value, file))


def test_a_class_in_place_of_the_function_is_named(tmp_path: Path) -> None:
    file = tmp_path / "law.py"
    file.write_text("class control:\n    def __call__(self, t, r, y, state, params):\n        return 0.0, state\n")
    with pytest.raises(InputError, match=r"its `control` is a class; write a function, `def control\(t, r, y, state"):
        load_student(file)


def test_a_file_of_a_python_control_system_alone_is_told_where_that_goes(write):
    system = write("import control\naxis = control.tf([176.0], [1.0, 100.0, 0.0])\n")
    with pytest.raises(InputError, match=r"`axis` is a system of python-control.*Experiment\(model=axis\)"):
        load_student(system)
    made = write("import control\ns = control.tf('s')\nmodel = 176.0 / (s * (s + 100.0))\n")
    with pytest.raises(InputError, match=r"`model` is a system of python-control.*Experiment\(model=model\)"):
        load_student(made)
    named = write("import control\nderivatives = control.ss([[0, 1], [0, -9]], [[0], [1]], [[1, 0]], 0)\n")
    with pytest.raises(InputError, match=r"write `def derivatives\(t, x, u, params\)`; in it return A @ x \+ B @ u$"):
        load_student(named)


def test_a_notebook_shows_the_users_lines_and_the_message_of_an_error() -> None:
    """IPython's own traceback of a slip in a cell had 75 lines of this package before the message."""
    with pytest.raises(ContractError) as broken:
        from_function(lambda r, y: 0.0, role="control")
    shown = broken.value._render_traceback_()
    assert len(shown) == 2 and shown[0].startswith("test_load.py, line ") and 'role="control"' in shown[0]
    assert "ContractError" in shown[1] and shown[1].endswith(str(broken.value))

    def deep(left: int) -> None:
        if not left:
            raise InputError("deep")
        deep(left - 1)

    with pytest.raises(InputError) as deep_down:
        deep(500)
    assert len(deep_down.value._render_traceback_()) == 4  # a line that calls itself is said once


def test_a_function_of_a_notebook_is_told_how_its_params_go_with_it() -> None:
    """Those of the cell are not looked at, so "define them" sent round in a circle who had."""
    with pytest.raises(ContractError, match=r'hand params over .*`\{"control": control, "params": \{.Kp.: 1.0\}\}`'):
        from_function(lambda t, r, y, state, params: (params["Kp"], state), role="control").controller()


def test_a_param_that_is_spelt_in_another_way_is_shown_as_it_is_there() -> None:
    """ "Hand params over" was said to a student who had, with Kd in place of kd."""
    error, params = KeyError("kd"), {"Kp": 30.0, "Kd": 0.3}
    assert missing_param(error, params, None) == "params has 'Kd': write the name alike in both places"
    assert "hand params over" in missing_param(KeyError("mass"), params, None)


def test_a_function_of_a_notebook_that_keeps_a_global_is_told() -> None:
    """Two runs of one experiment differed without a word."""
    cell: dict[str, object] = {}
    exec("i = 0\ndef control(t, r, y, state, params):\n    global i\n    i += 1\n    return i, state\n", cell)
    with pytest.warns(Notice, match="keeps `i` outside of its state.*return it in next_state"):
        from_function(cell["control"]).controller()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("        return 30 * e, state", "tabs and spaces in indentation (indent with four spaces a level, no tabs)"),
        ("\tprint(“e”)", "(type plain quotation marks, \" or ')"),
    ],
)
def test_what_an_editor_or_a_text_processor_did_is_told_with_its_remedy(tmp_path: Path, line: str, said: str) -> None:
    file = tmp_path / "law.py"
    file.write_text(f"def control(t, r, y, state, params):\n\te = r.position - y\n{line}\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        load_student(file)
    assert said in str(refused.value)


def test_an_empty_file_is_called_empty(tmp_path: Path) -> None:
    file = tmp_path / "law.py"
    file.write_text("\n")
    with pytest.raises(InputError, match=r"law\.py: it is empty; save your code in the editor"):
        load_student(file)


@pytest.mark.parametrize(
    "line",
    [
        "raise TypeError(Mute())",
        "raise Meta('x')",
        "raise SyntaxError('a', (3, 4, 5, 6))",
        "error = SyntaxError('a'); error.filename, error.text, error.msg = __file__, 5, 7; raise error",
        "raise KeyError('x' * 10**6)",
    ],
)
def test_no_exception_of_a_students_own_ends_what_reports_it(tmp_path: Path, line: str) -> None:
    """One that cannot be printed, has no name, or names no file; and a key of 10^6 letters, which is no parameter."""
    file = tmp_path / "law.py"
    file.write_text(
        "class Mute:\n    def __repr__(self): raise RuntimeError\n"
        "class Nameless(type):\n    __name__ = property(lambda self: 1 / 0)\n"
        "class Meta(Exception, metaclass=Nameless): pass\n"
        + line
        + "\ndef control(t, r, y, state, params): return 0.0, state\n"
    )
    with pytest.raises(InputError) as caught:
        load_student(file)
    assert str(file) in str(caught.value) and len(str(caught.value)) < 1000
    text = file.read_text().replace(line, "").replace("return 0.0, state", line.replace("__file__", "None"))
    file.write_text(text)
    law = load_student(file)
    with pytest.raises(Exception) as raised:
        law.controller().control(0.0, Reference(0.0, 0.0, 0.0), 0.0, None, {})
    assert len(student_error(raised.value, file)) < 1000
