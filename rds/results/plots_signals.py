"""What the controllers of a run knew: their signals over time, and an estimated velocity against the true one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.core.errors import InputError
from rds.core.figure import BLUE, GREY, VERMILLION, WIDTH, Picture, dress, legend
from rds.results.signals import VELOCITY, estimate_error, signals_of, true_velocity
from rds.results.units import heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rds.results.result import Result

_PANEL_HEIGHT = 2.45  # inches
_COLUMN_WIDTH = 4.3  # inches, at least, of each axis where there are several
_ERROR = "error of the estimate"


def signals(result: Result, axis: str | None = None) -> Picture:
    """Every signal over time, of `axis` or in a column per axis.

    A signal called `velocity` is drawn over the reference's velocity and, where the plant is simulated, over the true
    one, with the difference below it. Raises InputError where there is no such axis, or no signal.
    """
    if axis is not None and axis not in result.axes:
        raise InputError(f"the result has no axis {axis!r}; it has {', '.join(result.axes)}")
    of = {name: signals_of(result, name) for name in ([axis] if axis is not None else result.axes)}
    of = {name: found for name, found in of.items() if found}
    if not of:
        raise InputError(
            "no controller of this run has signals; declare them beside params, as in "
            '`signals = {"velocity": "mm/s"}`, and return their values as the third of control()'
        )
    rows = list(dict.fromkeys(row for name in of for row in _rows(result, name)))
    picture = Picture(_PANEL_HEIGHT * len(rows) + 0.5, max(WIDTH, _COLUMN_WIDTH * len(of)))
    grid = picture.subplots(len(rows), len(of), squeeze=False, sharex=True)
    for column, name in enumerate(of):
        own = _rows(result, name)
        for row, what in enumerate(rows):
            axes = grid[row, column]
            if what not in own:
                axes.set_axis_off()
                continue
            _draw(axes, result, name, what)
            if row < len(rows) - 1:
                axes.set_xlabel("")
    picture.align_ylabels()
    return picture


def _rows(result: Result, axis: str) -> list[str]:
    """What is drawn of an axis, in order: its signals, and the error of an estimated velocity below it."""
    rows = []
    for name in signals_of(result, axis):
        rows.append(name)
        if name == VELOCITY and estimate_error(result, axis) is not None:
            rows.append(_ERROR)
    return rows


def _draw(axes: Axes, result: Result, axis: str, what: str) -> None:
    time = result["time"]
    if what == _ERROR:
        error = estimate_error(result, axis)
        assert error is not None  # by _rows
        rms = float(np.sqrt(np.mean(error**2))) if len(error) else 0.0
        axes.plot(time, error, color=BLUE, linewidth=0.9, label=f"estimate − true, RMS {rms:.3g}")
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        dress(axes, heading(f"{axis} {what}", result.units[f"{axis}_{VELOCITY}"]))
        legend(axes, columns=5)
        return
    name = f"{axis}_{what}"
    unit = result.units[name]
    if what == VELOCITY:
        reference, true = f"{axis}_reference_velocity", true_velocity(result, axis)
        if reference in result and result.units[reference] == unit:
            axes.plot(time, result[reference], color=GREY, linewidth=3.0, alpha=0.55, label="reference")
        if true is not None:
            axes.plot(time, true, color=VERMILLION, linewidth=1.6, label="true")
        axes.plot(time, result[name], color=BLUE, linewidth=1.0, linestyle=(0, (4, 2)), label="estimate")
        legend(axes, columns=5)
    else:
        axes.plot(time, result[name], color=BLUE, linewidth=1.0)
    dress(axes, heading(f"{axis} {what.replace('_', ' ')}", unit))
