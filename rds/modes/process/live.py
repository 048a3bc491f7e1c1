"""A run as others see it while it goes on: how far it is, its rows so far, its live values."""

from __future__ import annotations

import threading
from array import array
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.modes.loop.live_values import LiveValues
from rds.modes.loop.plan import Plan
from rds.modes.process.ring import Ring


class Live:
    """What a run that goes on shows. The run attaches its parts and takes them away at its end; nobody waits for it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ring: Ring | None = None
        self._recorded: array[float] | None = None
        self._width = 0
        self._taken = 0
        self._stopped = False
        self._hard = False
        self.columns: list[str] = []
        self.units: dict[str, str] = {}
        self.live_values: LiveValues | None = None
        self.attached = threading.Event()

    def attach(
        self,
        plan: Plan,
        live_values: LiveValues,
        columns: list[str],
        units: dict[str, str],
        *,
        ring: Ring | None = None,
        recorded: array[float] | None = None,
    ) -> AbstractContextManager[Any]:
        """Show a run whose rows go to `ring`, or are `recorded` in this process, until the context ends."""
        with self._lock:
            live_values.verify_with(plan.verify)
            self.live_values, self._ring, self._recorded = live_values, ring, recorded
            self.columns, self.units, self._width = columns, units, len(columns)
            stopped, hard = self._stopped, self._hard
        if stopped:
            self.stop(hard)
        self.attached.set()
        return _Attached(self)

    @property
    def taken(self) -> int:
        """Samples taken so far."""
        with self._lock:
            return self._count()

    def read(self, first: int = 0) -> tuple[int, np.ndarray]:
        """The rows from number `first` on (rows × columns), and the number of the first that is still there."""
        with self._lock:
            if self._ring is not None:
                first, data = self._ring.read(first)
                return first, np.frombuffer(data, dtype="<f8").reshape(-1, self._width)
            if self._recorded is not None:
                end = self._count()
                first = min(max(first, 0), end)
                part = self._recorded[first * self._width : end * self._width]
                return first, np.frombuffer(part).reshape(-1, self._width)
            return first, np.empty((0, self._width))

    def set_all(self, values: dict[str, float]) -> None:
        """Set live values; InputError if the run is over, has not begun, or will not have them."""
        self.with_live_values(lambda live_values: live_values.set_all(values))

    def with_live_values(self, act: Callable[[LiveValues], Any]) -> Any:
        """What `act` makes of the live values; InputError where there is none."""
        with self._lock:
            if self.live_values is None:
                when = "is over" if self.attached.is_set() else "has not begun yet: wait until it is ready"
                raise InputError(f"no live value can be read or set: the run {when}")
            return act(self.live_values)

    def stop(self, hard: bool = False) -> None:
        """Ask for the end: in the order of the run (a program comes to rest on its path), or `hard`, at once."""
        with self._lock:
            self._stopped, self._hard = True, self._hard or hard
            if hard and self._ring is not None:
                self._ring.ask_to_stop()
            elif self.live_values is not None:
                self.live_values.set("stop", 1.0)

    @property
    def was_stopped(self) -> bool:
        """Whether somebody has asked for the end."""
        return self._stopped

    @property
    def was_cut(self) -> bool:
        """Whether somebody has asked for the end at once."""
        return self._hard

    def _count(self) -> int:
        if self._ring is not None:
            self._taken = self._ring.head
        elif self._recorded is not None:
            self._taken = len(self._recorded) // self._width
        return self._taken

    def _detach(self) -> None:
        with self._lock:
            self._count()
            self.live_values = self._ring = self._recorded = None


class _Attached(nullcontext[None]):
    """Takes the parts of a run away at its end."""

    def __init__(self, live: Live):
        super().__init__()
        self._live = live

    def __exit__(self, *_: object) -> None:
        self._live._detach()
