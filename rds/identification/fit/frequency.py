"""Parametric fit of the frequency response: K e^(-sL) / (τ s + 1) from command to velocity (a spindle's speed).

The model is compared as it is sampled: with the command held over each sample, a = e^(-T/τ), the dead time
L = (d + λ) T and h = (1 - λ) T,

    V/U = K z^(-d) ((1 - e^(-h/τ)) + (e^(-h/τ) - a) z⁻¹) / (z - a)                     speed at the samples
    ΔX/U = K z^(-d) (h + λ T z⁻¹) - τ (z - 1) V/U                                      way over each sample

Lines are weighted by the inverse variance that their coherence gives. A frequency response is that of a linear system.
Where an axis reverses, Coulomb friction F takes away from the velocity in proportion to 4F/(π V) at a velocity
amplitude V (its describing function): K and τ both come out too small by the factor 1/(1 + 4F/(π V)), and that
does not show in the coherence. A command with an offset that keeps the axis moving one way has no such bias.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.options import check_known
from rds.core.quantities import Quantity
from rds.identification.fit.estimate import UNUSABLE, Estimate
from rds.identification.fit.frequency_response import (
    FrequencyResponse,
    frequency_response,
    model_rate,
    model_response,
    output_rate,
    window_distortion,
)
from rds.identification.fit.made_estimate import made_estimate
from rds.identification.fit.regression import regress
from rds.identification.fit.smoothing import motion_of
from rds.identification.logs.log import Log, excited_part
from rds.identification.structures.signals import SPEEDS
from rds.identification.structures.structure import Structure

STRUCTURES: Mapping[str, tuple[str, ...]] = {"spindle": ("delay",), "axis": ("delay",)}  # and their options
OPTIONS = {"period": Quantity("period of a command that repeats; found in the data if not given", "s", above=0.0)}
_LEAST_LINES = 3
_PASSES = 2  # in which what windows do is worked out again, by the values before
_FLOOR = 1e-3  # of the response: how exactly a line may be believed, however quiet
_COHERENT = 0.9  # a median coherence below it deserves a warning
_ENOUGH = 20_000  # samples to tell friction from
_LOST = 15.0  # per cent: a gain that friction makes smaller by more is none of the axis's


def estimate(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Estimate:
    """τ, K (and dead time) of an axis or spindle by frequency response; `options`: `period` (s).

    Friction is told only where the axis never reverses, in that direction, by the mean velocity. InputError for other
    structures, and logs that excite fewer than three frequencies.
    """
    check_known(options, OPTIONS, "method frequency")
    allowed = STRUCTURES.get(structure.name)
    if allowed is None or not set(structure.options) <= set(allowed):
        known = " and ".join(f"{name} with option {of[0]}" for name, of in STRUCTURES.items())
        raise InputError(
            f"the frequency method is for {known}; here the structure is {structure.name} with options "
            f"{', '.join(structure.options) or 'none'}; take --method simulation"
        )
    period = options.get("period")
    if period is not None:
        period = OPTIONS["period"].check(period, "period", "frequency")
    is_rate = structure.name == "spindle"
    responses = [frequency_response(log, is_rate, period) for log in logs]
    for log, response in zip(logs, responses, strict=True):
        if len(response.frequency) < _LEAST_LINES:
            raise InputError(
                f"the command excites {len(response.frequency)} frequencies that the output follows, and "
                f"{_LEAST_LINES} or more are needed; log a multisine or a chirp",
                log.name,
            )
    names = [name for name in structure.parameters if name in ("tau", "K", "delay")]
    point, covariance, chi = _fit(responses, names, is_rate)
    values = dict(zip(names, point.tolist(), strict=True))
    for _ in range(_PASSES if any(response.period is None for response in responses) else 0):
        seen = [window_distortion(log, r, values, is_rate) for log, r in zip(logs, responses, strict=True)]
        point, covariance, chi = _fit(
            [replace(r, response=r.response / by) for r, by in zip(responses, seen, strict=True)], names, is_rate
        )
        values = dict(zip(names, point.tolist(), strict=True))
    order = list(structure.parameters)
    full = np.zeros((len(order), len(order)))
    places = [order.index(name) for name in names]
    full[np.ix_(places, places)] = covariance
    unidentifiable: list[str] = []
    if not is_rate:
        unidentifiable = _friction(logs, values, full, order)
    lines = sum(len(response.frequency) for response in responses)
    return made_estimate(
        structure,
        "frequency",
        logs,
        values,
        full,
        max(2 * lines - len(names), 1),
        unidentifiable=unidentifiable,
        warnings=_warnings(logs, responses, values, chi, is_rate),
        judged=is_rate or all(map(_direction, logs)),  # without the friction of a reversing axis, no free run is right
        details={
            "misfit": chi,
            "period": period,
            "responses": {log.name: _told(r) for log, r in zip(logs, responses, strict=True)},
        },
    )


def _fit(
    responses: Sequence[FrequencyResponse], names: Sequence[str], is_rate: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """Values, their covariance, and the mean square of misfit over standard error (1 if the model is right)."""
    with needed_for("a fit to frequency responses"):
        from scipy.optimize import least_squares

    T = max(response.sample_period for response in responses)
    weights = [1.0 / np.maximum(r.std_error, _FLOOR * np.abs(r.response)) for r in responses]

    def misses(point: np.ndarray) -> np.ndarray:
        values = dict(zip(names, point.tolist(), strict=True))
        parts = []
        for r, weight in zip(responses, weights, strict=True):
            miss = (model_response(r.frequency, r.sample_period, values, is_rate) - r.response) * weight
            parts.append(np.column_stack([miss.real, miss.imag]).ravel())
        return np.concatenate(parts)

    first = responses[0]
    gain = float(np.real(first.response[0])) or float(np.abs(first.response[0]))
    slowest = 1.0 / (2.0 * np.pi * max(float(r.frequency[-1]) for r in responses))
    starts = []
    for tau in np.geomspace(0.1 * slowest, 300.0 * slowest, 15):
        size = np.sqrt(1.0 + (2.0 * np.pi * float(first.frequency[0]) * tau) ** 2)
        start = np.array([{"tau": tau, "K": gain * size, "delay": 0.1 * T}[name] for name in names])
        starts.append((float(np.sum(misses(start) ** 2)), start))
    start = min(starts, key=lambda item: item[0])[1]
    low = [1e-3 * T if name == "tau" else 0.0 if name == "delay" else -np.inf for name in names]
    scale = [T if name == "delay" else abs(value) for name, value in zip(names, start.tolist(), strict=True)]
    found = least_squares(misses, start, "3-point", (low, [np.inf] * len(names)), x_scale=scale)
    lengths = [2 * len(response.frequency) for response in responses]
    jacobian = np.asarray(found.jac)
    spread = regress(jacobian, -found.fun, lengths)
    honest = np.linalg.pinv(jacobian.T @ jacobian)  # if the lines' errors are what they say
    chi = float(np.mean(found.fun**2))
    return found.x, np.where(np.eye(len(names)) > 0, np.maximum(spread.covariance, honest), spread.covariance), chi


def _friction(logs: Sequence[Log], values: dict[str, float], covariance: np.ndarray, order: Sequence[str]) -> list[str]:
    """Fill in friction where the mean velocity tells it, else zero with no end of error; sentences on the latter."""
    unidentifiable = []
    for name, way in (("friction_plus", 1.0), ("friction_minus", -1.0)):
        at, gain = order.index(name), order.index("K")
        one_way = [_steady(log, values) for log in logs if _direction(log) == way]
        values[name] = 0.0
        covariance[at, at] = np.inf
        if not one_way:
            where = "forward" if way > 0 else "backward"
            unidentifiable.append(
                f"{name}: a frequency response tells no friction, but where the axis moves {where} all along"
            )
            continue
        voltage, friction = (float(np.mean(np.concatenate([pair[i] for pair in one_way]))) for i in (0, 1))
        values[name] = way * max(way * friction, 0.0)
        covariance[at, :] = covariance[:, at] = voltage * covariance[gain, :]
        covariance[at, at] = voltage**2 * covariance[gain, gain]
    return unidentifiable


def _steady(log: Log, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Command, and by how much friction slows each sample, without the beginning: what gets the axis going is none."""
    u, y = output_rate(log, False)
    begin = min(int(10.0 * values["tau"] / log.sample_period), len(u) // 2)
    return u[begin:], (model_rate(u, y, log.sample_period, values, False) - y)[begin:]


def _direction(log: Log) -> float:
    """+1 or -1 if the axis never reverses in the log, by the way over stretches of a hundredth of it; else 0."""
    stretch = max(len(log) // 400, 2)
    moved = np.diff(log.position[::stretch])
    slack = 2.0 * (log.resolution or 0.0)
    if (moved > -slack).all() and log.position[-1] > log.position[0] + 10.0 * slack:
        return 1.0
    if (moved < slack).all() and log.position[-1] < log.position[0] - 10.0 * slack:
        return -1.0
    return 0.0


def _warnings(
    logs: Sequence[Log],
    responses: Sequence[FrequencyResponse],
    values: Mapping[str, float],
    chi: float,
    is_rate: bool,
) -> list[str]:
    said = []
    if values["K"] < 0.0:
        said.append(
            f"K = {values['K']:.4g} is negative: the output moves against the command. Is the sign of the command or "
            "of the position reversed?"
        )
    for log, response in zip(logs, responses, strict=True):
        coherence = float(np.median(response.coherence))
        if coherence < _COHERENT:
            said.append(
                f"{log.name}: the median coherence is {coherence:.2f}: much of the output does not follow the command "
                "linearly (noise, friction, or another input); raise the amplitude"
            )
        if not is_rate and _direction(log) == 0.0:
            said.append(_of_reversing(log))
    if chi > 4.0:
        said.append(
            f"the response is {np.sqrt(chi):.1f} standard errors off the model on average: this axis is not of first "
            "order in velocity, or not linear"
        )
    fastest = max(float(response.frequency[-1]) for response in responses)
    if 2.0 * np.pi * fastest * values["tau"] < 0.5:
        said.append(
            f"the highest frequency, {fastest:.3g} Hz, is far below the corner at {0.5 / np.pi / values['tau']:.3g} "
            "Hz, so tau rests on a small part of the response"
        )
    return said


def _of_reversing(log: Log) -> str:
    """What friction takes from K and τ of an axis that reverses, by the friction that a free run tells."""
    from rds.identification.fit import simulation_error
    from rds.identification.structures.axis_structure import make

    size = float(np.sqrt(2.0) * np.std(motion_of(log).velocity))
    unit = SPEEDS[log.units.get("position", "mm")]
    said = (
        f"{log.name}: the axis reverses, so Coulomb friction F makes K and tau too small by a factor of about "
        f"1/(1 + 4F/(π·{size:.3g} {unit})), and no coherence shows it"
    )
    try:
        found = simulation_error.estimate([excited_part(log, _ENOUGH)], make(), {}).values()
        friction = 0.5 * (found["friction_plus"] - found["friction_minus"])
        loss = 100.0 * (1.0 - 1.0 / (1.0 + 4.0 * friction / (np.pi * size)))
        said += f": some {loss:.2g} % here, where F is about {friction:.2g} {unit}"
        said += f": {UNUSABLE}" if loss > _LOST else ""
    except InputError:  # then there is more to say against the log than this
        pass
    return f"{said}. Add an offset that keeps the axis moving one way, or take --method simulation"


def _told(response: FrequencyResponse) -> dict[str, Any]:
    return {
        "frequency_hz": response.frequency.tolist(),
        "magnitude": np.abs(response.response).tolist(),
        "phase_deg": response.phase.tolist(),
        "coherence": response.coherence.tolist(),
        "std_error": response.std_error.tolist(),
        "averages": response.averages,
        "period_s": response.period,
    }
