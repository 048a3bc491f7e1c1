"""Watching a bus: statistics of what goes over it, its state and its failures. Views are elsewhere.

python-can's viewer and cantools' monitor work on the built-in bus as well; this one adds bus load, periods with their
jitter, error states, and what the modules' dialect says without a DBC file.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import can

from rds.bus.tools.decode import Decoder
from rds.bus.tools.receiver import Fault, Receiver
from rds.bus.tools.statistics import Row, Snapshot, Statistics, since

REFRESH = 0.25  # s
_RECENT = 1.0  # s over which the live view's rates and loads are taken


@dataclass(frozen=True)
class View:
    """What a monitor shows at one time."""

    snapshot: Snapshot
    bus: str  # its name
    bitrate: int  # bit/s
    state: str  # of the bus: active, passive, error, or closed during an outage
    lost: int = 0  # frames that came too fast to be counted
    faults: list[str] = field(default_factory=list)

    @property
    def healthy(self) -> bool:
        """Whether nothing went wrong while it watched."""
        return not (self.lost or self.faults)

    @property
    def headline(self) -> str:
        """State, load and rate in a line, and what is doubtful about them."""
        seen = self.snapshot
        text = (
            f"{self.bus}: {self.state}, load {seen.load:.1f} % of {self.bitrate / 1000:g} kbit/s, "
            f"{seen.rate:.0f} frames/s, {seen.frames} frames, {seen.errors} error frames"
        )
        if seen.impossible:
            text += f", {seen.impossible} that CAN doesn't have"
        if self.lost:
            text += f", {self.lost} not counted: they came too fast"
        if seen.load > 100.0:
            text += "; no real bus of this bit rate could carry this"
        return text


def monitor(
    open_bus: Callable[[], can.BusABC],
    statistics: Statistics,
    *,
    name: str = "bus",
    seconds: float | None = None,
    stop: threading.Event | None = None,
    refresh: Callable[[View], Any] | None = None,
) -> View:
    """Watch the bus until `stop` is set or `seconds` have passed, and return what was seen in all that time.

    `refresh` is called four times a second with rates and loads of the last second. A bus that fails is reported and
    opened again. Raises what `open_bus` raises at the start.
    """
    stop = stop or threading.Event()
    faults: list[str] = []

    def note(fault: Fault) -> None:
        faults.append(fault.text)

    receiver = Receiver(open_bus, note, name=name)
    queue = receiver.subscribe(name="the monitor")

    def view(snapshot: Snapshot) -> View:
        return View(snapshot, name, statistics.bitrate, _state(receiver.bus), queue.lost, list(faults))

    with receiver:
        began = time.monotonic()
        due = began + REFRESH
        recent: deque[Snapshot] = deque([statistics.snapshot(0.0)])
        while not (stop.is_set() or queue.ended):
            now = time.monotonic()
            if seconds is not None and now - began >= seconds:
                break
            if now >= due:
                due = now + REFRESH
                recent.append(statistics.snapshot(now - began))
                if len(recent) > 2 and recent[-1].seconds - recent[1].seconds >= _RECENT:
                    recent.popleft()
                if refresh is not None:
                    refresh(view(since(recent[-1], recent[0])))
            message = queue.get(max(0.0, due - time.monotonic()))
            if message is not None:
                statistics.add(message)
        return view(statistics.snapshot(time.monotonic() - began))


def _state(bus: can.BusABC | None) -> str:
    if bus is None:
        return "closed"
    try:
        return bus.state.name.lower()
    except (can.CanError, OSError, NotImplementedError):
        return "unknown"


def to_json(view: View, decode: Decoder) -> dict[str, Any]:
    """The view as plain values: rates in Hz, periods in ms, loads in %; None where there are too few frames."""
    snapshot = view.snapshot
    return {
        "bus": view.bus,
        "bitrate": view.bitrate,
        "state": view.state,
        "seconds": round(snapshot.seconds, 6),
        "frames": snapshot.frames,
        "rate_hz": _number(snapshot.rate),
        "load_percent": _number(snapshot.load),
        "error_frames": snapshot.errors,
        "last_error": describe_error(snapshot),
        "impossible_frames": snapshot.impossible,
        "lost": view.lost,
        "faults": view.faults,
        "identifiers": [_row(row, decode) for row in snapshot.rows],
    }


def describe_error(snapshot: Snapshot) -> str | None:
    """The last error frame in words, as SocketCAN and the built-in bus code them; None if there was none."""
    from rds.bus.medium.error_reports import describe

    message = snapshot.last_error
    return None if message is None else describe(message.arbitration_id, message.data)


def _row(row: Row, decode: Decoder) -> dict[str, Any]:
    decoded = decode(row.last)
    return {
        "identifier": f"0x{row.key.identifier:X}",
        "extended": row.key.extended,
        "remote": row.key.remote,
        "count": row.count,
        "rate_hz": _number(row.rate),
        "period_ms": _number(row.period * 1e3),
        "jitter_ms": _number(row.jitter * 1e3),
        "shortest_ms": _number(row.shortest * 1e3),
        "longest_ms": _number(row.longest * 1e3),
        "load_percent": _number(row.load),
        "data": row.data.hex(),
        "fd": row.last.is_fd,
        "name": decoded.name if decoded else None,
        "signals": decoded.signals if decoded else {},
    }


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if isfinite(value) else None
