"""All that is measured of one model on one log, before anything is concluded from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite, sqrt
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.identification.fit.estimate import Errors
from rds.identification.fit.initial_state import LEAST, estimate_start
from rds.identification.fit.initial_state import initial_samples as usual_samples
from rds.identification.fit.kstep import STEPS, ahead, errors_of
from rds.identification.fit.needed_voltage import NeededVoltage, needed_voltage, smoothed_velocity
from rds.identification.fit.residuals import LONGEST, ResidualTest, bandwidth, block_length, block_means, residual_tests
from rds.identification.fit.smoothing import speed_range
from rds.identification.logs.log import Log
from rds.identification.logs.motion import noise
from rds.identification.validate.attainable import Attainable, attainable
from rds.identification.validate.candidate import Candidate, check_units
from rds.identification.validate.discrepancy import Discrepancy, as_axis
from rds.identification.validate.discrepancy_of_motion import as_motion
from rds.identification.validate.same_data import Overlap, overlap

_MOVES = 1e-3  # of the measured motion
_RUNS_AWAY = 1e9  # of the measured motion: no error of a gain or a unit is so large, only a response that grows
_SLOPE = 1e-3  # of a standard error, for sensitivities
_FEWEST = 16  # blocks that are worth joining
_LATEST = 0.75  # of the log: where play is taken up later, no more of it is left out
_MOVED = (8.0, 2.0)  # times the noise, steps of the encoder: beyond the range of noise alone, an axis has moved


@dataclass(frozen=True)
class Range:
    """Lowest and highest of a quantity in the log, beside those of the fit's data (None: not recorded)."""

    here: tuple[float, float]
    fitted: tuple[float, float] | None
    unit: str


def largest(ends: tuple[float, float]) -> float:
    """The largest magnitude between the two ends of a range."""
    return max(abs(ends[0]), abs(ends[1]))


@dataclass(frozen=True)
class Assessment:
    """One model on one log. Arrays are over the samples from `first` on, which the errors count.

    `free_run`, `velocity` and `ahead` are model minus measurement. `velocity` is of mean velocities over blocks of
    `block` samples, for measurement and model alike (None for a spindle, whose output is one). `naive` predicts
    without a model: the axis stays, or moves on as it did over the last k samples, whichever is better.
    `gain` is the measured velocity over the model's (least squares); 1 for a model that is right.
    """

    log: Log
    first: int
    initial_state: tuple[float, ...]
    modelled: np.ndarray
    free_run: Errors | None  # None where the model's response is not finite
    unstable_at: float | None  # s, from which it is not
    velocity: Errors | None
    ahead: Mapping[int, Errors]
    naive: Mapping[int, Errors]
    drift: float | None  # unit/s: the slope of the residual over time
    gain: float | None
    block: int
    block_time: np.ndarray
    block_velocity: np.ndarray
    block_modelled: np.ndarray
    tests: ResidualTest | None
    voltage: NeededVoltage | None
    attainable: Attainable | None  # None where no fit to this log is a measure of the model
    as_axis: Discrepancy | None  # None for a model that is no linear axis
    as_motion: Discrepancy | None  # None where the model hardly moves
    frequency: float  # Hz: 99 % of the power of the motion's velocity lies below
    noise: float  # of the measurement, rounding included, in the unit of the position
    overlap: Overlap
    ranges: Mapping[str, Range]

    @property
    def time(self) -> np.ndarray:
        """s."""
        return self.log.time[self.first :]

    @property
    def measured(self) -> np.ndarray:
        """In the unit of the position."""
        return self.log.position[self.first :]

    @property
    def residual(self) -> np.ndarray:
        """Measured minus modelled."""
        return self.measured - self.modelled

    @property
    def unit(self) -> str:
        """Of the position (rev/min for a spindle's speed)."""
        return self.log.units.get("position", "mm")

    @property
    def changes(self) -> int:
        """How often the measured velocity swings from clearly high to clearly low, or back.

        It is taken over blocks so long that a step of the encoder is no change, where the log has so long ones.
        """
        step = 0.0 if self.log.resolution is None else self.log.resolution / (self.block * self.log.sample_period)
        rate = self.block_velocity
        while float(rate.std()) < 2.0 * step and len(rate) >= _FEWEST:
            rate, step = block_means(rate, 2), step / 2.0
        return _swings(rate, max(float(rate.std()), 2.0 * step, 1e-9))

    @property
    def motion(self) -> float:
        """The distance between the lowest and the highest position measured."""
        return float(np.ptp(self.measured))


