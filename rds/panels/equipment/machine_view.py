"""The machine in motion, in three dimensions: the table along X and Y, the head along Z, the spindle turning.

Drawn with k3d, which costs the kernel a few matrices ten times a second; made only when somebody wants to see it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import ipywidgets as widgets
import k3d
import numpy as np

from rds.machines import Machine

_FRAME, _TABLE, _HEAD, _TOOL = 0x8A8A8A, 0x56B4E9, 0xE69F00, 0xD55E00
_SLOWER = 20.0  # the spindle is drawn turning this much more slowly, or ten pictures a second would only flicker
_EDGES = ((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7))


class MachineView:
    """`begin(traces)` says what the rows hold, `show(row)` moves the machine there. Lengths are in mm."""

    def __init__(self, machine: Machine):
        self._axes = [name for name, axis in machine.axes.items() if axis.unit == "mm"][:3]
        self._spindle = next((name for name, axis in machine.axes.items() if axis.unit == "rev/min"), None)
        travel = [machine.axes[name].travel for name in self._axes] + [(-50.0, 50.0)] * (3 - len(self._axes))
        self._low, self._high = np.array(travel).T
        self._at: dict[str, int] = {}
        self._time, self._turned = 0.0, 0.0
        size = float(max(self._high - self._low))
        self._plot = k3d.plot(
            height=340, camera_auto_fit=False, menu_visibility=False, grid_visible=False, axes=["X", "Y", "Z"]
        )
        self._plot += box_lines(self._low, self._high)
        self._table = _solid((0.5 * size, 0.5 * size, 0.04 * size), _TABLE)
        self._head = _solid((0.14 * size, 0.14 * size, 0.3 * size), _HEAD)
        self._tool = _solid((0.09 * size, 0.025 * size, 0.16 * size), _TOOL)
        for part in (self._table, self._head, self._tool):
            self._plot += part
        self._size = size
        self._plot.camera = [1.0 * size, -1.25 * size, 0.8 * size, 0, 0, 0, 0, 0, 1]
        self.words = widgets.HTML()
        self.widget = widgets.VBox([self._plot, self.words])
        self._move({})

    def begin(self, traces: Sequence[tuple[str, str]]) -> None:
        """The columns of the rows to come, after the time."""
        names = [name for name, _ in traces]
        wanted = [*self._axes, *([self._spindle] if self._spindle else [])]
        self._at = {}
        for axis in wanted:
            for kind in ("measured", "modelled", "reference"):
                if f"{axis}_{kind}" in names:
                    self._at[axis] = 1 + names.index(f"{axis}_{kind}")
                    break
        self._time = self._turned = 0.0

    def show(self, row: np.ndarray) -> None:
        """Move to the positions of one row: time in s, then the traces."""
        if not len(row):
            return
        where = {axis: float(row[column]) for axis, column in self._at.items() if column < len(row)}
        step = float(row[0]) - self._time  # also back, where somebody scrubs
        self._time = float(row[0])
        speed = where.get(self._spindle or "", 0.0)
        self._turned += 2.0 * math.pi * speed / 60.0 / _SLOWER * step
        self._move(where)

    def _move(self, where: dict[str, float]) -> None:
        x, y, z = (where.get(name, 0.0) for name in [*self._axes, "", "", ""][:3])
        bottom = float(self._low[2])
        self._table.model_matrix = _placed(x, y, bottom)
        self._head.model_matrix = _placed(0.0, 0.0, z + 0.31 * self._size)
        self._tool.model_matrix = _placed(0.0, 0.0, z + 0.08 * self._size, self._turned)
        said = ", ".join(f"{name} {value:.3f}" for name, value in where.items())
        unit = f"mm; spindle in rev/min, drawn {_SLOWER:g} times slower" if self._spindle in where else "mm"
        self.words.value = f"<p>at {self._time:.2f} s: {said} [{unit}]</p>" if said else "<p>nothing has moved yet</p>"


def _placed(x: float, y: float, z: float, turned: float = 0.0) -> np.ndarray:
    c, s = math.cos(turned), math.sin(turned)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]], dtype=np.float32)


def _corners(low: Any, high: Any) -> np.ndarray:
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def box_lines(low: np.ndarray, high: np.ndarray) -> Any:
    """The travel of all axes."""
    corners = _corners(low, high).astype(np.float32)
    return k3d.lines(corners, np.array(_EDGES, dtype=np.uint32), indices_type="segment", color=_FRAME, shader="simple")


def _solid(size: tuple[float, float, float], color: int) -> Any:
    """A block about the origin."""
    half = np.array(size) / 2.0
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [each for a, b, c, d in faces for each in ((a, b, c), (a, c, d))]
    return k3d.mesh(
        _corners(-half, half).astype(np.float32),
        np.array(triangles, dtype=np.uint32),
        color=color,
        flat_shading=True,
        side="double",
    )
