"""Recorded calls made again: repeated, in another order, and in a second, freshly loaded copy of the code."""

from __future__ import annotations

import copy
import random
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rds.checks.allowance import Allowance
from rds.checks.values import same
from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.types import Source
from rds.core.values import shown


class Call(NamedTuple):
    """What a function was called with, params apart, and what it answered: both copied when it happened."""

    arguments: tuple[Any, ...]
    answer: Any


@dataclass(frozen=True)
class Difference:
    """A call that answered differently the second time, as a clause of a sentence."""

    text: str


@dataclass
class Replay:
    """Calls of one function made again; `ns` gathers the time of each call, by its index."""

    function: Callable[..., Any]
    params: dict[str, Any]
    calls: Sequence[Call]
    source: Source
    budget: float  # s for one pass; the least number of calls is made even so
    ns: dict[int, int] = field(default_factory=dict)

    def in_order(self, state: Any = None, chained: bool = False) -> Difference | None:
        """The calls as they were recorded, from the first; the one that answers differently, if any.

        With `chained`, a controller begins with `state` and goes on with the states that it returns itself: in a
        fresh copy, objects of the student's classes are not those of the first copy.
        """
        when = "when the run was repeated in a fresh copy"
        with Allowance(self.budget) as allowance:
            for k, call in enumerate(self.calls):
                if k >= _LEAST and allowance.is_spent():
                    break
                arguments = copy.deepcopy((*call.arguments[:3], state) if chained else call.arguments)
                answer = self._again(k, arguments, when)
                if isinstance(answer, Difference):
                    return answer
                if chained:
                    state = answer[1]
        return None

    def out_of_order(self) -> Difference | None:
        """The calls in a fixed random order, each twice in a row, as when two axes use the same function."""
        order = list(range(len(self.calls)))
        random.Random(1).shuffle(order)
        when = "when other calls came before it"
        with Allowance(self.budget) as allowance:
            for done, k in enumerate(order):
                if done >= _LEAST and allowance.is_spent():
                    break
                for _ in range(2):
                    answer = self._again(k, copy.deepcopy(self.calls[k].arguments), when)
                    if isinstance(answer, Difference):
                        return answer
        return None

    def _again(self, k: int, arguments: tuple[Any, ...], when: str) -> Any:
        """The answer to call `k` made again, or how it differs from the recorded one."""
        call = self.calls[k]
        started = time.perf_counter_ns()
        try:
            answer = self.function(*arguments, self.params)
        except STUDENT_ERRORS as error:
            return Difference(f"call {k} failed {when}: {student_error(error, self.source)}")
        self.ns[k] = min(time.perf_counter_ns() - started, self.ns.get(k, 1 << 62))
        if not same(answer, call.answer):
            return Difference(f"call {k} answered {shown(call.answer)} in the run and {shown(answer)} {when}")
        return answer


_LEAST = 10
