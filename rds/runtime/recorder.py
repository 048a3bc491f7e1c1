"""The recorder: between target and host, so that the end of either one loses nothing.

    python -m rds.runtime.recorder RUN_DIRECTORY RING TARGET_MODULE

It starts the target, copies the rows of the ring to the record on disk while they come, notices a target that
died or hangs, and writes how the run ended. It belongs to no terminal: the host may go, the run goes on.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from rds.core.types import Ending
from rds.runtime.record import PROCESSES, RecordFile, write_ending
from rds.runtime.ring import Ring

DRAIN_EVERY = 0.05  # s
HANG_AFTER = 5.0  # s without a new sample, or 20 periods if that is longer
READY_WITHIN = 60.0  # s from the start of the target to its first sample


class Recorder:
    """Copies rows from a ring to the record in `directory`."""

    def __init__(self, directory: Path, ring: Ring):
        self.directory, self.ring = directory, ring
        self._file = RecordFile(directory, ring.about)
        self._next = self._file.rows
        self.lost = 0

    def drain(self) -> int:
        """Copy what is new; returns how many rows have been copied in all."""
        first, rows = self.ring.read(self._next)
        if rows:
            self.lost += self._file.append(first, rows)
            self._next = first + len(rows) // (8 * len(self.ring.columns))
        return self._next

    def close(self) -> None:
        """Copy the rest; the record is on the disk."""
        self.drain()
        self._file.close()


def watch(target: subprocess.Popen[bytes], recorder: Recorder, period: float) -> str | None:
    """Record until the target ends; if it hangs, kill it and return what happened."""
    hang_after = max(HANG_AFTER, 20 * period)
    seen, since = -1, time.monotonic()
    while target.poll() is None:
        time.sleep(DRAIN_EVERY)
        rows, beat = recorder.drain(), recorder.ring.heartbeat
        if (rows, beat) != seen:
            seen, since = (rows, beat), time.monotonic()
        quiet = time.monotonic() - since
        if quiet > (hang_after if rows else READY_WITHIN):
            target.kill()
            target.wait()
            at = rows * period
            return (
                f"control() or the model did not return for {quiet:.0f} s at t = {at:.3f} s"
                if rows
                else f"the target was not ready within {READY_WITHIN:.0f} s"
            )
    return None


def conclude(directory: Path, rows: int, code: int | None, hung: str | None) -> dict[str, Any]:
    """How the run ended, from the target's own report or from the way it died."""
    try:
        report: dict[str, Any] = json.loads((directory / "target.json").read_text())
    except (OSError, ValueError):
        report = {"ending": Ending.KILLED, "reason": _death(code)}
    if hung:
        report |= {"ending": Ending.FAULT, "reason": hung}
    return report | {"rows": rows}


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        return f"the target process was ended by signal {-code}; its samples up to then are kept"
    return f"the target process ended with code {code}; see target.log for what it said"


def main(arguments: list[str]) -> int:
    """Start the target, record it, conclude."""
    directory, ring = Path(arguments[0]), Ring.open(arguments[1])
    recorder = Recorder(directory, ring)
    with open(directory / "target.log", "wb") as output:
        target = subprocess.Popen(
            [sys.executable, "-m", arguments[2], str(directory), arguments[1]],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
        )
        write_pids(directory, recorder=os.getpid(), target=target.pid)
        hung = watch(target, recorder, ring.about["sample_period"])
    recorder.close()
    write_ending(directory, conclude(directory, ring.head, target.returncode, hung))
    for name in ("plan.pickle", "target.json", PROCESSES):
        with contextlib.suppress(OSError):
            (directory / name).unlink()
    ring.close()
    with contextlib.suppress(OSError):
        ring.path.unlink()
    return 0


def write_pids(directory: Path, **pids: int) -> None:
    """Leave the process numbers where a user in trouble finds them."""
    (directory / PROCESSES).write_text(json.dumps(pids))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
