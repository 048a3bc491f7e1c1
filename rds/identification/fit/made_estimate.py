"""From the numbers of a method to an `Estimate`: intervals, the free run and predictions with them, and what to doubt.

Methods that do not fit the free run itself still have it computed: it is how a model will be used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.identification.fit.estimate import UNUSABLE, Errors, Estimate, Parameter, names_of, said_of_guesses
from rds.identification.fit.free_run_doubts import FAR, held_doubts, leap_doubts, other_doubts, over_noise_of
from rds.identification.fit.initial_state import estimate_start, initial_samples
from rds.identification.fit.kstep import ahead, errors_of
from rds.identification.fit.smoothing import speed_range
from rds.identification.logs.excitation import is_at_rest, is_steady
from rds.identification.logs.fingerprint import fingerprint
from rds.identification.logs.log import Gravity, Log
from rds.identification.logs.motor_constant import UNKNOWN
from rds.identification.logs.trace import trace
from rds.identification.structures import INVERSE_DYNAMICS
from rds.identification.structures.structure import Structure

_START = 1000  # samples from which a log's initial state is estimated
_PERIODS = 2.0  # of the sample period: a time constant that is shorter is sampled too slowly
_TOLD_BY = 0.6  # of the sample period: below it nothing is told
_ROUND = 0.2  # of the time constant: a sample period that would do
_UNTOLD = 0.5  # standard error over value from which a parameter that cannot be zero is not told
_SUM = -0.9  # correlation of two parameters from which their sum is told, and neither of them


def made_estimate(
    structure: Structure,
    method: str,
    logs: Sequence[Log],
    values: Mapping[str, float],
    covariance: np.ndarray,
    freedom: float,
    *,
    unidentifiable: Sequence[str] = (),
    warnings: Sequence[str] = (),
    relative_error_percent: float | None = None,
    details: Mapping[str, Any] | None = None,
    states: Sequence[tuple[float, ...]] | None = None,
    judged: bool = True,
) -> Estimate:
    """The estimate with `values` in the structure's order; `covariance` is of those, `freedom` for Student's t.

    `states` are the logs' initial states where the method has estimated them, by the free run; else they are estimated
    here, and the free run of each log in open loop is `judged`: it sees what no method's own intervals count.
    Parameters that the structure says are given have no error. InputError for values outside the structure's bounds.
    """
    values = {name: float(values[name]) for name in structure.parameters}
    covariance = 0.5 * (covariance + covariance.T)  # rounding leaves that of near twins uneven, which no reader takes
    given = set(structure.given(logs)) if structure.given else set()
    width = t_quantile(freedom)
    errors = np.sqrt(np.diag(covariance))
    parameters = {}
    notes = list(unidentifiable)
    for (name, value), error in zip(values.items(), errors.tolist(), strict=True):
        _check_bounds(structure, name, value, method)
        reach = 0.0 if name in given else width * error
        parameters[name] = Parameter(value, error, value - reach, value + reach, structure.units[name])
        known = any(name in sentence for sentence in notes)
        if not known and structure.bounds(name)[0] == 0.0 and np.isfinite(error) and error > _UNTOLD * abs(value):
            unit = structure.units[name]
            notes.append(
                f"{name}: {value:.3g} {unit} with a standard error of {error:.3g} {unit} is poorly determined by these "
                "data"
            )
    if not given:  # a constant that was held beside the log is one that is known
        notes += dict.fromkeys(f.what for log in logs for f in log.findings if f.kind == UNKNOWN)
    begun, free_run, predictions = {}, {}, {}
    starts: Sequence[tuple[float, ...] | None] = [None] * len(logs) if states is None else states
    runs = [_run(structure, log, values, state) for log, state in zip(logs, starts, strict=True)]
    with np.errstate(all="ignore"):
        off = max(over_noise_of(log, log.position - run) for log, (_, run) in zip(logs, runs, strict=True))
    said = _of_logs(logs)
    said += [*said_of_guesses(parameters), *_too_slow(logs, parameters, covariance, method, off), *warnings]
    if _none_told(parameters) and not any(UNUSABLE in sentence for sentence in said):
        said.append(
            f"{UNUSABLE}: not one of them is told by these data (every interval is wider than its value, or has no "
            "end); record more motion, at other commands (`rds excite`)"
        )
    for number, log in enumerate(logs):
        state = starts[number]
        begun[log.name], modelled = runs[number]
        free_run[log.name], predictions[log.name] = _errors(structure, log, values, modelled)
        if judged and states is None and not log.closed_loop:
            said += other_doubts(structure, log, log.position - modelled, method)
        if state is not None and not log.closed_loop and _has_velocity(structure):
            said += leap_doubts(structure, values, log, state[1], free_run[log.name])
        if log.closed_loop:
            said.append(
                f"{log.name} is closed-loop data: the command answers the axis's noise and friction, which biases any "
                "fit a little, and the free run lacks the controller that held the axis, so its error grows with time"
            )
            said += held_doubts(structure, log, predictions[log.name])
    return Estimate(
        structure=structure.name,
        options=structure.options,
        method=method,
        parameters=parameters,
        covariance=covariance,
        unidentifiable=tuple(notes),
        initial_state=begun,
        free_run=free_run,
        ahead=predictions,
        logs=tuple(fitted_stretch(log) for log in logs),
        relative_error_percent=relative_error_percent,
        warnings=tuple(dict.fromkeys(said)),
        details=dict(details or {}),
        output_unit=structure.output_unit,
        command_unit=structure.command_unit,
    )


def _of_logs(logs: Sequence[Log]) -> list[str]:
    """Faults and warnings about the logs, each once with the names of those that have it.

    A log of a steady speed or at rest, which tells nothing by itself, is no fault beside others that have none.
    """
    are_whole = any(all(finding.gravity is not Gravity.FAULT for finding in log.findings) for log in logs)
    faults: dict[str, list[str]] = {}
    warned: dict[str, list[str]] = {}
    for log in logs:
        for finding in log.findings:
            is_fault = finding.gravity is Gravity.FAULT
            beside = are_whole and finding.kind == "excitation" and (is_steady(log) or is_at_rest(log))
            if is_fault and not beside:
                faults.setdefault(finding.what, []).append(log.name)
            elif is_fault or finding.gravity is Gravity.WARNING:
                warned.setdefault(finding.what, []).append(log.name)
    said = [f"{UNUSABLE}: {names_of(names)}: {what}" for what, names in faults.items()]
    return said + [f"{names_of(names)}: {what}" for what, names in warned.items()]


def _too_slow(
    logs: Sequence[Log], parameters: Mapping[str, Parameter], covariance: np.ndarray, method: str, off: float
) -> list[str]:
    """A sentence where the samples are too far apart for the time constant, with the period that would do; or where a
    delay makes up for it, or the time constant for another structure: the free run is `off` by so many times the noise.

    Not of inverse dynamics: derivatives of coarse or noisy positions make its time constants short, whatever they are.
    """
    made = parameters.get("tau")
    if made is None or made.std_error == 0.0 or method == INVERSE_DYNAMICS:
        return []
    period = max(log.sample_period for log in logs)
    if made.value > _PERIODS * period:
        return []
    enough = _ROUND * made.value
    if made.value > _TOLD_BY * period and made.told and not made.wide:
        return [
            f"sampled too slowly: a sample period of {1e3 * period:.3g} ms for a time constant of "
            f"{1e3 * made.value:.3g} ms; {1e3 * enough:.2g} ms would do"
        ]
    most = _TOLD_BY * period
    delay = parameters.get("delay")
    if delay is not None and delay.std_error > 0.0 and not made.high <= most:
        i, j = (list(parameters).index(name) for name in ("tau", "delay"))
        if not covariance[i, j] > _SUM * made.std_error * delay.std_error:
            return [
                f"{UNUSABLE}: these data tell the sum of tau and delay, {1e3 * (made.value + delay.value):.3g} ms, and "
                "neither of them: a command that changes slowly makes the same motion with either. Log steps of the "
                "command, or hold one of them (--fix delay=0)"
            ]
    if off > FAR:
        return [
            f"{UNUSABLE}: tau came out within {_PERIODS:g} sample periods, at {1e3 * made.value:.3g} ms, and the free "
            f"run is {off:.3g} times the noise off. Either the structure is not how this machine moves, and tau makes "
            "up for it (no structure here has a spring, or a position that the command asks for), or within a sample "
            "the axis is at its speed. Try other options and structures before you sample faster"
        ]
    return [
        f"{UNUSABLE}: sampled too slowly. Within a sample period of {1e3 * period:.3g} ms the axis is at its speed: "
        f"the log tells that tau is below {1e3 * most:.3g} ms, and no more. A period of {1e3 * _ROUND * most:.2g} ms "
        f"tells a time constant of {1e3 * most:.3g} ms; for a shorter one, sample by as much faster (a fifth of it)"
    ]


def _has_velocity(structure: Structure) -> bool:
    """Whether the log shows the second state: that of a model of one's own may be anything, and play hides it."""
    return structure.sensitivities is not None and structure.state_names == ("position", "velocity")


