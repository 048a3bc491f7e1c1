"""Pictures of one result: response, tracking error and voltage over time."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rds.core.colours import QUANTITIES
from rds.core.errors import InputError
from rds.core.figure import GREY, RESPONSES, VERMILLION, WIDTH, Picture, dress, legend, quantity
from rds.core.types import Ending
from rds.results.late_samples import late_samples
from rds.results.metrics import settled, tracking_error
from rds.results.units import heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rds.results.result import Result

_ROUNDING, _LEAST_ERROR = 1e-9, 1e-3  # unit of the axis: no error at all, and what is drawn of it
_PANEL_HEIGHT = 2.45  # inches
_COLUMN_WIDTH = 4.3  # inches, at least, of each axis where there are several


def overview(result: Result, axis: str | None = None) -> Picture:
    """Response, error and voltage below each other: of `axis`, or a column per axis.

    Raises InputError for an axis that the result does not have, or one with nothing to draw.
    """
    return _grid(result, axis, [_RESPONSE, _ERROR, _VOLTAGE])


def response(result: Result, axis: str | None = None) -> Picture:
    """Reference, measured, modelled and simulated response over time."""
    return _grid(result, axis, [_RESPONSE])


def error(result: Result, axis: str | None = None) -> Picture:
    """Tracking error over time with the mean of each direction of motion; the model's error without a reference."""
    return _grid(result, axis, [_ERROR])


def voltage(result: Result, axis: str | None = None) -> Picture:
    """Voltage and command over time, with the limits of the converter where `meta["voltage_range"]` gives them."""
    return _grid(result, axis, [_VOLTAGE])


class _Panel(NamedTuple):
    has: Callable[[Result, str], bool]  # whether there is something to draw of an axis
    draw: Callable[[Axes, Result, str], None]
    own_legend: bool = False  # whether it says something that is not the same for all axes


def _grid(result: Result, axis: str | None, panels: list[_Panel]) -> Picture:
    chosen = _chosen(result, axis)
    used = [panel for panel in panels if any(panel.has(result, name) for name in chosen)]
    if not used:
        raise InputError(f"nothing to draw of {', '.join(chosen)}; the columns are {', '.join(result.columns)}")
    width = max(WIDTH, _COLUMN_WIDTH * len(chosen))
    picture = Picture(_PANEL_HEIGHT * len(used) + 0.5, width)
    grid = picture.subplots(len(used), len(chosen), squeeze=False, sharex=True)
    for column, name in enumerate(chosen):
        for row, panel in enumerate(used):
            axes = grid[row, column]
            if not panel.has(result, name):
                axes.set_axis_off()
                continue
            panel.draw(axes, result, name)
            if result.meta.get("ending") == Ending.FAULT and len(result["time"]):
                # the last sample before the student's code failed
                axes.axvline(result["time"][-1], color=VERMILLION, linewidth=1.6, label="fault")
            # what all columns share is said once; it may reach over the columns to its right
            if column == 0 or panel.own_legend:
                legend(axes, columns=5)
            if row < len(used) - 1:
                axes.set_xlabel("")
    picture.align_ylabels()
    return picture


def _chosen(result: Result, axis: str | None) -> list[str]:
    if axis is None:
        return result.axes
    if axis not in result.axes:
        raise InputError(f"the result has no axis {axis!r}; it has {', '.join(result.axes)}")
    return [axis]


def _has_response(result: Result, axis: str) -> bool:
    return any(f"{axis}_{kind}" in result for kind in RESPONSES)


def _draw_response(axes: Axes, result: Result, axis: str) -> None:
    for kind, style in RESPONSES.items():
        name = f"{axis}_{kind}"
        if name in result:
            axes.plot(result["time"], result[name], label=kind, **style)
    dress(axes, quantity(axis, result.units.get(f"{axis}_measured", "")))


def _error_of(result: Result, axis: str) -> tuple[np.ndarray | None, str]:
    """Reference - measured, or measured - modelled where there is no reference; and what to call it."""
    tracking = tracking_error(result, axis)
    measured, modelled = f"{axis}_measured", f"{axis}_modelled"
    if tracking is not None or measured not in result or modelled not in result:
        return tracking, "tracking error"
    return result[measured] - result[modelled], "measured − modelled"


def _has_error(result: Result, axis: str) -> bool:
    return _error_of(result, axis)[0] is not None


def _draw_error(axes: Axes, result: Result, axis: str) -> None:
    difference, label = _error_of(result, axis)
    assert difference is not None  # by _has_error
    time, used = result["time"], settled(result, axis)
    unit = result.units.get(f"{axis}_measured", "")
    axes.plot(time, difference, color=QUANTITIES["error"], linewidth=1.1)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    if np.abs(difference).max(initial=0.0) < _ROUNDING:
        axes.set_ylim(-_LEAST_ERROR, _LEAST_ERROR)
    for value, name, style in _means(difference[used]):
        axes.plot(time[used][[0, -1]], [value, value], color=VERMILLION, linewidth=1.3, linestyle=style)
        axes.plot([], [], color=VERMILLION, linewidth=1.3, linestyle=style, label=f"{name} {value:.3g}")
    _mark_late(axes, result)
    dress(axes, heading(f"{axis} {label}", unit))


def _means(difference: np.ndarray) -> list[tuple[float, str, str]]:
    if not len(difference):
        return []
    return [(float(difference.mean()), "mean", "-"), (float(np.abs(difference).mean()), "mean |error|", "--")]


def _has_voltage(result: Result, axis: str) -> bool:
    return any(f"{axis}_{part}" in result for part in ("voltage", "target", "command"))


def _draw_voltage(axes: Axes, result: Result, axis: str) -> None:
    acting = "target" if f"{axis}_target" in result else "voltage"
    sent, asked = f"{axis}_{acting}", f"{axis}_command"
    limit = result.meta.get("voltage_range") if acting == "voltage" else None
    if asked in result:
        axes.plot(result["time"], result[asked], color=GREY, linewidth=2.4, alpha=0.55, label="command")
    if sent in result:
        # constant over each sample: drawn as the staircase that it is
        style: dict[str, Any] = {"color": QUANTITIES["voltage"], "linewidth": 1.1, "drawstyle": "steps-post"}
        axes.plot(result["time"], result[sent], label=acting, **style)
    if limit:
        for sign in (1, -1):
            label = f"limit ±{limit:g} V" if sign > 0 else None
            axes.axhline(sign * limit, color=VERMILLION, linewidth=1.1, linestyle=(0, (5, 2)), label=label)
        # a command far beyond the limits would flatten what the axis got
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, -1.6 * limit), min(high, 1.6 * limit))
    dress(axes, f"{axis} {acting} [{result.units.get(sent, 'V')}]")


def _mark_late(axes: Axes, result: Result) -> None:
    late = late_samples(result)
    if late is None or not late.any():
        return
    at = result["time"][late]
    axes.plot(
        at,
        np.zeros(len(at)),
        transform=axes.get_xaxis_transform(),
        color=VERMILLION,
        linestyle="none",
        marker="|",
        markersize=12,
        clip_on=False,
        label=f"late: {len(at)}",
    )


_RESPONSE = _Panel(_has_response, _draw_response)
_ERROR = _Panel(_has_error, _draw_error, own_legend=True)
_VOLTAGE = _Panel(_has_voltage, _draw_voltage)
