"""Whether a model keeps `derivatives(t, x, u, params)` or `advance(x, u, T, params)`, and `output` if it has one."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from rds.checks import clauses
from rds.checks.allowance import Allowance
from rds.checks.checked_code import CheckedCode, checked_code
from rds.checks.memory import judge_memory
from rds.checks.replay import Call
from rds.checks.report import CheckReport, Findings, Timing
from rds.checks.timing import Work, judge_time
from rds.checks.values import same
from rds.checks.vectors import is_ragged, output_fault, vector_fault, vector_of
from rds.core.adapt import as_model, is_control_system
from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import RdsError
from rds.core.signature import argument_fault
from rds.core.types import Model
from rds.core.values import is_table, shown

BUDGET = 2.0  # s for each pass over the run
SUBSTEPS = 2  # of RK4 in each sample: the check wants the path's kind, not its digits
_LEAST = 5
_MOST_STATES = 6
_REST, _PUSH, _SWING = 50, 200, 200  # samples without voltage, at each of ±5 V, and of a 5 Hz sine
_VOLTAGE = 5.0  # V
_RUNAWAY = 1e9  # a state beyond it is unstable, or stiffer than RK4 can follow
_STILL = 1e-6  # mm: a model at rest that moves more than this without voltage is worth a word
_TWO_STEPS = 0.25  # relative difference between two steps of T and one of 2T that is worth a word


def check_model(
    model: Any,
    sample_period: float = 0.001,
    *,
    initial_state: Any = None,
    params: Mapping[str, Any] | None = None,
    budget: float = BUDGET,
) -> CheckReport:
    """Check a function, a file, a module or namespace, a `Model` or a system of python-control, in this process.

    It is given no voltage, ±5 V and a sine for 850 samples of `sample_period` s; x and u are arrays, as
    python-control hands them over. A function is `derivatives` unless its name or its arguments are those of
    `advance`. Faults are in the report; InputError is raised for a file that cannot be loaded or holds no model.
    """
    if is_control_system(model):
        model = as_model(model, sample_period)
    subject = checked_code(model, _role_of(model), initial_state, params)
    role = "advance" if "advance" in subject.student.functions else "derivatives"
    check = _Check(subject, role, isinstance(model, Model), sample_period, budget)
    check.check()
    return check.found.report("model", subject.name, check.timing)


def _role_of(model: Any) -> str:
    if getattr(model, "__name__", "") == "advance":
        return "advance"
    fits = argument_fault("advance", model) is None and argument_fault("derivatives", model) is not None
    return "advance" if callable(model) and fits else "derivatives"


class _Check:
    """One check: the subject, and what is found of it."""

    def __init__(self, subject: CheckedCode, role: str, scalar: bool, sample_period: float, budget: float):
        self.found = Findings()
        self.timing: Timing | None = None
        self.subject, self.source, self.role = subject, subject.student.source, role
        self.function = subject.function(role)
        self.output = subject.student.functions.get("output")
        self.T, self.budget, self.scalar = sample_period, budget, scalar
        self.params: dict[str, Any] = {}
        self.x0 = np.zeros(2)
        self.calls: list[Call] = []
        self.ns: list[int] = []
        self.positions: list[float] = []
        self.outputs: list[float] = []

    def check(self) -> None:
        found, student = self.found, self.subject.student
        for name in ("derivatives", "advance", "output"):
            if name in student.functions and (fault := argument_fault(name, student.functions[name])):
                return found.fault(clauses.ARGUMENTS, fault)
        if not isinstance(student.params, Mapping):
            said = f"params is {shown(student.params)}; write it as a dict of defaults, as in {{'K': 1.764}}"
            return found.fault(clauses.PARAMS, said)
        self.params = copy.deepcopy(dict(student.params))
        if not self._has_initial_state():
            return None
        self.work = Work()
        self.work.begin()
        with judge_memory(found, f"{self.role}()", self.subject, self.role, clauses.NO_MEMORY, self.budget) as memory:
            self._drive()
            self.work.end()
            memory.calls, memory.params = self.calls, self.params
        if not found.faults:
            self._judge_rest()
            if self.role == "advance":
                self._judge_two_steps()
        best = [min(ns, memory.ns.get(k, ns)) for k, ns in enumerate(self.ns)]
        first = min(self.ns[0], memory.first_ns or self.ns[0]) if self.ns else 0
        self.timing = judge_time(found, f"{self.role}()", best, first, self.work.close(), self.T)
        return None

    def _has_initial_state(self) -> bool:
        """Whether the run can begin: with what the student gave, else with [0.0, 0.0]."""
        given = self.subject.student.initial_state
        vector = self.x0 if given is None else vector_of(given)
        if vector is None or not vector.size or not np.isfinite(vector).all():
            remedy = "write a list of finite numbers, as in `initial_state = [0.0, 0.0]`"
            self.found.fault(clauses.INITIAL_STATE, f"initial_state is {shown(given)}; {remedy}")
            return False
        if is_table(given):
            remedy = f"write one list, as in `initial_state = {vector.tolist()}`"
            self.found.fault(clauses.INITIAL_STATE, f"initial_state is {shown(given)}, a table of numbers; {remedy}")
            return False
        self.x0 = vector
        size = self._size_for(vector.size)
        if size == vector.size or (size and given is not None):
            return True  # the run says what is wrong with its answer
        fitting = [n for n in range(1, _MOST_STATES + 1) if self._size_for(n) == n]
        if not fitting:
            return True  # it works with no number of states: the run says why
        said = "there is no initial_state" if given is None else f"initial_state has {_count(vector.size)}"
        remedy = f"define initial_state = {[0.0] * fitting[0]}"
        if "control" in self.subject.student.functions:
            remedy += ", and put the controller, whose state it is, into a file of its own"
        message = f"{said}, and {self.role}() works with {_count(fitting[0])}"
        self.found.fault(clauses.INITIAL_STATE, f"{message}; {remedy}")
        return False

    def _size_for(self, n: int) -> int:
        """How many values a trial call with `n` states gives; 0 if it fails."""
        subject = self.subject
        # In a copy of its own where there is one: a call that comes before the run would spoil its repetition.
        function = subject.fresh().functions[self.role] if subject.fresh else self.function
        try:
            answer = vector_of(function(*self._arguments(0.0, np.zeros(n), 0.0), copy.deepcopy(self.params)))
        except STUDENT_ERRORS:
            return 0
        return 0 if answer is None else answer.size

    def _arguments(self, t: float, x: np.ndarray, u: float) -> tuple[Any, ...]:
        voltage = u if self.scalar else np.array([u])
        return (t, x, voltage) if self.role == "derivatives" else (x, voltage, self.T)

    def _drive(self) -> None:
        """Follow the response to a voltage, and keep every call."""
        x, params = self.x0.copy(), copy.deepcopy(self.params)
        voltages = _voltages(self.T)
        with Allowance(self.budget) as allowance:
            for k, u in enumerate(voltages):
                if k >= _LEAST and allowance.is_spent():
                    return self.found.tried(k, len(voltages), self.budget)
                if self.output is not None and not self._judge_output(k * self.T, x, u):
                    return None
                self.positions.append(float(x[0]))
                after = self._step(k, x, u, params)
                if after is None:
                    return None
                x = after
                if np.abs(x).max() > _RUNAWAY or not np.isfinite(x).all():
                    said = f"a state grows beyond {_RUNAWAY:g} within {k} samples at {u:g} V"
                    self.found.warn(
                        clauses.FINITE, f"{said}; it is unstable, or too fast for {SUBSTEPS} RK4 steps a sample"
                    )
                    return None
        return None

    def _step(self, k: int, x: np.ndarray, u: float, params: dict[str, Any]) -> np.ndarray | None:
        """The state one sample later; None after a fault."""
        first = self._answer(k * self.T, x, u, params)
        if first is None or self.role == "advance":
            return first
        h = self.T / SUBSTEPS
        for i in range(SUBSTEPS):
            t = k * self.T + i * h
            k1 = first if i == 0 else self._answer(t, x, u, params)
            k2 = None if k1 is None else self._answer(t + h / 2, x + h / 2 * k1, u, params)
            k3 = None if k2 is None else self._answer(t + h / 2, x + h / 2 * k2, u, params)
            k4 = None if k3 is None else self._answer(t + h, x + h * k3, u, params)
            if k1 is None or k2 is None or k3 is None or k4 is None:
                return None
            x = x + h / 6 * (k1 + 2 * (k2 + k3) + k4)
        return x

    def _answer(self, t: float, x: np.ndarray, u: float, params: dict[str, Any]) -> np.ndarray | None:
        """What the function says, if it says it properly: a fault is noted otherwise."""
        arguments = self._arguments(t, x.copy(), u)
        before = copy.deepcopy(arguments)
        waited = 0 if self.ns else self.work.waited()
        started = time.perf_counter_ns()
        try:
            answer = self.function(*arguments, params)
        except STUDENT_ERRORS as error:
            situation = _situation(x, u)
            self.found.fault(clauses.RUNS, f"{self.role}() failed {situation}: {student_error(error, self.source)}")
            return None
        took = time.perf_counter_ns() - started
        self.ns.append(took if self.ns else max(0, took - (self.work.waited() - waited)))
        if fault := vector_fault(answer, len(self.x0)):
            self.found.fault(fault[0], f"{self.role}() returned {fault[1]} {_situation(x, u)}; {fault[2]}")
            return None
        if not same(before, arguments) and all(fault.clause != clauses.UNCHANGED for fault in self.found.faults):
            said = f"{self.role}() changed its arguments from {shown(before)} to {shown(arguments)}"
            self.found.fault(clauses.UNCHANGED, f"{said}; work on a copy, `x.copy()`")
        if not same(self.params, params):
            self.found.fault(clauses.UNCHANGED, f"{self.role}() changed params; they are the settings of a run")
            return None
        if self.role == "derivatives" and is_ragged(answer):
            said = f"derivatives() returned numbers and arrays side by side, {shown(answer)}"
            self.found.warn(clauses.SHAPE, f"{said}, which python-control refuses; write u[0] for the voltage")
        self.calls.append(Call(before, copy.deepcopy(answer)))
        return vector_of(answer)

    def _judge_output(self, t: float, x: np.ndarray, u: float) -> bool:
        assert self.output is not None
        given, situation = x.copy(), f"with x = {shown(x.tolist())}"
        try:
            answers = [self.output(t, given, np.zeros(1), self.params) for _ in range(2)]
            other = self.output(t, x.copy(), np.array([u]), self.params)
        except STUDENT_ERRORS as error:
            self.found.fault(clauses.RUNS, f"output() failed {situation}: {student_error(error, self.source)}")
            return False
        if fault := output_fault(answers[0]):
            self.found.fault(fault[0], f"output() returned {fault[1]} {situation}; {fault[2]}")
            return False
        if not same(answers[0], answers[1]):
            self.found.fault(
                clauses.DETERMINISTIC, f"output() returned {shown(answers[0])} and then {shown(answers[1])} {situation}"
            )
        elif not same(answers[0], other):
            said = "output() depends on the voltage; the encoder reads before the voltage of a sample is known"
            self.found.warn(clauses.OUTPUT, f"{said}, so it is always given 0 V")
        if not same(given, x):
            self.found.fault(clauses.UNCHANGED, "output() changed its argument `x`; work on a copy, `x.copy()`")
        self.outputs.append(float(np.asarray(answers[0]).ravel()[0]))
        return True

    def _judge_rest(self) -> None:
        positions = self.outputs or self.positions
        if self.x0.any() or len(positions) <= _REST:
            return
        moved = abs(positions[_REST - 1] - positions[0])
        if moved > _STILL:
            said = f"from rest and without voltage it moves by {moved:.3g} mm in {_REST} samples"
            self.found.warn(clauses.AT_REST, f"{said}; friction does not push, and an offset belongs in params")
        if max(positions) == min(positions):
            said = f"{_VOLTAGE:g} V either way do not move it"
            self.found.warn(clauses.AT_REST, f"{said}; look at the gain and the friction")

    def _judge_two_steps(self) -> None:
        """Two samples of T are one of 2T under the same voltage, unless T is not used or the step is a crude one."""
        call = self.calls[min(len(self.calls) - 1, _REST + 20)]
        x, u = np.asarray(call.arguments[0], dtype=float), _VOLTAGE
        voltage = u if self.scalar else np.array([u])
        try:
            once = vector_of(self.function(x.copy(), voltage, self.T, self.params))
            assert once is not None
            twice = vector_of(self.function(once, voltage, self.T, self.params))
            both = vector_of(self.function(x.copy(), voltage, 2 * self.T, self.params))
            assert twice is not None and both is not None
        except (RdsError, ValueError):
            return None  # it refuses another sample period than its own, openly
        except STUDENT_ERRORS as error:
            said = f"advance() failed over 2T: {student_error(error, self.source)}"
            return self.found.warn(clauses.SAMPLE_TIME, said)
        moved = np.abs(twice - x).max()
        if moved > 0 and np.abs(both - twice).max() > _TWO_STEPS * moved:
            said = f"advance() over 2T gives {shown(both.tolist())}, twice over T {shown(twice.tolist())}"
            remedy = "use T in it, or keep to the sample period that it was made for"
            self.found.warn(clauses.SAMPLE_TIME, f"{said}; {remedy}")
        return None


def _situation(x: np.ndarray, u: float) -> str:
    return f"with x = {shown(x.tolist())} and {u:g} V"


def _count(states: int) -> str:
    return f"{states} state{'s' if states != 1 else ''}"


def _voltages(T: float) -> np.ndarray:
    swing = _VOLTAGE * np.sin(2 * np.pi * 5.0 * T * np.arange(_SWING))
    parts = [np.zeros(_REST), np.full(_PUSH, _VOLTAGE), np.full(_PUSH, -_VOLTAGE), swing, np.zeros(_PUSH)]
    return np.concatenate(parts)
