"""Copies are found whatever was done to their names, numbers, comments and layout; what differs is not."""

from __future__ import annotations

import ast
import json
import re
from itertools import combinations
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.parallel.outcome import Failure, Outcome
from rds.grading.assignment.assignment import read_assignment
from rds.grading.batch.alike import Behaviour, _read, earlier_files
from rds.grading.batch.similarity import (
    GRAM,
    LEAST_COMMON,
    LEAST_SCORE,
    WINDOW,
    Fingerprints,
    Program,
    Uncompared,
    fingerprints,
    fingerprints_and_text,
    identical_files,
    same_loops,
    similar_pairs,
)
from rds.grading.batch.similarity_table import alike_json, found_html
from tests.grading.batches import ASSIGNMENT, law, put
from tests.grading.made import assignment_in

LAW = '''"""PD control with a filtered derivative."""

params = {"Kp": 30.0, "Kd": 0.3, "Kv": 0.567, "filter": 0.004, "T": 0.001}
initial_state = [0.0, 0.0]


def control(t, r, y, state, params):
    """One sample."""
    last_error, slope = state
    error = r.position - y
    share = params["T"] / (params["filter"] + params["T"])
    slope = slope + share * ((error - last_error) / params["T"] - slope)
    voltage = params["Kp"] * error + params["Kd"] * slope + params["Kv"] * r.velocity
    if abs(voltage) > 10.0:
        voltage = 10.0 if voltage > 0.0 else -10.0
    return voltage, [error, slope]
'''
OTHER = """
import numpy as np

A = np.array([[0.9, 0.1], [0.0, 0.8]])


class Observer:
    def __init__(self, gain):
        self.gain = gain

    def step(self, x, y, u):
        for _ in range(1):
            x = A @ x + self.gain * (y - x[0])
        return x + np.array([0.0, u])


def control(t, r, y, state, params):
    x = Observer(np.ones(2)).step(np.asarray(state), y, 0.0)
    while x[0] > 1e3:
        x = x / 2
    return float(-x @ [1.0, 2.0]), x.tolist()


initial_state = [0.0, 0.0]
"""


def disguised(code: str) -> str:
    """Other names, numbers, texts, comments, docstrings, annotations and layout; the same program."""
    for number, name in enumerate(("last_error", "slope", "share", "voltage", "error")):
        code = re.sub(rf"\b{name}\b", f"q{number}", code)
    code = code.replace("30.0", "27.125").replace("One sample.", "Mine!").replace("(t, r, y,", "(t: float, r, y,")
    return "# mine\n\n" + ast.unparse(ast.parse(code)).replace("\n", "\n\n").replace("    ", "  ")


def prints(**codes: str) -> list[Program]:
    return [(name, fingerprints(code.encode())) for name, code in codes.items()]


def test_a_copy_in_disguise_is_the_same_and_another_law_is_not() -> None:
    pairs = similar_pairs(prints(ada=LAW, ben=disguised(LAW), cy=OTHER))
    assert [(pair.first, pair.second, pair.score) for pair in pairs] == [("ada", "ben", 1.0)]


def test_the_lines_are_told() -> None:
    (pair,) = similar_pairs(prints(a=LAW, b="x = 1\n" * 40 + disguised(LAW)))
    assert pair.first_lines[0][0] >= 1 and pair.first_lines[-1][1] <= LAW.count("\n")
    assert pair.second_lines[-1][0] > 40


def test_functions_in_another_order_are_still_found() -> None:
    head, tail = LAW.split("def control", 1)
    moved = f"def control{tail}\n{OTHER.split('class Observer')[1].join(['class Observer', ''])}\n{head}"
    scores = [pair.score for pair in similar_pairs(prints(a=LAW, b=moved))]
    assert scores and scores[0] > 0.6


def test_what_the_template_gave_counts_for_nothing() -> None:
    template = [fingerprints(LAW.encode())]
    assert not similar_pairs(prints(ada=LAW, ben=disguised(LAW)), template)