def _none_told(parameters: Mapping[str, Parameter]) -> bool:
    """Whether something was estimated, and nothing of it is worth a number."""
    estimated = [p for p in parameters.values() if p.std_error > 0.0]
    return bool(estimated) and all(not p.told or p.wide for p in estimated)


def t_quantile(freedom: float, share: float = 0.95) -> float:
    """Half the width of the interval with this share, in standard errors (Student's t)."""
    with needed_for("a fit"):
        from scipy.special import stdtrit

    return float(stdtrit(max(freedom, 1.0), 0.5 + 0.5 * share))


def _check_bounds(structure: Structure, name: str, value: float, method: str) -> None:
    option, high = structure.parameters[name], structure.bounds(name)[1]
    if not np.isfinite(value) or value < option.low or value <= option.above or value > high:
        raise InputError(
            f"by {method}, {name} = {value:.4g} {structure.units[name]}, which no axis has ({option.described}): the "
            "sign of the command or the position is reversed, columns are swapped, or noise hides the motion; look at "
            "the data with `rds data describe`, or try another method"
        )


def _run(
    structure: Structure, log: Log, values: Mapping[str, float], state: tuple[float, ...] | None
) -> tuple[tuple[float, ...], np.ndarray]:
    """The initial state, and the free run from there (samples,)."""
    if state is None:
        few = slice(0, min(len(log), _START))
        state = estimate_start(structure, values, log.time[few], log.command[few], log.position[few])
    with np.errstate(all="ignore"):
        return state, np.asarray(structure.respond(log.time, log.command, state, values), dtype=float)


