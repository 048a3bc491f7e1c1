"""The recorder: between target and host, so that the end of either one loses nothing.

    python -m rds.modes.process.recorder RUN_DIRECTORY RING TARGET_MODULE

It starts the target, copies the rows of the ring to the record on disk while they come, notices a target that
died or hangs, and writes how the run ended. It belongs to no terminal: the host may go, the run goes on.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.core.garbage import collect_rarely

    collect_rarely()

import contextlib
import json
import os
import re
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from rds.core.garbage import leave
from rds.core.private_files import keep_process_private, open_private, write_private
from rds.core.traceback_frames import is_installed
from rds.core.types import Ending
from rds.modes.loop.changes import FILE as CHANGES
from rds.modes.loop.changes import STOP, as_text, read_changes, timed
from rds.modes.loop.live_values import LiveValues
from rds.modes.loop.program import HOLD
from rds.modes.process.processes import adopt_orphans, end_adopted, end_group, is_stopped, wait_for_end
from rds.modes.process.record import ENDING, PROCESSES, UNSTARTED, RecordFile, write_ending, write_whole
from rds.modes.process.ring import Ring

DRAIN_EVERY = 0.05  # s
HANG_AFTER = 5.0  # s without a new sample, or 20 periods if that is longer
HELD_UP = 1.0  # s for one look: this process did not run
READY_WITHIN = 60.0  # s from the start of the target to its first sample, without the time of homing
CLOSES_WITHIN = 30.0  # s from the end of the loop to that of the target: drives brake, and a bus may not answer
READY, CLOSING = 2, 3  # heartbeats of the target when its loop begins, and when it has ended
PLAN, REPORT, LOG, TRACE = "plan.pickle", "target.json", "target.log", "target.trace"
ASK_WHERE = getattr(signal, "SIGUSR1", None)  # the target answers in the file TRACE
ANSWERS_WITHIN = 1.0  # s
_SAMPLE = struct.Struct("<d")  # at the head of a row: which sample it is


class Recorder:
    """Copies rows from a ring to the record in `directory`, which is made when the first one comes."""

    def __init__(self, directory: Path, ring: Ring):
        self.directory, self.ring = directory, ring
        self.lost = 0  # rows that the ring had overwritten before they were copied
        self.due = 0  # the sample after the last one that was copied: periods may have been discarded before it
        self._file: RecordFile | None = None
        self._next = 0
        self._live_values = LiveValues.open(ring.live_values_path)
        self._noted = -1  # changes of live values that have been copied; -1: not known yet

    def drain(self) -> int:
        """Copy what is new; returns how many rows have been copied in all."""
        if self._file is None:
            if not self.ring.head:
                return 0
            self._file = RecordFile(self.directory, self.ring.about)
            self._next = self._file.rows
        first, rows = self.ring.read(self._next)
        if rows:
            self.lost += self._file.append(first, rows)
            size = 8 * len(self.ring.columns)
            self._next = first + len(rows) // size
            self.due = int(_SAMPLE.unpack_from(rows, len(rows) - size)[0]) + 1
        self._drain_changes()
        return self._next

    def host_is_gone(self) -> None:
        """A part program is not carried on without an operator: it comes to rest on its path, and ends."""
        if HOLD in self._live_values:
            self._live_values.set(STOP, 1.0)

    def _drain_changes(self) -> None:
        """After the rows: a record that begins has removed what an earlier run left."""
        path = self.directory / CHANGES
        if self._noted < 0:  # what an earlier writer of this run has copied, without the line that it was about to
            before = read_changes(self.directory)
            self._noted = len(before)
            if before:
                write_whole(path, as_text(before).encode())
        first, notes = self._live_values.notes(self._noted)
        if notes:
            with open_private(path, "a") as file:
                file.write(as_text(timed(notes, self.ring.about["sample_period"]), headings=not file.tell()))
            self._noted = first + len(notes)

    def close(self) -> None:
        """Copy the rest; the record is on the disk."""
        self.drain()
        if self._file is not None:
            self._file.close()


def patience(ring: Ring, period: float) -> float:
    """How long the target may be without a new sample and a new heartbeat in its phase, s."""
    if ring.heartbeat < READY:
        return READY_WITHIN
    return CLOSES_WITHIN if ring.heartbeat >= CLOSING else max(HANG_AFTER, 20 * period)


def watch(target: subprocess.Popen[bytes], recorder: Recorder, period: float) -> tuple[Ending, str] | None:
    """Record until the target ends; if it hangs, kill it and return what ending that is, and why.

    Time in which this process was held up itself does not count: the target may have been, too.
    """
    host = os.getppid()
    seen, since = (-1, -1), time.monotonic()
    while target.poll() is None:
        looked = time.monotonic()
        wait_for_end(target, DRAIN_EVERY)
        if host and os.getppid() != host:
            recorder.host_is_gone()
            host = 0
        now = (recorder.drain(), recorder.ring.heartbeat)
        if now != seen:
            seen, since = now, time.monotonic()
        elif (took := time.monotonic() - looked) > HELD_UP:
            since += took
        quiet = time.monotonic() - since
        heartbeat = recorder.ring.heartbeat
        if quiet > patience(recorder.ring, period):
            stopped = is_stopped(target.pid)
            where = "" if stopped else _where(recorder.directory, target)
            target.kill()
            target.wait()
            at = f"at t = {recorder.due * period:.3f} s"
            if stopped:
                return Ending.KILLED, (
                    f"the target process was stopped from outside (SIGSTOP, or a debugger) {at}, and did not go on for "
                    f"{quiet:.0f} s. It was killed; the watchdogs cut the voltage"
                )
            if heartbeat >= CLOSING:
                return Ending.MACHINE_LOST, (
                    f"the loop ended {at}, and the target had not let go of the machine {quiet:.0f} s later{where}: "
                    "see whether its bus or adapter still answers. The target was killed; the watchdogs cut the voltage"
                )
            if heartbeat >= READY:
                return Ending.FAULT, (
                    f"control() or the model did not return for {quiet:.0f} s {at}{where}; "
                    "look for a loop without an end in it. The target was killed; the watchdogs cut the voltage"
                )
            return Ending.FAULT, (
                f"the target was not ready within {READY_WITHIN:.0f} s{where}; look there for a loop without an end, "
                "or for what it waits for"
            )
    return None


def _where(directory: Path, target: subprocess.Popen[bytes]) -> str:
    """Where the target is, as the end of a sentence: the innermost line of the student's, if it has one; or nothing."""
    trace = directory / TRACE
    if ASK_WHERE is None or not trace.exists():  # it does not listen yet: the signal would end it
        return ""
    target.send_signal(ASK_WHERE)
    end = time.monotonic() + ANSWERS_WITHIN
    text, before = "", None
    while (not text or text != before) and time.monotonic() < end:
        time.sleep(DRAIN_EVERY)
        with contextlib.suppress(OSError):
            before, text = text, trace.read_text(errors="replace")
    for file, line, function in re.findall(r'File "(.+)", line (\d+) in (.+)', text):
        if not file.startswith("<frozen") and not is_installed(file):
            name = "a notebook cell" if "ipykernel" in file else Path(file).name
            return f", in {name}, line {line}, in {function}"
    return ""


