"""An assignment tried with honest designs, none of which may be zeroed, and cheats, none to be paid.

The honest ones are the reference solution as students would build it (rounded, with a dead band, in a class, ...), and
designs of textbooks for the axis of the first case. The cheats switch from limit to limit everywhere, or do so, or
nothing, only where no margin is measured; one shakes the motor beside a good law, which no margin shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rds.grading.assignment.assignment import Assignment
from rds.grading.assignment.by_heart import in_a_notebook, of_interpolators, table_of_voltages
from rds.grading.assignment.trial_grades import DECIDES, TrialGrades
from rds.grading.batch.grade_one import Opener
from rds.grading.cases.case import COUNTS, LINEAR
from rds.grading.criteria.criterion import Criterion
from rds.grading.grade import Grade

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
    "its reference one sample ahead": ("r = r._replace(position=r.position + {T} * r.velocity)", "pass"),
    "its voltage as an array": ("pass", "import numpy\n    u = numpy.array([u])[0]"),
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
    "an LQR with integral action": """
import numpy as np

params = {{"K": {K}, "tau": {tau}, "T": {T}}}
initial_state = [None, 0.0, 0.0]


def _gains(K, tau, T):
    decay = np.exp(-T / tau)
    A = np.array([[1.0, tau * (1.0 - decay), 0.0], [0.0, decay, 0.0], [T, 0.0, 1.0]])
    B = np.array([[K * (T - tau * (1.0 - decay))], [K * (1.0 - decay)], [0.0]])
    Q, R = np.diag([1.0, 1e-5, 10.0]), 1.0 / ({Kp} * {Kp})
    P = Q
    for _ in range(3000):
        F = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ F)
    return F[0].tolist()


_F = _gains({K}, {tau}, {T})


def control(t, r, y, state, params):
    last, speed, area = state
    last = y if last is None else last
    speed = speed + 0.5 * ((y - last) / params["T"] - speed)
    error = r.position - y
    u = _F[0] * error + _F[1] * (r.velocity - speed) + _F[2] * area + r.velocity / params["K"]
    return u, [y, speed, area + params["T"] * error]
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
# More than ±20 % of the limit would be taken for switching. It is the same noise when the work is counted.
_SHAKING = ("import random", "u += random.Random(t).uniform(-0.2, 0.2) * {limit}")
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


def audit(
    assignment: Assignment, pool: Opener, reference: Grade, announce: Callable[[str], None] = lambda text: None
) -> tuple[list[str], list[str]]:
    """Faults and notes. `reference` is the solution's grade; work, which takes long to count, is not counted.

    `announce` gets a sentence before each design, some of which take seconds.
    """
    solution = assignment.path(assignment.solution)
    cases: list[Any] = list(assignment.cases)
    if solution is None or solution.suffix != ".py" or assignment.kind not in ("controller", "interpolator"):
        return [], _tables(assignment.criteria)
    tried = TrialGrades(assignment, pool, [each for each in assignment.criteria if COUNTS not in each.needs], announce)
    if assignment.kind == "interpolator":
        return of_interpolators(tried, solution, reference), []
    if any(case.is_coupled for case in cases):
        return [], ["it is not tried with other designs: a case has one controller for several axes"]
    text, axis = solution.read_text(encoding="utf-8"), _axis(cases[0])
    faults: list[str] = []
    for name, (before, after) in _AS_STUDENTS_BUILD_IT.items():
        wrapped = _WRAPPED.format(before=before.format(**axis), after=after.format(**axis))
        faults += tried.zeroed(f"the reference solution with {name}", text + wrapped, reference)
    faults += tried.zeroed("the reference solution in a class", text + _IN_A_CLASS, reference)
    faults += tried.zeroed("the reference solution in a notebook", in_a_notebook(text, tried.names()), reference)
    if "K" in axis:
        for name, law in _TEXTBOOK.items():
            faults += tried.gated(name, law.format(**axis))
    measured = {name for each in assignment.criteria if LINEAR in each.needs for name in each.cases}
    paid = tried.paid("switching from limit to limit", _RELAY.format(**axis), {case.name for case in cases})
    known = tried.references(solution, measured)
    others = {case.name for case in cases} - measured
    if measured and others:
        for name, otherwise in (("switching", "{limit} if r.position > y else -{limit}"), ("standing still", "0.0")):
            words = {"decides": DECIDES, "known": known, "otherwise": otherwise.format(**axis)}
            said = f"{name} where no margin is measured, and the reference solution elsewhere,"
            paid += tried.paid(said, text + _ELSEWHERE.format(**words), others)
    paid += tried.bought(
        "a table of the voltages of the visible cases", table_of_voltages(tried.visible_runs(solution))
    )
    before, after = (each.format(**axis) for each in _SHAKING)
    shaken = tried.shaken(
        "the reference solution with white noise of 20 % of the limit",
        text + _WRAPPED.format(before=before, after=after),
    )
    if paid and not measured:
        paid = [f"{said}; no criterion measures a margin that could be required" for said in paid]
        return faults, paid + shaken
    return faults + paid, shaken + _tables(assignment.criteria)


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
