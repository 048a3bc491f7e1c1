"""Inverse-dynamics least squares: the equation of motion as a linear regression on measured velocity and acceleration.

The procedure of the EMPS's authors (Janot, Gautier, Brunot 2019): the position goes forward and backward through a
Butterworth filter of order 4, which shifts no phase; velocity and acceleration are central differences of it; samples
at both ends are left out; voltage (or force) and every column of the equation are filtered and decimated alike, so that
what the filters take from one side they take from the other. `MotionForm` says which equation.

Three things are ours. Samples at which the axis stands still are left out, since at rest friction answers any
voltage. The residuals' correlation counts in the standard errors (`regression.py`). And a log at irregular times, as
robots and networks stamp them, is taken at equal steps first, which filter and differences need.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
from rds.identification.logs.log import Log, irregular_at
from rds.identification.structures.motion_form import MotionForm, motion_form
from rds.identification.structures.structure import Structure

FIXED = "fixed"  # {name: value}: parameters that are held, beside those of OPTIONS
OPTIONS = {
    "cutoff": Quantity(
        "cut-off of the zero-phase filter; a tenth of the sampling frequency if not given", "Hz", above=0.0
    ),
    "order": Quantity("order of the filter, run forward and backward; 4 if not given", low=1.0, whole=True),
    "decimation": Quantity(
        "one of how many samples is kept; sampling frequency over cut-off if not given", low=1.0, whole=True
    ),
    "hold": Quantity(
        "share of the command before in what acts at a sample: 0.5 for a held command, 0 for a force at that instant",
        low=0.0,
        high=1.0,
    ),
    "drop": Quantity(
        "samples left out at each end; 4.9 sampling frequencies over the cut-off if not given", low=0.0, whole=True
    ),
}
_REST = 2  # decimated samples within which an axis at rest moves no more than one step of its encoder
_LEAST = 5  # rows for each coefficient
_ONE = 0.1  # sample periods: readings that are nearer count as one, their mean
_BRIDGED = 3.0  # sample periods: a longer step is a gap, within which the motion is not known


@dataclass(frozen=True)
class Settings:
    """How the data are filtered: frequencies in Hz, lengths in samples."""

    cutoff: float
    order: int
    decimation: int
    drop: int
    hold: float


@dataclass(frozen=True)
class RegressionResult:
    """What the regression says, in the structure's parameters without those that are given."""

    values: dict[str, float]
    covariance: np.ndarray
    regression: Regression
    form: MotionForm
    settings: Settings
    rows: int
    still: int  # rows left out because the axis stood
    held: tuple[str, ...]  # friction that came out with the wrong sign, and was held at zero
    absent: tuple[str, ...] = ()  # what no row holds
    fixed: tuple[str, ...] = ()
    stepped: tuple[str, ...] = ()  # logs at irregular times, which were taken at equal steps


