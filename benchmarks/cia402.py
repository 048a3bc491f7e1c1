"""One CiA 402 drive at 1 kHz and three at 500 Hz: our cyclic loop beside the canopen library's, in one run.

A cycle is from the start of sending to the last drive's position at hand. The drives are a process of their own. A
cycle is missed when not all positions came within its period; the reason is `system` where the machine woke the loop
more than half a period late in it or in the one before, `host` where sending alone took more than half a period,
otherwise `bus` (the hub, or the drives' process). The library's way: RPDOs by `transmit()`, SYNC by
`network.sync.transmit()`, TPDOs by `wait_for_reception()`, which is what its documentation shows.

Columns: wire time at most at 1 Mbit/s, cycle (median, 99th percentile, longest), lateness (99th percentile).

`python -m benchmarks.cia402 [--seconds 20] [--bitrate 1000000]`; without a bit rate, the bus is untimed.
"""

from __future__ import annotations

import argparse
import gc
import platform
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from importlib.metadata import version
from uuid import uuid4

import can
import canopen
from rich.console import Console
from rich.table import Table

from rds.bus.cia402.configure import prepare
from rds.bus.cia402.host import Cia402Drivers
from rds.bus.cia402.settings import read_settings
from rds.machines import load_machine
from rds.runtime.scheduling import raise_priority

MACHINE = "mini-cnc"
Cycle = Callable[[], tuple[int, bool]]  # -> (instant at which all is sent in ns, whether all positions came)


def wire_time(drives: int) -> int:
    """At most so many µs on a bus of 1 Mbit/s: per drive an RPDO of 4 and a TPDO of 6 bytes, and SYNC (55+10n bits)."""
    return 55 + drives * (95 + 115)


def keep(period: float, seconds: float, cycle: Cycle) -> tuple[list[int], list[int], Counter[str]]:
    """Run `cycle` every `period` s; return cycle times and latenesses in ns, and the missed cycles by reason."""
    step, times, late, missed = round(period * 1e9), [], [], Counter[str]()
    due = time.monotonic_ns() + step
    previous = 0
    for _ in range(round(seconds / period)):
        time.sleep(max(0, due - time.monotonic_ns()) * 1e-9)
        started = time.monotonic_ns()
        sent, complete = cycle()
        ended = time.monotonic_ns()
        lateness = started - due
        times.append(ended - started)
        late.append(lateness)
        if not complete or ended - started > step:
            if max(lateness, previous) > step // 2:
                missed["system"] += 1
            else:
                missed["host" if sent - started > step // 2 else "bus"] += 1
        previous = lateness
        due += step
        if due < ended:  # a backlog is not worked off
            due = ended - ended % step + step
    return times, late, missed


def ours(channel: str, axes: Sequence[str], period: float, seconds: float) -> tuple:
    """Cia402Drivers in mode cst at zero volts."""
    machine = load_machine(MACHINE)
    drivers = Cia402Drivers(machine, axes, channel=channel, sample_period=period)
    zero = [0.0] * len(axes)
    try:
        drivers.start()

        def cycle() -> tuple[int, bool]:
            before = drivers.counters.missing
            drivers.write(zero)
            sent = time.monotonic_ns()
            drivers.exchange()
            return sent, drivers.counters.missing == before

        return keep(period, seconds, cycle)
    finally:
        drivers.close()


def library(channel: str, axes: Sequence[str], period: float, seconds: float) -> tuple:
    """The same cycle through canopen, with its receiving thread."""
    machine = load_machine(MACHINE)
    settings = read_settings({"rpdo_transmission": 1}, machine, axes)
    network = canopen.Network(can.Bus(interface="rds", channel=channel, ignore_config=True))
    network.connect()
    try:
        prepare(network, settings, period)
        nodes = [network[drive.node] for drive in settings.drives]
        for node in nodes:
            node.tpdo[1].subscribe()

        def cycle() -> tuple[int, bool]:
            stamps = [node.tpdo[1].timestamp for node in nodes]
            for node in nodes:
                node.rpdo[1]["Target torque"].raw = 0
                node.rpdo[1].transmit()
            network.sync.transmit()
            sent = time.monotonic_ns()
            for node, stamp in zip(nodes, stamps, strict=True):
                pdo = node.tpdo[1]
                with pdo.receive_condition:
                    if pdo.timestamp == stamp and not pdo.receive_condition.wait(period):
                        return sent, False
            return sent, True

        return keep(period, seconds, cycle)
    finally:
        network.disconnect()


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--bitrate", type=int, default=None, help="bit/s of the built-in bus (default: untimed)")
    options = parser.parse_args(arguments)
    console = Console()
    priority = raise_priority(80)
    cases = [(["X"], 0.001), (["X", "Y", "Z"], 0.002)]
    rate = f"{options.bitrate} bit/s" if options.bitrate else "untimed"
    table = Table(title=f"CiA 402 cycles in µs, built-in bus ({rate}), {options.seconds:g} s each, {priority}")
    for column in ("drives", "ms", "loop", "wire", "median", "p99", "max", "late", "missed, why"):
        table.add_column(column, justify="left" if column in ("loop", "missed, why") else "right")
    for axes, period in cases:
        for name, loop in (("ours", ours), ("canopen", library)):
            channel = f"bench-{uuid4().hex[:8]}"
            where = ["--channel", channel, "--axes", ",".join(axes)]
            if options.bitrate:
                where += ["--option", f"bitrate={options.bitrate}"]
            server = subprocess.Popen(
                [sys.executable, "-m", "rds.bus.cia402.server", MACHINE, *where, "--exit-with-stdin"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            try:
                assert server.stdout is not None and server.stdout.readline().startswith(b"ready")
                gc.collect()
                gc.freeze()
                times, late, missed = loop(channel, axes, period, options.seconds)
            finally:
                server.terminate()
                server.wait()
            times, late = sorted(times), sorted(late)
            table.add_row(
                str(len(axes)),
                f"{period * 1e3:g}",
                name,
                f"{wire_time(len(axes))}",
                f"{times[len(times) // 2] / 1e3:.0f}",
                f"{times[len(times) * 99 // 100] / 1e3:.0f}",
                f"{times[-1] / 1e3:.0f}",
                f"{late[len(late) * 99 // 100] / 1e3:.0f}",
                f"{sum(missed.values())} of {len(times)}"
                + "".join(f", {reason} {count}" for reason, count in missed.items()),
            )
    console.print(table)
    console.print(
        f"Python {platform.python_version()}, python-can {version('python-can')}, canopen {version('canopen')}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