def assess(candidate: Candidate, log: Log, initial_samples: int | None = None, bandwidth: float = 0.0) -> Assessment:
    """Measure the model against the log.

    The initial state is estimated from the first `initial_samples` (default 50, of short logs a tenth), and errors
    count from there on. `bandwidth` is the intended one of a loop, Hz (0: see `discrepancy`). InputError for a log too
    short for that, or in another unit than the model.
    """
    check_units(candidate, log)
    first = _first(log, initial_samples)
    structure, values = candidate.structure, candidate.values
    t, u, y = log.time, log.command, log.position
    start = estimate_start(structure, values, t[:first], u[:first], y[:first])
    with np.errstate(all="ignore"):
        response = np.asarray(structure.respond(t, u, start, values), dtype=float)
    if response.shape != y.shape:
        raise InputError(f"the model answers with shape {response.shape} to {len(y)} samples", candidate.name)
    modelled = response[first:]
    far = _RUNS_AWAY * max(float(np.ptp(y)), 1.0)
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(~(np.abs(response - y[0]) < far))
    unstable_at = float(t[wrong[0]]) if len(wrong) else None
    frequency = _tried(log, response, candidate.is_rate)
    block = block_length(frequency, log.sample_period, len(modelled))
    rates = [_rates(t[first:], values, block, candidate.is_rate) for values in (y[first:], modelled)]
    common: dict[str, Any] = {
        "log": log,
        "first": first,
        "initial_state": start,
        "modelled": modelled,
        "unstable_at": unstable_at,
        "block": block,
        "frequency": frequency,
        "block_time": block_means(t[first:], block),
        "block_velocity": rates[0],
        "block_modelled": rates[1],
        "noise": max(noise(y[:LONGEST]), (log.resolution or 0.0) / sqrt(12.0)),
        "overlap": overlap(candidate, log),
        "ranges": _ranges(candidate, log),
    }
    unit = log.units.get("position", "mm")
    if unstable_at is not None:
        return Assessment(
            free_run=None,
            velocity=None,
            ahead={},
            naive={},
            drift=None,
            gain=None,
            tests=None,
            voltage=None,
            attainable=None,
            as_axis=None,
            as_motion=None,
            **common,
        )
    measured = y[first:]
    return Assessment(
        free_run=errors_of(measured, modelled, unit),
        velocity=None if candidate.is_rate else errors_of(rates[0], rates[1], f"{unit}/s"),
        ahead=ahead(measured, modelled, unit),
        naive=_naive(measured, unit),
        drift=_drift(t[first:], measured - modelled),
        gain=_gain(rates[0], rates[1]),
        tests=_tests(candidate, log, first, start, modelled, frequency),
        voltage=_voltage(candidate, log, block),
        attainable=attainable(candidate, log, start, common["noise"]),
        as_axis=as_axis(candidate, log, common["noise"], bandwidth),
        as_motion=_as_motion(candidate, log, first, response, block, bandwidth, common["noise"]),
        **common,
    )


def _as_motion(
    candidate: Candidate, log: Log, first: int, response: np.ndarray, block: int, bandwidth: float, noise: float
) -> Discrepancy | None:
    """As motion from sample `first` on; of a model with more states than position and velocity from where both move.

    Where an axis begins within its play, no first samples tell. Once both, axis and model, have been driven the same
    way, a constant is all that they are apart by, as the play has been taken up on the same side.
    """
    if candidate.structure.states > 2:
        least = max(_MOVED[0] * noise, _MOVED[1] * (log.resolution or 0.0))
        begun = min(max(_goes(way * y, first, least) for y in (log.position, response)) for way in (1.0, -1.0))
        first = begun if begun <= _LATEST * len(log) else first
    rates = [_rates(log.time[first:], y[first:], block, candidate.is_rate) for y in (log.position, response)]
    tau = candidate.values.get("tau", 0.0)
    return as_motion(log, first, response[first:], candidate.is_rate, rates, bandwidth, tau, noise)


def _goes(position: np.ndarray, first: int, least: float) -> int:
    """The first sample from `first` on that is `least` above an earlier one; their count where there is none."""
    up = position - np.minimum.accumulate(position) > least
    return max(first, int(np.argmax(up))) if up.any() else len(position)


def _swings(values: np.ndarray, least: float) -> int:
    """How often a series goes up by `least` or more, and down."""
    count, way, low, high = 0, 0.0, inf, -inf
    for value in values.tolist():
        low, high = min(low, value), max(high, value)
        if way <= 0.0 and value - low >= least:
            count, way, high = count + 1, 1.0, value
        elif way >= 0.0 and high - value >= least:
            count, way, low = count + 1, -1.0, value
    return count


