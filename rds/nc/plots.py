"""The picture of a part program: its path from three sides and in space, in machine coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.figure import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILLION, Picture, common_legend
from rds.interpolators.motion.segments import AXES
from rds.machines import Machine
from rds.nc.trace import CURVED, RAPID, STRAIGHT, Trace
from rds.nc.validate import TOLERANCE
from rds.nc.validation import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Kinds differ in line style as well, for any kind of colour vision and for print in black.
STYLES: dict[int, dict[str, Any]] = {
    RAPID: {"label": "rapid", "color": ORANGE, "linestyle": (0, (4, 3)), "linewidth": 0.9},
    STRAIGHT: {"label": "straight feed", "color": BLUE, "linestyle": "-", "linewidth": 1.2},
    CURVED: {"label": "arc feed", "color": GREEN, "linestyle": "-", "linewidth": 1.7},
}
_BOX: dict[str, Any] = {"label": "travel limits", "color": GREY, "linewidth": 1.0, "linestyle": (0, (6, 2, 1, 2))}
_VIEWS = (("XY", 0, 1), ("ZX", 0, 2), ("YZ", 1, 2))  # across and up
_WHOLE_BOX = 0.4  # the travel limits are in the picture when the path fills so much of them
_MOST_MARKS = 40


def plot(trace: Trace, machine: Machine | None = None, title: str = "") -> Picture:
    """XY, ZX and YZ, and the path in space: rapids dashed, start and end marked, lengths in mm.

    With a machine, its travel limits are a box, and places beyond them are crossed. Scales are equal in all directions.
    """
    picture = Picture(9.4)
    places = picture.add_gridspec(2, 2, height_ratios=[1.0, 0.9])
    points = trace.points
    machine = None if trace.of_tip else machine  # the travel is that of the joints
    travel = _travel(machine)
    beyond = _beyond(points, travel)
    whole = _shows_box(trace, travel)
    for (name, across, up), place in zip(_VIEWS, (places[0, 0], places[1, 0], places[1, 1]), strict=True):
        axes = picture.add_subplot(place)
        _view(axes, name, across, up, trace, points, beyond)
        low, high = _frame(trace, travel if whole else None)
        if travel is not None:
            axes.add_patch(_rectangle(travel, across, up))
        axes.set_xlim(low[across], high[across])
        axes.set_ylim(low[up], high[up])
        axes.set_aspect("equal", adjustable="box")
    space = picture.add_subplot(places[0, 1], projection="3d")
    _space(space, trace, points, beyond)
    handles, labels = picture.axes[0].get_legend_handles_labels()
    common_legend(picture, handles, labels, "outside lower center")
    picture.suptitle(_title(trace, title, machine, whole), x=0.01, ha="left", fontsize="medium")
    return picture


def _travel(machine: Machine | None) -> np.ndarray | None:
    """Travel of X, Y, Z (3 × 2); an axis that the machine does not have is nan. None without a machine."""
    if machine is None:
        return None
    return np.array([machine.axes[name].travel if name in machine.axes else (np.nan, np.nan) for name in AXES[:3]])


def _shows_box(trace: Trace, travel: np.ndarray | None) -> bool:
    if travel is None:
        return False
    span = trace.high[:3] - trace.low[:3]
    return bool(np.nanmax(span) >= _WHOLE_BOX * np.nanmax(travel[:, 1] - travel[:, 0]))


def _frame(trace: Trace, travel: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """What a picture shows: the path, or the travel with it, and a margin."""
    low, high = (
        np.where(np.isfinite(trace.low), trace.low, 0.0)[:3],
        np.where(np.isfinite(trace.high), trace.high, 0.0)[:3],
    )
    if travel is not None:
        low, high = np.fmin(low, travel[:, 0]), np.fmax(high, travel[:, 1])
    margin = 0.06 * max(float(np.max(high - low)), 1e-3)
    return low - margin, high + margin


def _beyond(points: dict[int, np.ndarray], travel: np.ndarray | None) -> np.ndarray:
    """Points outside of the travel, a few of them."""
    if travel is None:
        return np.zeros((0, 3))
    everything = np.concatenate(list(points.values()))
    outside = everything[
        np.any((everything < travel[:, 0] - TOLERANCE) | (everything > travel[:, 1] + TOLERANCE), axis=1)
    ]
    return outside[:: max(1, len(outside) // _MOST_MARKS)]


def _view(
    axes: Axes, name: str, across: int, up: int, trace: Trace, points: dict[int, np.ndarray], beyond: np.ndarray
) -> None:
    for kind, style in STYLES.items():
        if len(points[kind]):
            axes.plot(points[kind][:, across], points[kind][:, up], **style)
    _marks(axes, trace, beyond, (across, up))
    axes.set_xlabel(f"{AXES[across]} [mm]")
    axes.set_ylabel(f"{AXES[up]} [mm]")
    axes.set_title(name, loc="left", fontsize="medium")
    axes.grid(True, color="#E2E2E2", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _marks(axes: Any, trace: Trace, beyond: np.ndarray, order: tuple[int, ...]) -> None:
    """Start, end and what is beyond the travel."""

    def mark(places: np.ndarray, label: str, **style: Any) -> None:
        axes.plot(*(places[:, axis] for axis in order), linestyle="none", label=label, **style)

    mark(trace.start[None], "start", marker="o", markersize=8, color=BLACK, markerfacecolor="none", markeredgewidth=1.4)
    mark(trace.end[None], "end", marker="s", markersize=4.5, color=BLACK)
    if len(beyond):
        mark(beyond, "beyond the travel", marker="x", markersize=6, color=VERMILLION, markeredgewidth=1.5)


def _rectangle(travel: np.ndarray, across: int, up: int) -> Any:
    from matplotlib.patches import Rectangle

    sides = np.nan_to_num(travel)
    corner, size = sides[:, 0], sides[:, 1] - sides[:, 0]
    return Rectangle((corner[across], corner[up]), size[across], size[up], fill=False, **_BOX)


def _space(axes: Any, trace: Trace, points: dict[int, np.ndarray], beyond: np.ndarray) -> None:
    """The path alone, as large as may be: the travel is in the other views."""
    for kind, style in STYLES.items():
        if len(points[kind]):
            axes.plot(*points[kind].T, **style)
    _marks(axes, trace, beyond, (0, 1, 2))
    low, high = _frame(trace, None)
    for axis, name in enumerate("xyz"):
        getattr(axes, f"set_{name}lim")(low[axis], high[axis])
        getattr(axes, f"set_{name}label")(AXES[axis], fontsize="small", labelpad=(5, 5, -2)[axis])
    axes.set_box_aspect(np.maximum(high - low, 0.12 * np.max(high - low)), zoom=0.8)
    axes.set_title("in space [mm]", loc="left", fontsize="medium")
    axes.tick_params(labelsize="small")
    axes.view_init(elev=28, azim=-60)


def _title(trace: Trace, title: str, machine: Machine | None, whole: bool) -> str:
    lines = [title or "part program"]
    if not np.all(np.isfinite(trace.low)):
        return f"{lines[0]}: nothing moves"
    reach = [
        f"{name} {plain(low)} to {plain(high)}"
        for name, low, high in zip(AXES[:3], trace.low, trace.high, strict=False)
    ]
    place = "the tool's tip, on the work" if trace.of_tip else "machine coordinates"
    lines.append(f"{place}, mm: {', '.join(reach)}")
    turning = [
        f"{name} {plain(trace.low[axis])} to {plain(trace.high[axis])}°"
        for axis, name in enumerate(AXES)
        if axis > 2 and trace.high[axis] > trace.low[axis]
    ]
    if turning:
        lines.append(f"not drawn: {', '.join(turning)}")
    if machine is not None and not whole:
        travel = [
            f"{name} {low:g} to {high:g}"
            for name, axis in machine.axes.items()
            if name in AXES[:3]
            for low, high in [axis.travel]
        ]
        lines.append(f"travel of {machine.name}, wider than the picture: {', '.join(travel)}")
    if trace.resolution:
        lines.append(f"drawn to {plain(trace.resolution)} mm")
    return "\n".join(lines)
