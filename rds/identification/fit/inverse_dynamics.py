"""Inverse-dynamics least squares: the equation of motion as a linear regression on measured velocity and acceleration.

The procedure of the EMPS's authors (Janot, Gautier, Brunot 2019): the position goes forward and backward through a
Butterworth filter of order 4, which shifts no phase; velocity and acceleration are central differences of it; samples
at both ends are left out; voltage (or force) and every column of the equation are filtered and decimated alike, so that
what the filters take from one side they take from the other. `MotionForm` says which equation.

Two things are ours. Samples at which the axis stands still are left out, since at rest friction answers any
voltage. And the residuals' correlation counts in the standard errors (`regression.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.options import check_known
from rds.core.quantities import Quantity
from rds.identification.fit.estimate import Estimate
from rds.identification.fit.made_estimate import made_estimate
from rds.identification.fit.regression import Regression, regress
from rds.identification.logs.log import Log
from rds.identification.structures.motion_form import MotionForm, motion_form
from rds.identification.structures.structure import Structure

OPTIONS = {
    "cutoff": Quantity(
        "cut-off of the zero-phase filter; a tenth of the sampling frequency if not given", "Hz", above=0.0
    ),
    "order": Quantity("order of the filter, run forward and backward; 4 if not given", low=1.0),
    "decimation": Quantity("one of how many samples is kept; sampling frequency over cut-off if not given", low=1.0),
    "hold": Quantity(
        "share of the command before in what acts at a sample: 0.5 for a held command, 0 for a force at that instant",
        low=0.0,
    ),
    "drop": Quantity("samples left out at each end; 4.9 sampling frequencies over the cut-off if not given", low=0.0),
}
_JITTER = 0.1  # of a sample period: how far a time may be off the regular grid
_REST = 2  # decimated samples within which an axis at rest moves no more than one step of its encoder
_LEAST = 5  # rows for each coefficient


@dataclass(frozen=True)
class Settings:
    """How the data are filtered: frequencies in Hz, lengths in samples."""

    cutoff: float
    order: int
    decimation: int
    drop: int
    hold: float


@dataclass(frozen=True)
class Found:
    """What the regression says, in the structure's parameters without those that are given."""

    values: dict[str, float]
    covariance: np.ndarray
    regression: Regression
    form: MotionForm
    settings: Settings
    rows: int
    still: int  # rows left out because the axis stood
    held: tuple[str, ...]  # friction that came out with the wrong sign, and was held at zero


