"""A second look at a run's timing: the same calls made again, off the clock, in a process without effects.

    python -m rds.modes.process.second_look PLAN CALLS TIMES

A stall that struck while the student's code ran looks like running time. The code is deterministic by contract, so
calls with the same arguments take as long again if they took long by their own doing, and don't if they didn't.
What else the code does must not happen twice: where it starts a process, writes a file, or opens a connection, the
second look ends without an answer (see `forbid_effects`). So it does where it would take more than `MEMORY`.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.core.garbage import collect_rarely

    collect_rarely()

import os
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from time import perf_counter_ns as now
from typing import IO, Any

import numpy as np

from rds.core.thread_time import ThreadTime
from rds.modes.loop.plan import Plan, dump, load
from rds.modes.loop.program import InterpolatedProgram
from rds.modes.parts import start
from rds.modes.process.host import Rows
from rds.modes.process.record import write_whole
from rds.modes.process.replay import as_recorded

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

PASSES = 3
STARTING = 10.0  # s for the process to begin
MEMORY = 1 << 30  # bytes of data: code that leaks does not fill the computer pass after pass
_EFFECTS = {
    "subprocess": "Popen",
    "os": "system fork forkpty exec posix_spawn spawn startfile kill killpg remove rename mkdir rmdir truncate link "
    "symlink chmod chown utime putenv unsetenv setxattr removexattr",
    "socket": "connect bind sendto sendmsg",
    "shutil": "rmtree move copyfile copytree make_archive",
    "signal": "pthread_kill",
    "webbrowser": "open",
    "_thread": "start_new_thread start_joinable_thread",
}
_FORBIDDEN = frozenset(f"{module}.{name}" for module, names in _EFFECTS.items() for name in names.split())
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def own_times(plan: Plan, rows: Rows, which: np.ndarray) -> np.ndarray | None:
    """The time of each sample's interpolate(), control() and model, ns, at the least of some passes.

    None if they can't be repeated. `which` are the samples in question, one flag for each row: the passes end with
    the last of them (what was not repeated is infinite), and when each of them has been quick once.
    Each pass starts from the initial states and gets the positions and the voltages that were recorded, and the
    changes of live values.
    """
    if not plan.repeatable or not which.any():
        return None
    made = isinstance(plan.program, InterpolatedProgram)  # by the student's code, whose time counts
    same = (plan.with_changes(rows.changes) if made else as_recorded(plan, rows)).unwatched()
    of = dict(zip(rows.columns, rows.values.T, strict=True))
    last = int(np.flatnonzero(which)[-1]) + 1
    calls = np.column_stack(
        [
            of["sample"],
            which,
            *(of[f"{name}_measured"] for name in plan.names),
            *(of[axis.acting] for axis in plan.axes),
        ]
    )[:last]
    took = sum(float(of[stage][:last].sum()) for stage in ("interpolate", "compute", "model")) / 1e9
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("plan", "calls", "times")]
        write_whole(paths[0], dump(same), is_own=True)
        write_whole(paths[1], calls.tobytes())
        write_whole(paths[2], b"")
        _look(paths, STARTING + 2 * PASSES * took)
        times = np.frombuffer(paths[2].read_bytes())
    if not len(times) or len(times) % last:
        return None
    least = np.full(len(which), np.inf)
    least[:last] = times.reshape(-1, last).min(axis=0)
    return least


def _look(paths: list[Path], patience: float) -> None:
    """Let a process of its own make the calls; it and all that belongs to it is gone afterwards."""
    command = [sys.executable, "-P", "-m", "rds.modes.process.second_look", *map(str, paths)]
    nowhere = subprocess.DEVNULL
    process = subprocess.Popen(command, stdin=nowhere, stdout=nowhere, stderr=nowhere, start_new_session=True)
    try:
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience)
    finally:
        with suppress(OSError, AttributeError):
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()
        process.wait()


def _repeat(plan: Plan, calls: np.ndarray, written: IO[bytes], had_effect: list[str]) -> None:
    """Write the time of each call to `written`, pass by pass, as long as the code had no effect."""
    axes, period = len(plan.axes), plan.T * 1e9
    which = calls[:, 1] > 0
    least = np.full(len(calls), np.inf)
    for _ in range(PASSES):
        times = _pass(plan, calls[:, 0].astype(int).tolist(), calls[:, 2 : 2 + axes], calls[:, 2 + axes :])
        if had_effect:
            return
        written.write(times.tobytes())
        written.flush()
        least = np.minimum(least, times)
        if (least[which] < period / 2).all():
            return


def _pass(plan: Plan, samples: list[int], measured: np.ndarray, acting: np.ndarray) -> np.ndarray:
    drive, thread = plan.start(), ThreadTime()
    motions = [start(axis.model, plan.T) for axis in plan.axes]
    laws, changes = drive.laws, drive.changes
    times = np.empty(len(samples))
    next_sample = 0
    voltages: list[float] = []
    positions, applied = measured.tolist(), acting.tolist()
    for i, k in enumerate(samples):
        for _ in range(next_sample, k):  # as the loop does with discarded periods
            for motion, voltage in zip(motions, voltages, strict=False):
                motion.write(voltage)
        next_sample = k + 1
        changes(k)
        started = now()
        thread.begin()
        row: list[float] = [k]
        for law in laws:
            law(k, positions[i], row, [])
        voltages = applied[i]
        for motion, voltage in zip(motions, voltages, strict=False):
            motion.read()
            motion.write(voltage)
        span = now() - started
        times[i] = max(span - thread.taken(span), 0)
    thread.close()
    return times


def forbid_effects() -> list[str]:
    """From here on, refuse what has an effect outside this process; the list fills with what was refused.

    It holds for the rest of the process, and for Python code: it keeps work from being done twice and is no sandbox.
    """
    refused: list[str] = []
    sys.dont_write_bytecode = True

    def look(event: str, arguments: tuple[Any, ...]) -> None:
        is_write = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & _WRITING)
        if is_write or event in _FORBIDDEN:
            refused.append(event)
            raise PermissionError(f"{event} is not done a second time")

    sys.addaudithook(look)
    return refused


def _limit_memory() -> None:
    """From here on, what would take more than `MEMORY` of data is a MemoryError, where the system has such limits."""
    if resource is not None:
        with suppress(OSError, ValueError):  # the user has a lower limit
            resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, resource.getrlimit(resource.RLIMIT_DATA)[1]))


def main(arguments: list[str]) -> None:
    """Make the calls again, and write their times."""
    plan_path, calls_path, times_path = map(Path, arguments)
    values = np.frombuffer(calls_path.read_bytes())
    with open(times_path, "r+b") as written:
        had_effect = forbid_effects()
        _limit_memory()
        plan = load(plan_path)
        _repeat(plan, values.reshape(-1, 2 + 2 * len(plan.axes)), written, had_effect)
        os._exit(0)  # without what the code may have left for the end


if __name__ == "__main__":
    main(sys.argv[1:])
