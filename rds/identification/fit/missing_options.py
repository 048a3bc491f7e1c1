"""Which option of a structure would explain what a fit by simulation error leaves unexplained, in a sentence.

Residuals well above the measurement's noise say that the machine does something that the structure lacks, not what. So
each option that was not chosen is tried for a few free runs, beginning at the fit's own parameters and at those that
the data suggest, over a part of the logs. What is found is a hint, no estimate: that is for a fit of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rds.core.errors import InputError
from rds.identification.fit.estimate import Estimate
from rds.identification.fit.free_run_doubts import MISSED
from rds.identification.fit.problem import Problem
from rds.identification.fit.smoothing import motion_of
from rds.identification.fit.solve import least_squares
from rds.identification.logs.log import RATES, Log, excited_part, named_apart
from rds.identification.structures import SIMULATION_ERROR
from rds.identification.structures.structure import Structure
from rds.identification.structures.structures import LIBRARY, structure

_LONGEST = 10_000  # samples that are tried, of all logs together
_RUNS = 25  # free runs of a search
_LESS = 0.7  # of the residuals: an option that leaves more does not explain them
_MOST = 0.5  # of the residuals: a first search that leaves less needs no second
_GLIMPSE = 0.02  # of what an option begins with: hardly any effect, but a derivative
_FEW = 20  # samples of a log
_SHIFTS = (1, 2, 3, 5, 8)  # samples by which a command may have been logged late
_UNTELLABLE = ("viscous",)  # no data tell it beside the others


def with_hint(estimate: Estimate, logs: Sequence[Log]) -> Estimate:
    """The estimate with the hint among its warnings, where there is one; `logs` are those that were fitted."""
    try:
        hint = missing_option(estimate, logs)
    except InputError:  # the part that is tried holds too little: a hint ends no fit
        return estimate
    return estimate if hint is None else replace(estimate, warnings=(*estimate.warnings, hint))


def missing_option(estimate: Estimate, logs: Sequence[Log]) -> str | None:
    """What to try where the residuals are well above the noise; None where they are not, or nothing can be tried.

    `logs` are those that were fitted.
    """
    if estimate.method != SIMULATION_ERROR or estimate.structure not in LIBRARY.names():
        return None
    logs = named_apart(logs)
    if all(estimate.free_run[log.name].rmse <= MISSED * motion_of(log).noise for log in logs):
        return None
    untellable = (*_UNTELLABLE, "backlash") if estimate.output_unit in RATES else _UNTELLABLE
    others = [
        option
        for option in LIBRARY.module(estimate.structure).OPTIONS
        if option not in estimate.options and option not in untellable
    ]
    if not others:
        return None
    parts = [excited_part(log, max(_LONGEST // len(logs), _FEW)) for log in logs]
    signals = (estimate.output_unit, estimate.command_unit)
    least = _left(parts, structure(estimate.structure, estimate.options, *signals), estimate)
    if least is None:
        return None
    found = {}
    for option in others:
        left = _left(parts, structure(estimate.structure, (*estimate.options, option), *signals), estimate, least)
        if left is not None and left < _LESS * least:
            found[option] = left
    unit = next(iter(estimate.free_run.values())).unit
    if not found and "delay" in others and (late := _late_command(parts, estimate, signals, least)) is not None:
        seconds, left = late
        return (
            f"the command comes too late in this log, by about {1e3 * seconds:.3g} ms: taken so much earlier, it would "
            f"leave {left:.2g} {unit} in place of {least:.2g} {unit}. Was it stamped, or written to its row, after it "
            "acted?"
        )
    if not found:
        return (
            f"a short search found none of the other options of structure {estimate.structure} ({', '.join(others)}) "
            "to leave much less by itself: the machine does something that none of them has (a resonance, a limited "
            "current, ...), or several of them, or the log is at fault"
        )
    ranked = sorted(found, key=lambda option: found[option])
    said = ", ".join(f"{option} {found[option]:.2g} {unit}" for option in ranked)
    return (
        f"try --option {ranked[0]}: over {sum(map(len, parts))} samples it would leave "
        f"{found[ranked[0]]:.2g} {unit} in place of {least:.2g} {unit}"
        + (f" (by itself each: {said})" if len(ranked) > 1 else "")
    )


def _late_command(
    logs: Sequence[Log], estimate: Estimate, signals: tuple[str, str], least: float
) -> tuple[float, float] | None:
    """By how much earlier (s) a command explains the motion best, and what that leaves; None if it is not much less.

    No structure has a delay below 0.
    """
    own, found = structure(estimate.structure, estimate.options, *signals), {}
    for samples in _SHIFTS:
        shifted = [replace(log.part(0, len(log) - samples), command=log.command[samples:]) for log in logs]
        left = _left(shifted, own, estimate)
        if left is not None and left < _MOST * least:
            found[samples * logs[0].sample_period] = left
    return min(found.items(), key=lambda item: item[1]) if found else None


def _left(logs: Sequence[Log], wider: Structure, estimate: Estimate, least: float | None = None) -> float | None:
    """RMS of the residuals that `wider` leaves, in the unit of the position; None where no search succeeds.

    `least` is what the structure of the estimate leaves.
    """
    fixed = {name: value for name, value in estimate.details["fixed"].items() if name in wider.parameters}
    given = dict(wider.given(logs)) if wider.given else {}
    held = {name: value for name, (value, _) in wider.held(frozenset(fixed)).items()} if wider.held else {}
    best = None
    for values, states in _starts(logs, wider, estimate):
        problem = Problem(logs, wider, {**fixed, **given, **held})
        try:
            left = problem.rms(least_squares(problem, problem.point(values, states), _RUNS).squares)
        except InputError:  # the free run from there is not finite
            continue
        best = left if best is None else min(best, left)
        if least is None or best < _MOST * least:
            break
    return best


def _starts(
    logs: Sequence[Log], wider: Structure, estimate: Estimate
) -> list[tuple[Mapping[str, float], Sequence[tuple[float, ...]]]]:
    """The fit's values, with hardly any of what the option adds; and those that the data suggest."""
    assert wider.start is not None  # of every structure of the package
    begun, states = next(iter(wider.start(logs)))
    fitted = {name: value for name, value in estimate.values().items() if name in wider.parameters}
    added = {name: _GLIMPSE * begun[name] for name in wider.neutral if name not in fitted}
    return [({**begun, **added, **fitted}, states), (begun, states)]