def estimate(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Estimate:
    """The parameters of `structure` by inverse dynamics; `options` are those of `OPTIONS`.

    A central difference at a sample sees the time around it, in which a held command was half the last one and half
    this one: `hold` is 0.5. The default of axis-mass is 0, as the EMPS's authors have it. InputError where the data
    hold nothing to estimate from.
    """
    found = regress_logs(logs, structure, options)
    regression, names = found.regression, list(found.form.names)
    given = structure.given(logs) if structure.given else {}
    order = list(structure.parameters)
    covariance = np.zeros((len(order), len(order)))
    places = [order.index(name) for name in names]
    covariance[np.ix_(places, places)] = found.covariance
    untold = [
        f"{name}: no row of the data holds it (the axis never moves that way, or not at all differently)"
        for name in names
        if not np.isfinite(found.covariance[names.index(name), names.index(name)])
    ]
    freedom = max(found.rows / (1 + 2 * regression.lag) - len(names), 1.0)
    return made_estimate(
        structure,
        "inverse-dynamics",
        logs,
        {**found.values, **given},
        covariance,
        freedom,
        untold=untold,
        warnings=_warnings(found),
        relative_error_percent=regression.relative_percent,
        details={
            "explains": found.form.target,
            "cutoff_hz": found.settings.cutoff,
            "order": found.settings.order,
            "decimation": found.settings.decimation,
            "dropped_samples": found.settings.drop,
            "hold": found.settings.hold,
            "rows": found.rows,
            "rows_at_rest": found.still,
            "condition": regression.condition,
            "residual_autocorrelation": regression.autocorrelation,
            "correlation_rows": regression.lag,
            "ordinary_std_errors": dict(zip(names, _ordinary(found).tolist(), strict=True)),
        },
    )


def regress_logs(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Found:
    """The regression alone, over all logs together."""
    form = motion_form(structure)
    settings = _settings(logs, structure, options)
    gain = structure.given(logs)["force_gain"] if structure.given else 1.0
    blocks, still = [], 0
    for log in logs:
        rows, at_rest = _rows(log, form, settings, gain)
        blocks.append(rows[~at_rest])
        still += int(at_rest.sum())
    table = np.vstack(blocks)
    if len(table) < _LEAST * len(form.names):
        raise InputError(
            f"of {len(table) + still} rows after decimation, {still} are at rest: {len(table)} are left for "
            f"{len(form.names)} parameters, too few; log a longer or livelier motion, or keep more rows, as with "
            "--set decimation=1",
            ", ".join(log.name for log in logs),
        )
    lengths = [len(block) for block in blocks]
    regression, held = _with_signs(table[:, 1:], table[:, 0], lengths, form)
    theta = regression.values
    if form.target == "voltage" and theta[1] == 0.0:
        raise InputError("the velocity is nowhere in the voltage: there is no gain to estimate", logs[0].name)
    return Found(
        values=dict(zip(form.names, form.values(theta).tolist(), strict=True)),
        covariance=form.covariance(theta, regression.covariance),
        regression=regression,
        form=form,
        settings=settings,
        rows=len(table),
        still=still,
        held=tuple(form.names[column] for column in held),
    )


def _settings(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Settings:
    check_known(options, OPTIONS, "method inverse-dynamics")
    numbers = {
        name: OPTIONS[name].check(value, name, "inverse-dynamics")
        for name, value in options.items()
        if value is not None
    }
    hold = numbers.get("hold", 0.0 if structure.name == "axis-mass" else 0.5)
    if hold > 1.0:
        raise InputError(f"inverse-dynamics: hold = {hold:g} must be at most 1 ({OPTIONS['hold'].meaning})")
    rate = 1.0 / float(np.mean([log.sample_period for log in logs]))
    cutoff = numbers.get("cutoff", rate / 10.0)
    if cutoff >= 0.5 * rate:
        raise InputError(
            f"inverse-dynamics: cutoff = {cutoff:g} Hz must be below half the sampling frequency, {0.5 * rate:g} Hz"
        )
    return Settings(
        cutoff=cutoff,
        order=int(numbers.get("order", 4)),
        decimation=int(numbers.get("decimation", max(round(rate / cutoff), 1))),
        drop=int(numbers.get("drop", round(4.9 * rate / cutoff))),
        hold=hold,
    )


def _rows(log: Log, form: MotionForm, settings: Settings, gain: float) -> tuple[np.ndarray, np.ndarray]:
    """The target and the columns of one log, decimated, (rows, 1 + coefficients); and which rows are at rest."""
    with needed_for("a fit by inverse dynamics"):
        from scipy.signal import butter, decimate, filtfilt

    T = log.sample_period
    off = np.abs(log.time - log.time[0] - T * np.arange(len(log)))
    if off.max() > _JITTER * T:
        at = int(np.argmax(off > _JITTER * T))
        raise InputError(
            f"at sample {at}, t = {log.time[at]:g} s is {off[at] / T:.2g} sample periods off a regular grid; filters "
            "need regular times: take --method simulation, which uses times as they are, or resample the log",
            log.source or log.name,
        )
    least = 2 * settings.drop + 4 * settings.decimation * len(form.names)
    if len(log) < max(least, 40):
        raise InputError(
            f"it has {len(log)} samples, and this filter needs {max(least, 40)} or more; raise the cut-off (--set "
            "cutoff=HZ), or take --method simulation",
            log.source or log.name,
        )
    b, a = butter(settings.order, 2.0 * settings.cutoff * T)
    smooth = filtfilt(b, a, log.position)
    velocity = smooth if form.is_rate else np.gradient(smooth, T)
    acceleration = np.gradient(velocity, T)
    force = gain * log.command
    if settings.hold > 0.0:
        force = np.concatenate([force[:1], (1.0 - settings.hold) * force[1:] + settings.hold * force[:-1]])
    inside = slice(settings.drop, len(log) - settings.drop)
    table = np.column_stack([force, form.columns(velocity, acceleration)])[inside]
    rest = np.abs(log.position) <= (log.resolution or 0.0) if form.is_rate else _at_rest(log, settings)
    q = settings.decimation
    if q == 1:
        return table, rest[inside]
    small = decimate(table, q, axis=0)
    rests = np.maximum.reduceat(rest[inside], np.arange(0, len(table), q))
    return small, rests[: len(small)]


def _at_rest(log: Log, settings: Settings) -> np.ndarray:
    """Whether at each sample the position stays within one step of the encoder, over some rows' time."""
    with needed_for("a fit by inverse dynamics"):
        from scipy.ndimage import maximum_filter1d, minimum_filter1d

    width = max(_REST * settings.decimation, 3)
    reach = maximum_filter1d(log.position, width) - minimum_filter1d(log.position, width)
    return np.asarray(reach <= 1.01 * (log.resolution or 0.0))


def _with_signs(X: np.ndarray, y: np.ndarray, lengths: Sequence[int], form: MotionForm) -> tuple[Regression, list[int]]:
    """The regression; friction that would drive the axis is held at zero, the worst first, and the rest done again."""
    kept = list(range(X.shape[1]))
    while True:
        found = regress(X[:, kept], y, lengths)
        way = np.sign(found.values[kept.index(1)]) if form.target == "voltage" and 1 in kept else 1.0
        wrong = {
            column: size
            for column, sign in form.friction.items()
            if column in kept and (size := -sign * way * found.values[kept.index(column)]) > 0.0
        }
        if not wrong:
            break
        kept.remove(max(wrong, key=lambda column: wrong[column] * float(np.linalg.norm(X[:, column]))))
    held = [column for column in range(X.shape[1]) if column not in kept]
    if not held:
        return found, held
    values, covariance = np.zeros(X.shape[1]), np.zeros((X.shape[1], X.shape[1]))
    ordinary = np.zeros(X.shape[1])
    values[kept], covariance[np.ix_(kept, kept)], ordinary[kept] = found.values, found.covariance, found.ordinary
    untold = tuple(kept[column] for column in found.untold)
    return replace(found, values=values, covariance=covariance, ordinary=ordinary, untold=untold), held


def _ordinary(found: Found) -> np.ndarray:
    """Standard errors if the residuals were white, as the authors state them."""
    spread = np.diag(found.regression.ordinary**2)
    full = found.regression.covariance
    scale = np.sqrt(np.where(np.diag(full) > 0.0, np.diag(full), 1.0))
    with np.errstate(invalid="ignore"):
        correlation = np.where(np.isfinite(full), full / np.outer(scale, scale), 0.0)
    ordinary = np.sqrt(np.diag(spread))
    finite = np.where(np.isfinite(ordinary), ordinary, 0.0)
    return np.sqrt(np.diag(found.form.covariance(found.regression.values, correlation * np.outer(finite, finite))))


def _warnings(found: Found) -> list[str]:
    said = []
    regression = found.regression
    if found.held:
        said.append(
            f"{', '.join(found.held)} came out driving the axis, not braking it, and was held at 0: friction is too "
            "small for these data to tell, the form is wrong, or the sign of the command is reversed"
        )
    if found.form.target == "voltage" and found.values["K"] < 0.0:
        said.append(
            f"K = {found.values['K']:.4g} is negative: a positive command moves the axis backward. Is the sign of the "
            "command or of the position reversed?"
        )
    if regression.relative_percent > 20.0:
        said.append(
            f"the equation leaves {regression.relative_percent:.1f} % of the {found.form.target} unexplained: this is "
            "not how the axis moves, or the columns are not what they are taken for"
        )
    if regression.condition > 100.0:
        said.append(
            f"the columns are nearly dependent (condition number {regression.condition:.0f} of 100 at most): the "
            "motion varies too little in speed and acceleration; errors are large and shared between parameters"
        )
    if found.still > found.rows:
        said.append(f"{found.still} of {found.rows + found.still} rows are at rest and tell nothing")
    return said
