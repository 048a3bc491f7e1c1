"""The target: a process of its own, started fresh for each real-time run, that does nothing but the loop.

    python -m rds.modes.process.target RUN_DIRECTORY RING

It reads the plan from the run's directory, gets ready, rehearses, runs, and leaves `target.json`: how the run
ended, and the environment that its timing was measured in. Whatever happens, the axes end at zero volts.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.core.garbage import collect_rarely

    collect_rarely()

import faulthandler
import json
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rds.core.clock import RealTimeClock
from rds.core.contracts import Drivers
from rds.core.errors import AdapterError, MachineError, RdsError
from rds.core.private_files import keep_process_private, open_private
from rds.core.types import Ending
from rds.modes import load_mode
from rds.modes.loop.changes import STOP
from rds.modes.loop.live_values import LiveValues
from rds.modes.loop.plan import Plan, load
from rds.modes.loop.stopwatch import Stopwatch, quiet_memory
from rds.modes.process.blame import fault
from rds.modes.process.environment import describe_environment, prepare, stolen_ticks
from rds.modes.process.record import write_whole
from rds.modes.process.recorder import ASK_WHERE, CLOSING, PLAN, READY, REPORT, TRACE
from rds.modes.process.ring import Ring

log = logging.getLogger(__name__)


class _Stopped(Exception):
    """Somebody wants the end before the first sample."""


def run(plan: Plan, ring: Ring, live_values: LiveValues) -> dict[str, Any]:
    """Take every sample of the plan; returns how it ended, why, and the environment."""
    from rds.bus.hub.command import Command
    from rds.bus.hub.run_watch import RunWatch
    from rds.bus.modules.dialects import DEFAULT, open_drivers

    mode = load_mode(plan.mode)
    environment = describe_environment() | prepare(plan.priority, plan.cpu)
    clock = RealTimeClock(round(plan.T * 1e9), plan.late)
    report: dict[str, Any] = {"ending": Ending.FAULT, "reason": "", "environment": environment}
    stolen = stolen_ticks()
    drivers = loop = watch = stopwatch = None
    notes: Callable[[], list[str]] = list
    counted: dict[str, int] = {}  # by the drivers before the first sample
    bus = dict(plan.bus)
    faults, dialect = bus.pop("faults", ()), bus.pop("dialect", DEFAULT)
    threads = threading.active_count()
    stack = ExitStack()

    def homing(axis: str, position: float) -> None:
        ring.beat(1 - ring.heartbeat)  # it goes on
        if ring.stop_asked() or live_values.values().get(STOP):
            raise _Stopped(f"stopped while {axis} was homed; it has no power, and is to be homed again")

    try:
        if bus["interface"] == "rds":
            stack.enter_context(Command(bus["channel"]))
        drivers = open_drivers(dialect, plan.machine, plan.names, plan.T, mode.drivers == "dry run", bus)
        drivers.start(homing)
        if bus["interface"] == "rds":
            watch = stack.enter_context(RunWatch(bus["channel"], faults))
        ring.beat(1)
        stopwatch = Stopwatch(clock, ring.append, ring.stop_asked)
        if hasattr(signal, "SIGCONT"):
            signal.signal(signal.SIGCONT, stopwatch.thread.went_on)
        loop = stopwatch.time(mode.build(plan, drivers))
        assert loop.changes is not None
        loop.changes.live_values = live_values
        environment["rehearsal"] = rehearse(clock, drivers, plan.rehearsal)
        counted = asdict(drivers.counters)
        if watch is not None:
            watch.start()
        threads = threading.active_count()
        ring.beat(READY)
        with quiet_memory():
            clock.start()
            try:
                report["ending"] = loop.run()
            finally:
                stopwatch.end_copy()
        report["reason"], notes = loop.changes.reason, loop.notes
        if report["ending"] is Ending.DONE:
            drivers.confirm()
    except _Stopped as stopped:
        report |= {"ending": Ending.STOPPED, "reason": str(stopped)}
    except MachineError as error:
        ending = Ending.ADAPTER_LOST if isinstance(error, AdapterError) else Ending.MACHINE_LOST
        report |= {"ending": ending, "reason": str(error)}
    except BaseException as error:  # the student's code may raise anything, SystemExit included
        if not isinstance(error, RdsError):
            log.exception("the run ended by an exception")
        report["reason"] = fault(plan, error, loop.k if loop else None)
    finally:
        ring.beat(CLOSING)
        environment["threads"] = threading.active_count() - threads  # that the student's code left running
        if drivers is not None:
            report["drivers"] = {name: n - counted.get(name, 0) for name, n in asdict(drivers.counters).items()}
            drivers.close()
            if watch is not None:
                report["bus"] = watch.summary()
        stack.close()
        if stopwatch is not None:
            environment |= {"stops": stopwatch.thread.stops, "page_faults": stopwatch.thread.page_faults}
            environment["instructions"] = stopwatch.instructions.to_json()
            stopwatch.close()
    after = stolen_ticks()
    environment["stolen_ticks"] = after - stolen if after is not None and stolen is not None else None
    report["samples"] = ring.head
    report["notes"] = notes()  # they may take their time now that the axes have no power
    return report


def main(arguments: list[str]) -> None:
    """Run the plan in a run's directory."""
    from rds.bus.tools.mf4 import put_off_asammdf

    put_off_asammdf()
    directory, ring_path = Path(arguments[0]), arguments[1]
    ring = Ring.open(ring_path)
    # The end of the terminal's session, or a polite kill, is a request to stop: the axes come to rest first.
    for number in (signal.SIGTERM, signal.SIGINT, getattr(signal, "SIGHUP", signal.SIGTERM)):
        signal.signal(number, lambda *_: ring.ask_to_stop())
    if ASK_WHERE is not None:
        faulthandler.register(ASK_WHERE, open_private(directory / TRACE, "w", is_own=True), all_threads=False)
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING)
    plan = load(directory / PLAN)
    report = run(plan, ring, LiveValues.open(ring.live_values_path))
    write_whole(directory / REPORT, json.dumps(report, default=str).encode())
    sys.stdout.flush()
    sys.stderr.flush()
    # Not by the usual way: a thread that the student's code started, or a lock that it holds, must not keep this alive.
    os._exit(0)


def rehearse(clock: RealTimeClock, drivers: Drivers | None, seconds: float) -> dict[str, Any]:
    """Keep the period for `seconds`, exchanging zero volts with the machine, and report how well it went.

    Returns the number of `samples`, the `stalls` (woken more than a period late), and the lateness and I/O time
    at the median and at most, in µs.
    """
    samples = max(int(seconds * 1e9 / clock.period), 20)
    late, io = [], []
    clock.start()
    for k in range(samples):
        clock.wait(k)
        started = clock.now()
        if drivers is not None:
            drivers.exchange()
        late.append(clock.lateness(k, started))
        io.append(clock.now() - started)
        if clock.lateness(k, clock.now()) > clock.period:  # a backlog is not a stall
            clock.start_at(k + 1)
    late.sort()
    io.sort()
    return {
        "samples": samples,
        "stalls": sum(value > clock.period for value in late),
        "lateness_p50": late[samples // 2] / 1e3,
        "lateness_max": late[-1] / 1e3,
        "io_p50": io[samples // 2] / 1e3,
        "io_max": io[-1] / 1e3,
    }


if __name__ == "__main__":
    keep_process_private()
    main(sys.argv[1:])
