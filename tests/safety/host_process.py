"""A host in a process of its own: python host_process.py DIALECT CHANNEL PERIOD VOLTS [--free] [--patient]

It commands axis X with constant VOLTS and writes what happens on stdout: "moving" once it commands, "refused" when a
module has refused a command, "lost REASON" at its end. Without --free it takes the command of the channel, as every
run does. A CiA 402 drive waits for its heartbeats for 1.5 s, with --patient for 15 s: longer than a computer is held
up. With a line on stdin, "VOLTS SECONDS IDENTIFIER", it commands VOLTS for one period, in a frame with this identifier
that the bus holds back for so long.
"""

from __future__ import annotations

import contextlib
import select
import sys
import time
from typing import Any

from rds.bus.hub.command import Command
from rds.bus.hub.faults import Faults
from rds.bus.modules.dialects import open_drivers
from rds.core.errors import MachineError
from rds.machines import load_machine

HEARTBEAT = 0.5  # s, of CiA 402 hosts and drives; three may be missing
MACHINES = {"rds": "mini-cnc", "oacs": "mrmt-oacs", "cia402": "mini-cnc"}


def main(dialect: str, channel: str, period: str, volts: str, *flags: str) -> int:
    """Command until something is wrong."""
    T = float(period)
    with contextlib.ExitStack() as stack:
        try:
            if "--free" not in flags:
                stack.enter_context(Command(channel))
            bus: dict[str, Any] = {"interface": "rds", "channel": channel}
            if dialect == "cia402":
                bus["cia402"] = {"heartbeat": 10 * HEARTBEAT if "--patient" in flags else HEARTBEAT}
            drivers = open_drivers(dialect, load_machine(MACHINES[dialect]), ["X"], T, False, bus)
            stack.callback(drivers.close)
            drivers.start()
            due, refused = time.monotonic(), False
            for k in range(1_000_000):
                drivers.exchange()
                now = float(volts)
                if k > 10 and select.select([sys.stdin], [], [], 0.0)[0] and (line := sys.stdin.readline()):
                    pulse, by, identifier = line.split()
                    with Faults(channel) as faults:
                        faults.inject("delay", node="host", identifier=int(identifier), by=float(by), count=1)
                    now = float(pulse)
                drivers.write([now])
                if k == 10:
                    say("moving")
                if getattr(drivers.counters, "refused", 0) and not refused:
                    refused = True
                    say("refused")
                due = max(due + T, time.monotonic())
                time.sleep(max(0.0, due - time.monotonic()))
        except MachineError as error:
            say(f"lost {error}")
    return 0


def say(line: str) -> None:
    """One line on stdout."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
