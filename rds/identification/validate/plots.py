"""The pictures of a validation: overlay, residual, correlations, friction curve, parameter intervals."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from rds.core.figure import BLUE, CYCLE, GREEN, GREY, RESPONSES, VERMILLION, Picture, dress, legend, quantity
from rds.identification.fit.needed_voltage import static_curve
from rds.identification.fit.residuals import Correlation
from rds.identification.logs.units import acting
from rds.identification.validate.assessment import Assessment
from rds.identification.validate.candidate import Candidate
from rds.results.units import heading

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_POINTS = 20_000  # that a line is drawn with
_CURVE = 81  # voltages of a friction curve


def overlay(a: Assessment) -> Picture:
    """Measured and modelled position and velocity (or speed), and the residual, over time."""
    rows = 2 if a.velocity is None else 3
    picture = Picture(2.45 * rows + 0.5)
    panels = picture.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    t, measured, modelled = (_thinned(values) for values in (a.time, a.measured, a.modelled))
    _pair(panels[0], t, measured, modelled)
    dress(panels[0], quantity("", a.unit).strip(), None)
    legend(panels[0])
    if a.velocity is not None:
        _pair(panels[1], a.block_time, a.block_velocity, a.block_modelled)
        dress(panels[1], heading("velocity", a.velocity.unit), None)
    last = panels[-1]
    last.plot(t, measured - modelled, color=BLUE, linewidth=0.9)
    last.axhline(0.0, color=GREY, linewidth=0.8)
    if a.log.resolution:
        for sign in (1, -1):
            label = f"encoder ±{a.log.resolution:g} {a.unit}" if sign > 0 else None
            last.axhline(sign * a.log.resolution, color=GREY, linewidth=1.0, linestyle=(0, (5, 2)), label=label)
    legend(last)
    dress(last, heading("measured − modelled", a.unit))
    picture.align_ylabels()
    return picture


def correlations(a: Assessment) -> Picture:
    """Autocorrelation of the residual and its correlation with the command, with the 99 % bands."""
    assert a.tests is not None
    picture = Picture(3.1)
    left, right = picture.subplots(1, 2, sharey=True)
    _stems(left, a.tests.auto, "autocorrelation of the residual", "lag [s]")
    loop = ", in a closed loop" if a.log.closed_loop else ""
    _stems(right, a.tests.cross, "correlation with the command", f"lag [s], positive: residual after command{loop}")
    return picture


def friction_curve(candidate: Candidate, a: Assessment) -> Picture:
    """The voltage that steady motion takes: the model's, and what was measured about it.

    Each point is a block of the log: the model's voltage at its velocity, less the extra voltage that the model needed
    there. What acceleration takes is left out by that, as far as the model knows it.
    """
    assert a.voltage is not None
    top = float(np.abs(a.log.command).max())
    speeds, voltages = static_curve(
        candidate.structure, candidate.values, np.linspace(-top, top, _CURVE), candidate.is_rate
    )
    reach = 1.3 * float(np.abs(a.voltage.velocity).max())
    picture = Picture(3.8)
    axes = picture.subplots()
    for sign in (1.0, -1.0):
        branch = (speeds * sign > 0.0) & (np.abs(speeds) <= reach)
        order = np.argsort(speeds[branch])
        x, y = speeds[branch][order], voltages[branch][order]
        points = a.voltage.velocity * sign > 0.0
        if len(x) < 2:
            continue
        v, extra = a.voltage.velocity[points], a.voltage.extra[points]
        inside = (v >= x[0]) & (v <= x[-1])
        label = "measured, less what acceleration takes" if sign > 0 else None
        axes.plot(v[inside], np.interp(v[inside], x, y) - extra[inside], ".", color=BLUE, markersize=4, label=label)
        axes.plot(x, y, color=VERMILLION, linewidth=1.6, label="model, steady" if sign > 0 else None)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    legend(axes)
    speed = a.ranges["velocity"]
    unit = a.ranges["command"].unit
    dress(axes, heading(acting(unit), unit), heading("velocity", speed.unit))
    return picture


def voltage_errors(a: Assessment) -> Picture:
    """The extra voltage over velocity, over the command and over time."""
    assert a.voltage is not None
    picture = Picture(2.9)
    panels = picture.subplots(1, 3, sharey=True)
    unit = a.ranges["command"].unit
    shown = (
        (a.voltage.velocity, heading("velocity", a.ranges["velocity"].unit)),
        (a.voltage.command, heading("command", unit)),
        (a.voltage.time, "time [s]"),
    )
    for axes, (x, label) in zip(panels, shown, strict=True):
        axes.plot(x, a.voltage.extra, ".", color=BLUE, markersize=3)
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        dress(axes, heading("needed − given", unit) if axes is panels[0] else "", label)
    return picture


def intervals(models: Sequence[Candidate]) -> Picture | None:
    """Each parameter with its 95 % interval, of all models that have it; None where there is nothing to draw."""
    names = list(dict.fromkeys(name for model in models for name in model.values))
    if not names:
        return None
    columns = min(len(names), 4)
    rows = -(-len(names) // columns)
    picture = Picture((0.9 + 0.32 * len(models)) * rows + 0.4)
    grid = picture.subplots(rows, columns, squeeze=False, sharey=True)
    for axes in grid.flat[len(names) :]:
        axes.set_axis_off()
    for axes, name in zip(grid.flat, names, strict=False):
        unit = next(m.structure.units.get(name, "") for m in models if name in m.values)
        for row, model in enumerate(models):
            if name in model.values:
                _interval(axes, model, name, row)
        axes.set_yticks(range(len(models)), [model.name for model in models])
        axes.set_ylim(len(models) - 0.5, -0.5)
        dress(axes, "", heading(name, unit))
        axes.margins(x=0.1)
        axes.locator_params(axis="x", nbins=4)
    return picture


def _interval(axes: Axes, model: Candidate, name: str, row: int) -> None:
    value, known = model.values[name], model.parameters.get(name)
    colour = CYCLE[row % len(CYCLE)]
    if known is not None and isfinite(known.low) and isfinite(known.high):
        axes.plot([known.low, known.high], [row, row], color=colour, linewidth=2.0)
    if known is None or known.told:
        axes.plot([value], [row], "o", color=colour, markersize=5)
        return
    axes.plot([value], [row], "o", color=colour, markersize=5, markerfacecolor="none")
    axes.annotate("assumed", (value, row), xytext=(0, 6), textcoords="offset points", ha="center", fontsize=7)


def _pair(axes: Axes, t: np.ndarray, measured: np.ndarray, modelled: np.ndarray) -> None:
    axes.plot(t, measured, label="measured", **RESPONSES["measured"])
    axes.plot(t, modelled, label="modelled, free run", **RESPONSES["modelled"])


def _stems(axes: Axes, found: Correlation, what: str, lag: str) -> None:
    beyond = np.abs(found.values) > found.band
    for chosen, colour in ((~beyond, GREEN), (beyond, VERMILLION)):
        axes.vlines(found.lags[chosen], 0.0, found.values[chosen], color=colour, linewidth=1.6)
    axes.axhspan(-found.band, found.band, color=GREY, alpha=0.2, label=f"99 % band ±{found.band:.3f}")
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    legend(axes)
    dress(axes, what, lag)


def _thinned(values: np.ndarray) -> np.ndarray:
    return values[:: max(len(values) // _MOST_POINTS, 1)]
