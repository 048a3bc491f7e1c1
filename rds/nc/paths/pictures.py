"""Pictures of paths: seen from above, with start and direction, and the height along the way."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rds.core.errors import InputError
from rds.core.types import Segment
from rds.nc.paths.measure import extent, pieces, total_length, trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rds.core.figure import Picture
    from rds.nc.paths.outlines import Outline

_ARROWS = 12  # along the whole path
_CHORDS_PER_SIZE = 20000.0  # arcs are drawn in chords that are off by this part of the picture


def picture(segments: Sequence[Segment], title: str = "", *, drawing: Outline | None = None) -> Picture:
    """The path in the XY plane: equal axes in mm, start, end and direction, rapid ways between pieces dashed.

    The height along it has a picture of its own where it changes. With `drawing`, the path lies over the drawing and
    the outline as traced. InputError for a path without segments.
    """
    from rds.core.figure import Picture

    if not segments:
        raise InputError("a path without segments has no picture")
    bounds = extent(segments)
    size = max(high - low for low, high in bounds) or 1.0
    lines = [trace(piece, size / _CHORDS_PER_SIZE) for piece in pieces(segments)]
    rises = len(bounds) > 2 and bounds[2][1] - bounds[2][0] > 1e-9
    shown = Picture(10.5 if rises else 8.0, 8.5)
    panels = shown.subplots(2, 1, height_ratios=[3, 1]) if rises else [shown.subplots()]
    _draw_plan(panels[0], lines, drawing, total_length(segments))
    if rises:
        _draw_height(panels[1], lines)
    shown.suptitle(title or "path", fontsize="medium")
    return shown


def _draw_plan(axes: Axes, lines: list[np.ndarray], drawing: Outline | None, length: float) -> None:
    from rds.core.figure import BLUE, GREEN, GREY, ORANGE, VERMILLION, dress

    if drawing is not None:
        axes.imshow(drawing.darkness, cmap="Greys", vmin=0.0, vmax=2.5, extent=drawing.bounds, interpolation="nearest")
        for k, ring in enumerate(drawing.traced):
            label = "outline as traced" if k == 0 else None
            axes.plot(ring[:, 0], ring[:, 1], color=ORANGE, linewidth=0.9, linestyle=(0, (4, 2)), label=label)
    for k, line in enumerate(lines):
        axes.plot(line[:, 0], line[:, 1], color=BLUE, linewidth=1.4, label="path" if k == 0 else None)
        _arrows(axes, line, length / _ARROWS, BLUE)
    for k, (before, after) in enumerate(pairwise(lines)):
        x, y = np.column_stack([before[-1, :2], after[0, :2]])
        axes.plot(x, y, color=GREY, linewidth=1.0, linestyle=(0, (5, 3)), label="rapid" if k == 0 else None)
    start, end = lines[0][0], lines[-1][-1]
    axes.plot(*start[:2], "o", color=GREEN, markersize=8, label="start")
    axes.plot(*end[:2], "x", color=VERMILLION, markersize=8, markeredgewidth=2, label="end")
    dress(axes, "Y [mm]", "X [mm]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.06)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.09), ncols=5, frameon=False, fontsize="small")


def _arrows(axes: Axes, line: np.ndarray, spacing: float, colour: str) -> None:
    """Heads along the line, pointing the way that the tool goes; at least one for each piece."""
    xy = line[:, :2]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
    if along[-1] == 0.0:
        return
    count = max(int(along[-1] / spacing), 1)
    for at in (np.arange(count) + 0.5) * along[-1] / count:
        k = int(np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(xy) - 2))
        step = xy[k + 1] - xy[k]
        here = xy[k] + step * (at - along[k]) / max(along[k + 1] - along[k], 1e-300)
        direction = step / max(float(np.linalg.norm(step)), 1e-300) * along[-1] * 1e-6
        axes.annotate(
            "",
            xy=tuple(here + direction),
            xytext=tuple(here - direction),
            arrowprops={"arrowstyle": "-|>", "color": colour, "mutation_scale": 13, "shrinkA": 0, "shrinkB": 0},
        )


def _draw_height(axes: Axes, lines: list[np.ndarray]) -> None:
    from rds.core.figure import BLUE, GREEN, GREY, VERMILLION, dress

    done = 0.0
    for k, line in enumerate(lines):
        along = done + np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        axes.plot(along, line[:, 2], color=BLUE, linewidth=1.4)
        if k == 0:
            axes.plot(0.0, line[0, 2], "o", color=GREEN, markersize=8)
        else:
            axes.axvline(done, color=GREY, linewidth=1.0, linestyle=(0, (5, 3)))
        done = float(along[-1])
    axes.plot(done, lines[-1][-1, 2], "x", color=VERMILLION, markersize=8, markeredgewidth=2)
    dress(axes, "Z [mm]", "distance cut [mm]")
