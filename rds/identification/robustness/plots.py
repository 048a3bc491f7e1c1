"""A study in pictures: how figures are spread, and what the largest error depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.core.figure import BLUE, GREY, VERMILLION, Picture, dress, legend
from rds.identification.robustness.figures import FIGURES

if TYPE_CHECKING:
    from rds.identification.robustness.study import Study

_SHOWN = ("max_error", "rms_error", "gain_margin", "phase_margin")
_DOTS = 4000  # as many as the eye tells apart


def distributions(study: Study, axis: int) -> Picture:
    """Histograms of tracking errors and margins, with the nominal run."""
    picture = Picture(5.6)
    unit = study.task.plan.axes[axis].axis.unit
    for place, (name, panel) in enumerate(zip(_SHOWN, picture.subplots(2, 2).flat, strict=True)):
        meaning, own_unit, _ = FIGURES[name]
        values = study.figure(axis, name)
        values = values[np.isfinite(values)]
        dress(panel, "draws", f"{meaning} [{own_unit or unit}]")
        if len(values):
            panel.hist(values, bins=min(60, max(10, len(values) // 20)), color=BLUE, alpha=0.75, label="draws")
            nominal = study.nominal[axis, list(FIGURES).index(name)]
            if np.isfinite(nominal):
                panel.axvline(nominal, color=VERMILLION, linestyle=(0, (5, 2)), label="estimate")
        else:
            panel.text(0.5, 0.5, "not known", ha="center", va="center", color=GREY, transform=panel.transAxes)
        if place == 0:
            legend(panel)
    return picture


def dependence(study: Study, axis: int) -> Picture:
    """The largest tracking error over each parameter that varies; draws that diverge are not shown."""
    spread = study.task.axes[axis].spread
    names = spread.varied
    columns = min(4, len(names))
    rows = -(-len(names) // columns)
    picture = Picture(0.5 + 2.5 * rows)
    error, unit = study.figure(axis, "max_error"), study.task.plan.axes[axis].axis.unit
    chosen = np.flatnonzero(np.isfinite(error))[:_DOTS]
    panels = picture.subplots(rows, columns, squeeze=False, sharey=True)
    for name, panel in zip(names, panels.flat, strict=False):
        place = spread.names.index(name)
        parameter_unit = spread.units.get(name, "")
        dress(panel, f"error [{unit}]", f"{name} [{parameter_unit}]" if parameter_unit else name)
        panel.plot(study.drawn[axis][chosen, place], error[chosen], ".", color=BLUE, markersize=2.0, alpha=0.5)
        panel.axvline(spread.values[place], color=VERMILLION, linestyle=(0, (5, 2)))
        panel.label_outer(remove_inner_ticks=False)
        panel.locator_params(axis="x", nbins=4)
    for panel in list(panels.flat)[len(names) :]:
        panel.set_visible(False)
    return picture
