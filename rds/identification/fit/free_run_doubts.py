"""What a free run beside the measurement says against the parameters, in sentences with numbers and units."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rds.identification.fit.estimate import UNUSABLE, Errors
from rds.identification.fit.initial_state import first_velocities, initial_samples
from rds.identification.fit.kstep import over_noise
from rds.identification.fit.smoothing import Motion, motion_of
from rds.identification.logs.excitation import is_at_rest, is_steady
from rds.identification.logs.log import RATES
from rds.identification.logs.motion import travel
from rds.identification.structures.structure import Structure

if TYPE_CHECKING:
    from rds.identification.logs.log import Log

_POOR = 90.0  # per cent: a model that fits worse does not explain the motion
MISSED = 1.5  # times the measurement's noise: residuals that are larger hold something else
_LEAP = 0.05  # of the highest speed: by how much a fitted initial velocity may leave those that the log shows
FAR = 10.0  # times what noise makes of a prediction: it is off by more than noise and intervals explain
_LITTLE = 100.0  # times the measurement's noise: with less motion than that, a fit is not told by much
_NONE = 12.0  # times the noise: it alone spans 8 in 10^4 samples, 10.4 in 10^7
_WHITE = 2.576  # 99 % band, in units of 1/√N
_LAGS = (1, 10, 100)
_NARROW = ": intervals hold for errors that are small beside the motion, and may be too narrow here; record more motion"
_WIDENED = (
    ": derivatives mislead there, so intervals reach to where the residuals grow by more than chance; "
    "record more motion"
)
_OR_HELD = ". Where a controller held the axis (closed_loop in the map), that alone lets a free run drift away"


def fitted_doubts(structure: Structure, log: Log, error: np.ndarray) -> list[str]:
    """Doubts where the free run is what was fitted; `error` is measurement minus free run (samples,)."""
    motion, size, unit = motion_of(log), _rms(error), structure.output_unit
    so = _NARROW if structure.sensitivities is None else _WIDENED  # see profile.py
    said = [*_little(log, motion, unit, so), *_poor(log, motion, error)]
    if motion.noise > 0.0 and size > MISSED * motion.noise:
        said.append(
            f"{log.name}: the residuals ({size:.3g} {unit} RMS) are {size / motion.noise:.3g} times the measurement's "
            f"noise ({motion.noise:.2g} {unit}): the machine does something that structure {_named(structure)} lacks. "
            "The intervals count the residuals' correlation, but not that the parameters make up for what is missing"
        )
    return said + _coloured(log, motion, error)


def other_doubts(structure: Structure, log: Log, error: np.ndarray, method: str) -> list[str]:
    """Doubts where `method` fitted something else, and no controller held the axis: then the free run judges it."""
    if not np.isfinite(error).all():
        return [f"{log.name}: the free run leaves the finite numbers: {UNUSABLE}; compare with --method simulation"]
    motion, size, unit = motion_of(log), _rms(error), structure.output_unit
    # forces are right in a closed loop as well, whose free run drifts; the other methods are for open loops
    is_open = log.closed_loop is False or method != "inverse-dynamics"
    said = [*_little(log, motion, unit, _NARROW), *_poor(log, motion, error, is_open)]
    if motion.noise > 0.0 and size > MISSED * motion.noise:
        said.append(
            f"{log.name}: the free run of these parameters is {size:.3g} {unit} off (RMS), {size / motion.noise:.3g} "
            f"times the measurement's noise ({motion.noise:.2g} {unit}). Either structure {_named(structure)} lacks "
            f"something, or noise, encoder or sampling mislead the method {method}, which no interval counts: compare "
            f"with --method simulation{'' if log.closed_loop is False else _OR_HELD}"
        )
    return said


def leap_doubts(
    structure: Structure, values: Mapping[str, float], log: Log, begun: float, free_run: Errors
) -> list[str]:
    """Doubts where a fit began the free run at the velocity `begun`, which the first samples do not show.

    A wrong model hides its error so. `free_run` begins in the state that the first samples show.
    """
    first = initial_samples(len(log))
    low, high = first_velocities(structure, values, log.time[:first], log.command[:first], log.position[:first])
    slack = _LEAP * float(np.abs(motion_of(log).velocity).max())
    if low - slack <= begun <= high + slack or not free_run.fit_percent < _POOR:
        return []
    unit = structure.output_unit
    return [
        f"{log.name}: the fit begins the free run at {begun:.4g} {unit}/s, and the log begins at {low:.4g} to "
        f"{high:.4g} {unit}/s; from there these parameters explain {free_run.fit_percent:.1f} % of the motion only: "
        f"{UNUSABLE}; try other options, other structures or another method"
    ]


def held_doubts(structure: Structure, log: Log, predicted: Mapping[int, Errors]) -> list[str]:
    """Doubts where a controller held the axis, whose absence a short prediction does not show."""
    found = over_noise(predicted, motion_of(log).noise)
    if found is None or found[1] <= FAR:
        return []
    k, ratio = found
    return [
        f"{log.name}: predictions {k} samples ahead are {predicted[k].rmse:.3g} {structure.output_unit} off (RMS), "
        f"{ratio:.3g} times what the measurement's noise makes: the machine does something that structure "
        f"{_named(structure)} lacks (a delay, play, ...), or the parameters are off; no interval counts that"
    ]


def over_noise_of(log: Log, error: np.ndarray) -> float:
    """How many times the measurement's noise the `error` (samples,) is, RMS; 0 of a log without noise."""
    noise = motion_of(log).noise
    return _rms(error) / noise if noise > 0.0 else 0.0


