"""The machine in motion as a widget: what it looks like goes to the page once, rows of a run as they come.

Our own, because `k3d`, which draws the paths of programs, is moved from the kernel; here the browser moves the
machine by itself, however busy the kernel is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import anywidget
import numpy as np
import traitlets

from rds.machines import Machine
from rds.panels.kit.row_stream import RowStream
from rds.panels.kit.static_files import static
from rds.panels.scene.bodies import scene_of

_PARTS = ("frames.js", "draw.js", "stock.js", "scene.js")


class MachineScene(anywidget.AnyWidget):
    """`begin(traces, live)`, then `add(rows)` as they come: time (s) and one value per trace.

    A run that goes on is shown as it comes (`live`), another one is played. Nothing is sent before somebody looks.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    scene: Any = traitlets.Dict().tag(sync=True)
    columns: Any = traitlets.List([]).tag(sync=True)  # of the rows, after the time
    live = traitlets.Bool(False).tag(sync=True)
    shows = traitlets.Bool(False).tag(sync=True)
    asked = traitlets.Bool(False).tag(sync=True)  # whether a page has seen what draws there
    stock: Any = traitlets.Dict().tag(sync=True)  # low, high ([x, y, z], mm, in the work's frame), cell, columns, rows
    tools: Any = traitlets.Dict().tag(sync=True)  # by number: radius, profile, length, rings; a row's column `tool`

    def __init__(self, machine: Machine, **options: Any):
        css = static(__file__, "scene.css")
        super().__init__(_esm=static(__file__, *_PARTS), _css=css, scene=scene_of(machine), **options)
        self._stream = RowStream()
        self._intended = np.empty(0, dtype="<f4")
        self.on_msg(self._asked)

    def begin(self, traces: Sequence[tuple[str, str]], live: bool, beside: RowStream | None = None) -> None:
        """Empty, with these traces: (name, unit) each. Where a strip shows the same rows, `beside` are that strip's."""
        self.live = live
        self.columns = [name for name, _ in traces]
        self._stream = RowStream(len(traces)) if beside is None else beside
        self.send({"kind": "clear"})

    def add(self, rows: np.ndarray) -> None:
        """More rows, (n, 1 + traces)."""
        self.show(self._stream.add(rows))

    def show(self, chosen: np.ndarray) -> None:
        """What the strip beside it was given, and has chosen."""
        if len(chosen) and self.shows:
            self._deliver(chosen)

    def lay(self, stock: dict[str, Any], heights: np.ndarray, tools: dict[str, Any]) -> None:
        """Stock, the heights over its cells that the part is meant to have (mm), and what cuts it; {}: no stock."""
        with self.hold_sync():
            self.tools, self.stock = tools, stock
        self._intended = np.ascontiguousarray(heights, dtype="<f4").ravel()
        if self.shows:
            self.send({"kind": "intended"}, [self._intended.tobytes()])

    def _deliver(self, rows: np.ndarray) -> None:
        self.send({"kind": "rows", "width": rows.shape[1]}, [np.ascontiguousarray(rows, dtype="<f8").tobytes()])

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """A page that begins to look asks for everything; it may have missed what changed while it was loaded."""
        if content == {"kind": "all"}:
            self.send_state(["live", "columns", "stock", "tools"])
            self.send({"kind": "clear"})
            if len(self._stream.rows):
                self._deliver(self._stream.rows)
            if len(self._intended):
                self.send({"kind": "intended"}, [self._intended.tobytes()])
