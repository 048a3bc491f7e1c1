"""Controllers known to be bad, each with the clause that it breaks."""

from __future__ import annotations

import itertools
import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rds.checks import check_controller, clauses
from rds.core.types import Controller

total = 0.0
history: list[float] = []
counter = itertools.count()
rng = np.random.default_rng(1)


def global_memory(t, r, y, state, params):
    global total
    total += r.position - y
    return total, state


def list_memory(t, r, y, state, params):
    history.append(y)
    return history[-2] - y if len(history) > 1 else 0.0, state


def helper_memory(t, r, y, state, params):
    return _accumulate(r.position - y), state


def _accumulate(error, memory={"sum": 0.0}):  # noqa: B006 - the fault to be found
    memory["sum"] += error
    return memory["sum"]


def default_memory(t, r, y, state, params, memory=[0.0]):  # noqa: B006
    memory[0] += y
    return memory[0], state


def attribute_memory(t, r, y, state, params):
    attribute_memory.last = getattr(attribute_memory, "last", 0.0) + y
    return attribute_memory.last, state


def iterator_memory(t, r, y, state, params):
    return 0.001 * next(counter), state


def _closure_memory():
    last = 0.0

    def control(t, r, y, state, params):
        nonlocal last
        u, last = 10.0 * (y - last), y
        return u, state

    return control


class _Object:
    def __init__(self):
        self.integral = 0.0

    def control(self, t, r, y, state, params):
        self.integral += r.position - y
        return self.integral, state


class _Class:
    integral = 0.0

    @classmethod
    def step(cls, error):
        cls.integral += error
        return cls.integral


def class_memory(t, r, y, state, params):
    return _Class.step(r.position - y), state


def reset_at_start_memory(t, r, y, state, params):
    global total
    total = 0.0 if t == 0.0 else total + y
    return total, state


def chance(t, r, y, state, params):
    return random.gauss(0.0, 1.0), state


def clock(t, r, y, state, params):
    return (time.perf_counter() % 1.0) * (r.position - y), state


def seeded_chance(t, r, y, state, params):
    return rng.normal(), state


def voltage_alone(t, r, y, state, params):
    return 5.0 * (r.position - y)


def nothing(t, r, y, state, params):
    5.0 * (r.position - y)  # forgot to return it


def three_values(t, r, y, state, params):
    return 0.0, 0.0, 0.0


def swapped(t, r, y, state, params):
    return state, 5.0 * (r.position - y)


def generator(t, r, y, state, params):
    yield 0.0, state


def text(t, r, y, state, params):
    return "1.5", state


def boolean(t, r, y, state, params):
    return r.position > y, state


def masked_number(t, r, y, state, params):
    return np.ma.masked_greater(np.ma.array([r.position - y]), 0.05)[0] * 30.0, state


def masked_array(t, r, y, state, params):
    return np.ma.masked_greater(np.ma.array([r.position - y]), 0.05), state


def complex_number(t, r, y, state, params):
    return (y + 0j) ** 0.5, state


def no_number(t, r, y, state, params):
    return None, state


def array_of_several(t, r, y, state, params):
    return np.array([1.0, 2.0]), state


def not_a_number(t, r, y, state, params):
    return float("nan") if t > 0.5 else 0.0, state


def infinite(t, r, y, state, params):
    return np.float64(np.inf), state


def divides_by_zero(t, r, y, state, params):
    return 1.0 / r.position, state


def fails_far_away(t, r, y, state, params):
    table = [0.0] * 20
    return table[int(abs(r.position - y))], state


def grows(t, r, y, state, params):
    return 5.0 * (r.position - y), [*state, y]


def number_for_list(t, r, y, state, params):
    integral = state[0] + r.position - y
    return integral, integral


def changes_state(t, r, y, state, params):
    state[0] += r.position - y
    return state[0], state


def changes_params(t, r, y, state, params):
    params["sum"] = params.get("sum", 0.0) + y
    return 0.0, state


def generator_state(t, r, y, state, params):
    return 0.0, (value for value in (1, 2))


@dataclass
class _Handle:
    name: str


def identity_state(t, r, y, state, params):
    handle = state if isinstance(state, _Handle) else _Handle("a")
    known = getattr(identity_state, "known", {})
    identity_state.known = known
    known[id(handle)] = known.get(id(handle), 0.0) + y
    return known[id(handle)], handle


def slow(t, r, y, state, params):
    end = time.thread_time() + 1.5e-3  # of work, also where others use the processor meanwhile
    while time.thread_time() < end:
        pass
    return 0.0, state


def sleeps(t, r, y, state, params):
    time.sleep(1.2e-3)
    return 0.0, state


def exits(t, r, y, state, params):
    raise SystemExit(1)


def four_arguments(t, r, y, state):
    return 0.0, state


def wrong_order(t, y, r, state, params):
    return 0.0, state