def _first(log: Log, initial_samples: int | None) -> int:
    if initial_samples is None:
        initial_samples = usual_samples(len(log))
    if initial_samples < LEAST:
        raise InputError(f"initial_samples = {initial_samples} must be at least {LEAST}")
    if len(log) < 2 * initial_samples:
        raise InputError(
            f"the log has {len(log)} samples, and its initial state takes {initial_samples}; a longer log is needed",
            log.source or log.name,
        )
    return initial_samples


def _tried(log: Log, response: np.ndarray, is_rate: bool) -> float:
    """Of the model's motion, which no rounding disturbs; of the command, where the model hardly moves."""
    if np.isfinite(response).all() and float(np.ptp(response)) > _MOVES * float(np.ptp(log.position)):
        rate = response if is_rate else np.diff(response) / np.diff(log.time)
        if (frequency := bandwidth(rate, log.sample_period)) > 0.0:
            return frequency
    return bandwidth(log.command, log.sample_period)


def _rates(t: np.ndarray, y: np.ndarray, block: int, is_rate: bool) -> np.ndarray:
    """Mean velocity over each block, (blocks,); of a speed, its mean."""
    if is_rate:
        return block_means(y, block)
    step = np.append(np.diff(t), t[-1] - t[-2])
    way = np.append(np.diff(y), 0.0) if len(y) else y
    return block_means(way, block) / block_means(step, block)


def _naive(measured: np.ndarray, unit: str) -> dict[int, Errors]:
    """What predicts without a model: it stays where it is, or moves on as it did over the last k samples."""
    stays = ahead(measured, np.zeros(len(measured)), unit)
    found = {}
    for k in STEPS:
        if k not in stays:
            continue
        found[k] = stays[k]
        if 2 * k < len(measured):
            as_before = 2.0 * measured[k:-k] - measured[: -2 * k]
            goes_on = errors_of(measured[2 * k :], as_before, unit)
            found[k] = min(stays[k], goes_on, key=lambda errors: errors.rmse)
    return found


def _drift(t: np.ndarray, residual: np.ndarray) -> float:
    centred = t - t.mean()
    return float(centred @ residual) / float(centred @ centred)


def _gain(measured: np.ndarray, modelled: np.ndarray) -> float | None:
    size = float(modelled @ modelled)
    return float(measured @ modelled) / size if size > 0.0 and isfinite(size) else None


def _tests(
    candidate: Candidate, log: Log, first: int, start: tuple[float, ...], modelled: np.ndarray, frequency: float
) -> ResidualTest:
    log, modelled = log.part(0, first + LONGEST), modelled[:LONGEST]  # of the rest, no derivatives are needed
    names, covariance = candidate.estimated, None
    slopes = None
    if names and candidate.covariance is not None:
        order = list(candidate.parameters)
        places = [order.index(name) for name in names]
        covariance = candidate.covariance[np.ix_(places, places)]
        slopes = np.stack([_slope(candidate, log, first, start, modelled, name) for name in names], axis=1)
    return residual_tests(
        log.position[first:] - modelled,
        log.command[first:],
        modelled,
        log.sample_period,
        frequency=frequency,
        resolution=log.resolution,
        sensitivities=slopes,
        covariance=covariance,
    )


def _slope(
    candidate: Candidate, log: Log, first: int, start: tuple[float, ...], modelled: np.ndarray, name: str
) -> np.ndarray:
    """The derivative of the response by a parameter, by a small fraction of its standard error."""
    step = _SLOPE * candidate.parameters[name].std_error
    moved = {**candidate.values, name: candidate.values[name] + step}
    with np.errstate(all="ignore"):
        response = np.asarray(candidate.structure.respond(log.time, log.command, start, moved), dtype=float)
    return (response[first:] - modelled) / step


def _voltage(candidate: Candidate, log: Log, block: int) -> NeededVoltage:
    window = max(block, 4)
    velocity = smoothed_velocity(log, window, candidate.is_rate)
    return needed_voltage(log, candidate.structure, candidate.values, velocity, window, candidate.is_rate)


def _ranges(candidate: Candidate, log: Log) -> dict[str, Range]:
    unit = log.units.get("position", "mm")
    command = (float(log.command.min()), float(log.command.max()))
    return {
        "command": Range(command, candidate.range_of("command"), log.units.get("command", "V")),
        "velocity": Range(speed_range(log), candidate.range_of("velocity"), unit if candidate.is_rate else f"{unit}/s"),
    }
