"""A study in numbers: percentiles of each figure, the worst draw, and which parameters drive it."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.extras import needed_for
from rds.identification.robustness.figures import FIGURES, MARGINS

if TYPE_CHECKING:
    from rds.identification.robustness.study import Study

PERCENTS = (5, 50, 95, 99)
_DRIVES = 0.3  # a rank correlation that is worth a word
_BY_CHANCE = 2.0  # standard deviations of a rank correlation that is none, 1/√(draws - 1)


@dataclass(frozen=True)
class AxisSummary:
    """One axis. Each of `figures` has nominal, p5, p50, p95, p99 and worst; None for what is not known or infinite.

    p95 is what 95 % of the draws are no worse than, be it an error or a margin.
    """

    axis: str
    unit: str
    figures: dict[str, dict[str, float | None]]
    units: dict[str, str]
    unstable: int
    failed: int
    worst: int | None  # the draw with the largest tracking error
    worst_values: dict[str, float]
    deviations: dict[str, float]  # of the worst draw: in standard deviations of the draws, or halves of the range
    drivers: dict[str, float | None]  # rank correlation of each parameter with the largest error
    nominal_values: dict[str, float]
    parameter_units: dict[str, str]


def summaries(study: Study) -> list[AxisSummary]:
    """A summary of each axis."""
    return [_axis(study, number) for number in range(len(study.axes))]


def to_json(study: Study) -> dict[str, Any]:
    """The study as JSON can hold it."""
    return {
        "runs": len(study.figures),
        "seed": study.task.seed,
        "level": study.level,
        "seconds": round(study.seconds, 3),
        "axes": {
            found.axis: {
                "figures": {name: values | {"unit": found.units[name]} for name, values in found.figures.items()},
                "unstable": found.unstable,
                "failed": found.failed,
                "worst_draw": found.worst,
                "parameters": {
                    name: {
                        "nominal": value,
                        "worst": found.worst_values.get(name),
                        "deviation": found.deviations.get(name),
                        "rank_correlation": found.drivers.get(name),
                        "unit": found.parameter_units.get(name, ""),
                    }
                    for name, value in found.nominal_values.items()
                },
            }
            for found in summaries(study)
        },
        "failures": {str(draw): reason for draw, reason in list(study.reasons.items())[:10]},
        "notes": list(study.notes),
    }


def sentences(study: Study) -> list[str]:
    """What to know of each axis, in words."""
    said = []
    for found in summaries(study):
        line = f"{found.axis}: {_stability(found, len(study.figures))}"
        if found.worst is not None:
            error = found.figures["max_error"]["worst"]
            size = "diverges" if error is None else f"has an error of up to {error:.4g} {found.unit}"
            line += f"; the worst, draw {found.worst}, {size}"
            ranked = sorted((-abs(r), name, r) for name, r in found.drivers.items() if r is not None)
            known = int(np.count_nonzero(~np.isnan(study.figure(study.axes.index(found.axis), "max_error"))))
            if ranked and abs(ranked[0][2]) >= max(_DRIVES, _BY_CHANCE / sqrt(max(known - 1, 1))):
                _, name, r = ranked[0]
                line += f"; {'more' if r > 0 else 'less'} {name} makes it worse (rank correlation {r:+.2f})"
        said.append(line)
    said += [f"draw {draw} could not be run: {reason}" for draw, reason in list(study.reasons.items())[:3]]
    if len(study.reasons) > 3:
        said.append(f"{len(study.reasons)} draws could not be run")
    return said


def _stability(found: AxisSummary, runs: int) -> str:
    if found.unstable:
        return f"{found.unstable} of {runs} loops are unstable"
    if found.figures["pole_radius"]["worst"] is None:
        return "no run diverged; there is no linear loop to tell poles and margins of"
    return "all loops stable"


def _axis(study: Study, number: int) -> AxisSummary:
    axis, plan = study.task.axes[number], study.task.plan.axes[number]
    error, drawn = study.figure(number, "max_error"), study.drawn[number]
    known = np.flatnonzero(~np.isnan(error))
    worst = int(known[np.argmax(error[known])]) if len(known) else None
    names, spread = axis.spread.names, axis.spread
    scale = np.sqrt(np.diag(spread.covariance)) if spread.covariance is not None else 0.5 * (spread.high - spread.low)
    off = [] if worst is None else (drawn[worst] - spread.values).tolist()
    return AxisSummary(
        axis=axis.name,
        unit=plan.axis.unit,
        figures={
            name: _percentiles(_without_nan(study, number, i), worse_is_more)
            for i, (name, (_, _, worse_is_more)) in enumerate(FIGURES.items())
        },
        units={name: unit or plan.axis.unit for name, (_, unit, _) in FIGURES.items()},
        unstable=int(study.unstable(number).sum()),
        failed=len(study.reasons),
        worst=worst,
        worst_values={} if worst is None else dict(zip(names, map(float, drawn[worst]), strict=True)),
        deviations={name: d / s for name, d, s in zip(names, off, scale.tolist(), strict=False) if s > 0.0},
        drivers={
            name: _rank_correlation(drawn[known, i], error[known])
            for i, name in enumerate(names)
            if name in spread.varied
        },
        nominal_values=dict(zip(names, map(float, spread.values), strict=True)),
        parameter_units=dict(spread.units),
    )


def _without_nan(study: Study, number: int, figure: int) -> np.ndarray:
    """A figure of the nominal run and of every draw; a loop that is unstable has margins of 0."""
    rows = np.concatenate([study.nominal[None, number], study.figures[:, number]])
    values, radius = rows[:, figure], rows[:, list(FIGURES).index("pole_radius")]
    is_margin = list(FIGURES)[figure] in MARGINS
    return np.where(np.isnan(values) & (radius >= 1.0), 0.0, values) if is_margin else values


def _percentiles(values: np.ndarray, worse_is_more: bool) -> dict[str, float | None]:
    """Of the values of the draws; the first one is the nominal run's."""
    nominal, known = float(values[0]), values[1:][~np.isnan(values[1:])]
    if not len(known):
        return {"nominal": _finite(nominal), **{f"p{p}": None for p in PERCENTS}, "worst": None}
    # the least value that so many draws, or more, are no worse than: one of them, so that an infinite error does not
    # make its neighbours NaN; of margins, less is worse
    sign = 1.0 if worse_is_more else -1.0
    found = sign * np.percentile(sign * known, PERCENTS, method="inverted_cdf")
    worst = known.max() if worse_is_more else known.min()
    return {
        "nominal": _finite(nominal),
        **{f"p{p}": _finite(value) for p, value in zip(PERCENTS, found, strict=True)},
        "worst": _finite(worst),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _rank_correlation(a: np.ndarray, b: np.ndarray) -> float | None:
    """Spearman's, from -1 to 1; None where one of them is constant."""
    with needed_for("a robustness study"):
        from scipy.stats import rankdata

    if len(a) < 3 or np.ptp(a) == 0.0 or (b == b[0]).all():
        return None
    return float(np.corrcoef(rankdata(a), rankdata(b))[0, 1])
