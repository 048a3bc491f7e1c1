"""Whether a controller keeps `control(t, r, y, state, params) -> (voltage, next_state)`, and its signals if any."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping
from numbers import Number
from typing import Any

import numpy as np

from rds.checks import clauses
from rds.checks.allowance import Allowance
from rds.checks.answers import voltage_fault
from rds.checks.checked_code import CheckedCode, checked_code
from rds.checks.exercise import LinearAxis, references
from rds.checks.memory import judge_memory
from rds.checks.replay import Call
from rds.checks.report import CheckReport, Findings, Timing
from rds.checks.timing import Work, judge_time
from rds.checks.values import same, size
from rds.core.adapt import as_controller, is_control_system
from rds.core.blame import STUDENT_ERRORS, is_tuple_for_number, student_error
from rds.core.load import how_to_define, missing_param, wants_state
from rds.core.signals import declaration_fault
from rds.core.signature import argument_fault
from rds.core.types import Controller, Reference
from rds.core.values import has_nan, shown

BUDGET = 2.0  # s of its own for each pass over the run: a slow controller is judged by fewer samples
_LEAST = 5  # samples, whatever they take
_LARGE_ERROR = 100.0  # mm
_SEVERAL = "it works with arrays of several axes: check it with `rds check --axes`, run it with `coupled = true`"


def check_controller(
    controller: Any,
    sample_period: float = 0.001,
    *,
    coupled: bool | None = None,
    axes: int = 2,
    initial_state: Any = None,
    params: Mapping[str, Any] | None = None,
    budget: float = BUDGET,
) -> CheckReport:
    """Check a function, a file, a module or namespace, a `Controller` or a system of python-control, in this process.

    It drives a linear axis along sines and steps for 1800 samples of `sample_period` s; a `coupled` one gets
    arrays of `axes` values. `initial_state` and `params` go before the subject's own. Faults are in the report;
    InputError is raised for a file that cannot be loaded or holds no controller.
    """
    if is_control_system(controller):
        controller = as_controller(controller, sample_period)
    if coupled is None:
        coupled = isinstance(controller, Controller) and controller.coupled
    subject = checked_code(controller, "control", initial_state, params)
    run = _Run(subject, sample_period, axes if coupled else 0, budget)
    run.check()
    return run.found.report("controller", subject.name, run.timing)


class _Run:
    """One check: the subject, and what is found of it."""

    def __init__(self, subject: CheckedCode, sample_period: float, axes: int, budget: float):
        self.found = Findings()
        self.timing: Timing | None = None
        self.subject, self.source = subject, subject.student.source
        self.function = subject.function("control")
        self.T, self.axes, self.budget = sample_period, axes, budget
        self.params: dict[str, Any] = {}
        self.signals: tuple[str, ...] = ()
        self.calls: list[Call] = []
        self.ns: list[int] = []
        self.sizes: list[int] = []

    def check(self) -> None:
        found, student = self.found, self.subject.student
        if fault := argument_fault("control", self.function):
            return found.fault(clauses.ARGUMENTS, fault)
        if not isinstance(student.params, Mapping):
            said = f"params is {shown(student.params)}; write it as a dict of defaults, as in {{'gain': 20.0}}"
            return found.fault(clauses.PARAMS, said)
        if fault := declaration_fault(student.signals):
            return found.fault(clauses.SIGNALS, fault)
        self.signals = tuple(student.signals)
        try:
            self.params = copy.deepcopy(dict(student.params))
            self.initial_state = copy.deepcopy(student.first_state)
        except Exception as error:
            said = f"{error}: keep numbers, lists, dicts and arrays in initial_state and params"
            return found.fault(clauses.SAVED_STATE, said)
        self.work = Work()
        with judge_memory(found, "control()", self.subject, "control", clauses.MEMORY, self.budget) as memory:
            self._drive()
            memory.calls, memory.params = self.calls, self.params
        self._judge_states()
        if not found.faults:
            self._probe()
        best = [min(ns, memory.ns.get(k, ns)) for k, ns in enumerate(self.ns)]
        first = min(self.ns[0], memory.first_ns or self.ns[0]) if self.ns else 0
        self.timing = judge_time(found, "control()", best, first, self.work.close(), self.T)

    def _drive(self) -> None:
        """Close the loop around it, and keep every call."""
        params = copy.deepcopy(self.params)
        state = copy.deepcopy(self.initial_state)
        table = references(self.T)
        plants = [LinearAxis(self.T) for _ in range(max(1, self.axes))]
        with Allowance(self.budget) as allowance:
            for k in range(len(table)):
                if k >= _LEAST and allowance.is_spent():
                    return self.found.tried(k, len(table), self.budget)
                t = k * self.T
                r, y = self._inputs(table, k, plants)
                answer = self._call(t, r, y, state, params)
                if answer is None:
                    return None
                voltage, state, *_ = answer
                self.sizes.append(size(state))
                for plant, u in zip(plants, np.asarray(voltage, dtype=float).ravel(), strict=True):
                    plant.move(t, float(u))
        return None

    def _call(self, t: float, r: Reference, y: Any, state: Any, params: dict[str, Any]) -> Any:
        """Its answer, which is kept with what it was given; None after a fault."""
        try:
            before = copy.deepcopy((t, r, y, state))
        except Exception as error:
            return self._cannot_be_copied(state, error)
        self.work.begin()
        waited = 0 if self.ns else self.work.waited()
        started = time.perf_counter_ns()
        try:
            answer = self.function(t, r, y, state, params)
        except STUDENT_ERRORS as error:
            return self._failed(error, t, before)
        took = time.perf_counter_ns() - started
        self.ns.append(took if self.ns else max(0, took - (self.work.waited() - waited)))
        self.work.end()
        if not self._judge_arguments(before, (t, r, y, state), params) or not self._judge_answer(answer, t):
            return None
        try:
            self.calls.append(Call(before, copy.deepcopy(tuple(answer))))
        except Exception as error:
            return self._cannot_be_copied(answer[1], error)
        return answer

    def _cannot_be_copied(self, state: Any, error: Exception) -> None:
        said = f"next_state {shown(state)} cannot be copied ({error}); keep numbers, lists, dicts and arrays in it"
        self.found.fault(clauses.SAVED_STATE, said)

    def _inputs(self, table: np.ndarray, k: int, plants: list[LinearAxis]) -> tuple[Reference, Any]:
        if not self.axes:
            return Reference(*table[k].tolist()), plants[0].position
        rows = np.array([table[(k + 97 * axis) % len(table)] for axis in range(self.axes)])
        return Reference(*rows.T.copy()), np.array([plant.position for plant in plants])

    def _judge_arguments(self, before: tuple[Any, ...], after: tuple[Any, ...], params: dict[str, Any]) -> bool:
        for name, old, new in zip(("t", "r", "y", "state"), before, after, strict=True):
            if not same(old, new):
                said = f"control() changed its argument `{name}` from {shown(old)} to {shown(new)}"
                remedy = "make a new one and return that" if name == "state" else "work on a copy"
                self.found.fault(clauses.UNCHANGED, f"{said}; {remedy}")
        if not same(self.params, params):
            keys = [key for key in params if not same(params[key], self.params.get(key))]
            said = f"control() changed params[{', '.join(map(repr, keys))}]"
            self.found.fault(clauses.UNCHANGED, f"{said}; params are the settings of a run, keep what changes in state")
            return False
        return True

    def _judge_answer(self, answer: Any, t: float) -> bool:
        fault = voltage_fault(answer, self.axes, self.signals)
        if fault is not None:
            clause, said, remedy = fault
            is_number = isinstance(answer, tuple | list) and bool(answer) and isinstance(answer[0], Number)
            if not self.axes and not self.calls and not is_number and self._works_with_arrays():
                remedy += f"; or, as {_SEVERAL}"
            self.found.fault(clause, f"control() returned {said} at t = {t:.3f} s; {remedy}")
        return fault is None

    def _failed(self, error: BaseException, t: float, before: tuple[Any, ...]) -> None:
        said = student_error(error, self.source)
        may_be_for_several = _is_about_form(error) and not is_tuple_for_number(error)
        if not self.axes and not self.calls and may_be_for_several and self._works_with_arrays():
            return self.found.fault(clauses.RUNS, f"control() fails with one axis's numbers: {said}; {_SEVERAL}")
        if not self.calls:
            if self._is_for_want_of_state(error, before):
                said = f"control() fails with the empty state, and there is no initial_state: {said}"
                remedy = how_to_define("initial_state", "[0.0]", self.source)
                return self.found.fault(clauses.INITIAL_STATE, f"{said}; {remedy}")
            remedy = missing_param(error, self.params, self.source)
            return self.found.fault(
                clauses.RUNS, "; ".join(filter(None, (f"control() failed in its first call: {said}", remedy)))
            )
        if len(self.calls) == 1 and _is_about_form(error) and not _alike(self.initial_state, before[3]):
            returned = f"control() cannot take the next_state that it returned itself, {shown(before[3])}: {said}"
            remedy = f"return it in the form of initial_state, {shown(self.initial_state)}"
            return self.found.fault(clauses.NEXT_STATE, f"{returned}; {remedy}")
        return self.found.fault(
            clauses.RUNS, f"control() failed at t = {t:.3f} s with state {shown(before[3])}: {said}"
        )

    def _is_for_want_of_state(self, error: BaseException, before: tuple[Any, ...]) -> bool:
        student = self.subject.student
        if student.initial_state is not None or student.starts_with_none or not _is_about_form(error):
            return False
        params = copy.deepcopy(self.params)
        return wants_state(error, lambda state: self.function(*before[:3], state, params), self.source)

    def _works_with_arrays(self) -> bool:
        state = copy.deepcopy(self.initial_state)
        try:
            answer = self.function(
                0.0,
                Reference(*np.zeros((3, 2))),
                np.zeros(2),
                state,
                copy.deepcopy(self.params),
            )
        except STUDENT_ERRORS:
            return False
        return voltage_fault(answer, 2, self.signals) is None

    def _judge_states(self) -> None:
        """A state that only grows makes every run end late; a buffer that fills up and stays is nothing to fear."""
        n = len(self.sizes)
        if n < 8:
            return
        first, middle, last = self.sizes[0], self.sizes[n // 2], self.sizes[-1]
        grown = f"the state grew from {first} to {last} values in {n} calls"
        if first < middle < last and self.sizes[-1 - n // 8] < last:
            self.found.fault(clauses.NEXT_STATE, f"{grown}; keep sums, or the last few samples, not the whole past")
        initial = self.subject.student.initial_state
        final = self.calls[-1].answer[1]
        if _is_sequence(initial) and size(initial) and _is_sequence(final) and len(initial) != len(final):
            said = f"next_state has {len(final)} values and initial_state {len(initial)}"
            self.found.warn(clauses.NEXT_STATE, f"{said}; give both the same form")
        elif isinstance(initial, np.ndarray) and isinstance(final, np.ndarray) and initial.shape != final.shape:
            said = f"next_state has the shape {final.shape} and initial_state {initial.shape}"
            self.found.warn(clauses.NEXT_STATE, f"{said}; give both the same form")
        if not has_nan(self.initial_state):
            for (t, *_), (_, state, *_) in self.calls:
                if has_nan(state):
                    return self.found.warn(
                        clauses.NEXT_STATE,
                        f"next_state is {shown(state)} at t = {t:.3f} s: a number has become NaN, and a voltage that "
                        "is finite all the same (min() and max() turn NaN into a limit) lets the run go on with it; "
                        "look for a division by zero, a root, a logarithm or inf - inf",
                    )

    def _probe(self) -> None:
        """Ordinary moments that the run may not have had: all zero, at rest far from the reference."""
        for state in (self.initial_state, self.calls[-1].answer[1]):
            for position, y in ((0.0, 0.0), (_LARGE_ERROR, 0.0), (0.0, _LARGE_ERROR), (-_LARGE_ERROR, 0.0)):
                values = np.zeros((3, self.axes or 1))
                values[0] = position
                measured = np.full(self.axes or 1, y)
                r = Reference(*values) if self.axes else Reference(*values[:, 0].tolist())
                given = f"with r.position = {position:g} mm and y = {y:g} mm"
                try:
                    answer = self.function(
                        0.0, r, measured if self.axes else y, copy.deepcopy(state), copy.deepcopy(self.params)
                    )
                except STUDENT_ERRORS as error:
                    return self.found.fault(
                        clauses.RUNS, f"control() failed {given}: {student_error(error, self.source)}"
                    )
                if fault := voltage_fault(answer, self.axes, self.signals):
                    return self.found.fault(fault[0], f"control() returned {fault[1]} {given}; {fault[2]}")
        return None


def _is_about_form(error: BaseException) -> bool:
    return isinstance(error, IndexError | KeyError | TypeError | ValueError | AttributeError)


def _is_sequence(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray) and not (isinstance(value, np.ndarray) and value.ndim == 0)


def _alike(a: Any, b: Any) -> bool:
    """The same form: as many values in the same kind of thing, a list being as good as a tuple."""
    return size(a) == size(b) and (_is_sequence(a) == _is_sequence(b))
