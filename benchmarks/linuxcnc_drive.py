#!/usr/bin/python3
"""What a simulated LinuxCNC starts as its display: runs the programs beside it, one by one, from machine zero.

The servo thread's positions go through halsampler to PROGRAM.samples, one row for each millisecond.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import linuxcnc  # type: ignore[import-not-found]

WAIT = 600.0  # s, at most for one program


def main() -> None:
    folder = Path(sys.argv[0]).parent
    command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()

    def until(met: Callable[[], bool]) -> None:
        ends = time.monotonic() + WAIT
        while time.monotonic() < ends:
            status.poll()
            if said := errors.poll():
                print("LinuxCNC says", said, file=sys.stderr)
            if met():
                return
            time.sleep(0.01)
        raise TimeoutError

    def idle() -> bool:
        done = status.interp_state == linuxcnc.INTERP_IDLE and status.exec_state == linuxcnc.EXEC_DONE
        return bool(done and status.inpos and status.queue == 0)

    for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        command.wait_complete()
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.teleop_enable(0)
    command.wait_complete()
    command.home(-1)
    until(lambda: all(status.homed[:3]))
    for program in sorted(folder.glob("*.ngc")):
        command.mode(linuxcnc.MODE_MDI)
        command.wait_complete()
        command.mdi("G53 G0 X0 Y0 Z0")
        time.sleep(0.2)
        until(idle)
        command.mode(linuxcnc.MODE_AUTO)
        command.wait_complete()
        with program.with_suffix(".samples").open("w") as stream:
            sampler = subprocess.Popen(["halsampler"], stdout=stream)
            time.sleep(0.3)  # what the sampler had kept of before is out, and 0.3 s of rest are in
            command.program_open(str(program))
            command.wait_complete()
            command.auto(linuxcnc.AUTO_RUN, 0)
            time.sleep(0.3)
            until(idle)
            time.sleep(0.2)
            sampler.terminate()
            sampler.wait()


if __name__ == "__main__":
    main()
