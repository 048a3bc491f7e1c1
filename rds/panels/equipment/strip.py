"""A live strip chart: some traces over the last seconds, ten times a second, which can be paused and scrubbed back.

The chart is uPlot (MIT licence, in `static/`), in an anywidget. Rows are thinned to what a screen can show before
they leave the kernel, and sent as bytes; all that was recorded stays in the run's own files.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import anywidget
import numpy as np
import traitlets

_STATIC = Path(__file__).parent / "static"
# Okabe and Ito's colours, which the colour-blind can tell apart, without the yellow that a projector swallows
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
RATE = 100.0  # rows a second that are sent
KEPT = 200_000  # rows kept for a page that is shown again


@cache
def _module() -> str:
    chart = (_STATIC / "uPlot.iife.min.js").read_text(encoding="utf-8")
    return chart + "\n" + (_STATIC / "strip.js").read_text(encoding="utf-8")


class StripChart(anywidget.AnyWidget):
    """`begin(traces)`, then `add(rows)` as they come: time (s) and one value per trace."""

    _esm = traitlets.Unicode().tag(sync=True)
    _style = traitlets.Unicode().tag(sync=True)
    traces: Any = traitlets.List([]).tag(sync=True)
    window = traitlets.Float(5.0).tag(sync=True)  # s that are shown
    height = traitlets.Int(260).tag(sync=True)  # px
    tells = traitlets.Bool(False).tag(sync=True)  # whether the page says in `shown` which time it shows
    shown = traitlets.Float(0.0).tag(sync=True)  # s, the right edge

    def __init__(self, **options: Any):
        super().__init__(_esm=_module(), _style=(_STATIC / "uPlot.min.css").read_text(encoding="utf-8"), **options)
        self._rows = np.empty((0, 1))
        self._next = -np.inf
        self.on_msg(self._asked)

    def begin(self, traces: Sequence[tuple[str, str]]) -> None:
        """Empty, with these traces: (name, unit) each. Traces of a unit share an axis, but errors have their own."""
        self.traces = [
            {
                "name": name.replace("_", " "),
                "unit": unit,
                "scale": f"{unit} of error" if name.endswith("_error") else unit,
                "color": COLORS[i % len(COLORS)],
                "dash": [6, 4] if i == 0 else [],
            }
            for i, (name, unit) in enumerate(traces)
        ]
        self._rows = np.empty((0, len(traces) + 1))
        self._next = -np.inf
        self.send({"kind": "clear"})

    def add(self, rows: np.ndarray) -> None:
        """More rows, (n, 1 + traces); those that come faster than RATE are thinned."""
        chosen = self._thinned(np.asarray(rows, dtype=float))
        if len(chosen):
            self._rows = np.concatenate((self._rows, chosen))[-KEPT:]
            self._deliver(chosen)

    def at(self, time: float) -> np.ndarray:
        """The row that was sent last before `time` (s); empty where there is none."""
        index = int(np.searchsorted(self._rows[:, 0], time + 1e-9)) - 1
        return self._rows[index] if index >= 0 else np.empty(0)

    def _thinned(self, rows: np.ndarray) -> np.ndarray:
        keep = []
        for index, time in enumerate(rows[:, 0]):
            if time >= self._next - 1e-9:
                keep.append(index)
                self._next = time + 1.0 / RATE
        return rows[keep]

    def _deliver(self, rows: np.ndarray) -> None:
        self.send({"kind": "rows", "width": rows.shape[1]}, [np.ascontiguousarray(rows, dtype="<f8").tobytes()])

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """A page that has just been shown asks for everything so far."""
        if content == {"kind": "all"}:
            self.send({"kind": "clear"})
            if len(self._rows):
                self._deliver(self._rows)
