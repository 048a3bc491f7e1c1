"""Whether an interpolator keeps `interpolate(segment, T, params)`, which yields (position, velocity, acceleration)."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from rds.checks import clauses
from rds.checks.checked_code import CheckedCode, checked_code
from rds.checks.hidden_state import changed, outside_sources, remembered
from rds.checks.paths import ARC, CIRCLE, CLOCKWISE, LINE, LINE_BACK, LINE_OF_ONE, LINE_OF_THREE, name_of
from rds.checks.report import CheckReport, Findings, Timing
from rds.checks.rows import Trace, alternate, trace
from rds.checks.timing import Work, judge_time
from rds.checks.track import follows_chord, judge_track
from rds.checks.values import same
from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.signature import argument_fault
from rds.core.types import Segment
from rds.core.values import shown

BUDGET = 3.0  # s for each segment
_LEAST = 20  # rows, whatever they take
_OTHER: Mapping[Segment, Segment] = MappingProxyType({LINE: LINE_BACK, ARC: CLOCKWISE})


def check_interpolator(
    interpolator: Any,
    sample_period: float = 0.001,
    *,
    params: Mapping[str, Any] | None = None,
    budget: float = BUDGET,
) -> CheckReport:
    """Check a function, a file, or a module or namespace, in this process.

    It gets lines of one, two and three axes and arcs both ways round, at `sample_period` s; one that handles only
    lines or only arcs is as good, and the report's notes say so. Faults are in the report; InputError is raised
    for a file that cannot be loaded or holds no interpolator.
    """
    subject = checked_code(interpolator, "interpolate", None, params)
    check = _Check(subject, sample_period, budget)
    check.check()
    return check.found.report("interpolator", subject.name, check.timing)


class _Check:
    """One check: the subject, and what is found of it."""

    def __init__(self, subject: CheckedCode, sample_period: float, budget: float):
        self.found = Findings()
        self.timing: Timing | None = None
        self.subject, self.source = subject, subject.student.source
        self.function = subject.function("interpolate")
        self.T, self.budget = sample_period, budget
        self.params: dict[str, Any] = {}

    def check(self) -> None:
        found, given = self.found, self.subject.student.params
        if fault := argument_fault("interpolate", self.function):
            return found.fault(clauses.ARGUMENTS, fault)
        if not isinstance(given, Mapping):
            said = f"params is {shown(given)}; write it as a dict of defaults, as in {{'acceleration': 500.0}}"
            return found.fault(clauses.PARAMS, said)
        self.params = copy.deepcopy(dict(given))
        before = remembered(self.function)
        work = Work()
        work.begin()
        line, arc = self._trace(LINE), self._trace(ARC)
        work.end()
        good = [trace for trace in self._kinds(line, arc) if self._judge(trace)]
        if good and not found.faults:
            self._judge_memory(good, before)
        if good and not found.faults:
            self._others(good)
        ns = [ns for each in (line, arc) for ns in each.ns]
        if good:
            pairs = [(each.ns, self._trace(each.segment).ns) for each in good]
            ns = [min(pair) for first, second in pairs for pair in zip(first, second, strict=False)]
        self.timing = judge_time(found, "a row of interpolate()", ns, 0, work.close(), self.T)
        return None

    def _trace(self, segment: Segment) -> Trace:
        params = copy.deepcopy(self.params)
        result = trace(self.function, segment, self.T, params, self.source, self.budget)
        if not same(params, self.params):
            self.found.fault(clauses.UNCHANGED, "interpolate() changed params; they are the settings of a run")
        return result

    def _kinds(self, line: Trace, arc: Trace) -> list[Trace]:
        """Those of the two that the code means to handle; a note says which it does not."""
        if line.refused and not arc.refused:
            self.found.notes.append("it handles ArcSegment only")
            return [arc]
        if arc.refused and not line.refused:
            self.found.notes.append("it handles LineSegment only")
            return [line]
        if line.fault is None and arc.fault is None and follows_chord(arc):
            said = "given an ArcSegment, it follows the straight line from start to end"
            self.found.warn(clauses.SEGMENTS, f"{said}; raise a ValueError for what it does not handle")
            return [line]
        return [line] if line.refused else [line, arc]

    def _judge(self, result: Trace) -> bool:
        """Note what is wrong with the rows; whether they are good enough to look further."""
        if result.fault is not None:
            self.found.fault(*result.fault)
            return False
        if not result.complete:
            said = f"{len(result.rows)} rows of {name_of(result.segment)} took {self.budget:g} s"
            self.found.warn(clauses.ENDS, f"{said}; nothing after them was checked")
            return False
        judge_track(self.found, result, self.T)
        return True

    def _others(self, good: list[Trace]) -> None:
        """More axes, the other way round: what goes wrong in silence is a fault, an error is worth a warning."""
        segments: list[Segment] = []
        for each in good:
            segments += [LINE_BACK, LINE_OF_THREE, LINE_OF_ONE] if each.segment is LINE else [CLOCKWISE, CIRCLE]
        for segment in segments:
            result = self._trace(segment)
            if result.fault is not None and result.fault[0] == clauses.RUNS:
                self.found.warn(clauses.SEGMENTS, result.fault[1])
            else:
                self._judge(result)

    def _judge_memory(self, good: list[Trace], before: dict[str, Any]) -> None:
        """Repeat the segments in a fresh copy, then take rows of several of them in turn."""
        places = changed(before, remembered(self.function))
        pairs = [each for first in good for each in (first, self._trace(_OTHER[first.segment])) if each.fault is None]
        segments, expected = tuple(each.segment for each in pairs), [each.rows for each in pairs]
        per_row = 1e-9 * sum(sum(each.ns) for each in pairs) / sum(len(each.rows) for each in pairs)
        most = max(_LEAST, int(self.budget / per_row / len(segments)))
        counts = [min(len(rows), most) for rows in expected]
        functions = [self.function]
        if self.subject.fresh is not None:
            other = self.subject.fresh().functions["interpolate"]
            for segment in (LINE, ARC):  # both, as at first
                rows = trace(other, segment, self.T, copy.deepcopy(self.params), self.source, self.budget).rows
                for each in good:
                    if each.segment is segment and not _agree(each.rows, rows):
                        return self.found.fault(clauses.DETERMINISTIC, self._chance())
            functions.append(self.subject.fresh().functions["interpolate"])
        for function in functions:
            try:
                rows_in_turn = alternate(function, segments, self.T, self.params, counts)
            except STUDENT_ERRORS as error:
                said = f"interpolate() failed when two segments took turns: {student_error(error, self.source)}"
                return self.found.fault(clauses.NO_GLOBALS, f"{said}; keep all in variables inside the function")
            if not all(_agree(old, new) for old, new in zip(expected, rows_in_turn, strict=True)):
                if self.subject.fresh is None and not places and outside_sources(self.function):
                    return self.found.fault(clauses.DETERMINISTIC, self._chance())
                where = f", in {places[0]}" if places else ""
                said = f"interpolate() remembers something from call to call{where}"
                remedy = (
                    "two segments in turn give other rows than one after the other; keep all in variables inside it"
                )
                return self.found.fault(clauses.NO_GLOBALS, f"{said}: {remedy}")
        return None

    def _chance(self) -> str:
        names = ", ".join(f"`{name}`" for name in outside_sources(self.function))
        cause = f"it uses {names}" if names else "look for random numbers, the clock and files"
        return f"interpolate() gives other rows for the same segment when it is called again; {cause}"


def _agree(old: np.ndarray, new: np.ndarray) -> bool:
    n = min(len(old), len(new)) if len(old) and len(new) else 0
    return n > 0 and same(old[:n], new[:n])