def estimate(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Estimate:
    """The parameters of `structure` by inverse dynamics; `options` are those of `OPTIONS`, and `fixed` {name: value},
    parameters that are held.

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
    open_ended = [name for name in names if not np.isfinite(found.covariance[names.index(name), names.index(name)])]
    unidentifiable = [f"{name}: no row of the data holds it (the axis never moves that way)" for name in found.absent]
    if together := [name for name in open_ended if name not in found.absent]:
        unidentifiable.append(
            f"{' and '.join(together)} come only together: the motion is the same at all times, or at one speed each "
            "way, so the data cannot tell them apart; log other speeds, or hold one of them (--fix)"
        )
    freedom = max(found.rows / (1 + 2 * regression.lag) - len(names), 1.0)
    return made_estimate(
        structure,
        "inverse-dynamics",
        logs,
        {**found.values, **given},
        covariance,
        freedom,
        unidentifiable=unidentifiable,
        warnings=_warnings(found),
        relative_error_percent=regression.relative_percent,
        details={
            FIXED: dict(options.get(FIXED) or {}),
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


def regress_logs(
    logs: Sequence[Log], structure: Structure, options: Mapping[str, Any], bridged: float = _BRIDGED
) -> RegressionResult:
    """The regression alone, over all logs together. `bridged`: the longest step of the time, in sample periods."""
    form = motion_form(structure)
    fixed = _fixed(options.get(FIXED) or {}, form, structure)
    stepped = tuple(log.name for log in logs if irregular_at(log) is not None)
    settings = _settings(logs, structure, {name: value for name, value in options.items() if name != FIXED})
    gain = next(iter(structure.given(logs).values())) if structure.given else 1.0
    blocks, still = [], 0
    for log in logs:
        rows, at_rest = _rows(log, form, settings, gain, bridged)
        blocks.append(rows[~at_rest])
        still += int(at_rest.sum())
    table = np.vstack(blocks)
    if len(table) < _LEAST * len(form.names):
        raise InputError(
            f"of {len(table) + still} rows after decimation, {still} are at rest: {len(table)} are left for "
            f"{len(form.names) - len(fixed)} parameters, too few; log a longer or livelier motion, or keep more rows, "
            "as with --set decimation=1",
            ", ".join(log.name for log in logs),
        )
    lengths = [len(block) for block in blocks]
    regression, held = _with_signs(table[:, 1:], table[:, 0], lengths, form, fixed)
    theta = regression.values
    if form.gain is not None and (theta[form.gain] == 0.0 or form.gain in regression.unidentifiable):
        alone = not table[:, 1 + form.gain].any() or form.gain not in regression.unidentifiable
        why = (
            f"the velocity is nowhere in the {form.target}: there is no gain to estimate"
            if alone
            else "gain and friction come only together: the motion is at one speed; log other speeds, or hold K (--fix)"
        )
        raise InputError(why, logs[0].name)
    return RegressionResult(
        values=dict(zip(form.names, form.values(theta).tolist(), strict=True)),
        covariance=_held_out(form.covariance(theta, regression.covariance), form, fixed),
        regression=regression,
        form=form,
        settings=settings,
        rows=len(table),
        still=still,
        held=tuple(form.names[column] for column in held),
        absent=tuple(name for name, column in zip(form.names, table[:, 1:].T, strict=True) if not column.any()),
        fixed=tuple(fixed),
        stepped=stepped,
    )


def _held_out(covariance: np.ndarray, form: MotionForm, fixed: Iterable[str]) -> np.ndarray:
    """The covariance with no uncertainty of what is held, where rounding leaves some."""
    for name in fixed:
        at = form.names.index(name)
        covariance[at, :] = covariance[:, at] = 0.0
    return covariance


def force_error(
    log: Log, structure: Structure, values: Mapping[str, float], options: Mapping[str, Any]
) -> tuple[float, int]:
    """100 |force - its model| / |force| with these `values`, and the rows that it was taken over: those that move."""
    form = motion_form(structure)
    gain = next(iter(structure.given([log]).values())) if structure.given else 1.0
    rows, at_rest = _rows(log, form, _settings([log], structure, options), gain)
    table = rows[~at_rest]
    _, theta, _ = form.held({name: values[name] for name in form.names})
    miss = table[:, 0] - table[:, 1:] @ theta
    size = float(np.linalg.norm(table[:, 0]))
    return 100.0 * float(np.linalg.norm(miss)) / size if size > 0.0 else np.inf, len(table)


def _fixed(given: Mapping[str, Any], form: MotionForm, structure: Structure) -> dict[str, float]:
    owner = f"structure {structure.name} by inverse dynamics"
    check_known(given, form.names, owner)
    if len(given) == len(form.names):
        raise InputError(f"{owner}: every parameter is held, so nothing is left to estimate")
    return {name: structure.parameters[name].check(value, name, owner) for name, value in given.items()}


def _settings(logs: Sequence[Log], structure: Structure, options: Mapping[str, Any]) -> Settings:
    check_known(options, OPTIONS, "method inverse-dynamics")
    numbers = {
        name: OPTIONS[name].check(value, name, "inverse-dynamics")
        for name, value in options.items()
        if value is not None
    }
    rate = 1.0 / max(log.sample_period for log in logs)  # the slowest log's: its filter must be one
    cutoff = numbers.get("cutoff", rate / 10.0)
    if cutoff >= 0.5 * rate:
        raise InputError(
            f"inverse-dynamics: cutoff = {cutoff:g} Hz must be below half the sampling frequency, {0.5 * rate:g} Hz"
        )
    return Settings(
        cutoff=cutoff,
        order=numbers.get("order", 4),
        decimation=numbers.get("decimation", max(round(rate / cutoff), 1)),
        drop=numbers.get("drop", round(4.9 * rate / cutoff)),
        hold=numbers.get("hold", 0.0 if structure.name == "axis-mass" else 0.5),
    )


def _regular(log: Log, is_held: bool, bridged: float) -> Log:
    """The log itself, or at equal steps, the mean ones, where its times are not: the position by a cubic spline.

    Of a held command each step gets its mean, since a change falls between two steps; another one is taken on straight
    lines. InputError for a step of more than `bridged` periods: no spline knows the motion in such a gap.
    """
    if irregular_at(log) is None:
        return log
    with needed_for("a fit by inverse dynamics"):
        from scipy.interpolate import CubicSpline

    steps = np.diff(log.time) / log.sample_period
    if steps.max() > bridged:
        at = int(np.argmax(steps > bridged))
        raise InputError(
            f"{steps[at]:.3g} sample periods are between {log.time[at]:g} and {log.time[at + 1]:g} s, a gap that no "
            "filter bridges; `--method simulation` simulates across it with the command held, or "
            'gaps = "split" in the map makes a log of each stretch (in Python: log.part(first, end))',
            log.source or log.name,
        )
    grid = np.linspace(log.time[0], log.time[-1], len(log))
    group = np.cumsum(np.concatenate([[0], steps >= _ONE]))  # a spline through two readings at one time goes far off
    time, position = (np.bincount(group, each) / np.bincount(group) for each in (log.time, log.position))
    command = np.interp(grid, log.time, log.command)
    if is_held:
        so_far = np.concatenate([[0.0], np.cumsum(log.command[:-1] * np.diff(log.time))])
        command[:-1] = np.diff(np.interp(grid, log.time, so_far)) / (grid[1] - grid[0])
    return replace(log, time=grid, command=command, position=CubicSpline(time, position)(grid), extra={})


def _rows(
    log: Log, form: MotionForm, settings: Settings, gain: float, bridged: float = _BRIDGED
) -> tuple[np.ndarray, np.ndarray]:
    """The target and the columns of one log, decimated, (rows, 1 + coefficients); and which rows are at rest."""
    with needed_for("a fit by inverse dynamics"):
        from scipy.signal import butter, decimate, filtfilt

    log = _regular(log, settings.hold > 0.0, bridged)
    T = log.sample_period
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


def _with_signs(
    X: np.ndarray, y: np.ndarray, lengths: Sequence[int], form: MotionForm, fixed: Mapping[str, float]
) -> tuple[Regression, list[int]]:
    """The regression with `fixed` parameters held; friction that would drive the axis is held at zero, the worst first,
    and the rest done again.
    """
    A, b, free = form.held(fixed)
    reduced, target = X @ A, y - X @ b
    kept = list(range(len(free)))
    while True:
        found = regress(reduced[:, kept], target, lengths)
        theta = A[:, kept] @ found.values + b
        way = np.sign(theta[form.gain]) if form.gain is not None else 1.0
        wrong = {
            at: size
            for at in kept
            if free[at] in form.friction and (size := -form.friction[free[at]] * way * theta[free[at]]) > 0.0
        }
        if not wrong or len(kept) == 1:
            break
        kept.remove(max(wrong, key=lambda at: wrong[at] * float(np.linalg.norm(reduced[:, at]))))
    held = [free[at] for at in range(len(free)) if at not in kept]
    if not held and not fixed:
        return found, held
    part = A[:, kept]
    hidden = np.isinf(np.diag(found.covariance))
    unidentifiable = (part[:, hidden] != 0.0).any(axis=1)
    covariance = part @ np.where(np.isfinite(found.covariance), found.covariance, 0.0) @ part.T
    covariance[unidentifiable, :] = covariance[:, unidentifiable] = 0.0
    covariance[unidentifiable, unidentifiable] = np.inf
    ordinary = np.sqrt((part**2) @ np.where(np.isfinite(found.ordinary), found.ordinary, 0.0) ** 2)
    ordinary[unidentifiable] = np.inf
    size = float(np.linalg.norm(y))
    return (
        replace(
            found,
            values=theta,
            covariance=covariance,
            ordinary=ordinary,
            unidentifiable=tuple(np.flatnonzero(unidentifiable).tolist()),
            relative_percent=100.0 * float(np.linalg.norm(found.residual)) / size if size > 0.0 else np.inf,
        ),
        held,
    )


def _ordinary(found: RegressionResult) -> np.ndarray:
    """Standard errors if the residuals were white, as the authors state them."""
    spread = np.diag(found.regression.ordinary**2)
    full = found.regression.covariance
    scale = np.sqrt(np.where(np.diag(full) > 0.0, np.diag(full), 1.0))
    with np.errstate(invalid="ignore"):
        correlation = np.where(np.isfinite(full), full / np.outer(scale, scale), 0.0)
    ordinary = np.sqrt(np.diag(spread))
    finite = np.where(np.isfinite(ordinary), ordinary, 0.0)
    covariance = found.form.covariance(found.regression.values, correlation * np.outer(finite, finite))
    return np.sqrt(np.diag(_held_out(covariance, found.form, found.fixed)))


def _warnings(found: RegressionResult) -> list[str]:
    said = []
    regression = found.regression
    if found.held:
        said.append(
            f"{', '.join(found.held)} came out driving the axis, not braking it, and was held at 0: friction is too "
            "small for these data to tell, the form is wrong, or the sign of the command is reversed"
        )
    if found.stepped:
        said.append(
            f"{', '.join(found.stepped)}: the times are irregular, and derivatives need equal steps: the position was "
            "taken at such steps by a spline"
        )
    if found.form.gain is not None and found.values["K"] < 0.0:
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
