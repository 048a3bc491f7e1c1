"""Pictures of several results over each other: two compared, or one experiment in all its modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.core.figure import (
    BLUE,
    CYCLE,
    GREY,
    ORANGE,
    RESPONSES,
    VERMILLION,
    Picture,
    common_legend,
    dress,
    legend,
    quantity,
)
from rds.results.metrics import error_metrics, settled, tracking_error

if TYPE_CHECKING:
    from rds.results.compare import Comparison
    from rds.results.result import Result

_ROW_HEIGHT = 2.7  # inches
_PAIR: tuple[dict[str, Any], ...] = (
    {"color": ORANGE, "linewidth": 2.4, "alpha": 0.9},
    {"color": BLUE, "linewidth": 1.2},
)  # two results over each other


def modes(results: Sequence[Result], labels: Sequence[str] | None = None) -> Picture:
    """One experiment in several modes: a row per axis, measured responses to the left, tracking errors to the right.

    `labels` names the results (default: their modes). Raises InputError if there are no results, or if they have no
    axis in common.
    """
    if not results:
        raise InputError("there are no results to draw; give at least one")
    names = list(labels) if labels is not None else [result.mode or f"run {i + 1}" for i, result in enumerate(results)]
    shared = [axis for axis in results[0].axes if all(f"{axis}_measured" in result for result in results)]
    if not shared:
        raise InputError("the results have no axis in common: " + "; ".join(", ".join(r.axes) for r in results))
    picture = Picture(_ROW_HEIGHT * len(shared) + 0.4)
    grid = picture.subplots(len(shared), 2, squeeze=False, sharex=True)
    for row, axis in enumerate(shared):
        left, right = grid[row]
        unit = results[0].units.get(f"{axis}_measured", "")
        _reference(left, results, axis)
        right.plot([], [], linestyle="none", label=f"mean |error| [{unit}]:")
        for result, name, style in _ordered(results, names):
            left.plot(result["time"], result[f"{axis}_measured"], label=name, **style)
            error = tracking_error(result, axis)
            if error is not None:
                mean = error_metrics(error[settled(result, axis)])["mean_abs_error"]
                right.plot(result["time"], error, label="–" if mean is None else f"{mean:.4f}", **style)
        x = "time [s]" if row == len(shared) - 1 else None
        dress(left, quantity(axis, unit), x)
        dress(right, f"{axis} tracking error [{unit}]", x)
        right.axhline(0.0, color=GREY, linewidth=0.8)
        legend(right, columns=len(results) + 1)
    handles, texts = grid[0, 0].get_legend_handles_labels()
    common_legend(picture, handles, texts, "outside upper left")
    picture.align_ylabels()
    return picture


def comparison(compared: Comparison) -> Picture:
    """Two results: per axis both measured responses to the left and their difference, b - a, to the right.

    Runs along a path have a last row: how far the measured and the commanded positions are off the programmed path.
    """
    from rds.results.comparison_text import labels

    names = labels(compared)
    off = [
        (column, label)
        for column, label in (("contour_error", "measured"), ("path_error", "commanded"))
        if column in compared.a and column in compared.b
    ]
    count = len(compared.axes) + bool(off)
    picture = Picture(_ROW_HEIGHT * count + 0.4)
    grid = picture.subplots(count, 2, squeeze=False, sharex=True)
    for row, (axis, about) in enumerate(compared.axes.items()):
        left, right = grid[row]
        column = f"{axis}_measured"
        _reference(left, [compared.a, compared.b], axis)
        for result, name, style in zip((compared.a, compared.b), names, _PAIR, strict=True):
            left.plot(result["time"], result[column], label=name, **style)
        time, difference = compared.difference(axis)
        right.plot(
            time, difference, color=VERMILLION, linewidth=0.9, label=f"RMS {about.rms_difference:.4g} {about.unit}"
        )
        right.axhline(0.0, color=GREY, linewidth=0.8)
        x = "time [s]" if row == len(grid) - 1 else None
        dress(left, quantity(axis, about.unit), x)
        dress(right, f"{axis} difference, b − a [{about.unit}]", x)
        legend(left)
        legend(right)
    for axes, (column, label) in zip(grid[-1], off, strict=False):
        for result, name, style in zip((compared.a, compared.b), names, _PAIR, strict=True):
            axes.plot(result["time"], result[column] * 1e3, label=name, **style)
        dress(axes, f"{label}, off the path [µm]")
        legend(axes)
    for axes in grid[-1][len(off) :] if off else ():
        axes.set_axis_off()
    picture.align_ylabels()
    return picture


def _reference(axes: Any, results: Sequence[Result], axis: str) -> None:
    for result in results:
        if f"{axis}_reference" in result:
            axes.plot(result["time"], result[f"{axis}_reference"], label="reference", **RESPONSES["reference"])
            return


def _styles() -> dict[str, dict[str, Any]]:
    """How responses of the modes are drawn, by mode, in order.

    A later one is drawn over an earlier one: narrower and dashed, so that equal lines show as two colours.
    """
    from rds.modes import load_mode, mode_names

    modes = sorted((load_mode(name) for name in mode_names()), key=lambda mode: mode.layer)
    return {mode.name: dict(mode.line) for mode in modes if mode.line is not None}


def _ordered(results: Sequence[Result], names: Sequence[str]) -> list[tuple[Result, str, dict[str, Any]]]:
    """Results with their styles, in the order in which they are to be drawn."""
    known = _styles()
    several = len({result.mode for result in results}) < len(results)
    drawn = []
    for i, (result, name) in enumerate(zip(results, names, strict=True)):
        style = {"color": CYCLE[i % len(CYCLE)], "linewidth": 1.2} if several else known.get(result.mode or "")
        rank = i if several or result.mode not in known else [*known].index(result.mode)
        drawn.append((rank, i, result, name, style or {"color": CYCLE[i % len(CYCLE)], "linewidth": 1.2}))
    return [(result, name, style) for _, _, result, name, style in sorted(drawn, key=lambda entry: entry[:2])]