def conclude(directory: Path, rows: int, code: int | None, hung: tuple[Ending, str] | None) -> dict[str, Any]:
    """How the run ended, from the target's own report or from the way it died."""
    try:
        report: dict[str, Any] = json.loads((directory / REPORT).read_text())
    except (OSError, ValueError):
        report = {"ending": Ending.KILLED, "reason": _death(directory, rows, code)}
    if hung:
        report |= {"ending": hung[0], "reason": hung[1]}
    return report | {"rows": rows}


def finish(directory: Path, ring: Ring, ending: dict[str, Any]) -> None:
    """Write how the run ended, and remove what only its processes needed; of a run without a sample, all the rest."""
    write_ending(directory, ending, ENDING if ring.head else UNSTARTED)
    names = [PLAN, REPORT, PROCESSES, TRACE]
    with contextlib.suppress(OSError):
        if not ring.head or not (directory / LOG).stat().st_size:
            names.append(LOG)
    for name in names:
        with contextlib.suppress(OSError):
            (directory / name).unlink()


def _death(directory: Path, rows: int, code: int | None) -> str:
    if code is not None and code < 0:
        kept = "; its samples up to then are kept" if rows else ", before its first sample"
        return f"the target process was ended by signal {-code}{kept}"
    said = ""
    with contextlib.suppress(OSError):
        lines = (directory / LOG).read_text(errors="replace").strip().splitlines()
        said = f"; the last that it said: {lines[-1][:300]}" if lines else ""
    return f"the target process ended with code {code} by itself, as os._exit() does{said}"


def main(arguments: list[str]) -> int:
    """Start the target, record it, conclude."""
    directory, ring = Path(arguments[0]), Ring.open(arguments[1])
    adopt_orphans()
    for left in (REPORT, TRACE):  # of a run whose recorder and host were killed
        with contextlib.suppress(OSError):
            (directory / left).unlink()
    recorder = Recorder(directory, ring)
    with open_private(directory / LOG, "wb") as output:
        target = subprocess.Popen(
            [sys.executable, "-P", "-m", arguments[2], str(directory), arguments[1]],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
        # where a user in trouble finds them, and the host if the recorder is killed
        processes = {"recorder": os.getpid(), "target": target.pid, "live_values": str(ring.live_values_path)}
        processes["channel"] = ring.about.get("channel")  # of the built-in bus: where an emergency stop goes
        write_private(directory / PROCESSES, json.dumps(processes).encode())
        hung = watch(target, recorder, ring.about["sample_period"])
    end_group(target.pid)
    end_adopted()
    recorder.close()
    finish(directory, ring, conclude(directory, ring.head, target.returncode, hung))
    ring.close()
    for path in (ring.live_values_path, ring.path):  # in this order, see `shared.remove_left`
        with contextlib.suppress(OSError):
            path.unlink()
    return 0


if __name__ == "__main__":
    keep_process_private()
    leave(main(sys.argv[1:]))
