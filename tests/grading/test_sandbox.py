"""What a submission answers inside the sandbox is what it answers outside, sample for sample; nothing is left over."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from rds.core.load import load_student
from rds.core.types import ArcSegment, LineSegment, Reference
from rds.grading.grade import Status
from rds.grading.sandbox import Limits, Pool, SubmissionError
from rds.grading.sandbox.inside.worker import _callable_names
from rds.models.student import student_model
from rds.modes.parts import start

T = 1e-3
PD = """
import numpy as np
params = {"Kp": 30.0, "Kd": 0.3}
initial_state = [0.0, np.zeros(2)]
def control(t, r, y, state, params):
    error = r.position - y
    memory = state[1] * 0.5 + np.array([error, t])
    return params["Kp"] * error + params["Kd"] * (error - state[0]) / 1e-3 + memory.sum(), [error, memory]
"""
MODEL = """
params = {"K": 1.764, "tau": 9.943e-3}
def derivatives(t, x, u, params):
    return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]
"""
INTERPOLATOR = """
import math
def interpolate(segment, T, params):
    moves = [b - a for a, b in zip(segment.start, segment.end)]
    distance = math.hypot(*moves)
    n = math.ceil(distance / segment.feed_rate / T)
    for k in range(1, n + 1):
        position = [a + m * k / n for a, m in zip(segment.start, moves)]
        yield position, [m / distance * segment.feed_rate for m in moves], [0.0] * len(moves)
"""


def questions(samples: int) -> list[tuple[float, Reference, float]]:
    """Time, reference and position of as many samples."""
    return [
        (k * T, Reference(5.0 * math.sin(k / 50), 0.1 * math.cos(k / 50), 0.0), 5.0 * math.sin(k / 50 - 0.1))
        for k in range(samples)
    ]


@pytest.mark.parametrize("jobs", [1, 64])  # processors apart where there are two, and one for both
def test_a_controller_answers_as_it_does_outside(jobs: int, pool: Pool, written: Callable[..., Path]) -> None:
    path = written(PD, "")
    controller = load_student(path).controller()
    state, expected = controller.initial_state, []
    for t, r, y in questions(500):
        u, state = controller.control(t, r, y, state, controller.params)
        expected.append(float(u))
    with Pool(jobs=jobs, slot=0) as other, other.open(path) as subject:
        assert subject.loaded.defines == ("control",)
        assert subject.loaded.params == {"Kp": 30.0, "Kd": 0.3}
        assert subject.loaded.initial_state == [0.0, [0.0, 0.0]]
        subject.begin_control(T=T)
        assert [subject.control(*question) for question in questions(500)] == expected
        assert subject.counts.calls == 500


def test_parameters_go_before_its_own(pool: Pool, written: Callable[..., Path]) -> None:
    text = "params = {'gain': 2.0}\ndef control(t, r, y, state, params): return params['gain'] * state[0], state\n"
    with pool.open(written(text, "initial_state = [1.0]")) as subject:
        subject.begin_control({"gain": 3.0}, [5.0], T)
        assert subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0) == 15.0
        with pytest.raises(SubmissionError, match="gian"):
            subject.begin_control({"gian": 3.0}, [5.0], T)


def test_several_axes_get_and_give_arrays(pool: Pool, written: Callable[..., Path]) -> None:
    text = "def control(t, r, y, state, params): return r.position - y + r.velocity[::-1], state"
    with pool.open(written(text, "")) as subject:
        subject.begin_control(T=T, axes=("X", "Y"))
        assert subject.control(0.0, ((1.0, 2.0), (10.0, 20.0), (0.0, 0.0)), (0.5, 0.25)) == (20.5, 11.75)


def test_finite_voltages_are_taken_whose_sum_is_not(pool: Pool, written: Callable[..., Path]) -> None:
    law = "def control(t, r, y, state, params):\n    return [1.7e308, 1.7e308], state\n"
    with pool.open(written(law, "")) as subject:
        subject.begin_control(T=T, axes=("X", "Y"))
        assert subject.control(0.0, ((0.0, 0.0),) * 3, (0.0, 0.0)) == (1.7e308, 1.7e308)


def test_a_model_moves_as_it_does_outside(pool: Pool, written: Callable[..., Path]) -> None:
    path = written(MODEL, "")
    motion = start(student_model(load_student(path)), T)
    voltages = [math.sin(k / 20) for k in range(200)]
    expected = [motion.read()]
    for voltage in voltages:
        motion.write(voltage)
        expected.append(motion.read())
    with pool.open(path, kind="model") as subject:
        assert [subject.begin_model(T=T), *map(subject.advance, voltages)] == expected


def test_rows_of_an_interpolator_come_as_numbers(pool: Pool, written: Callable[..., Path]) -> None:
    with pool.open(written(INTERPOLATOR, ""), kind="interpolator") as subject:
        rows = list(subject.rows(LineSegment((0.0, 0.0), (3.0, 4.0), 20.0), T))
        assert len(rows) == 250
        assert rows[-1][0] == (3.0, 4.0)
        assert rows[0][1] == pytest.approx((12.0, 16.0))
        arc = ArcSegment((0.0, 0.0), (2.0, 0.0), (1.0, 0.0), 20.0, clockwise=True)
        assert len(list(subject.rows(arc, T))) == 100


def test_a_row_that_is_none_is_a_fault_and_no_end(pool: Pool, written: Callable[..., Path]) -> None:
    path = written("def interpolate(segment, T, params):\n    yield [1.0], [0.0], [0.0]\n    yield\n")
    segment = LineSegment((0.0,), (1.0,), 10.0)
    with pool.open(path, kind="interpolator") as subject, pytest.raises(SubmissionError, match="row 1 is None"):
        list(subject.rows(segment, 1e-3))


def test_an_interpolator_without_an_end_is_cut(pool: Pool, written: Callable[..., Path]) -> None:
    text = "def interpolate(segment, T, params):\n    while True:\n        yield [0.0], [0.0], [0.0]\n"
    with (
        pool.open(written(text, ""), kind="interpolator") as subject,
        pytest.raises(SubmissionError, match="more than 500 rows") as caught,
    ):
        list(subject.rows(LineSegment((0.0,), (1.0,), 1.0), T, most=500))
    assert caught.value.status is Status.BROKE_CONTRACT


def test_functions_take_and_give_plain_values(pool: Pool, written: Callable[..., Path]) -> None:
    text = """
