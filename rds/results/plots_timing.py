"""Pictures of a run's timing: how its stages are distributed, and which samples were late."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.core.errors import InputError
from rds.core.figure import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION, Picture, dress, legend
from rds.results.late_samples import STAGES, late_samples, total_time
from rds.results.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = dict(zip(STAGES, (BLUE, ORANGE, SKY, GREEN, PURPLE), strict=True))
_TITLES = {
    "lateness": "lateness (system)",
    "io": "I/O (bus)",
    "interpolate": "interpolate (path)",
    "compute": "compute (controller)",
    "model": "model",
}
_FLOOR = 0.1  # µs: what is drawn of shorter times on a logarithmic scale
_BINS_PER_DECADE = 12


def timing(result: Result) -> Picture:
    """Histograms of the stages with the sample period, and each sample's whole time with the late ones marked.

    Raises InputError for a result without timing columns, as simulation leaves.
    """
    total = total_time(result)
    late = late_samples(result)
    if total is None or late is None:
        raise InputError(f"the result of mode {result.mode!r} has no timing; emulation and implementation record it")
    picture = Picture(6.2)
    above, below = picture.subplots(2, 1, height_ratios=[1.25, 1])
    _histograms(above, result)
    _over_time(below, result, total, late)
    return picture


def _histograms(axes: Axes, result: Result) -> None:
    period = result.sample_period * 1e6
    stages = {stage: np.maximum(result[stage], _FLOOR) for stage in STAGES if stage in result and len(result)}
    highest = max([2 * period, *(values.max() * 1.1 for values in stages.values())])
    edges = np.geomspace(_FLOOR, highest, int(np.log10(highest / _FLOOR) * _BINS_PER_DECADE) + 1).tolist()
    for stage, values in stages.items():
        axes.hist(values, bins=edges, histtype="stepfilled", color=_COLOURS[stage], alpha=0.18)
        axes.hist(
            values, bins=edges, histtype="step", color=_COLOURS[stage], linewidth=1.5, label=_label(stage, values)
        )
    axes.axvline(period, color=BLACK, linewidth=1.3, linestyle=(0, (5, 2)), label=f"period {period:g} µs")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.7)
    dress(axes, "number of samples", "time per sample [µs]")
    axes.xaxis.set_major_formatter("{x:g}")
    legend(axes, columns=2)  # three are wider than a panel's figure


def _label(stage: str, values: np.ndarray) -> str:
    middle, high = np.percentile(values, [50, 99])
    return f"{_TITLES[stage]}: p50 {middle:.3g}, p99 {high:.3g} µs"


def _over_time(axes: Axes, result: Result, total: np.ndarray, late: np.ndarray) -> None:
    period = result.sample_period * 1e6
    shown = np.maximum(total, _FLOOR)
    axes.plot(result["time"], shown, color=BLUE, linewidth=0.7, label="due to complete")
    axes.axhline(period, color=BLACK, linewidth=1.3, linestyle=(0, (5, 2)))
    axes.plot(
        result["time"][late],
        shown[late],
        color=VERMILLION,
        linestyle="none",
        marker="v",
        markersize=5,
        label=f"late: {int(late.sum())} of {len(late)} samples",
    )
    axes.set_yscale("log")
    dress(axes, "whole sample [µs]")
    axes.yaxis.set_major_formatter("{x:g}")
    legend(axes)
