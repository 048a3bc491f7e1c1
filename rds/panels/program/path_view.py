"""The path of a part program on the page: from three sides, with travel limits, what is beyond them, and the tool."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import anywidget
import numpy as np
import traitlets

from rds.machines import Machine
from rds.nc.trace import CURVED, RAPID, STRAIGHT, Trace
from rds.nc.validate import TOLERANCE
from rds.panels.kit.static_files import static

_MOST = 40_000  # points that are sent; more are left out evenly, which no screen shows
_CROSSES = 60
_SIDES = ("XY", "ZX", "YZ")  # what is seen first: the first whose axes the machine has


class PathView(anywidget.AnyWidget):
    """`show(trace)` draws a program; `tool` is where the tool is, machine coordinates in mm; empty: nowhere."""

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    side = traitlets.Unicode("XY").tag(sync=True)
    travel: Any = traitlets.List([]).tag(sync=True)
    low: Any = traitlets.List([]).tag(sync=True)
    high: Any = traitlets.List([]).tag(sync=True)
    ends: Any = traitlets.List([]).tag(sync=True)
    tool: Any = traitlets.List([]).tag(sync=True)
    sentence = traitlets.Unicode("no program").tag(sync=True)
    height = traitlets.Int(330).tag(sync=True)  # px

    def __init__(self, machine: Machine, **options: Any):
        seen = next((side for side in _SIDES if set(side) <= set(machine.axes)), _SIDES[0])  # a lathe has no Y
        script, style = static(__file__, "path_view.js"), static(__file__, "path_view.css")
        super().__init__(_esm=script, _css=style, **{"side": seen, **options})
        self._box = travel_of(machine)
        self.travel = self._box.tolist()
        self._points = [np.zeros((0, 3))] * 3
        self._beyond = np.zeros((0, 3))
        self.on_msg(self._asked)

    def show(self, trace: Trace, sentence: str = "") -> None:
        """Draw the path of a program, and say in a sentence what there is to see."""
        points = trace.points
        self._points = [_thinned(points[kind]) for kind in (RAPID, STRAIGHT, CURVED)]
        everything = np.concatenate(list(points.values()))
        outside = everything[
            np.any((everything < self._box[:, 0] - TOLERANCE) | (everything > self._box[:, 1] + TOLERANCE), axis=1)
        ]
        self._beyond = outside[:: max(1, len(outside) // _CROSSES)]
        moves = bool(np.all(np.isfinite(trace.low[:3])))
        self.low, self.high = (trace.low[:3].tolist(), trace.high[:3].tolist()) if moves else ([], [])
        self.ends = [trace.start.tolist(), trace.end.tolist()] if moves else []
        self.sentence = sentence
        self._deliver()

    def place(self, position: Sequence[float]) -> None:
        """Show the tool there: X, Y, Z in machine coordinates, mm."""
        self.tool = [float(value) for value in position]

    def _deliver(self) -> None:
        tables = [*self._points, self._beyond]
        self.send({"kind": "points"}, [np.ascontiguousarray(table, dtype="<f4").tobytes() for table in tables])

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        if content == {"kind": "all"}:
            self.send_state(["low", "high", "ends", "tool", "sentence"])
            self._deliver()


def travel_of(machine: Machine) -> np.ndarray:
    """Travel of X, Y and Z (3 × 2, mm); an axis that the machine does not have stays at 0."""
    return np.array([machine.axes[name].travel if name in machine.axes else (0.0, 0.0) for name in "XYZ"])


def _thinned(points: np.ndarray) -> np.ndarray:
    """No more than can be seen; gaps between polylines stay."""
    step = len(points) // _MOST + 1
    if step == 1:
        return points
    keep = np.isnan(points[:, 0])
    keep[::step] = True
    keep[1:] |= keep[:-1] & np.isnan(points[:-1, 0])  # a polyline's first point
    chosen: np.ndarray = points[keep]
    return chosen
