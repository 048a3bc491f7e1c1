"""Four modules on the bus with bit timing: 1 Mbit/s, 1 kHz, beside cyclictest in the same run.

A cycle is what a control loop does: from before the command is sent until the fourth answer has been read, by the
drivers that implementation uses, with the modules and the hub in processes of their own. Its wire time is that of the
five frames with the interframe spaces between them, from their exact bits. Each missed cycle (not all four answers
within the period) is put down to

- the bus, if error frames or frames of others were on it;
- the host, if this process was woken late: at the tick, or when the fourth answer had long been on the bus (its stamp);
- the system, otherwise: hub or modules, which have real-time priority and less than 0.3 ms of work in a cycle, were
  not run in time.

Run by `python -m benchmarks timed-bus`, or `python -m benchmarks.timed_bus [SECONDS]`.
"""

from __future__ import annotations

import gc
import subprocess
import sys
import time
from array import array
from collections import Counter
from dataclasses import dataclass, field
from typing import Any
from uuid import uuid4

import can

from benchmarks.cyclictest import Cyclictest
from benchmarks.figures import TITLES, Figure
from rds.bus.hub.builtin import BuiltinBus
from rds.bus.hub.faults import Faults
from rds.bus.medium.bits import frame_time
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.cli.console import show_table
from rds.core.clock import LatePolicy, RealTimeClock
from rds.core.errors import MachineError
from rds.core.scheduling import lock_memory, raise_priority
from rds.machines import load_machine

BITRATE = 1_000_000  # bit/s
PERIOD = 1_000_000  # ns
FRAMES = 5  # in a cycle
RATIO = 1.25  # most, of the median cycle to its wire time
LATE = 100_000  # ns by which a process that was woken is late
_INTERFRAME = 3 * 1_000_000_000 // BITRATE  # ns


class NotingBus(BuiltinBus):
    """A node that keeps the stamp and wire time of what it receives and sends, ns."""

    def __init__(self, **options: Any):
        super().__init__(**options)
        self.shift = time.monotonic_ns() - time.time_ns()  # of stamps, to the clock of this process
        self.clear()

    def clear(self) -> None:
        """Begin a cycle."""
        self.last = self.frames = self.wire = 0

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """As always."""
        message = super().recv(timeout)
        if message is not None:
            self.last = round(message.timestamp * 1e9) + self.shift
            self._add(message)
        return message

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """As always."""
        super().send(msg, timeout)
        self._add(msg)

    def _add(self, message: can.Message) -> None:
        self.frames += 1
        self.wire += frame_time(message.arbitration_id, bytes(message.data), bitrate=BITRATE)


@dataclass
class Cycles:
    """What was measured; ns."""

    times: array[float] = field(default_factory=lambda: array("d"))
    wire: array[float] = field(default_factory=lambda: array("d"))
    missed: Counter[str] = field(default_factory=Counter)
    skipped: int = 0  # periods that passed while the loop was late, or the machine was started again
    lost: int = 0  # times that the machine had not answered for ten periods, and was started again
    hub: dict[str, Any] = field(default_factory=dict)


