"""Parameters by simulation error: those with whose free run the model comes closest to what was measured.

The free run starts from an initial state of its own for each log, estimated with the parameters, and sees no
measurement after that. The sum of squared differences is made least by scipy's `least_squares` (trust region, bounds,
scaled by the derivatives) with the structure's exact derivatives.

Options: `fixed` {name: value}, parameters that are held; `start` {name: value}, where the search begins; `progress`
(done, of) -> None, called after every free run of a log, of the most that there can be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.progress import Progress
from rds.identification.fit.estimate import Estimate
from rds.identification.fit.free_run_doubts import is_little
from rds.identification.fit.made_estimate import made_estimate, t_quantile
from rds.identification.fit.problem import Problem
from rds.identification.fit.profile import widening
from rds.identification.fit.search import SearchResult, find, from_plain, stands_at_bound
from rds.identification.fit.smoothing import encoder_step
from rds.identification.fit.solve import EVALUATIONS, first_state
from rds.identification.fit.suspicions import suspicions
from rds.identification.fit.uncertainty import Uncertainty, uncertainty_of
from rds.identification.fit.unidentifiable import unidentifiable_by
from rds.identification.logs.excitation import steps_to_one_level
from rds.identification.logs.log import Log
from rds.identification.structures import SIMULATION_ERROR
from rds.identification.structures.structure import Start, Structure

OPTIONS = ("fixed", "start", "progress")


def estimate(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Estimate:
    """The parameters with the least squared free-run error over all logs together, and how far to trust them.

    InputError for an unknown option or parameter, a value out of its bounds, fewer samples than unknowns, or logs
    that hold no motion.
    """
    check_known(options, OPTIONS, "method simulation")
    logs = [log if log.resolution is not None else replace(log, resolution=encoder_step(log.position)) for log in logs]
    fixed = _checked(options.get("fixed") or {}, structure)
    begun = _checked(options.get("start") or {}, structure)
    given = structure.given(logs) if structure.given else {}
    for name in given:
        if name in fixed:
            raise InputError(f"structure {structure.name}: {name} is given with the log and cannot be fixed as well")
    held = structure.held(frozenset(fixed)) if structure.held else {}
    holding = {**fixed, **given, **{name: value for name, (value, _) in held.items()}}
    for name in begun:
        if name in holding:
            raise InputError(
                f"structure {structure.name}: {name} is held at {holding[name]:g}, so no search begins at "
                f"{begun[name]:g}; leave its start out, or do not hold it"
            )
    unknowns = len(structure.parameters) - len(holding) + structure.states * len(logs)
    if (samples := sum(len(log) for log in logs)) <= unknowns:
        raise InputError(
            f"{samples} samples are too few for {unknowns} unknowns (parameters and initial states); give longer logs"
        )
    tick = _ticker(options.get("progress"), structure, len(logs))
    starts = _starts(logs, structure, begun, holding)
    neutral = {name: value for name, value in structure.neutral.items() if name not in holding and name not in begun}
    if neutral:
        starts = from_plain(logs, structure, {**holding, **neutral}, starts, tick)
    found = find(logs, structure, holding, starts, tick)
    problem, solution = found.problem, found.solution
    uncertainty = uncertainty_of(problem, solution)
    values = problem.values(solution.point)
    order = list(structure.parameters)
    places = [order.index(name) for name in problem.names]
    free = len(problem.names)
    covariance = np.zeros((len(order), len(order)))
    covariance[np.ix_(places, places)] = uncertainty.covariance[:free, :free]
    if not solution.converged:  # what is still to go may be as wrong as it is large
        left = solution.step[:free][:, None]
        covariance[np.ix_(places, places)] += left @ left.T
    open_ended = _widen(covariance, order, logs, structure, holding, found, uncertainty)
    open_ended += [name for name in _of_one_speed(logs, problem, covariance, order) if name not in open_ended]
    for name in (*found.unmoved, *open_ended):
        covariance[order.index(name), :] = covariance[:, order.index(name)] = 0.0
        covariance[order.index(name), order.index(name)] = np.inf
    errors = dict(zip(order, np.sqrt(np.diag(covariance)), strict=True))
    return made_estimate(
        structure,
        SIMULATION_ERROR,
        logs,
        values,
        covariance,
        uncertainty.effective - problem.size,
        unidentifiable=[
            *(sentence for name, (_, sentence) in held.items()),
            *unidentifiable_by(structure, problem.names, values, uncertainty, found.unmoved),
            *(
                f"{name}: {values[name]:.4g} {structure.units[name]}".rstrip()
                + " is assumed; values far from it explain these data as well, the other parameters with them"
                for name in open_ended
            ),
        ],
        warnings=suspicions(problem, solution, uncertainty, errors),
        details={
            "fixed": dict(fixed),
            "evaluations": solution.evaluations,
            "starts": found.tried,
            "at_bound": [name for i, name in enumerate(problem.names) if stands_at_bound(problem, solution, i)],
            "noise_rms": uncertainty.noise,
            "correlated_over_samples": uncertainty.block,
            "effective_samples": uncertainty.effective,
        },
        states=[problem.state(solution.point, number) for number in range(len(logs))],
    )


def _widen(
    covariance: np.ndarray,
    order: list[str],
    logs: Sequence[Log],
    structure: Structure,
    holding: Mapping[str, float],
    found: SearchResult,
    uncertainty: Uncertainty,
) -> list[str]:
    """Widen the covariance where the motion is small beside the noise; the parameters whose intervals have no end."""
    if structure.sensitivities is None or not any(is_little(structure, log) for log in logs):
        return []  # a structure without derivatives would take hours
    problem, solution = found.problem, found.solution
    values = problem.values(solution.point)
    whole = Problem(logs, structure, holding)  # with those that were held for want of an occasion to tell them
    states = [problem.state(solution.point, number) for number in range(len(logs))]
    freedom = max(uncertainty.effective - problem.size, 1.0)
    reaches = {
        name: t_quantile(freedom) * float(np.sqrt(variance))
        for name in problem.names
        if 0.0 < (variance := covariance[order.index(name), order.index(name)]) < np.inf
    }
    allowed = t_quantile(freedom) ** 2 * solution.squares / uncertainty.effective
    factors = widening(whole, whole.point(values, states), solution.squares, reaches, allowed)
    open_ended = [name for name, factor in factors.items() if not np.isfinite(factor)]
    scale = np.array([factors.get(name, 1.0) if name not in open_ended else 1.0 for name in order])
    covariance *= np.outer(scale, scale)
    return open_ended


def _of_one_speed(logs: Sequence[Log], problem: Problem, covariance: np.ndarray, order: Sequence[str]) -> list[str]:
    """Gain and friction, where one steady speed is all that tells them: only what they make together is known.

    A few samples at rest, or the noise of a measured command, seem to part them, and derivatives there promise a gain
    that none of the data determine.
    """
    together = [name for name in problem.names if name == "K" or name.startswith("friction")]
    if "K" not in together or len(together) == 1 or not steps_to_one_level(logs):
        return []
    return [name for name in together if np.isfinite(covariance[order.index(name), order.index(name)])]


def _starts(
    logs: Sequence[Log], structure: Structure, begun: Mapping[str, float], holding: Mapping[str, float]
) -> Iterator[Start]:
    """Values and initial states to search from, best first; what the user gave goes before what the data say."""
    if structure.start is not None:
        for values, states in structure.start(logs):
            yield {**values, **begun}, states
            if all(name in begun or name in holding for name in structure.parameters):
                return  # other starts are the same
        return
    if missing := [name for name in structure.parameters if name not in begun and name not in holding]:
        raise InputError(f"structure {structure.name} needs a value to start from for {', '.join(missing)}")
    yield dict(begun), [first_state(structure, log) for log in logs]


def _checked(given: Mapping[str, Any], structure: Structure) -> dict[str, float]:
    owner = f"structure {structure.name}"
    check_known(given, structure.parameters, owner)
    values = {name: structure.parameters[name].check(value, name, owner) for name, value in given.items()}
    for name, value in values.items():
        if value > structure.bounds(name)[1]:
            raise InputError(
                f"{owner}: {name} = {value:g} must be at most {structure.bounds(name)[1]:g} "
                f"({structure.parameters[name].described})"
            )
    return values


def _ticker(progress: Progress | None, structure: Structure, logs: int) -> Callable[[], None]:
    """Counts free runs; how many there will be is not known, only how many there can be."""
    if progress is None:
        return lambda: None
    done = 0
    each = 1 if structure.sensitivities else 1 + len(structure.parameters) + structure.states
    most = EVALUATIONS * logs * each

    def tick() -> None:
        nonlocal done
        done = min(done + 1, most)
        progress(done, most)

    return tick
