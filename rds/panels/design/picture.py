"""A design as a picture for a report: the poles, and the curves that the panel shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rds.core.figure import BLUE, GREY, VERMILLION, Picture, dress, legend
from rds.identification.robustness.tracking_design import LoopDraws, TrackingDesign
from rds.panels.design.charts import ACCENT, ASIDE, QUIET, charts

_COLORS = {ACCENT: BLUE, ASIDE: VERMILLION, QUIET: GREY}
_COLUMNS = 3


def design_picture(design: TrackingDesign, size: float, cloud: LoopDraws | None) -> Picture:
    """Poles (1/s), with those of the loop over the cloud; then the charts for a step of `size` in the axis's unit."""
    shown = charts(design, size)
    rows = -(-(1 + len(shown)) // _COLUMNS)
    picture = Picture(2.7 * rows)
    places = picture.subplots(rows, _COLUMNS, squeeze=False).ravel()
    _plane(places[0], design, cloud)
    for place, chart in zip(places[1:], shown, strict=False):
        _chart(place, chart)
    for place in places[1 + len(shown) :]:
        place.set_axis_off()
    pole = design.poles[0]
    words = f"poles {pole.real:.4g} ± {abs(pole.imag):.4g} i" if pole.imag else f"poles {_reals(design)}"
    picture.suptitle(f"{design.axis.name}: {words}, observer {design.observer_pole:.4g} [1/s]", fontsize="medium")
    return picture


def _reals(design: TrackingDesign) -> str:
    return ", ".join(f"{each.real:.4g}" for each in design.poles)


def _plane(place: Any, design: TrackingDesign, cloud: LoopDraws | None) -> None:
    if cloud is not None:
        drawn = cloud.poles.ravel()
        drawn = drawn[np.isfinite(drawn)]
        place.plot(drawn.real, drawn.imag, "+", color=GREY, markersize=3, label="over the cloud")
    poles = np.array(design.poles)
    place.plot(poles.real, poles.imag, "x", color=BLUE, markersize=9, markeredgewidth=2.0, label="poles of the error")
    far = max(1.9 * float(np.abs(poles.real).max()), 1.5 * float(np.abs(poles.imag).max()))
    place.axvline(0.0, color=GREY, linewidth=0.8)
    dress(place, "imaginary part [rad/s]", "real part [1/s]")
    place.set_xlim(-far, 0.2 * far)
    place.set_ylim(-0.8 * far, 0.8 * far)
    legend(place, 2)


def _chart(place: Any, chart: Mapping[str, Any]) -> None:
    for each in chart["series"]:
        values = [np.array([np.nan if value is None else value for value in each[key]], float) for key in ("x", "y")]
        style: dict[str, Any] = {"color": _COLORS[each["color"]], "linewidth": 1.3, "label": each.get("name")}
        if each.get("dots"):
            style |= {"linestyle": "none", "marker": "+", "markersize": 9}
        elif each.get("dash"):
            style |= {"linestyle": (0, tuple(map(float, str(each["dash"]).split())))}
        place.plot(*values, **style)
    dress(place, chart["y_label"], chart["x_label"])
    if chart.get("log"):
        place.set_xscale("log")
    if chart.get("y_step"):
        place.yaxis.set_major_locator(_multiple(chart["y_step"]))
    if chart.get("equal"):
        place.set_aspect("equal", adjustable="box")
    for key, limit in (("x_range", place.set_xlim), ("y_range", place.set_ylim)):
        if key in chart:
            limit(*chart[key])
    legend(place, 3)
    place.set_title(chart["title"], loc="right", fontsize="small")


def _multiple(step: float) -> Any:
    from matplotlib.ticker import MultipleLocator

    return MultipleLocator(step)