def test_what_most_of_a_class_have_is_no_sign() -> None:
    everybody = prints(**{f"s{n}": LAW for n in range(20)})
    assert not similar_pairs(everybody)
    few = prints(**{f"s{n}": OTHER for n in range(3)}, **{f"t{n}": f"x{n} = {n}" for n in range(20)})
    assert len(similar_pairs(few)) == 3


@pytest.mark.parametrize("code", ["", "def (", "\0", "(" * 9999, "x = 1", "-" * 5000 + "1"])
def test_code_that_is_none_has_no_pairs(code: str) -> None:
    assert not similar_pairs(prints(ada=code, ben=code))


def test_a_line_that_is_nearly_too_deep_hides_nothing() -> None:
    """It could be read in the sandbox, but not from deep in the stack: a copy with such a line was like nothing."""

    def deep(frames: int) -> Fingerprints:
        return fingerprints(f"{LAW}\nx = {'+'.join(['1'] * 2800)}\n".encode()) if not frames else deep(frames - 1)

    assert len(deep(100)) > LEAST_COMMON


@given(st.lists(st.sampled_from("abcdefgh"), max_size=25), st.lists(st.sampled_from("abcdefgh"), max_size=25))
def test_a_common_passage_of_enough_nodes_is_always_found(before: list[str], after: list[str]) -> None:
    """The guarantee of winnowing. Each form has three nodes or more."""
    forms = dict(zip("abcdefgh", FORMS, strict=True))
    common = [forms[name] for name in "abcdefghhgfedcba"]
    assert 3 * len(common) >= GRAM + WINDOW - 1
    one = "\n".join([*(forms[name] for name in before), *common])
    two = "\n".join([*common, *(forms[name] for name in after)])
    assert fingerprints(one.encode()).keys() & fingerprints(two.encode()).keys()


FORMS = ("x = 1", "f(x)", "x += y", "del x", "x = [y]", "assert x", "x = -y", "x = y if x else 1")


@given(st.lists(st.sets(st.integers(0, 40)), min_size=2, max_size=11))
def test_pairs_are_those_of_a_comparison_one_by_one(values: list[set[int]]) -> None:
    found = {f"s{n:02}": {value: (value, value) for value in own} for n, own in enumerate(values)}
    expected = {
        (a, b, len(both) / min(len(found[a]), len(found[b])), len(both))
        for a, b in combinations(found, 2)
        if len(both := found[a].keys() & found[b].keys()) >= LEAST_COMMON
        and len(both) >= LEAST_SCORE * min(len(found[a]), len(found[b]))
    }
    pairs = similar_pairs(found.items())
    assert {(pair.first, pair.second, pair.score, pair.common) for pair in pairs} == expected
    assert all(sum(last - first + 1 for first, last in pair.first_lines) == pair.common for pair in pairs)


def test_the_same_file_is_always_told_also_when_most_of_a_class_have_it() -> None:
    given = {f"s{n:02}": "law" if n < 7 else f"x{n}" for n in range(12)}
    (group,) = identical_files(given, {"solution.py": "other"})
    assert group.students == tuple(f"s{n:02}" for n in range(7)) and group.source == ""
    (group,) = identical_files(given, {"solution.py": "law"})
    assert group.source == "solution.py"
    shown = found_html(json.loads(alike_json([], [group])))
    assert "solution.py" in shown and "s06" in shown
    assert identical_files({"ada": "x", "ben": "y"}, {"my.py": "y"})[0].students == ("ben",)


def test_a_solution_that_was_handed_out_is_named_as_the_source() -> None:
    found = prints(ada=LAW, ben=disguised(LAW), cy=OTHER)
    (pair,) = similar_pairs(found, sources={"solution.py": fingerprints(LAW.encode()), "b.py": {}})
    assert pair.source == "solution.py"
    (pair,) = similar_pairs(found, sources={"solution.py": fingerprints(OTHER.encode())})
    assert pair.source == ""