def is_little(structure: Structure, log: Log) -> bool:
    """Whether the motion of a log, or that in one direction, is so small beside the noise that derivatives mislead."""
    return bool(_little(log, motion_of(log), structure.output_unit, ""))


def _little(log: Log, motion: Motion, unit: str, so: str) -> list[str]:
    noise = motion.noise
    if (reach := float(np.ptp(log.position))) < _LITTLE * noise:
        return [_too_small(log, "", reach, "in all", noise, unit) + so]
    said = []
    for way, word in ((1.0, "forward "), (-1.0, "backward ")):
        reach = travel(log.position, way)
        if unit not in RATES and _NONE * noise < reach < _LITTLE * noise:
            said.append(_too_small(log, word, reach, "at most", noise, unit) + so)
    return said


def _too_small(log: Log, way: str, reach: float, how: str, noise: float, unit: str) -> str:
    return (
        f"{log.name}: the axis moves {way}by {reach:.3g} {unit} {how}, only {reach / noise:.0f} times the "
        f"measurement's noise ({noise:.2g} {unit})"
    )


def _poor(log: Log, motion: Motion, error: np.ndarray, is_open: bool = True) -> list[str]:
    if is_at_rest(log):  # there is no motion to explain
        moved, unit = float(np.ptp(error)), log.units.get("position", "mm")
        return [f"{log.name}: the axis rests there, and the model moves by {moved:.3g} {unit}"] if moved > 0.0 else []
    spread = float(log.position.std())
    fit = 100.0 * (1.0 - float(error.std()) / spread) if spread > 0.0 else 0.0
    if not (fit < _POOR and _rms(error) > MISSED * motion.noise) or (log.is_rate and is_steady(log)):
        return []  # a speed that stays the same has no motion to explain
    verdict = (
        UNUSABLE if is_open else "unless a controller held it (closed_loop in the map), they are not the axis's own"
    )
    return [
        f"{log.name}: the free run of these parameters explains {fit:.1f} % of the motion only: {verdict}; look at the "
        "data with `rds data describe` (columns, signs, units), and try other options or structures"
    ]


def _coloured(log: Log, motion: Motion, error: np.ndarray) -> list[str]:
    e = error - error.mean()
    power = float(e @ e)
    correlation = {lag: float(e[lag:] @ e[:-lag]) / power for lag in _LAGS if lag < len(e) // 4 and power > 0.0}
    band = _WHITE / np.sqrt(len(error))
    beyond = {lag: value for lag, value in correlation.items() if abs(value) > 2.0 * band}
    if not beyond or (motion.noise > 0.0 and _rms(error) <= MISSED * motion.noise):
        return []
    values = ", ".join(f"{value:.2f} at {lag}" for lag, value in beyond.items())
    return [
        f"{log.name}: the residuals are not white (autocorrelation {values} samples' distance; 99 % band "
        f"±{band:.3f}): parameters that fit this log may not fit another"
    ]


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _named(structure: Structure) -> str:
    name = Path(structure.name).name
    return f"{name} with {', '.join(structure.options)}" if structure.options else name
