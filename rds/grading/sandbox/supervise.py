"""One thread that watches all cells of a pool from outside, and ends those that exceed a limit.

A cell cannot argue with it: it reads /proc, and it kills the cell's init, with which the kernel ends all its processes.
"""

from __future__ import annotations

import select
import threading
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rds.grading.sandbox.cell import Cell

PERIOD = 0.02  # s between two looks


class Supervisor:
    """Watches cells from `watch` until `forget`."""

    def __init__(self) -> None:
        self._cells: dict[int, Cell] = {}
        self._poll = select.poll()
        self._lock = threading.Lock()
        self._is_needed = threading.Event()
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name="rds-sandbox-supervisor", daemon=True)
        self._thread.start()

    def watch(self, cell: Cell) -> None:
        """From now on `cell` keeps its limits."""
        with self._lock:
            self._cells[cell.output.descriptor] = cell
            self._poll.register(cell.output.descriptor, select.POLLIN)
        self._is_needed.set()

    def drain(self, cell: Cell) -> None:
        """Read what `cell` has printed so far."""
        with self._lock:
            if cell.output.descriptor in self._cells:
                cell.take_output()

    def forget(self, cell: Cell) -> None:
        """`cell` has ended, and what it printed has been read."""
        with self._lock:
            if self._cells.pop(cell.output.descriptor, None) is not None:
                self._silence(cell)
            if not self._cells:
                self._is_needed.clear()

    def close(self) -> None:
        """End the thread."""
        self._is_closed = True
        self._is_needed.set()
        self._thread.join()

    def _run(self) -> None:
        last = time.monotonic()
        while not self._is_closed:
            if not self._is_needed.wait(1.0):
                last = time.monotonic()
                continue
            self._read(int(PERIOD * 1000))
            now = time.monotonic()
            if now - last < PERIOD:
                continue
            with self._lock:
                cells = list(self._cells.values())
            for cell in cells:
                cell.inspect(now - last)
            last = now

    def _read(self, milliseconds: int) -> None:
        for descriptor, _ in self._poll.poll(milliseconds):
            with self._lock:
                cell = self._cells.get(descriptor)
                if cell is not None and not cell.take_output():
                    self._silence(cell)

    def _silence(self, cell: Cell) -> None:
        try:
            self._poll.unregister(cell.output.descriptor)
        except KeyError:
            return  # it had been silent before
