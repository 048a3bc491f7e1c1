"""An assignment of controllers tried with honest designs, none of which may be zeroed, and cheats, none to be paid.

The honest ones are the reference solution as students would build it (rounded, with a dead band, in a class, ...), and
designs of textbooks for the axis of the first case. The cheats switch from limit to limit everywhere, or do so, or
nothing, only where no margin is measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rds.core.private_files import write_private
from rds.grading.assignment.assignment import Assignment
from rds.grading.batch.grade_one import Graded, Opener, grade_with_runs
from rds.grading.batch.scratch import scratch
from rds.grading.cases.case import COUNTS, LINEAR
from rds.grading.criteria.criterion import Criterion
from rds.grading.grade import Band, Grade

_DECIDES = 20  # samples after which a cheat knows the case by its reference

_WRAPPED = """

_exact = control


def control(t, r, y, state, params):
    {before}
    u, state = _exact(t, r, y, state, params)
    {after}
    return u, state
"""
_AS_STUDENTS_BUILD_IT: Mapping[str, tuple[str, str]] = {
    "its voltage rounded to millivolts": ("pass", "u = round(u, 3)"),
    "its voltage rounded to 12 bits": ("pass", "u = round(u / {limit} * 2048) / 2048 * {limit}"),
    "its measurement rounded to two counts": ("y = round(y / {counts}) * {counts}", "pass"),
    "a dead band of two counts": ("y = r.position if abs(r.position - y) <= {counts} else y", "pass"),
    "a hundredth of the voltage by the sign of the motion": (
        "pass",
        "u += 0.01 * {limit} * ((r.velocity > 0) - (r.velocity < 0))",
    ),
}
_IN_A_CLASS = """

class _Law:
    exact = staticmethod(control)

    def voltage(self, *sample):
        return self.exact(*sample)


def control(t, r, y, state, params):
    return _Law().voltage(t, r, y, state, params)
"""
_TEXTBOOK = {
    "PI control with anti-windup": """
params = {{"Kp": {Kp}, "Ki": {Ki}, "K": {K}, "T": {T}, "limit": {limit}}}
initial_state = [0.0]


def control(t, r, y, state, params):
    error = r.position - y
    asked = params["Kp"] * error + state[0] + r.velocity / params["K"]
    u = max(-params["limit"], min(params["limit"], asked))
    return u, [state[0] + params["T"] * (params["Ki"] * error + 20.0 * (u - asked))]
""",
    "state feedback with a filtered velocity": """
params = {{"Kp": {Kp}, "Kd": {Kd}, "K": {K}, "T": {T}}}
initial_state = [None, 0.0]


def control(t, r, y, state, params):
    last, speed = state
    last = y if last is None else last
    speed = speed + 0.2 * ((y - last) / params["T"] - speed)
    u = params["Kp"] * (r.position - y) + params["Kd"] * (r.velocity - speed) + r.velocity / params["K"]
    return u, [y, speed]
""",
    "sliding mode with a boundary layer": """
params = {{"slope": {slope}, "layer": {layer}, "reach": {reach}, "K": {K}, "T": {T}}}
initial_state = [None, 0.0]


def control(t, r, y, state, params):
    last, speed = state
    last = y if last is None else last
    speed = speed + 0.2 * ((y - last) / params["T"] - speed)
    s = r.velocity - speed + params["slope"] * (r.position - y)
    return r.velocity / params["K"] + params["reach"] * max(-1.0, min(1.0, s / params["layer"])), [y, speed]
""",
}
_RELAY = """
def control(t, r, y, state, params):
    return ({limit} if r.position > y else -{limit}), state
"""
_ELSEWHERE = """

_exact, _first = control, initial_state if "initial_state" in globals() else []
initial_state = [_first, 0, True]


def control(t, r, y, state, params):
    inner, k, is_measured = state
    if k == {decides}:
        is_measured = any(abs(r.position - known) < 1e-9 for known in {known})
    u, inner = _exact(t, r, y, inner, params)
    return (u if is_measured else {otherwise}), [inner, k + 1, is_measured]