BAD = [
    (global_memory, clauses.MEMORY, "global `total`"),
    (list_memory, clauses.MEMORY, "global `history`"),
    (helper_memory, clauses.MEMORY, "default argument `memory` of _accumulate()"),
    (default_memory, clauses.MEMORY, "default argument `memory`"),
    (attribute_memory, clauses.MEMORY, "attribute `attribute_memory.last`"),
    (iterator_memory, clauses.MEMORY, "`counter`"),
    (_closure_memory(), clauses.MEMORY, "variable `last` around control()"),
    (_Object().control, clauses.MEMORY, "object of _Object.control()"),
    (class_memory, clauses.MEMORY, "class attribute `_Class.integral`"),
    (reset_at_start_memory, clauses.MEMORY, "global `total`"),
    (seeded_chance, clauses.MEMORY, "global `rng`"),
    (identity_state, clauses.MEMORY, "known"),
    (chance, clauses.DETERMINISTIC, "`random`"),
    (clock, clauses.DETERMINISTIC, "`perf_counter`"),
    (voltage_alone, clauses.PAIR, "alone"),
    (nothing, clauses.PAIR, "returned nothing"),
    (three_values, clauses.PAIR, "3 values"),
    (generator, clauses.PAIR, "not `yield`"),
    (swapped, clauses.VOLTAGE, "the state second"),
    (text, clauses.VOLTAGE, "'1.5' (str)"),
    (boolean, clauses.VOLTAGE, "(bool)"),
    (complex_number, clauses.VOLTAGE, "(complex)"),
    (masked_number, clauses.VOLTAGE, "a masked number is none"),
    (masked_array, clauses.VOLTAGE, "a masked number is none"),
    (no_number, clauses.VOLTAGE, "None"),
    (array_of_several, clauses.VOLTAGE, "one number"),
    (not_a_number, clauses.VOLTAGE, "nan at t = 0.501 s"),
    (infinite, clauses.VOLTAGE, "inf"),
    (divides_by_zero, clauses.RUNS, "ZeroDivisionError"),
    (fails_far_away, clauses.RUNS, "y = 0 mm: test_bad_controllers.py, line"),
    (grows, clauses.NEXT_STATE, "grew"),
    (number_for_list, clauses.NEXT_STATE, "in the form of initial_state, [0.0]"),
    (changes_state, clauses.UNCHANGED, "`state`"),
    (changes_params, clauses.UNCHANGED, "'sum'"),
    (generator_state, clauses.SAVED_STATE, "cannot be copied"),
    (slow, clauses.TIME, "compute less"),
    (sleeps, clauses.TIME, "it waits"),
    (exits, clauses.RUNS, "SystemExit"),
    (four_arguments, clauses.ARGUMENTS, "params missing"),
    (wrong_order, clauses.ARGUMENTS, "`y` in place 2"),
]


@pytest.mark.parametrize(("bad", "clause", "detail"), BAD, ids=[getattr(b[0], "__name__", str(b[0])) for b in BAD])
def test_the_broken_clause_is_named(bad, clause, detail):
    report = check_controller(bad, initial_state=[0.0], budget=0.5)
    assert not report.ok
    assert clause in [fault.clause for fault in report.faults], str(report)
    assert detail in str(report)


@pytest.fixture
def crowded() -> Iterator[None]:
    """Eight others work on the one processor that this process may use."""
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("no thread is bound to a processor here")
    processors = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(processors)})  # which those that are started inherit
    work = "import time\nwhile time.process_time() < 60: pass"  # an end of its own, should this test be killed
    others = [subprocess.Popen([sys.executable, "-c", work]) for _ in range(8)]
    yield
    for other in others:
        other.kill()
        other.wait()
    os.sched_setaffinity(0, processors)


def test_a_slow_law_that_others_keep_from_the_processor_is_not_told_that_it_waits(crowded):
    assert "compute less" in str(check_controller(slow, initial_state=[0.0], budget=0.1))


def test_a_late_fault_is_found_when_others_keep_the_law_from_the_processor(crowded):
    """A budget by the clock ended the run at sample 330 of 1800, and the law was said to keep its interface."""
    started = time.process_time()
    assert check_controller(not_a_number, initial_state=[0.0], budget=60.0).faults
    needed = time.process_time() - started
    for _ in range(3):
        report = check_controller(not_a_number, initial_state=[0.0], budget=2 * needed)
        assert "nan at t = 0.501 s" in str(report)


def test_a_run_that_is_cut_short_is_told():
    """At 10 ms a law of 2 ms is fast enough, but a fault at sample 501 is not looked for in 0.1 s."""

    def control(t, r, y, state, params):
        time.sleep(0.002)
        return not_a_number(t / 10, r, y, state, params)

    report = check_controller(control, 0.01, initial_state=[0.0], budget=0.1)
    assert report.ok and re.search(r"only the first \d\d of 1800 samples were tried: they took 0.1 s", str(report))


def undeclared_signals(t, r, y, state, params):
    return 0.0, state, {"velocity": 0.0}


def test_signals_without_a_declaration_are_told_how_to_declare_them():
    report = check_controller(undeclared_signals, initial_state=[0.0])
    assert [fault.clause for fault in report.faults] == [clauses.PAIR]
    assert 'signals = {"velocity": "mm/s"}' in str(report)


