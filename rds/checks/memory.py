"""Whether a function remembers anything outside its arguments, and whether it answers the same twice."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rds.checks import clauses
from rds.checks.checked_code import CheckedCode
from rds.checks.hidden_state import changed, outside_sources, remembered
from rds.checks.replay import Call, Difference, Replay
from rds.checks.report import Findings
from rds.checks.values import is_plain

REMEDIES = {
    clauses.MEMORY: "take it from `state` and return it in next_state",
    clauses.NO_MEMORY: "make it a state, an element of x",
    clauses.NO_GLOBALS: "make it a variable inside the function",
}


@dataclass
class Memory:
    """What the run hands over, and the time of the calls made again (ns, by index) that it gets back."""

    calls: Sequence[Call] = ()
    params: dict[str, Any] = field(default_factory=dict)
    ns: dict[int, int] = field(default_factory=dict)
    first_ns: int | None = None


@contextmanager
def judge_memory(
    found: Findings, what: str, subject: CheckedCode, role: str, clause: str, budget: float
) -> Iterator[Memory]:
    """Around the recorded run of the function in `role`: note hidden memory and chance in `found` when it is over.

    The run is first repeated in order in a fresh copy of the file. Only the clock or chance can make that differ.
    Then its calls are made out of order, there and in the first copy: that differs if something is remembered.
    A function without a file has no fresh copy; then what changed in its surroundings tells the two apart.
    """
    function = subject.student.functions[role]
    before = remembered(function)
    memory = Memory()
    yield memory
    if len(memory.calls) < 2:
        return
    places = changed(before, remembered(function))
    calls, params, source = memory.calls, memory.params, subject.student.source
    difference: Difference | None = None
    copies = [function]
    if subject.fresh is not None:
        other = subject.fresh()
        is_transferable = all(is_plain(call.arguments[3:]) for call in calls)
        again = Replay(other.functions[role], copy.deepcopy(params), calls, source, budget, memory.ns)
        unlike = again.in_order() if is_transferable else again.in_order(other.initial_state, chained=True)
        memory.first_ns = memory.ns.get(0)
        if unlike is not None:
            return found.fault(clauses.DETERMINISTIC, _chance(what, unlike, function))
        if is_transferable:  # for a state of the student's classes, the first copy has to do
            copies.append(subject.fresh().functions[role])
    for each in copies:
        replay = Replay(each, copy.deepcopy(params), calls, source, budget, memory.ns)
        difference = difference or replay.out_of_order()
    # A sum may be back where it was at the end of the run, but not at the end of its calls in another order.
    places = places or changed(before, remembered(function))
    if difference is None:
        if places:
            said = f"{what} changes {places[0]} from call to call, though its answers do not depend on it"
            found.warn(clause, f"{said}; {REMEDIES[clause]}, or leave it out")
    elif subject.fresh is None and not places and outside_sources(function):
        found.fault(clauses.DETERMINISTIC, _chance(what, difference, function))
    else:
        where = f", in {places[0]}" if places else ""
        found.fault(
            clause, f"{what} remembers something outside its arguments{where}: {difference.text}; {REMEDIES[clause]}"
        )


def _chance(what: str, difference: Difference, function: Any) -> str:
    names = ", ".join(f"`{name}`" for name in outside_sources(function))
    cause = f"it uses {names}" if names else "look for random numbers, the clock, files and the order of sets"
    return f"{what} answers differently in the same situation: {difference.text}; {cause}, which must not decide"