"""


def audit(assignment: Assignment, pool: Opener, reference: Grade) -> tuple[list[str], list[str]]:
    """Faults and notes. `reference` is the solution's grade; work, which takes long to count, is not counted."""
    solution = assignment.path(assignment.solution)
    cases: list[Any] = list(assignment.cases)
    if assignment.kind != "controller" or solution is None or solution.suffix != ".py":
        return [], []
    if any(case.is_coupled for case in cases):
        return [], ["it is not tried with other designs: a case has one controller for several axes"]
    tried = _Tried(assignment, pool, [each for each in assignment.criteria if COUNTS not in each.needs])
    text, axis = solution.read_text(encoding="utf-8"), _axis(cases[0])
    faults: list[str] = []
    for name, (before, after) in _AS_STUDENTS_BUILD_IT.items():
        wrapped = _WRAPPED.format(before=before.format(**axis), after=after.format(**axis))
        faults += tried.zeroed(f"the reference solution with {name}", text + wrapped, reference)
    faults += tried.zeroed("the reference solution in a class", text + _IN_A_CLASS, reference)
    if "K" in axis:
        for name, law in _TEXTBOOK.items():
            faults += tried.gated(name, law.format(**axis))
    measured = {name for each in assignment.criteria if LINEAR in each.needs for name in each.cases}
    paid = tried.paid("switching from limit to limit", _RELAY.format(**axis), {case.name for case in cases})
    known = tried.references(solution, measured)
    others = {case.name for case in cases} - measured
    if measured and others:
        for name, otherwise in (("switching", "{limit} if r.position > y else -{limit}"), ("standing still", "0.0")):
            words = {"decides": _DECIDES, "known": known, "otherwise": otherwise.format(**axis)}
            said = f"{name} where no margin is measured, and the reference solution elsewhere,"
            paid += tried.paid(said, text + _ELSEWHERE.format(**words), others)
    if paid and not measured:
        paid = [f"{said}; no criterion measures a margin that could be required" for said in paid]
        return faults, paid
    return faults + paid, _tables(assignment.criteria)


class _Tried:
    """Designs graded for the first student of a check."""

    def __init__(self, assignment: Assignment, pool: Opener, criteria: list[Criterion]):
        self._assignment, self._pool, self._criteria = assignment, pool, criteria

    def zeroed(self, name: str, text: str, reference: Grade) -> list[str]:
        """Criteria in which a design earns nothing, and the solution does."""
        full = {score.name for score in reference.criteria if score.band is Band.FULL and score.max_score}
        return [
            f"{score.title}: an honest design earns nothing ({name}): {score.sentence}"
            for score in self._graded(text).grade.criteria
            if score.name in full and not score.score
        ]

    def gated(self, name: str, text: str) -> list[str]:
        """Gates that a design does not pass."""
        gates = {name for each in self._criteria for name in each.requires}
        linear = {each.name for each in self._criteria if LINEAR in each.needs}
        return [
            f"{score.title}: an honest design earns nothing ({name}), and so nothing that requires it: {score.sentence}"
            for score in self._graded(text).grade.criteria
            if score.name in gates & linear and score.band is Band.NONE
        ]

    def paid(self, name: str, text: str, cases: set[str]) -> list[str]:
        """Criteria of these cases alone that pay a cheat."""
        scores = {score.name: score for score in self._graded(text).grade.criteria}
        return [
            f"{each.title}: {name} earns {scores[each.name].score:.4g} of {each.max_score:.4g} points; let it require "
            "a margin that is measured in its own cases, or a criterion that such a loop does not pass"
            for each in self._criteria
            if each.cases and set(each.cases) <= cases and LINEAR not in each.needs and scores[each.name].score
        ]

    def references(self, solution: Path, cases: set[str]) -> list[float]:
        """By what a cheat knows these cases: the reference of each axis after `_DECIDES` samples."""
        found = grade_with_runs(self._assignment, solution, "student 1", self._pool, criteria=self._criteria)
        runs = [run for run in found.runs if run.case in cases and len(run.result) > _DECIDES]
        return [float(run.result[f"{axis}_reference"][_DECIDES]) for run in runs for axis in run.result.axes]

    def _graded(self, text: str) -> Graded:
        with scratch("audit") as folder:
            path = folder / "submission.py"
            write_private(path, text.encode(), is_own=True)
            return grade_with_runs(self._assignment, path, "student 1", self._pool, criteria=self._criteria)


def _axis(case: Any) -> dict[str, float]:
    """What designs need of the first axis of a case: gains for a damping of 0.7 where its τ and K are known."""
    plan = case.plan
    axis, model = plan.axes[0].axis, case.plants[0].base.params
    high = float(plan.machine.converter.range)
    found = {"limit": high, "counts": 2.0 * float(axis.resolution or 1e-3), "T": float(plan.T)}
    tau, K = model.get("tau"), model.get("K")
    if isinstance(tau, float) and isinstance(K, float):
        Kp = 0.5 / (K * tau)
        found |= {"tau": tau, "K": K, "Kp": Kp, "Ki": 0.5 * Kp, "Kd": 0.1 / K}
        found |= {"slope": 0.3 / tau, "layer": 0.3 * K * high, "reach": 0.3 * high}
    return found


def _tables(criteria: Iterable[Criterion]) -> list[str]:
    """Functions all of whose tests students see."""
    tested = [each for each in criteria if each.tests]
    hidden = {test.function for each in tested if not each.is_visible for test in each.tests}
    seen = sorted({test.function for each in tested if each.is_visible for test in each.tests} - hidden)
    return [f"{name}(): students see all of its tests, and a table of the answers passes them" for name in seen]
