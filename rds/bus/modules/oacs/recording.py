"""Recorded motions and readings of a module, as results. Time is k period, by the count that each message carries."""

from __future__ import annotations

from typing import Any

import numpy as np

from rds.bus.modules.oacs.codes import MessageToHost
from rds.bus.modules.oacs.messaging import ReceivedMessage
from rds.bus.modules.oacs.transfer import ModuleDescription
from rds.core.errors import MachineError
from rds.results import Result


class _Unwrapper:
    """Sample numbers from a count that starts again at `turn`."""

    def __init__(self, turn: int, first: int | None = None):
        self._turn = turn
        self._first = first  # None: the first one heard
        self._last = 0

    def number(self, count: int) -> int:
        if self._first is None:
            self._first = count
        step = (count - self._first - self._last) % self._turn
        self._last += step
        return self._last


_SETTLED_COUNTS = 2  # by which a position that has settled may still change: an encoder between two counts
_SETTLED_SHARE = 0.002  # or this share of the step, where that is more


class PositionRecorder:
    """The positions of one motion: a step of the set point by `by` (unit)."""

    def __init__(self, description: ModuleDescription, period: float, by: float):
        self._d = description
        self._period = period
        self._by = by
        self._numbers = _Unwrapper(256, 0)  # a motion's positions count from 0
        self.samples: dict[int, int] = {}  # number: counts
        self._far = max(1, round(abs(by) * description.counts_per_unit))  # counts
        self._band = max(_SETTLED_COUNTS, _SETTLED_SHARE * self._far)  # counts
        self._first: int | None = None
        self._level = 0  # counts: what the position has stayed near...
        self._since = 0  # ...from this sample on
        self._last = (0, 0)  # sample, counts
        self._moved = False

    @property
    def first(self) -> int:
        """Where the axis stood at the step, counts; 0 before the first position has come."""
        return self._first or 0

    @property
    def way(self) -> tuple[int, int]:
        """How far the axis is from where it began, and how far it has to go; counts."""
        gone = 0 if self._first is None else abs(self._last[1] - self._first)
        return min(gone, self._far), self._far

    @property
    def still(self) -> float:
        """For how long the position has stayed within 2 counts or 0.2 % of the step, s; 0 until it has moved."""
        return (self._last[0] - self._since) * self._period if self._moved else 0.0

    def take(self, heard: ReceivedMessage) -> None:
        """A message of the module."""
        fields = heard.message.fields
        if heard.message.kind == "Reply" and fields["Code"] == MessageToHost.POSITION:
            self._keep(self._numbers.number(fields["Sequence"]), fields["Position"])

    def _keep(self, number: int, counts: int) -> None:
        self.samples[number] = counts
        self._last = number, counts
        if self._first is None:
            self._first = self._level = counts
        if abs(counts - self._level) > self._band:
            self._level, self._since, self._moved = counts, number, True

    def result(self, machine: str, notes: list[str]) -> Result:
        """The response. MachineError if there are too few samples."""
        if len(self.samples) < 2:
            raise MachineError(f"{machine} sent {len(self.samples)} positions; a response needs two at least")
        name, unit = self._d.axis, self._d.unit
        numbers = np.array(sorted(self.samples))
        measured = np.array([self.samples[k] for k in numbers.tolist()]) * self._d.resolution
        columns = {
            "time": numbers * self._period,
            f"{name}_reference": np.full(len(numbers), measured[0] + self._by),
            f"{name}_measured": measured,
        }
        units = {f"{name}_reference": unit, f"{name}_measured": unit}
        meta = _meta(name, machine, self._period, numbers, "step response of a module")
        return Result(columns, units, meta | {"notes": [*meta["notes"], *notes]})


class ReadingsRecorder:
    """Acceleration and current."""

    def __init__(self, description: ModuleDescription, period: float):
        self._d = description
        self._period = period
        self._numbers = _Unwrapper(1 << 16)
        self._rows: dict[int, dict[str, float]] = {}

    @property
    def span(self) -> float:
        """Time recorded so far, s."""
        return (max(self._rows, default=0) - min(self._rows, default=0)) * self._period

    def take(self, heard: ReceivedMessage) -> None:
        """A message of the module."""
        kind, fields = heard.message.kind, heard.message.fields
        if kind == "Acceleration":
            row = self._rows.setdefault(self._numbers.number(fields["AccelerationCount"]), {})
            row |= {f"acceleration_{axis}": fields[f"Acceleration{axis.upper()}"] for axis in "xyz"}
        elif kind == "Current":
            row = self._rows.setdefault(self._numbers.number(fields["CurrentCount"]), {})
            row["current"] = fields["Current"]

    def result(self, machine: str) -> Result:
        """The readings. MachineError if there are too few."""
        names = sorted({name for row in self._rows.values() for name in row})
        whole = {k: row for k, row in sorted(self._rows.items()) if len(row) == len(names)}
        if len(whole) < 2:
            raise MachineError(f"{machine} sent {len(whole)} readings; a record needs two at least")
        numbers = np.array(list(whole))
        letter = self._d.axis
        columns = {f"{letter}_{name}": np.array([row[name] for row in whole.values()]) for name in names}
        units = {column: "A" if column.endswith("current") else "g" for column in columns}
        meta = _meta(letter, machine, self._period, numbers, "readings of a module")
        return Result({"time": numbers * self._period} | columns, units, meta)


def _meta(axis: str, machine: str, period: float, numbers: np.ndarray, mode: str) -> dict[str, Any]:
    lost = int(numbers[-1] - numbers[0]) + 1 - len(numbers)
    notes = [f"{lost} of the module's messages were lost; their samples are missing"] if lost else []
    return {"axes": [axis], "sample_period": period, "mode": mode, "machine": machine, "notes": notes}
