"""The picture of a part program on a machine with less than two linear axes: each axis along the program."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from rds.core.figure import BLUE, GREY, ORANGE, Picture, common_legend, dress
from rds.interpolators.motion.segments import AXES
from rds.machines import Machine

_UNITS = ("mm", "mm", "mm", "degrees", "degrees", "degrees")
_RAPID: dict[str, Any] = {"label": "rapid", "color": ORANGE, "linestyle": (0, (4, 3)), "linewidth": 1.2}
_FEED: dict[str, Any] = {"label": "feed", "color": BLUE, "linestyle": "-", "linewidth": 1.4}
_TRAVEL: dict[str, Any] = {"label": "travel limits", "color": GREY, "linewidth": 1.0, "linestyle": (0, (6, 2, 1, 2))}


def has_no_side(machine: Machine) -> bool:
    """Whether a machine has less than two linear axes, so that no side of a path can be seen."""
    return sum(name in AXES[:3] for name in machine.axes) < 2


def plot_axes(segments: Iterable[np.ndarray], machine: Machine, title: str = "") -> Picture:
    """Position of each axis over the way along the program; arrays of SEGMENT, all straight. Rapids are dashed."""
    parts = [part for part in segments if len(part)]
    picture = Picture(2.0 + 2.2 * sum(name in AXES for name in machine.axes))
    picture.suptitle(title if parts else f"{title}: nothing moves", x=0.01, ha="left", fontsize="medium")
    names = [name for name in machine.axes if name in AXES]
    places = picture.subplots(len(names), 1, sharex=True, squeeze=False).ravel()
    for name, place in zip(names, places, strict=True):
        if parts:
            _draw(place, name, np.concatenate(parts))
        low, high = place.get_ylim()
        for limit in machine.axes[name].travel:
            if low <= limit <= high or not parts:
                place.axhline(limit, **_TRAVEL)
        dress(place, f"{name} [{_UNITS[AXES.index(name)]}]", None)
    places[-1].set_xlabel("way along the program [mm; degrees where only rotary axes move]")
    handles = {
        text: handle for place in places for handle, text in zip(*place.get_legend_handles_labels(), strict=True)
    }
    if handles:
        common_legend(picture, list(handles.values()), list(handles), "outside lower center")
    return picture


def _draw(place: Any, name: str, segments: np.ndarray) -> None:
    axis = AXES.index(name)
    end = np.cumsum(segments["length"])
    gap = np.full(len(segments), np.nan)
    way = np.column_stack((end - segments["length"], end, gap))
    position = np.column_stack((segments["start"][:, axis], segments["end"][:, axis], gap))
    for rapid, style in ((True, _RAPID), (False, _FEED)):
        some = segments["rapid"] == rapid
        if some.any():
            place.plot(way[some].ravel(), position[some].ravel(), **style)
