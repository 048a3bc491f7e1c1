"""First-order step fit: gain, time constant and dead time from steps of the voltage.

A spindle's speed, and an axis's velocity while its direction stays, answer a step with

    v(t) = v_f + (v_b - v_f) e^(-(t - L)/τ)   for t >= L,      v_f = K (u + u₀)   or   K u - F±

All steps are fitted together by least squares, with τ, K, F±, u₀ and L in common. What each step began with (speed v_b;
an axis's position) is linear and solved for inside. An axis is fitted by its position, the integral of v: no
derivative of it is taken. The rules of thumb (63.2 %) give the start, and stand beside in the details.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.options import check_known
from rds.identification.fit.estimate import Estimate
from rds.identification.fit.made_estimate import made_estimate
from rds.identification.fit.regression import regress
from rds.identification.fit.steps import Reading, Window, find_windows, read_step
from rds.identification.logs.log import Log
from rds.identification.structures.structure import Structure

STRUCTURES: Mapping[str, tuple[str, ...]] = {"spindle": ("offset", "delay"), "axis": ("delay",)}  # and their options
_LOW_TAU, _HIGH_TAU = 0.2, 10.0  # sample periods, times the longest step: where τ is looked for
_GRID = 25
_STEP = 1e-5  # relative, for differences

Windows = Sequence[tuple[Log, Window]]


def estimate(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Estimate:
    """The parameters of a spindle or axis by the steps in `logs`; there are no `options`.

    InputError for other structures, and logs without steps, or whose steps tell no parameter.
    """
    check_known(options, (), "method step")
    allowed = STRUCTURES.get(structure.name)
    if allowed is None or not set(structure.options) <= set(allowed):
        known = " and ".join(f"{name} with options {' and '.join(of)}" for name, of in STRUCTURES.items())
        raise InputError(
            f"the step fit is for {known}; here the structure is {structure.name} with options "
            f"{', '.join(structure.options) or 'none'}; take --method simulation"
        )
    is_rate = structure.name == "spindle"
    windows = [(log, window) for log in logs for window in find_windows(log, is_rate)]
    _check_windows(logs, windows, is_rate)
    unidentifiable = [] if is_rate else _missing(windows)
    names = [name for name in structure.parameters if name not in unidentifiable]
    readings = [reading for log, window in windows if (reading := read_step(log, window, is_rate))]
    values, residual, jacobian, lengths = _solve(windows, names, readings, is_rate)
    spread = regress(jacobian, residual, lengths)
    order = list(structure.parameters)
    covariance = np.zeros((len(order), len(order)))
    places = [order.index(name) for name in names]
    errors = np.sqrt(np.diag(spread.covariance))  # by few samples at the onset of steps: too small by chance
    wider = np.divide(spread.ordinary, errors, out=np.ones(len(names)), where=np.isfinite(errors) & (errors > 0.0))
    covariance[np.ix_(places, places)] = spread.covariance * np.outer(wider.clip(1.0), wider.clip(1.0))
    for name in unidentifiable:
        covariance[order.index(name), order.index(name)] = np.inf
    way = {"friction_plus": "forward", "friction_minus": "backward"}
    sentences = [f"{name}: no step ends in motion {way[name]}" for name in unidentifiable]
    sentences += [f"{names[i]}: the steps do not tell it apart from the others" for i in spread.unidentifiable]
    return made_estimate(
        structure,
        "step",
        logs,
        {**dict.fromkeys(unidentifiable, 0.0), **values},
        covariance,
        max(len(residual) / (1 + 2 * spread.lag) - len(names), 1.0),
        unidentifiable=sentences,
        warnings=_warnings(values, readings if is_rate else [], windows),
        details={
            "steps": len(windows),
            "steps_after_a_turn": sum(window.tail for _, window in windows),
            "readings": [asdict(reading) for reading in readings],
            "rmse_of_steps": float(np.sqrt(np.mean(residual**2))),
        },
    )


def _check_windows(logs: Sequence[Log], windows: Windows, is_rate: bool) -> None:
    where = ", ".join(log.name for log in logs)
    if not windows:
        raise InputError(
            "there is no step to fit: no voltage stays the same for 12 samples or more while the "
            f"{'speed' if is_rate else 'axis'} answers it; log a square voltage in system-test mode, or take "
            "--method simulation",
            where,
        )
    if not is_rate and all(
        len({round(window.voltage, 6) for _, window in windows if window.way == way}) < 2 for way in (1, -1)
    ):
        raise InputError(
            "the steps of each direction all end at one voltage, which tells no gain apart from friction; log steps to "
            "two voltages or more in each direction",
            where,
        )


def _missing(windows: Windows) -> list[str]:
    ways = {window.way for _, window in windows}
    return [name for name, way in (("friction_plus", 1), ("friction_minus", -1)) if way not in ways]


def _solve(
    windows: Windows, names: Sequence[str], readings: Sequence[Reading], is_rate: bool
) -> tuple[dict[str, float], np.ndarray, np.ndarray, list[int]]:
    """Values, residuals, their derivatives by the values (with the sign of the model's), and the windows' lengths."""
    with needed_for("a fit to steps"):
        from scipy.optimize import least_squares

    shortest = min(log.sample_period for log, _ in windows)
    longest = max(float(log.time[w.end - 1] - log.time[w.first]) for log, w in windows)
    guesses = [reading.tau for reading in readings if reading.tau > 0.0]
    middle = float(np.median(guesses)) if guesses else 0.1 * longest
    grid = np.unique([*np.geomspace(_LOW_TAU * shortest, _HIGH_TAU * longest, _GRID), middle])
    starts = [_linear_part(windows, names, float(tau), is_rate) for tau in grid]
    start, _ = min(starts, key=lambda item: item[1])
    is_delay = np.array([name == "delay" for name in names])
    scale = np.where(is_delay, shortest, np.maximum(np.abs(start), 1e-3))
    # differences are relative, and of a delay of 0 nothing would be left: it is counted from a sample before. It begins
    # at one sample, because a search that begins at a bound may stay there
    zero = np.where(is_delay, -shortest, 0.0)

    def misses(point: np.ndarray) -> np.ndarray:
        return np.concatenate(_misses(windows, dict(zip(names, (point + zero).tolist(), strict=True)), is_rate))

    low = np.array([1e-3 * shortest if name == "tau" else 0.0 if name == "delay" else -np.inf for name in names])
    high = np.where(is_delay, 0.5 * longest, np.inf)
    begin = np.where(is_delay, np.minimum(shortest, 0.5 * high), np.clip(start, low, high))
    found = least_squares(
        misses, begin - zero, "3-point", (low - zero, high - zero), x_scale=scale, diff_step=np.full(len(names), _STEP)
    )
    lengths = [window.end - window.first for _, window in windows]
    return dict(zip(names, (found.x + zero).tolist(), strict=True)), -found.fun, np.asarray(found.jac), lengths


def _linear_part(windows: Windows, names: Sequence[str], tau: float, is_rate: bool) -> tuple[np.ndarray, float]:
    """A point and its sum of squares: with τ given and no delay, the final speeds by least squares, then the rest."""
    finals, rows, cost = [], [], 0.0
    for log, window in windows:
        A, c, y = _window(log, window, tau, 0.0, is_rate)
        full = np.column_stack([A, c])
        solution = np.linalg.lstsq(full, y, rcond=None)[0]
        cost += float(np.sum((y - full @ solution) ** 2))
        finals.append(solution[-1])
        if is_rate:
            rows.append([window.voltage, 1.0])
        else:
            rows.append([window.voltage, -float(window.way > 0), -float(window.way < 0)])
    X, v = np.array(rows), np.array(finals)
    if is_rate and "offset" not in names:
        X = X[:, :1]
    solved = np.linalg.lstsq(X, v, rcond=None)[0]
    values = {"tau": tau, "K": solved[0], "delay": 0.0}
    if is_rate:
        values["offset"] = solved[1] / solved[0] if len(solved) > 1 and solved[0] else 0.0
    else:
        values |= {"friction_plus": solved[1], "friction_minus": solved[2]}
    return np.array([values[name] for name in names]), cost


def _misses(windows: Windows, values: Mapping[str, float], is_rate: bool) -> list[np.ndarray]:
    """Model minus measurement of each window, what it began with being solved for."""
    misses = []
    friction = {1: values.get("friction_plus", 0.0), -1: values.get("friction_minus", 0.0)}
    for log, window in windows:
        A, c, y = _window(log, window, values["tau"], values.get("delay", 0.0), is_rate)
        final = values["K"] * (window.voltage + values.get("offset", 0.0))
        if not is_rate:
            final -= friction[window.way]
        rest = y - final * c
        base, _ = np.linalg.qr(A)
        misses.append(base @ (base.T @ rest) - rest)
    return misses


def _window(
    log: Log, window: Window, tau: float, delay: float, is_rate: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns of what the window began with (samples, n), the column of the final speed, and the measurement."""
    part = slice(window.first, window.end)
    t, y = log.time[part] - log.time[window.first], log.position[part]
    if window.tail:  # began somewhere before: position and speed there are both free
        return np.column_stack([np.ones(len(t)), np.exp(-t / tau)]), t, y
    since = np.maximum(t - delay, 0.0)
    gone = -np.expm1(-since / tau)
    if is_rate:
        return (1.0 - gone)[:, None], gone, y
    began = np.minimum(t, delay) + tau * gone
    return np.column_stack([np.ones(len(t)), began]), since - tau * gone, y


def _warnings(values: Mapping[str, float], readings: Sequence[Reading], windows: Windows) -> list[str]:
    said = []
    if values["K"] < 0.0:
        said.append(
            f"K = {values['K']:.4g} is negative: a positive voltage lowers the speed. Is the sign of the command or of "
            "the position reversed?"
        )
    longest = max(float(log.time[w.end - 1] - log.time[w.first]) for log, w in windows)
    if values["tau"] > longest:
        said.append(
            f"tau = {values['tau']:.3g} s is longer than the longest step, {longest:.3g} s: no final speed was seen, "
            "so that tau and K come only as their ratio"
        )
    gains = np.array([reading.gain for reading in readings])  # of a spindle: friction makes an axis's differ anyway
    if len(gains) > 1 and np.ptp(gains) > 0.1 * abs(float(np.median(gains))):
        said.append(
            f"the gain differs from step to step, from {gains.min():.4g} to {gains.max():.4g}: friction, or a gain "
            "that depends on speed; a single K is their mean"
        )
    return said
