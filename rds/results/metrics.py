"""Numbers that say how well an axis followed its reference and how well its model foretold it.

The error is reference - measured. Standard deviations are of the population (ddof = 0). The fit is that of
system identification, 100·(1 - ‖y - ŷ‖ / ‖y - mean(y)‖) in per cent, with y measured and ŷ modelled.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rds.results.result import Result

MOVING = (0, 6)  # of `program_state`, where a part program moves the axes: it runs, or goes home
ERROR_METRICS = ("mean_error", "std_error", "mean_abs_error", "std_abs_error", "max_abs_error", "rms_error")


class _Named(dict[str, Any]):
    """A dict whose KeyError names what there is."""

    def __missing__(self, name: str) -> Any:
        kind = "axis" if any(isinstance(each, dict) for each in self.values()) else "metric"
        raise KeyError(f"no {kind} {name!r}; this result has {', '.join(self) or 'none'}")


def axis_metrics(result: Result) -> dict[str, dict[str, float | None]]:
    """Per axis: `mean_error`, `std_error`, `mean_abs_error`, `std_abs_error`, `max_abs_error`, `rms_error` and
    `fit_percent`; plain floats that JSON can hold.

    A key is absent where there is nothing to compare: the six errors without a reference (system test, model
    validation), `fit_percent` without a modelled response (simulation, emulation). It is None where the number is
    not defined: no samples, or a fit to a measured response that never moves.

    The first period of a periodic reference is left out, because the axis starts from rest; a run that is not
    longer than one period is used whole. Of a part program the samples count in which it moves the axes: waiting,
    holding and dwelling at one place would thin the errors out. `metric_notes` says what is left out.
    """
    return _Named((axis, _one_axis(result, axis)) for axis in result.axes)


def _one_axis(result: Result, axis: str) -> dict[str, float | None]:
    metrics = _Named()
    used = settled(result, axis)
    error = tracking_error(result, axis)
    if error is not None:
        metrics.update(error_metrics(error[used]))
    measured, modelled = f"{axis}_measured", f"{axis}_modelled"
    if measured in result and modelled in result:
        metrics["fit_percent"] = fit_percent(result[measured][used], result[modelled][used])
    return metrics


def tracking_error(result: Result, axis: str) -> np.ndarray | None:
    """Reference - measured at every sample, in the axis's unit; None where either is missing."""
    reference, measured = f"{axis}_reference", f"{axis}_measured"
    if reference not in result or measured not in result:
        return None
    return np.asarray(result[reference] - result[measured], dtype=float)


def error_metrics(error: np.ndarray) -> dict[str, float | None]:
    """The six metrics of a tracking error, in the error's unit; all None for no samples."""
    if not len(error):
        return dict.fromkeys(ERROR_METRICS)
    size = np.abs(error)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not defined, and comes out as None
        rms = math.sqrt(float(np.mean(error**2)))
        values = (error.mean(), error.std(), size.mean(), size.std(), size.max(), rms)
    return {name: _finite(value) for name, value in zip(ERROR_METRICS, values, strict=True)}


def fit_percent(measured: np.ndarray, modelled: np.ndarray) -> float | None:
    """100·(1 - ‖y - ŷ‖ / ‖y - mean(y)‖) in per cent; None if `measured` is constant or empty."""
    if not len(measured) or np.ptp(measured) == 0:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        spread = float(np.linalg.norm(measured - np.mean(measured)))
        miss = float(np.linalg.norm(measured - modelled))
    return _finite(100.0 * (1.0 - miss / spread)) if spread else None


def settled(result: Result, axis: str) -> slice | np.ndarray:
    """The samples that the metrics use, as an index of columns.

    Those in which a part program moves the axes; else after the first period, or all if none are left by that.
    """
    if "program_state" in result:
        return moving(result)
    period = _period(result, axis)
    return slice(None) if period is None else slice(_first_settled(result, period), None)


def moving(result: Result) -> np.ndarray:
    """Whether each sample of a part program's run is one in which it moves the axes."""
    return np.isin(result["program_state"], MOVING)


def metric_notes(result: Result) -> list[str]:
    """What the metrics leave out, or could not, in a sentence per case."""
    if "program_state" in result:
        waited = len(result) - int(moving(result).sum())
        said = f"The metrics leave out {waited} of {len(result)} samples, in which the part program waited, dwelt or"
        return [f"{said} was held."] if waited else []
    notes: dict[str, list[str]] = {}
    for axis in result.axes:
        period = _period(result, axis)
        if period is None or not len(result) or not _compares(result, axis):
            continue
        first = _first_settled(result, period)
        if first is None:
            note = f"the run is not longer than one period of the reference ({period:g} s): the metrics use all of it"
        else:
            rest = result.length - float(result["time"][first] - result["time"][0])
            note = f"the metrics leave out the first period of the reference ({period:g} s)"
            if rest < period - result.sample_period / 2:
                note += f"; only {rest:g} s of the second are there"
        notes.setdefault(note, []).append(axis)
    return [f"{', '.join(axes)}: {note}." for note, axes in notes.items()]


def _compares(result: Result, axis: str) -> bool:
    """Whether there is a metric of `axis`: a system test measures, and has nothing to compare that with."""
    return f"{axis}_measured" in result and (f"{axis}_reference" in result or f"{axis}_modelled" in result)


def _first_settled(result: Result, period: float) -> int | None:
    """The first sample after one period; None if there is none."""
    time = result["time"]
    # half a sample less, so that rounding in k·T does not decide about the sample at the period's end
    first = int(np.searchsorted(time, time[0] + period - result.sample_period / 2)) if len(time) else 0
    return first if first < len(time) else None


def metric_units(result: Result, axis: str) -> dict[str, str]:
    """The unit of each metric of `axis`: that of its position (mm, degrees, rev/min), and % for the fit."""
    unit = result.units.get(f"{axis}_measured", "")
    return {**dict.fromkeys(ERROR_METRICS, unit), "fit_percent": "%"}


def _period(result: Result, axis: str) -> float | None:
    period = (result.meta.get("period") or {}).get(axis)
    return float(period) if period and period > 0 else None


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