def _errors(
    structure: Structure, log: Log, values: Mapping[str, float], modelled: np.ndarray
) -> tuple[Errors, Mapping[int, Errors]]:
    """Of the free run, and of predictions ahead with it, as a validation measures them: from an initial state of the
    first samples, which no error counts. Of a log that is too short for that, of the run that was fitted.
    """
    first = initial_samples(len(log))
    if len(log) >= 2 * first and np.isfinite(modelled).all():
        t, u, y = log.time, log.command, log.position
        start = estimate_start(structure, values, t[:first], u[:first], y[:first])
        with np.errstate(all="ignore"):
            modelled = np.asarray(structure.respond(t, u, start, values), dtype=float)
    else:
        first = 0
    if not np.isfinite(modelled).all():
        return Errors(-np.inf, np.inf, np.inf, structure.output_unit), {}
    measured, modelled = log.position[first:], modelled[first:]
    return errors_of(measured, modelled, structure.output_unit), ahead(measured, modelled, structure.output_unit)


def fitted_stretch(log: Log) -> dict[str, Any]:
    """What an estimate, and the model file made of it, say of a log that was fitted: `Estimate.logs` holds these.

    Beside file and rows, the lowest and highest command (V) and velocity (mm/s), beyond which the model is a guess, and
    position (mm) with the encoder's resolution, where one was logged; the fingerprint and the trace by which the data
    are known again under another name, or with noise.
    """
    found: dict[str, Any] = {
        "name": log.name,
        "source": log.source,
        "sha256": log.sha256,
        "first": log.first,
        "end": log.first + len(log),
        "command": (float(log.command.min()), float(log.command.max())),
        "velocity": speed_range(log),
    }
    if not log.is_rate:
        found["position"] = (float(log.position.min()), float(log.position.max()))
        found |= {"resolution": float(log.resolution)} if log.resolution else {}
    found |= {"fingerprint": hashes} if (hashes := fingerprint(log)) else {}
    return found | ({"trace": places} if (places := trace(log)) else {})