def test_of_pairs_as_much_alike_those_that_nothing_explains_come_first() -> None:
    found = prints(ada=OTHER, ben=OTHER, cy=LAW, di=disguised(LAW))
    assert [(pair.first, pair.score) for pair in similar_pairs(found)] == [("ada", 1.0), ("cy", 1.0)]
    pairs = similar_pairs(found, sources={"solution.py": fingerprints(OTHER.encode())})
    assert [(pair.first, pair.source) for pair in pairs] == [("cy", ""), ("ada", "solution.py")]


def test_the_table_escapes_names() -> None:
    pairs = similar_pairs(prints(**{"<b>": LAW, "ben": disguised(LAW)}))
    shown = found_html(json.loads(alike_json(pairs)))
    assert "<b>" not in shown and "&lt;b&gt;" in shown
    assert "No two submissions" in found_html(json.loads(alike_json([])))


def test_files_of_others_are_compared_with_the_class_alone() -> None:
    others = prints(**{"2024/eve": disguised(LAW), "2024/zoe": LAW})
    pairs = similar_pairs(prints(ada=LAW, cy=OTHER), others=others)
    assert {(pair.first, pair.second) for pair in pairs} == {("ada", "2024/eve"), ("ada", "2024/zoe")}


def test_equal_runs_make_a_group_whatever_the_programs_look_like() -> None:
    behaviours = [{"sine": "a", "step": "b"}, {"step": "b", "sine": "a"}, {"sine": "a", "step": "c"}, {}, None]
    one, same, other, *nothing = (Behaviour.of({"behaviour": by_case}).runs for by_case in behaviours)
    given = {"ada": one, "ben": same, "cy": other, "di": nothing[0], "ed": nothing[1]}
    groups = same_loops(given, {"2024/eve": other})
    assert [(group.students, group.others) for group in groups] == [(("ada", "ben"), ()), (("cy",), ("2024/eve",))]
    assert "to the last bit" in found_html(json.loads(alike_json([], [], groups)))


def test_files_of_two_years_in_folders_of_one_name_are_both_compared(tmp_path: Path) -> None:
    read = read_assignment(assignment_in(tmp_path / "task", ASSIGNMENT, law()))
    places = [put(tmp_path / year / "submitted", {"ada.py": year}) for year in ("2023", "2024")]
    found = earlier_files(read, places)
    assert {name: code.read() for name, code in found.items()} == {
        f"{place}/ada": place.parent.name.encode() for place in places
    }
    assert list(earlier_files(read, places[:1])) == ["submitted/ada"]


def test_a_copy_in_a_text_that_is_run_is_told() -> None:
    """It has no structure to compare, so no pair shows it."""
    hidden = b"import re\nPATTERN = re.compile('a')\nCODE = 'x = 1'\nexec(CODE)\nrun = eval\n"
    assert fingerprints_and_text(hidden)[1] == ((4, 5),)
    assert fingerprints_and_text(LAW.encode())[1] == ()
    done = [
        Outcome(0, ({}, ((4, 5),))),
        Outcome(1, ({1: (1, 1)}, ())),
        Outcome(2, failure=Failure.DIED, reason="it <died>"),
    ]
    done.append(Outcome(3, fingerprints_and_text(b"def control(:\n")))
    found = [left_out for *_, left_out in _read(["ada", "bob", "cid", "dan"], iter(done))]
    nothing = Uncompared("dan", (), "Python cannot read it, or it is too short")
    assert found == [Uncompared("ada", ((4, 5),)), None, Uncompared("cid", (), "it <died>"), nothing]
    shown = found_html(json.loads(alike_json([], uncompared=[each for each in found if each])))
    assert "4–5" in shown and "runs text" in shown and "it &lt;died&gt;" in shown and "bob" not in shown
