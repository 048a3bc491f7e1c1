"""The least squares of a problem, searched from one start after the other until the measurement is explained.

A parameter that hardly shows (friction of a direction in which the axis hardly moves) leaves a valley without a floor.
So the fit is made without it as well as with it, and with it holds only if the residuals become smaller by more than
chance makes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice, tee

import numpy as np

from rds.core.errors import InputError
from rds.identification.fit.problem import Problem
from rds.identification.fit.residuals import effective_samples
from rds.identification.fit.smoothing import motion_of
from rds.identification.fit.solve import Solution, least_squares, tells_all
from rds.identification.logs.log import Log
from rds.identification.structures.structure import HiddenParameter, Start, Structure

_ENOUGH = 1.5  # times the noise: residuals that are no larger, and not smooth, hold nothing more
_SMOOTH = 0.5  # correlation of neighbouring residuals from which they hold motion
_EXACT = 1e-6  # of the motion: residuals of data without noise
_AGAIN = 1e-3  # of the sum of squares: two searches that end nearer than this end at the same place
_LITTLE = 0.02  # of what an option begins with: hardly any effect, but a derivative
_GLIMPSE = 30  # free runs of a search from another start
_BY_LEAPS = ("stribeck",)  # whether the axis sticks or breaks away hangs on it: beside the best place are others
_APART = (0.5, 2.0)  # times such a parameter: where a search begins again
_TOUCHES = 1e-9  # of the units used: what is nearer to a bound has run into it
_SAME = 0.01  # of the noise: runs that differ by less are the same


@dataclass(frozen=True)
class SearchResult:
    """Where the searches ended. `unmoved` were held: the data give no occasion to tell them."""

    problem: Problem
    solution: Solution
    tried: int  # starts
    unmoved: tuple[str, ...] = ()


def find(
    logs: Sequence[Log],
    structure: Structure,
    holding: Mapping[str, float],
    starts: Iterable[Start],
    tick: Callable[[], None],
) -> SearchResult:
    """The best fit with the parameters in `holding` held. InputError where the free run from a start is not finite."""
    given = iter(starts)
    first = next(given)
    first_pass, second_pass = tee(chain([first], given))
    idle = structure.idle(logs, first[0]) if structure.idle else {}
    idle = {name: how for name, how in idle.items() if name not in holding}
    if not idle:
        return _search(Problem(logs, structure, holding, tick), first_pass)
    without = Problem(logs, structure, {**holding, **{name: how.value for name, how in idle.items()}}, tick)
    still = _search(without, first_pass)
    moved = _search(Problem(logs, structure, holding, tick), second_pass)
    if still.solution.squares - moved.solution.squares > len(idle) * _by_chance(moved):
        return moved
    return _guessed(still, idle, min(without.rms(still.solution.squares), *(motion_of(log).noise for log in logs)))


def _by_chance(found: SearchResult) -> float:
    """What one parameter more may take off the sum of squares where the truth does not need it.

    It may choose, among all N samples, where it shows: 2 ln N variances of a residual that is worth one sample.
    """
    problem, solution = found.problem, found.solution
    residuals = [problem.residuals(solution.point, number)[0] for number in range(len(problem.logs))]
    samples = sum(len(error) for error in residuals)
    alike = samples / sum(effective_samples(error) for error in residuals)
    return 2.0 * float(np.log(samples)) * alike * solution.squares / samples


def from_plain(
    logs: Sequence[Log],
    structure: Structure,
    holding: Mapping[str, float],
    starts: Iterable[Start],
    tick: Callable[[], None],
) -> Iterator[Start]:
    """Before the starts given, those from the best fit without what options add, which `holding` holds without effect.

    So a structure with options never ends far above the plain one, which is the easier to find.
    """
    given, again = tee(starts)
    begun = next(again)[0]
    found = find(logs, structure, holding, given, tick)
    plain = found.problem.values(found.solution.point)
    states = [found.problem.state(found.solution.point, number) for number in range(len(logs))]
    for share in (1.0, _LITTLE):
        yield {name: share * begun[name] if name in holding else value for name, value in plain.items()}, states
    yield from chain([(begun, states)], again)


def _guessed(found: SearchResult, idle: Mapping[str, HiddenParameter], noise: float) -> SearchResult:
    """With likely values in the place of those that hold out anything, where the free runs stay the same."""
    problem, point = found.problem, found.solution.point
    for name, how in idle.items():
        runs = [problem.response(point, i) for i in range(len(problem.logs))]
        for value in how.likely(problem.values(point)):
            tried = Problem(problem.logs, problem.structure, {**problem.fixed, name: value})
            if all(np.abs(tried.response(point, i) - run).max() <= _SAME * noise for i, run in enumerate(runs)):
                problem = tried
                break
    return SearchResult(problem, found.solution, found.tried, tuple(idle))


def _search(problem: Problem, starts: Iterable[Start]) -> SearchResult:
    """The best end of searches, up to the first that explains the measurement or ends where another did.

    The first may take its time; those after it show in few steps whether they lead to a better place, and only the best
    is then followed to its end.
    """
    best: Solution | None = None
    tried = 0
    begun: dict[str, float] = {}
    for values, states in starts if problem.names else islice(starts, 1):
        begun = begun or dict(values)
        solution = least_squares(problem, problem.point(values, states), _GLIMPSE if tried else None)
        tried += 1
        again = best is not None and abs(solution.squares - best.squares) <= _AGAIN * best.squares
        if best is None or solution.squares < best.squares:
            best = solution
        if again and best.converged:
            break  # what is left is not for want of a better start
        if best.converged and tells_all(best.triangle) and _explains(problem, best):
            break
    assert best is not None
    if not best.converged and tried > 1:
        end = least_squares(problem, best.point)
        best = end if end.squares <= best.squares else best
    for number in (number for number, name in enumerate(problem.names) if name in _BY_LEAPS):
        for times in _APART:
            point = best.point.copy()
            point[number] *= times
            try:
                beside = least_squares(problem, point, _GLIMPSE)
            except InputError:  # the free run from there is not finite
                continue
            best = beside if beside.squares < (1.0 - _AGAIN) * best.squares else best
            tried += 1
    for number, name in enumerate(problem.names):
        if not stands_at_bound(problem, best, number) or _explains(problem, best):
            continue
        best = _leave_bound(problem, best, number, begun[name])
        tried += 1
    return SearchResult(problem, best, tried)


def stands_at_bound(problem: Problem, solution: Solution, number: int) -> bool:
    """Whether the parameter with this number is at a bound, or so near that it may as well be."""
    low, high = problem.structure.bounds(problem.names[number])
    value = float(solution.point[number])
    return any(np.isfinite(bound) and abs(value - bound) <= _TOUCHES for bound in (low, high))


def _leave_bound(problem: Problem, best: Solution, number: int, begun: float) -> Solution:
    """The better of the end of a search and of one that begins there, but with this parameter where all began.

    A search that ran into a bound may stand still there for no reason but the way by which it came.
    """
    point = best.point.copy()
    point[number] = begun
    try:
        again = least_squares(problem, point)
    except InputError:  # the free run from there is not finite
        return best
    return again if again.squares < (1.0 - _AGAIN) * best.squares else best


def _explains(problem: Problem, solution: Solution) -> bool:
    """Whether the residuals are as small as the noise, and no motion."""
    for number, log in enumerate(problem.logs):
        error, _ = problem.residuals(solution.point, number)
        size = float(np.sqrt(np.mean(error**2)))
        rounding = (log.resolution or 0.0) / np.sqrt(12.0)
        if size <= max(_ENOUGH * rounding, _EXACT * float(log.position.std())):
            continue
        neighbours = float(error[1:] @ error[:-1]) / float(error @ error)
        if size > _ENOUGH * motion_of(log).noise or neighbours > _SMOOTH:
            return False
    return True
