"""The picture of a cut stock: heights from above, and what differs from the intended part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rds.core.figure import Picture
    from rds.nc.stock.stock import Stock

_MOST_PIXELS = 1500  # along a side


def picture(stock: Stock, title: str, part: np.ndarray | None = None) -> Picture:
    """Heights (mm) with shading as from a lamp at the upper left; with `part` also the difference from it (mm)."""
    from matplotlib.colors import LightSource

    from rds.core.figure import Picture, dress

    every = max(max(stock.heights.shape) // _MOST_PIXELS, 1)
    heights = stock.heights[::every, ::every]
    shown = Picture(6.5, 14.0 if part is not None else 8.5)
    panels = shown.subplots(1, 2 if part is not None else 1, squeeze=False)[0]
    axes = panels[0]
    low = max(float(heights.min()), stock.floor - 0.05 * float(np.ptp(heights)))
    image = axes.imshow(heights, cmap="viridis", origin="lower", extent=stock.extent, vmin=low, interpolation="nearest")
    shade = LightSource(315, 45).hillshade(heights, vert_exag=1.0, dx=stock.cell * every, dy=stock.cell * every)
    axes.imshow(shade, cmap="gray", origin="lower", extent=stock.extent, alpha=0.35, interpolation="nearest")
    shown.colorbar(image, ax=axes, label="height z [mm]", shrink=0.8)
    dress(axes, "Y [mm]", "X [mm]")
    if part is not None:
        more = (stock.heights - part)[::every, ::every]
        most = max(float(np.abs(more).max()), 1e-6)
        image = panels[1].imshow(
            more, cmap="RdBu_r", origin="lower", extent=stock.extent, vmin=-most, vmax=most, interpolation="nearest"
        )
        shown.colorbar(image, ax=panels[1], label="above (+) or below (−) the intended part [mm]", shrink=0.8)
        dress(panels[1], "Y [mm]", "X [mm]")
    for panel in panels:
        panel.set_aspect("equal")
    shown.suptitle(title, fontsize="medium")
    return shown
