"""An estimate as an object that JSON can hold, and as tables that a terminal and a page show."""

from __future__ import annotations

from dataclasses import asdict
from math import hypot, isfinite, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rds.identification.fit.estimate import Errors, Estimate, Parameter

Rows = list[list[Any]]


def to_json(estimate: Estimate) -> dict[str, Any]:
    """The object that `rds fit --json` prints; null stands for what is not finite or not known."""
    fit, rmse = _overall(estimate)
    names = list(estimate.parameters)
    return finite(
        {
            "structure": estimate.structure,
            "options": list(estimate.options),
            "method": estimate.method,
            "parameters": {name: asdict(parameter) for name, parameter in estimate.parameters.items()},
            "correlation": dict(
                zip(names, (dict(zip(names, row, strict=True)) for row in estimate.correlation.tolist()), strict=True)
            ),
            "unidentifiable": list(estimate.unidentifiable),
            "fit_percent": fit,
            "rmse": rmse,
            "unit": _unit(estimate),
            "relative_error_percent": estimate.relative_error_percent,
            "free_run": {name: asdict(errors) for name, errors in estimate.free_run.items()},
            "ahead": {
                name: {str(steps): asdict(errors) for steps, errors in by_steps.items()}
                for name, by_steps in estimate.ahead.items()
            },
            "initial_state": {name: list(state) for name, state in estimate.initial_state.items()},
            "logs": [dict(log) for log in estimate.logs],
            "details": dict(estimate.details),
            "warnings": list(estimate.warnings),
        }
    )


def finite(value: Any) -> Any:
    """The value with null for every number that is not finite."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def parameter_rows(estimate: Estimate) -> tuple[list[str], Rows]:
    """Columns and rows of the parameters with their intervals."""
    at_bound = estimate.details.get("at_bound", ())
    rows: Rows = [[name, *_shown(p, name in at_bound), p.unit] for name, p in estimate.parameters.items()]
    return ["parameter", "value", "std error", "95 % interval", "unit"], rows


def _shown(p: Parameter, at_bound: bool = False) -> tuple[str, str, str]:
    """Value, standard error and interval; of what the data do not tell few digits, and that it is no estimate."""
    few = f"{p.value if abs(p.value) > 1e-15 else 0.0:.2g}"  # a search that ends at 0 may leave 1e-32, or -0
    if not p.told:
        return f"({few}, assumed)", "–", "not determined by these data"
    if p.std_error == 0.0:
        return f"{p.value:.6g}", "–", "held"
    if at_bound:
        return f"({few}, at its bound)", "–", "not determined by these data"
    if p.wide:
        return f"({few}, poorly determined)", f"{p.std_error:.2g}", f"{p.low:.2g} to {p.high:.2g}"
    return f"{p.value:.6g}", f"{p.std_error:.2g}", f"{p.low:.6g} to {p.high:.6g}"


def correlation_rows(estimate: Estimate) -> tuple[list[str], Rows]:
    """Columns and rows of the correlations between parameters that have an uncertainty."""
    correlation = estimate.correlation
    names = list(estimate.parameters)
    kept = [i for i in range(len(names)) if correlation[i, i] == correlation[i, i]]
    rows: Rows = [[names[i], *(f"{correlation[i, j]:+.3f}" for j in kept)] for i in kept]
    return ["", *(names[i] for i in kept)], rows


def error_rows(estimate: Estimate) -> tuple[list[str], Rows]:
    """Columns and rows of the free run and the predictions so many samples ahead, side by side for each log."""
    rows: Rows = []
    for name, free in estimate.free_run.items():
        both: dict[str, Errors] = {"free run": free}
        both |= {f"{steps} ahead": errors for steps, errors in estimate.ahead.get(name, {}).items()}
        rows += [
            [name, what, f"{e.fit_percent:.2f}", f"{e.rmse:.4g}", f"{e.maximum:.4g}", e.unit]
            for what, e in both.items()
        ]
    return ["log", "prediction", "fit %", "RMSE", "max", "unit"], rows


def as_text(estimate: Estimate) -> str:
    """Parameters, errors and doubts, a line each, as a print of the estimate shows them."""
    lines = [f"{described(estimate)} by {estimate.method}"]
    for name, value, _, interval, unit in parameter_rows(estimate)[1]:
        lines.append(f"  {name} = {' '.join(filter(None, (value, unit)))} ({interval})")
    for log, what, fit, rmse, most, unit in error_rows(estimate)[1]:
        lines.append(f"  {log}, {what}: fit {fit} %, RMSE {rmse} {unit}, at most {most} {unit}")
    return "\n".join([*lines, *(f"  to doubt: {doubt}" for doubt in (*estimate.unidentifiable, *estimate.warnings))])


def described(estimate: Estimate) -> str:
    """The structure with its options."""
    name = Path(estimate.structure).name
    return f"{name} with {', '.join(estimate.options)}" if estimate.options else name


def note(estimate: Estimate) -> str:
    """What the errors mean."""
    said = (
        "Fit: 100 (1 - |y - ŷ| / |y - mean y|) %. The free run sees no measurement after its initial state, which was "
        "estimated; so many samples ahead starts from the position measured at each sample."
    )
    if estimate.relative_error_percent is not None:
        said += f" Command that the model needs beside the one given: {estimate.relative_error_percent:.2f} %."
    return said


def _overall(estimate: Estimate) -> tuple[float, float]:
    """Fit and RMSE of the free runs of all logs: the worst fit that is known (that of a log at rest is not), and the
    root mean square over all samples.
    """
    fits = [errors.fit_percent for errors in estimate.free_run.values() if not isnan(errors.fit_percent)]
    lengths = [log["end"] - log["first"] for log in estimate.logs]
    squares = 0.0
    for errors, length in zip(estimate.free_run.values(), lengths, strict=True):
        squares = hypot(squares, errors.rmse * length**0.5)
    return min(fits, default=nan), squares / sum(lengths) ** 0.5


def _unit(estimate: Estimate) -> str:
    return next((errors.unit for errors in estimate.free_run.values()), "")
