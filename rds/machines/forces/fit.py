"""Coefficients of the cutting force from measured forces: least squares of the logarithms, with intervals.

    ln F = ln K + β ln d + γ ln V + α ln f

A straight line in the coefficients, so that the estimate is closed-form. Intervals are Student's, of 95 %, for errors
of ln F that are independent and of one size: forces measured to a constant percentage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for

NAMES = {"depth": "d", "speed": "V", "feed": "f"}
LEVEL = 0.95
_VARIES = 1e-3  # the least range of ln d, ln V or ln f from which an exponent is estimated
_INDEPENDENT = 1e-6  # smallest singular value, relative to the largest, of scaled columns


@dataclass(frozen=True)
class ForceFit:
    """Estimates by name (K, depth, speed, feed), their intervals (NaN without freedom), and how well they fit.

    `fixed` are the exponents that were given; `scatter` is the standard deviation of ln F, a relative error.
    """

    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    fixed: tuple[str, ...]
    scatter: float
    r_squared: float
    readings: int


def fit_force(force: np.ndarray, given: Mapping[str, np.ndarray], fixed: Mapping[str, float] | None = None) -> ForceFit:
    """The coefficients from `force` (N) at the depths, speeds and feeds `given` by name (mm, m/min, mm), (n,) each.

    An exponent in `fixed` is taken as it is; one whose data are not given is 0. Raises InputError for numbers that are
    not positive, for fewer readings than coefficients, and for data that do not determine an exponent.
    """
    with needed_for("a fit of cutting forces"):
        from scipy import stats
    fixed = dict(fixed or {})
    for name in (*given, *fixed):
        if name not in NAMES:
            raise InputError(f"there is no {name!r} in the cutting force; it has {', '.join(NAMES)}")
    for name, column in {"force": force, **given}.items():
        if wrong := np.flatnonzero(~(np.asarray(column) > 0.0)).tolist():
            raise InputError(
                f"{name} of reading {wrong[0] + 1} is {column[wrong[0]]:g}; its logarithm needs more than 0"
            )
    logs = {name: np.log(np.asarray(column, dtype=float)) for name, column in given.items()}
    free = [name for name in NAMES if name in logs and name not in fixed]
    for name in free:
        if np.ptp(logs[name]) < _VARIES:
            raise InputError(
                f"the {name} is the same in all readings, which do not determine its exponent; vary it, or fix the "
                f"exponent (--fix {name}=1)"
            )
    y = np.log(np.asarray(force, dtype=float))
    for name, exponent in fixed.items():
        y = y - exponent * logs.get(name, 0.0)
    A = np.column_stack([np.ones(len(y)), *(logs[name] for name in free)])
    freedom = len(y) - A.shape[1]
    if freedom < 0:
        raise InputError(
            f"{len(y)} readings do not determine {A.shape[1]} coefficients; measure more, or fix exponents"
        )
    centred = A[:, 1:] - A[:, 1:].mean(axis=0)
    if free and np.linalg.svd(centred / np.linalg.norm(centred, axis=0), compute_uv=False)[-1] < _INDEPENDENT:
        raise InputError(
            f"the {' and the '.join(free)} change together in all readings, which do not tell their exponents apart; "
            "vary one alone, or fix an exponent"
        )
    beta, *_ = np.linalg.lstsq(A, y, rcond=None)
    residual = y - A @ beta
    variance = float(residual @ residual) / freedom if freedom else np.nan
    deviation = np.sqrt(variance * np.diag(np.linalg.inv(A.T @ A)))
    reach = deviation * (stats.t.ppf(0.5 + LEVEL / 2, freedom) if freedom else np.nan)
    values: dict[str, float] = {"K": float(np.exp(beta[0]))} | dict.fromkeys(NAMES, 0.0) | fixed
    intervals = {"K": (float(np.exp(beta[0] - reach[0])), float(np.exp(beta[0] + reach[0])))}
    for name, value, half in zip(free, beta[1:], reach[1:], strict=True):
        values[name] = float(value)
        intervals[name] = (float(value - half), float(value + half))
    if not values["feed"] > 0.0 and "feed" in free:
        raise InputError(
            f"the force falls as the feed rises (exponent {values['feed']:.3g}), which no cut does; see whether "
            "columns are exchanged; if not, vary the feed more, or fix its exponent (--fix feed=1)"
        )
    spread = float(((y - y.mean()) ** 2).sum())
    r_squared = 1.0 - float(residual @ residual) / spread if spread else 1.0
    return ForceFit(values, intervals, tuple(fixed), float(np.sqrt(variance)), r_squared, len(y))