import numpy as np
def table(a, b): return {"sum": a + b, "rows": np.outer([a, b], [1, 2])}
def nothing(): return object()
def infinite(): return [1.0, float("inf")]
def fails(): return 1 / 0
"""
    with pool.open(written(text, ""), kind="functions") as subject:
        assert subject.call("table", [1, 2.5]) == {"sum": 3.5, "rows": [[1.0, 2.0], [2.5, 5.0]]}
        for name, said in [
            ("nothing", "a object"),
            ("infinite", "holds inf"),
            ("fails", "ZeroDivisionError"),
            ("absent", "no function absent"),
        ]:
            with pytest.raises(SubmissionError, match=said):
                subject.call(name)
        assert subject.call("table", [0, 0])["sum"] == 0  # and the next call is answered


@pytest.mark.parametrize(
    "text",
    [
        "from __future__ import annotations\nfrom dataclasses import dataclass\n@dataclass\nclass G:\n    k: int = 2",
        "import pickle\nclass G:\n    pass\npickle.loads(pickle.dumps(G()))",
        "import sys\nme = sys.modules[__name__]",
        "import locale\nlocale.setlocale(locale.LC_ALL, '')",
    ],
)
def test_a_file_of_functions_is_a_module_like_others(text: str, pool: Pool, written: Callable[..., Path]) -> None:
    with pool.open(written(f"{text}\ndef two(): return 2.0\n", ""), kind="functions") as subject:
        assert subject.call("two") == 2.0


@pytest.mark.parametrize("value", ["Fraction(1, 2)", "np.longdouble(0.5)", "Own(0.5)", "[Fraction(1, 2)][0]"])
def test_a_number_of_whatever_class_is_a_number(value: str, pool: Pool, written: Callable[..., Path]) -> None:
    text = f"import numpy as np\nfrom fractions import Fraction\nclass Own(float): pass\ndef half(): return {value}\n"
    text += "def huge(): return Fraction(10 ** 400, 3)\n"
    with pool.open(written(text, ""), kind="functions") as subject:
        assert subject.call("half") == 0.5
        with pytest.raises(SubmissionError, match="a Fraction beyond what a float can be"):
            subject.call("huge")


def test_nothing_of_one_case_is_left_for_the_next(pool: Pool, written: Callable[..., Path]) -> None:
    text = """
import builtins, os, tempfile
calls = []
def control(t, r, y, state, params):
    calls.append(t)
    builtins.seen = getattr(builtins, "seen", 0) + 1
    with open(tempfile.gettempdir() + "/memory", "a") as file:
        file.write("x")
    return float(len(calls) + builtins.seen + os.path.getsize("/tmp/memory")), state