def _told(value):
    return lambda t, r, y, state, params: (0.0, state, {"velocity": value(t)})


@pytest.mark.parametrize(
    ("bad", "detail"),
    [
        (lambda t, r, y, state, params: (0.0, state), "without the signals velocity"),
        (lambda t, r, y, state, params: (0.0, state, [1.0]), "the signals are [1.0]"),
        (lambda t, r, y, state, params: (0.0, state, {"speed": 1.0}), "lack 'velocity'"),
        (
            lambda t, r, y, state, params: (0.0, state, {"velocity": 1.0, "speed": 1.0}),
            "'speed', which is not declared",
        ),
        (_told(lambda t: float("nan") if t > 0.5 else 0.0), "the signal 'velocity' is nan at t = 0.501 s"),
        (_told(lambda t: np.zeros(2)), "one finite number"),
        (_told(lambda t: "fast"), "the signal 'velocity' is 'fast'"),
    ],
)
def test_declared_signals_are_kept(bad, detail):
    report = check_controller(Controller(bad, (), signals={"velocity": "mm/s"}), budget=30.0)
    assert [fault.clause for fault in report.faults] == [clauses.SIGNALS]
    assert detail in str(report)


def test_a_coupled_law_tells_an_array_of_each_signal():
    def control(t, r, y, state, params):
        return np.zeros(2), state, {"velocity": 0.0}

    report = check_controller(Controller(control, (), coupled=True, signals={"velocity": "mm/s"}))
    assert [fault.clause for fault in report.faults] == [clauses.SIGNALS]
    assert "an array of 2 finite numbers" in str(report)


def test_a_declaration_that_cannot_be_columns_is_a_fault(tmp_path):
    path = tmp_path / "named_badly.py"
    path.write_text(
        "signals = {'measured': 'mm'}\ndef control(t, r, y, state, params): return 0.0, state, {'measured': y}\n"
    )
    report = check_controller(path)
    assert [fault.clause for fault in report.faults] == [clauses.SIGNALS]
    assert "X_measured" in str(report)


def test_signals_by_chance_are_found():
    def control(t, r, y, state, params):
        return 0.0, state, {"velocity": random.random()}

    report = check_controller(Controller(control, (), signals={"velocity": "mm/s"}), budget=30.0)
    assert [fault.clause for fault in report.faults] == [clauses.DETERMINISTIC]


def test_one_broken_clause_is_one_fault():
    """What follows from a fault is not reported as further ones."""
    for bad in (global_memory, chance, voltage_alone, text, grows, changes_state, exits):
        assert len(check_controller(bad, initial_state=[0.0], budget=0.5).faults) == 1, bad.__name__


def test_missing_initial_state_is_named():
    def control(t, r, y, state, params):
        return state[0], state

    report = check_controller(control)
    assert [fault.clause for fault in report.faults] == [clauses.INITIAL_STATE]
    assert "there is no initial_state" in str(report)


def test_an_error_that_any_state_meets_is_not_for_want_of_one():
    def control(t, r, y, state, params):
        return r - y, state

    report = check_controller(control)
    assert [fault.clause for fault in report.faults] == [clauses.RUNS]
    assert "r.position" in str(report) and "initial_state" not in str(report)


def test_params_must_be_a_dict():
    namespace = {"control": lambda t, r, y, state, params: (0.0, state), "params": [1.0]}
    assert [fault.clause for fault in check_controller(namespace).faults] == [clauses.PARAMS]


def contour(t, r, y, state, params):
    error = r.position - y
    return 3.0 * error + 0.5 * error[::-1], state


def test_a_law_for_arrays_gets_the_hint_to_couple_it():
    assert "coupled" in str(check_controller(contour))
    assert check_controller(contour, coupled=True).ok


@pytest.mark.parametrize(
    "voltage", [1.0, [1.0, 2.0, 3.0], np.array([1.0, np.nan]), np.array([[1.0, 2.0]]), ["1", "2"], [1.0, [2.0]]]
)
def test_a_coupled_law_returns_one_voltage_for_each_axis(voltage):
    report = check_controller(lambda t, r, y, state, params: (voltage, state), coupled=True)
    assert [fault.clause for fault in report.faults] == [clauses.VOLTAGE]


def test_a_coupled_law_must_not_write_to_its_arrays():
    def control(t, r, y, state, params):
        y -= r.position
        return -3.0 * y, state

    report = check_controller(control, coupled=True)
    assert [fault.clause for fault in report.faults] == [clauses.UNCHANGED]


def test_a_decimal_comma_is_no_law_of_several_axes(tmp_path: Path) -> None:
    file = tmp_path / "law.py"
    file.write_text("Kp = 30,0\ndef control(t, r, y, state, params):\n    return Kp * (r.position - y), state\n")
    said = str(check_controller(file))
    assert "30,0 is a tuple, 30.0 a number" in said and "--axes" not in said
