"""Rows of a run on their way to the page: thinned to what a screen can show, and kept for a page shown again."""

from __future__ import annotations

import numpy as np

RATE = 100.0  # rows a second that are sent
KEPT = 200_000  # rows kept for a page that is shown again


class RowStream:
    """`add(rows)` gives those that are to be sent; `rows` are all of them. Rows: time (s) and one value per trace."""

    def __init__(self, traces: int = 0):
        self.rows = np.empty((0, traces + 1))
        self._next = -np.inf

    def add(self, rows: np.ndarray) -> np.ndarray:
        """Those that come faster than RATE are left out."""
        rows = np.asarray(rows, dtype=float)
        keep = []
        for index, time in enumerate(rows[:, 0].tolist()):
            if time >= self._next - 1e-9:
                keep.append(index)
                self._next = time + 1.0 / RATE
        chosen: np.ndarray = rows[keep]
        if len(chosen):
            self.rows = np.concatenate((self.rows, chosen))[-KEPT:]
        return chosen
