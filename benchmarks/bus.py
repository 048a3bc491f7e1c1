"""The built-in bus between two processes, beside python-can's `virtual` between two threads, in one run.

One-way latency: a frame each millisecond, from before send() to after recv(). Frames a second: offered as fast as
send() takes them, until the last has been received; nothing may be lost or reordered, which is asserted. A control
cycle: a tick to the four modules of the mini CNC in a process of their own, and their answers.

Run by `make bench`, or `python -m benchmarks.bus`.
"""

from __future__ import annotations

import argparse
import gc
import importlib.metadata
import multiprocessing
import platform
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any
from uuid import uuid4

import can
from rich.console import Console
from rich.table import Table

from rds.bus.modules.rds.drivers import AxisDrivers
from rds.core.scheduling import raise_priority
from rds.machines import load_machine

PERIOD = 0.001  # s
LATENCY_ID, BURST_ID = 1, 2


def frame(identifier: int, number: int) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=number.to_bytes(8, "little"))


def receive(interface: str, channel: str, samples: int, burst: int, ready: Any, result: Any, priority: int) -> None:
    """Take `samples` frames stamped by the sender, then `burst` numbered ones; put the delays in ns, and the end."""
    if priority:
        raise_priority(priority)
    delays = []
    with can.Bus(interface=interface, channel=channel, ignore_config=True) as bus:
        ready.set()
        while len(delays) < samples:
            message = bus.recv(10.0)
            now = time.monotonic_ns()
            assert message is not None and message.arbitration_id == LATENCY_ID, "a frame was lost"
            delays.append(now - int.from_bytes(message.data, "little"))
        for number in range(burst):
            message = bus.recv(10.0)
            assert message is not None, f"only {number} of {burst} frames came"
            got = int.from_bytes(message.data, "little")
            assert message.arbitration_id == BURST_ID and got == number, f"frame {got} came in place of {number}"
        result.put((delays, time.monotonic_ns()))


def send(interface: str, channel: str, samples: int, burst: int, ready: Any) -> int:
    """The other end; returns when the burst began, ns."""
    with can.Bus(interface=interface, channel=channel, ignore_config=True) as bus:
        ready.wait()
        due = time.monotonic()
        for _ in range(samples):
            due += PERIOD
            time.sleep(max(0.0, due - time.monotonic()))
            bus.send(frame(LATENCY_ID, time.monotonic_ns()))
        time.sleep(0.05)
        begin = time.monotonic_ns()
        for number in range(burst):
            bus.send(frame(BURST_ID, number))
    return begin


def measure(
    interface: str, make_receiver: Callable[..., Any], parts: Any, samples: int, burst: int
) -> dict[str, float]:
    """Latency p50 and p99 in µs and frames a second of an interface."""
    channel = uuid4().hex[:16]
    ready, result, priority = parts.Event(), parts.Queue(), 0 if interface == "virtual" else 50
    receiver = make_receiver(target=receive, args=(interface, channel, samples, burst, ready, result, priority))
    receiver.start()
    begin = send(interface, channel, samples, burst, ready)
    delays, end = result.get(timeout=60)
    receiver.join()
    delays.sort()
    return {
        "latency p50, µs": delays[len(delays) // 2] / 1e3,
        "latency p99, µs": delays[len(delays) * 99 // 100] / 1e3,
        "frames a second": burst / ((end - begin) * 1e-9),
    }


class Threads:
    """The parts of `multiprocessing` that measure() needs, between threads."""

    Event = threading.Event

    @staticmethod
    def Queue() -> Any:
        import queue

        return queue.Queue()


def control_cycle(cycles: int) -> dict[str, float]:
    """exchange() with four modules served by another process at 1 kHz, µs."""
    machine, channel = load_machine("mini-cnc"), uuid4().hex[:16]
    command = [sys.executable, "-m", "rds.bus.modules.rds.server", "mini-cnc", "--channel", channel]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        assert server.stdout is not None
        server.stdout.readline()
        drivers = AxisDrivers(machine, channel=channel)
        drivers.start()
        times = []
        gc.disable()
        due = time.monotonic()
        for _ in range(cycles):
            due += PERIOD
            time.sleep(max(0.0, due - time.monotonic()))
            begin = time.perf_counter_ns()
            drivers.exchange()
            times.append(time.perf_counter_ns() - begin)
            drivers.write([2.0, -2.0, 1.0, 3.0])
        gc.enable()
        counters = drivers.counters
        drivers.close()
        server.terminate()
    times.sort()
    return {
        "cycle p50, µs": times[len(times) // 2] / 1e3,
        "cycle p99, µs": times[len(times) * 99 // 100] / 1e3,
        "answers missing": counters.missing,
    }


def run(samples: int = 3000, burst: int = 50_000) -> dict[str, dict[str, float]]:
    """All measurements, by subject."""
    context = multiprocessing.get_context("spawn")
    virtual = measure("virtual", threading.Thread, Threads, samples, burst)
    priority = raise_priority(50)
    builtin = measure("rds", context.Process, context, samples, burst)
    return {
        f"built-in bus, two processes ({priority})": builtin,
        "python-can virtual, two threads": virtual,
        "control cycle, four modules": control_cycle(samples),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=3000, help="frames or cycles, one each ms")
    parser.add_argument("--burst", type=int, default=50_000, help="frames offered at once")
    options = parser.parse_args(arguments)
    results = run(options.samples, options.burst)
    table = Table(title="Built-in CAN bus", caption=versions())
    table.add_column("subject")
    table.add_column("measure")
    table.add_column("value", justify="right")
    for subject, values in results.items():
        for measure_name, value in values.items():
            table.add_row(subject, measure_name, f"{value:,.0f}")
    Console(width=100).print(table)
    return 0


def versions() -> str:
    """What the numbers were measured with."""
    packages = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("mini-cnc-rds", "python-can"))
    return f"{packages}, Python {platform.python_version()}, {platform.system()} {platform.release()}"


if __name__ == "__main__":
    sys.exit(main())
