"""A live strip chart: lanes linked in time, ten times a second, paused, scrubbed, zoomed, measured by two cursors.

The chart is uPlot (MIT licence, in `static/`), in an anywidget. Rows are thinned to what a screen can show before
they leave the kernel, and sent as bytes; all that was recorded stays in the run's own files.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import anywidget
import numpy as np
import traitlets

from rds.core.colours import BLUE, QUANTITIES
from rds.core.types import Ending
from rds.panels.kit.row_stream import RowStream
from rds.panels.kit.static_files import static
from rds.results import Result

DASHES: tuple[list[int], ...] = ([], [9, 4], [3, 3], [9, 3, 3, 3])  # by axis, of several
_LANES = {"error": "error", "voltage": "voltage", "target": "target", "contour error": "contour error"}
_WEIGHTS = {"position": 1.8, "voltage": 0.9, "target": 0.9}  # how high a lane is, beside 1
_ORDER = ("position", "error", "contour error", "voltage", "target")  # of the lanes, from the top
MOST_GHOST = 5_000  # rows of an earlier run that are sent, at most twice as many


class StripChart(anywidget.AnyWidget):
    """`begin(traces)`, then `add(rows)` as they come: time (s) and one value per trace."""

    _esm = traitlets.Unicode().tag(sync=True)
    _style = traitlets.Unicode().tag(sync=True)
    traces: Any = traitlets.List([]).tag(sync=True)
    window = traitlets.Float(5.0).tag(sync=True)  # s that are shown
    height = traitlets.Int(430).tag(sync=True)  # px of all lanes together
    events: Any = traitlets.List([]).tag(sync=True)  # marks: {"time": s, "text": what happened, "fault": red?}
    ghost = traitlets.Unicode("").tag(sync=True)  # the name of an earlier run that stands behind; none: ""

    def __init__(self, **options: Any):
        chart = static(__file__, "uPlot.iife.min.js", "strip.js")
        super().__init__(_esm=chart, _style=static(__file__, "uPlot.min.css"), **options)
        self.stream = RowStream()
        self._ghost = np.empty((0, 1))
        self.on_msg(self._asked)

    def begin(self, traces: Sequence[tuple[str, str]]) -> None:
        """Empty, with these traces: (name, unit) each, in lanes by quantity and unit."""
        self.events = []
        self.traces = dressed(traces)
        self.stream = RowStream(len(traces))
        self.send({"kind": "clear"})

    def add(self, rows: np.ndarray) -> np.ndarray:
        """More rows, (n, 1 + traces); those that are shown."""
        chosen = self.stream.add(rows)
        if len(chosen):
            self._deliver(chosen)
        return chosen

    def stand_behind(self, rows: np.ndarray, name: str) -> None:
        """Draw an earlier run `name` behind: rows as of `add`, with nan for what it does not have. No rows: none."""
        self._ghost = rows[:: max(1, len(rows) // MOST_GHOST)]
        self.ghost = name if len(rows) else ""
        self._deliver_ghost()

    def _deliver(self, rows: np.ndarray) -> None:
        self.send({"kind": "rows", "width": rows.shape[1]}, [np.ascontiguousarray(rows, dtype="<f8").tobytes()])

    def _deliver_ghost(self) -> None:
        rows = np.ascontiguousarray(self._ghost, dtype="<f8")
        self.send({"kind": "ghost", "width": rows.shape[1]}, [rows.tobytes()])

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """A page just shown asks for everything so far; it may have missed what changed while it was loaded."""
        if content == {"kind": "all"}:
            self.send_state(["traces", "events", "ghost"])
            self.send({"kind": "clear"})
            if len(self.stream.rows):
                self._deliver(self.stream.rows)
            if len(self._ghost):
                self._deliver_ghost()


def end_marks(result: Result) -> list[dict[str, Any]]:
    """The mark where a run ended early, in red for a fault; none for one that came to its end."""
    ending = result.meta.get("ending")
    if ending in (None, Ending.DONE) or not len(result):
        return []
    return [{"time": float(result["time"][-1]), "text": str(ending), "fault": ending == Ending.FAULT}]


def dressed(traces: Sequence[tuple[str, str]]) -> list[dict[str, Any]]:
    """The traces as the page draws them: each quantity has its colour, each axis its dashes, each lane its height."""
    parts = [_parts(name) for name, _ in traces]
    axes = list(dict.fromkeys(axis for axis, _ in parts if axis))
    found = []
    for (name, unit), (axis, quantity) in zip(traces, parts, strict=True):
        lane = _LANES.get(quantity, "position" if quantity in QUANTITIES else quantity)
        dash = DASHES[axes.index(axis) % len(DASHES)] if len(axes) > 1 and axis else []
        found.append(
            {
                "name": name.replace("_", " "),
                "unit": unit,
                "lane": lane,
                "scale": f"{lane} [{unit}]",
                "rank": _ORDER.index(lane) if lane in _ORDER else len(_ORDER),
                "weight": _WEIGHTS.get(lane, 1.0),
                "color": QUANTITIES.get(quantity, BLUE),
                "width": 3.0 if quantity == "reference" else 1.6,
                "dash": [6, 4] if quantity == "modelled" and not dash else dash,
            }
        )
    return found


def _parts(name: str) -> tuple[str, str]:
    """The axis and the quantity of a column."""
    if name == "contour_error":
        return "", "contour error"
    axis, _, quantity = name.rpartition("_")
    return axis, quantity