initial_state = ()
"""
    with pool.open(written(text, "")) as subject:
        answers = []
        for _ in range(3):
            subject.begin_control(T=T)
            answers.append([subject.control(k * T, Reference(0.0, 0.0, 0.0), 0.0) for k in range(3)])
    assert answers == [[3.0, 6.0, 9.0]] * 3


def test_a_fault_names_time_line_and_remedy_and_the_next_run_can_begin(
    pool: Pool, written: Callable[..., Path]
) -> None:
    text = "def control(t, r, y, state, params):\n    return 1.0 / (0.003 - t), state\n"
    with pool.open(written(text, "initial_state = ()")) as subject:
        for _ in range(2):
            subject.begin_control(T=T)
            with pytest.raises(SubmissionError, match=r"t = 0\.003 s.*submission\.py, line 2.*ZeroDivisionError") as e:
                for k in range(10):
                    subject.control(k * T, Reference(0.0, 0.0, 0.0), 0.0)
            assert e.value.status is Status.BROKE_CONTRACT
            assert k == 3


@pytest.mark.parametrize("answer", ["float('nan')", "float('inf')", "'1.0'", "None", "[1.0, 2.0]", "True", "10**400"])
def test_only_one_finite_number_is_a_voltage(answer: str, pool: Pool, written: Callable[..., Path]) -> None:
    text = f"def control(t, r, y, state, params): return {answer}, state\ninitial_state = ()"
    with pool.open(written(text, "")) as subject:
        subject.begin_control(T=T)
        with pytest.raises(SubmissionError, match=r"t = 0\.000 s") as caught:
            subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
    assert caught.value.status is Status.BROKE_CONTRACT


def test_samples_come_in_order(pool: Pool, written: Callable[..., Path]) -> None:
    with pool.open(written("")) as subject:
        with pytest.raises(ValueError, match="begin one first"):
            subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
        subject.begin_control(T=T)
        with pytest.raises(ValueError, match="not sample 0"):
            subject.control(T, Reference(0.0, 0.0, 0.0), 0.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def contrl(t, r, y, state, params): return 1.0, state", "did you mean control"),
        ("def control(t, y): return 1.0", "cannot be called"),
        ("def control(t, r, y, state, params) return 1", "syntax error"),
        ("import pandas", "No module named 'pandas'"),
        ("import helpers", "what is graded must be in one file"),
        ("gains = open('gains.csv').read()", "no other file is there: write what it holds into this one"),
        ("x = (", r"Python 3\.\d+ cannot read it"),
        ("import control as ct\ncontrol = ct.tf([60, -30], [1, -0.5], 0.001)", "TransferFunction of python-control"),
        ("from rds.controllers import library_controller", "No module named 'rds.controllers'"),
        ("raise ValueError('\\x1b[2J' + 'x' * 10000)", "ValueError"),
    ],
)
def test_what_cannot_be_loaded_is_said(text: str, said: str, pool: Pool, written: Callable[..., Path]) -> None:
    with pytest.raises(SubmissionError, match=said) as caught:
        pool.open(written(text, ""))
    assert caught.value.status is Status.FAILED_TO_LOAD
    assert len(caught.value.reason) <= 600
    assert caught.value.reason.isprintable()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import pandas", r"submission.py:1: .*what is graded must be in one file"),
        ("x = (", r"submission.py:1: syntax error.*Python 3\.\d+ cannot read it"),
        ("quit()", "remove the exit"),
    ],
)
def test_functions_that_cannot_be_loaded_are_told_the_remedy(
    text: str, said: str, pool: Pool, written: Callable[..., Path]
) -> None:
    with pytest.raises(SubmissionError, match=said):
        pool.open(written(text, ""), kind="functions")


def test_what_it_prints_is_kept(pool: Pool, written: Callable[..., Path]) -> None:
    with pool.open(written("print('hello \\x1b[2J world')\nimport sys\nprint('bad', file=sys.stderr)\n")) as subject:
        pass
    assert subject.output == "hello \N{REPLACEMENT CHARACTER}[2J world\nbad\n"


def test_its_output_can_be_set_up_as_files_for_windows_do(pool: Pool, written: Callable[..., Path]) -> None:
    text = "import io, sys\nsys.stdout.reconfigure(encoding='utf-8')\nprint('5 \\u00b5m')\n"
    text += "sys.stdout = io.TextIOWrapper(sys.stdout.buffer, 'utf-8', line_buffering=True)\nprint('again')\n"
    with pool.open(written(text)) as subject:
        pass
    assert subject.output == "5 \u00b5m\nagain\n"


def test_scipy_and_control_are_there_for_who_imports_them(pool: Pool, written: Callable[..., Path]) -> None:
    text = "import control as ct\nfrom scipy import signal\ndef control(t, r, y, state, params): return 1.0, state\n"
    limits = Limits(load_seconds=20.0)
    with pool.open(written(text, "gain = ct.dcgain(ct.tf([2], [1, 1]))\n"), limits) as subject:
        subject.begin_control(T=T)
        assert subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0) == 1.0


def test_unseeded_random_numbers_are_the_same_each_time(pool: Pool, written: Callable[..., Path]) -> None:
    text = "import random\nimport numpy as np\ndrawn = random.random(), np.random.rand(), hash('text')\n"
    text += "def draw(): return [*drawn, np.random.default_rng().random(), np.random.default_rng().random()]\n"
    drawn = []
    for _ in range(2):
        with pool.open(written(text, ""), kind="functions") as subject:
            drawn.append(subject.call("draw"))
    assert drawn[0] == drawn[1] and drawn[0][-1] != drawn[0][-2]


def test_half_a_character_in_what_it_says_is_told_as_such_and_is_no_tampering(
    pool: Pool, written: Callable[..., Path]
) -> None:
    raises = written('def control(t, r, y, state, params):\n    raise ValueError("no file " + chr(0xDCFF))\n', "")
    with pool.open(raises) as subject:
        subject.begin_control()
        with pytest.raises(SubmissionError, match=r"ValueError: no file \?"):
            subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
    answers = written('def name():\n    return ["x" + chr(0xDCFF)]\n', "", "functions.py")
    with pool.open(answers, kind="functions") as subject, pytest.raises(SubmissionError, match="half a character"):
        subject.call("name")


def test_a_file_that_imports_matplotlib_finds_it_imported(pool: Pool, written: Callable[..., Path]) -> None:
    """Or each case, and above all the run that is counted, would import it anew: 18 s of a grader's time."""
    pytest.importorskip("matplotlib")
    text = 'import sys\nparams = {"ready": "matplotlib.pyplot" in sys.modules}\n'
    with pool.open(written(text + "import matplotlib.pyplot as plt\n")) as subject:
        assert subject.loaded.params == {"ready": True}


