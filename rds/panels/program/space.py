"""A part program's path in space, drawn with k3d, in the box of the machine's travel; the tool moves while it runs."""

from __future__ import annotations

from collections.abc import Sequence

import ipywidgets as widgets
import k3d
import numpy as np

from rds.machines import Machine
from rds.nc.trace import CURVED, RAPID, STRAIGHT, Trace
from rds.panels.kit.html import Html
from rds.panels.program.path_view import travel_of

_COLORS = {RAPID: 0xD55E00, STRAIGHT: 0x0072B2, CURVED: 0x009E73}
_TOOL = 0xCC79A7
_MOST = 20_000  # pieces of a kind that are drawn


_FRAME = 0x8A8A8A
_EDGES = ((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7))


class SpaceView:
    """`show(trace)` draws a program, `place(position)` moves the tool. Lengths are in mm."""

    def __init__(self, machine: Machine):
        low, high = travel_of(machine).T
        self._size = float(max(high - low)) or 1.0
        self._plot = k3d.plot(
            height=340,
            camera_auto_fit=False,
            menu_visibility=False,
            axes=["X", "Y", "Z"],  # with units they do not fit in the corner
            grid_visible=True,
        )
        self._plot += _box_lines(low, high)
        self._tool = k3d.points(np.zeros((1, 3), np.float32), point_size=0.02 * self._size, color=_TOOL, shader="mesh")
        self._plot += self._tool
        self._lines: list[object] = []
        words = "<p>In mm. Orange: rapid; blue: straight; green: arc feed; violet: the tool. Turn it by mouse.</p>"
        self.widget = widgets.VBox([self._plot, Html(words)])

    def show(self, trace: Trace) -> None:
        """Draw the path, as large as may be."""
        for each in self._lines:
            self._plot -= each
        self._lines = []
        for kind, points in trace.points.items():
            pieces = _pieces(points)
            if len(pieces):
                corners = np.arange(2 * len(pieces), dtype=np.uint32).reshape(-1, 2)
                line = k3d.lines(
                    pieces.reshape(-1, 3), corners, indices_type="segment", color=_COLORS[kind], shader="simple"
                )
                self._plot += line
                self._lines.append(line)
        if np.all(np.isfinite(trace.low[:3])):
            middle = (trace.low[:3] + trace.high[:3]) / 2.0
            far = 1.1 * max(float(np.max(trace.high[:3] - trace.low[:3])), 0.05 * self._size)
            self._tool.point_size = 0.06 * far
            x, y, z = middle.tolist()
            self._plot.camera = [x + far, y - 1.2 * far, z + 0.9 * far, x, y, z, 0, 0, 1]

    def place(self, position: Sequence[float]) -> None:
        """The tool is there."""
        self._tool.positions = np.array([position], dtype=np.float32)


def _pieces(points: np.ndarray) -> np.ndarray:
    """The straight pieces of polylines with gaps (nan rows): shape (n, 2, 3)."""
    if len(points) < 2:
        return np.zeros((0, 2, 3), np.float32)
    whole = ~(np.isnan(points[:-1, 0]) | np.isnan(points[1:, 0]))
    pairs = np.stack((points[:-1][whole], points[1:][whole]), axis=1)
    chosen: np.ndarray = pairs[:: len(pairs) // _MOST + 1].astype(np.float32)
    return chosen


def _box_lines(low: np.ndarray, high: np.ndarray) -> object:
    """The travel of all axes."""
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    edges = np.array(_EDGES, dtype=np.uint32)
    return k3d.lines(corners.astype(np.float32), edges, indices_type="segment", color=_FRAME, shader="simple")