def measure(seconds: float) -> Cycles:
    """Drive the four axes of the mini CNC for so long."""
    machine, channel = load_machine("mini-cnc"), uuid4().hex[:16]
    command = [sys.executable, "-m", "rds.bus.modules.rds.server", "mini-cnc", "--channel", channel]
    command += ["--option", f"bitrate={BITRATE}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        assert server.stdout is not None
        server.stdout.readline()
        raise_priority(80)
        lock_memory()
        filters = [{"can_id": 0x20, "can_mask": 0x7E0, "extended": False}]
        with NotingBus(channel=channel, can_filters=filters, name="host") as bus, Faults(channel) as line:
            drivers = AxisDrivers(machine, bus=bus)
            drivers.start()
            try:
                return _cycles(drivers, bus, line, round(seconds * 1e9 / PERIOD))
            finally:
                drivers.close()
                server.terminate()


def _cycles(drivers: AxisDrivers, bus: NotingBus, line: Faults, count: int) -> Cycles:
    found = Cycles()
    clock = RealTimeClock(PERIOD, LatePolicy(discard=True))
    missing = drivers.counters.missing
    suspects: list[tuple[int, int]] = []  # how late the tick, and the reading of the last answer was
    gc.collect()
    gc.disable()
    line.statistics(reset=True)
    clock.start()
    k = 0
    while k < count:
        taken = clock.wait(k)
        found.skipped += taken - k
        k = taken
        begin = time.monotonic_ns()
        late = clock.lateness(k, clock.now())
        bus.clear()
        try:
            drivers.exchange()
        except MachineError:  # ten periods in a row
            found.lost += 1
            drivers.start()
            missing = drivers.counters.missing
            continue
        end = time.monotonic_ns()
        push = 5.0 if k % 1000 < 500 else -5.0
        drivers.write([push, -push, push / 2, 3.0])
        if drivers.counters.missing == missing and end - begin <= PERIOD:
            found.times.append(end - begin)
            found.wire.append(bus.wire + _INTERFRAME * (bus.frames - 1))
        else:
            suspects.append((late, end - bus.last if bus.frames == FRAMES else 0))
        missing = drivers.counters.missing
        k += 1
    gc.enable()
    time.sleep(0.01)
    found.hub = line.statistics()
    ours = {"host", *load_machine("mini-cnc").axes}
    strange = found.hub["error_frames"] or any(node["frames"] for node in line.nodes() if node["name"] not in ours)
    for late, unread in suspects:
        found.missed["bus" if strange else "host" if late > LATE or unread > LATE else "system"] += 1
    return found


def run(seconds: float = 60.0) -> list[Figure]:
    """The figures of one run."""
    cyclictest = Cyclictest()
    cyclictest.start()
    try:
        found = measure(seconds)
    finally:
        theirs = cyclictest.stop()
    times, wire = sorted(found.times), sorted(found.wire)
    ratios = sorted(time / its for time, its in zip(found.times, found.wire, strict=True))
    missed = sum(found.missed.values())
    figures = [
        Figure("wire time of a cycle, median", "µs", (_at(wire, 0.5) / 1e3,)),
        Figure("cycle p50", "µs", (_at(times, 0.5) / 1e3,)),
        Figure("cycle p99", "µs", (_at(times, 0.99) / 1e3,)),
        Figure("cycle / its wire time, p50", "×", (_at(ratios, 0.5),), limit=RATIO),
        Figure("cycle / its wire time, p99", "×", (_at(ratios, 0.99),)),
        Figure("missed cycles", f"of {round(seconds * 1e9 / PERIOD)}", (float(missed),)),
        *(Figure(f"missed by the {who}", "", (float(found.missed[who]),)) for who in ("bus", "host", "system")),
        Figure("periods skipped after a late cycle", "", (float(found.skipped),)),
        Figure("machine lost and started again", "times", (float(found.lost),)),
        Figure("bus load", "%", (100 * found.hub["load"],)),
    ]
    for name, title in (("delivery_lateness", "hub: end of frame to hand-over"), ("pickup_lateness", "hub: pick-up")):
        figures += [Figure(f"{title} {part}", "µs", (found.hub[name][part],)) for part in ("p50", "p99", "max")]
    if cyclictest.obstacle:
        return [*figures, Figure("cyclictest", note=cyclictest.obstacle)]
    return [*figures, *(Figure(f"cyclictest {part}", "µs", (theirs[part],)) for part in ("p50", "p99", "max"))]


def _at(values: list[float], part: float) -> float:
    return values[min(len(values) - 1, int(part * len(values)))] if values else float("nan")


def main() -> int:
    """Print the table. Exit code 1 if the target was not met."""
    figures = run(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
    show_table("Four modules, 1 Mbit/s, 1 kHz", TITLES, [figure.cells() for figure in figures])
    return 1 if any(figure.met is False for figure in figures) else 0


if __name__ == "__main__":
    sys.exit(main())