AT_HOME = {
    "a window for pictures": "import matplotlib as m\nm.use('TkAgg')\nfrom matplotlib.pyplot import plot\nplot([1])\n",
    "an import for experiments": "from rds import Experiment, read_log\ndef plan(of): return Experiment(of)\n",
    "an import of all": "from rds import *\n",
    "a language": "import locale\nlocale.setlocale(locale.LC_ALL, 'de_DE.UTF-8')\n",
}


@pytest.mark.parametrize("name", AT_HOME)
def test_what_a_file_says_for_its_author_s_computer_does_no_harm(
    name: str, pool: Pool, written: Callable[..., Path]
) -> None:
    if "matplotlib" in AT_HOME[name]:
        pytest.importorskip("matplotlib")
    with pool.open(written(AT_HOME[name])) as subject:
        subject.begin_control()
        assert isinstance(subject.control(0.0, Reference(1.0, 0.0, 0.0), 0.0), float)


def test_what_python_adds_for_who_sits_before_it_is_there(pool: Pool, written: Callable[..., Path]) -> None:
    with pool.open(written("help(len)\nprint(quit, copyright, credits, license, sep='')\n")) as subject:
        assert "Return the number of items" in subject.output and "NameError" not in subject.output
    with pytest.raises(SubmissionError, match=r"it ends the program while it loads: .*SystemExit.*remove the exit"):
        pool.open(written("exit()\n"))
    law = "def control(t, r, y, state, params):\n    if y > 1.0:\n        quit()\n    return 1.0, state\n"
    with pool.open(written(law, "")) as subject:
        subject.begin_control(T=T)
        subject.control(0.0, Reference(1.0, 0.0, 0.0), 0.0)
        with pytest.raises(SubmissionError, match="SystemExit"):
            subject.control(T, Reference(1.0, 0.0, 0.0), 2.0)


def test_who_runs_an_experiment_while_the_file_is_loaded_is_told_what_to_do(
    pool: Pool, written: Callable[..., Path]
) -> None:
    text = "from rds import Experiment\nfound = Experiment(controller='p')\n"
    with pytest.raises(SubmissionError, match=r'line 2.*move what runs experiments under `if __name__ == "__main__"'):
        pool.open(written(text))


def test_a_function_is_found_beside_whatever_is_imported() -> None:
    """Star imports of numpy, scipy and the like bring more than a thousand names; `rise_time` comes late in them."""
    variables = {"__name__": "submission", **{f"a{k}": len for k in range(1500)}}
    exec("def rise_time(tau): return 2.2 * tau", variables)
    assert "rise_time" in _callable_names(variables) and len(_callable_names(variables)) == 1000
