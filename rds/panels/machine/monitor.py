"""The bus as it goes: what is on it now, which can be paused and filtered, and what it must carry at worst."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rds.bus.tools.link import BUILTIN, bus_name, open_bus
from rds.bus.tools.monitor import View, monitor
from rds.bus.tools.statistics import BITRATE, Row, Statistics
from rds.core.errors import InputError
from rds.panels.session.task import Task

MOST = 200  # identifiers that are shown


@dataclass(frozen=True)
class Line:
    """An identifier as it is shown."""

    identifier: str
    name: str  # what the message is called, "" where nobody knows
    count: int
    rate: float  # frames/s of the last second; nan where there are too few
    load: float  # % of the bit rate
    data: str  # hexadecimal
    signals: str


class BusMonitor:
    """Watches a bus beside the page, listening only. `view` is what it saw last, while it is not paused."""

    def __init__(self) -> None:
        self.view: View | None = None
        self.paused = False
        self._stop = threading.Event()
        self._decode: Callable[..., Any] | None = None

    def watch(self, interface: str, channel: str | None, **options: Any) -> Callable[[Task[View]], View]:
        """Work for a Task: watch until `end`. Its errors are those of opening the bus; outages are in the view.

        `options` go to the interface as they are (bitrate, ...).
        """
        self._stop.clear()
        self.view, self.paused = None, False

        def work(task: Task[View]) -> View:
            from rds.bus.tools.decode import decoder

            self._decode = decoder()
            own: dict[str, Any] = {"error_frames": True} if interface == BUILTIN else {}

            def opener() -> Any:
                return open_bus(interface, channel, node="monitor", **options | own)

            with opener() as bus:
                bitrate = getattr(bus, "bitrate", 0) or BITRATE
            task.note = f"listening on {bus_name(interface, channel)}"
            statistics = Statistics(bitrate)
            name = bus_name(interface, channel)
            return monitor(opener, statistics, name=name, stop=self._stop, refresh=self._refresh)

        return work

    def end(self) -> None:
        """Stop watching."""
        self._stop.set()

    def _refresh(self, view: View) -> None:
        if not self.paused:
            self.view = view

    @property
    def headline(self) -> str:
        """State, load and rate in a sentence; why the bus fails, where it does."""
        view = self.view
        if view is None:
            return "nothing was heard yet"
        if not view.faults:
            return view.headline
        return f"{view.headline}; {view.faults[-1]}; check cable, power and bit rate"

    def lines(self, wanted: str = "") -> tuple[list[Line], int]:
        """The identifiers heard, those with the highest priority first: of a filter as `parse_filter` has it.

        At most MOST, and how many more there are.
        """
        if self.view is None or self._decode is None:
            return [], 0
        keep = parse_filter(wanted)
        rows = [row for row in self.view.snapshot.rows if row.rate != 0.0 or row.count]
        kept = [line for line in map(self._line, rows) if keep(int(line.identifier, 16), line.name)]
        return kept[:MOST], len(kept[MOST:])

    def _line(self, row: Row) -> Line:
        assert self._decode is not None
        decoded = self._decode(row.last)
        signals = ", ".join(f"{name} {value}" for name, value in decoded.signals.items()) if decoded else ""
        name = decoded.name if decoded else ""
        identifier = f"0x{row.key.identifier:0{8 if row.key.extended else 3}X}"
        return Line(identifier, name, row.count, row.rate, row.load, row.data.hex(" ").upper(), signals)


def parse_filter(text: str) -> Callable[[int, str], bool]:
    """A filter of identifiers and names: `0x020`, `0x020-0x07F`, or part of a name, several separated by commas.

    InputError for what cannot be a filter; empty text keeps everything.
    """
    tests = [_test(part) for each in text.split(",") if (part := each.strip())]
    return lambda identifier, name: not tests or any(test(identifier, name) for test in tests)


def _test(part: str) -> Callable[[int, str], bool]:
    if not part[0].isdigit():
        return lambda identifier, name: part.lower() in name.lower()
    first, dash, last = part.partition("-")
    try:
        low = int(first, 0)
        high = int(last, 0) if dash else low
    except ValueError:
        raise InputError(
            f"filter {part!r} must be an identifier, as in 0x020, a range, as in 0x020-0x07F, or part of a name"
        ) from None
    if low > high:
        raise InputError(f"filter {part!r} goes from a higher to a lower identifier; swap them")
    return lambda identifier, name: low <= identifier <= high
