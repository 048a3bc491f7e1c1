"""The host's side of a run: simulations here, real-time runs in a target process that this one looks after."""

from __future__ import annotations

import contextlib
import os
import secrets
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.types import Ending
from rds.modes import load_mode
from rds.modes.machine import machine_behind
from rds.runtime.plan import Plan, dump
from rds.runtime.record import clear, read_ending, read_raw, write_ending, write_whole
from rds.runtime.recorder import Recorder
from rds.runtime.ring import Ring
from rds.runtime.stopwatch import TIMING_COLUMNS

Progress = Callable[[int, int], None]  # samples taken, samples in all

_CHUNK = 5000  # samples between two calls of a simulation's progress
_RING_BYTES = 64 << 20
_POLL = 0.05  # s


@dataclass(frozen=True)
class Rows:
    """The rows that a loop recorded, with their columns and units, and how the run ended."""

    columns: list[str]
    units: dict[str, str]
    values: np.ndarray  # rows × columns
    ending: Ending
    reason: str
    report: dict[str, Any]
    notes: tuple[str, ...] = ()


def run_plan(plan: Plan, directory: Path | None, progress: Progress | None = None) -> Rows:
    """Run a plan in its mode. A real-time run keeps its raw record in `directory` (made if it doesn't exist).

    Raises InputError or ContractError for what a simulated run finds wrong in a student's code; a real-time run
    reports it in its ending.
    """
    if load_mode(plan.mode).real_time:
        assert directory is not None
        with machine_behind(plan) as reached:
            return _in_target(reached, directory, progress)
    return _here(plan, progress)


def _here(plan: Plan, progress: Progress | None) -> Rows:
    """A simulation, in this process and in virtual time."""
    mode = load_mode(plan.mode)
    columns, units = plan.columns(mode.followed)
    recorded = array("d")
    loop = replace(mode.build(plan, None), record=recorded.extend)
    ending = None
    while ending is None:
        ending = loop.run(loop.k + _CHUNK) if progress else loop.run()
        if progress:
            progress(loop.k, plan.samples)
    values = np.frombuffer(recorded).reshape(-1, len(columns))
    return Rows(columns, units, values, ending, "", {})


def _in_target(plan: Plan, directory: Path, progress: Progress | None) -> Rows:
    mode = load_mode(plan.mode)
    columns, units = plan.columns(mode.followed)
    columns[1:1] = TIMING_COLUMNS
    units |= dict.fromkeys(TIMING_COLUMNS, "ns")
    directory.mkdir(parents=True, exist_ok=True)
    clear(directory)
    write_whole(directory / "plan.pickle", dump(plan))
    about = {"units": units, "mode": plan.mode, "machine": plan.machine.name, "axes": plan.names}
    about |= {"sample_period": plan.T, "samples": plan.samples}
    capacity = min(plan.samples, max(_RING_BYTES // (8 * len(columns)), 1000))
    ring = Ring.create(_ring_path(), columns, capacity, **about)
    recorder = subprocess.Popen(
        [sys.executable, "-m", "rds.runtime.recorder", str(directory), str(ring.path), "rds.modes.target"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        _follow(recorder, ring, plan, progress)
    finally:
        if recorder.poll() is None:
            ring.ask_to_stop()
            recorder.wait()
        if not read_ending(directory):
            _take_over(directory, ring, plan.T)
        ring.close()
        with contextlib.suppress(OSError):
            ring.path.unlink()
    report = read_ending(directory)
    about, values = read_raw(directory)
    return Rows(columns, units, values, Ending(report["ending"]), report.get("reason", ""), report)


def _follow(recorder: subprocess.Popen[bytes], ring: Ring, plan: Plan, progress: Progress | None) -> None:
    """Wait for the end of the run; an interrupt asks it to end safely, and waits on."""
    while recorder.poll() is None:
        try:
            if progress:
                progress(ring.head, plan.samples)
            time.sleep(_POLL)
        except KeyboardInterrupt:
            if ring.stop_asked():
                raise
            ring.ask_to_stop()
    if progress:
        progress(ring.head, plan.samples)


def _take_over(directory: Path, ring: Ring, period: float) -> None:
    """The recorder died: copy what the target still writes until it is quiet, and conclude."""
    recorder = Recorder(directory, ring)
    ring.ask_to_stop()
    seen = -1
    while recorder.drain() != seen:
        seen = recorder.drain()
        time.sleep(max(0.5, 3 * period))
    recorder.close()
    write_ending(
        directory,
        {
            "ending": Ending.KILLED,
            "reason": "the recorder process was ended from outside; the samples up to then are kept",
            "rows": ring.head,
        },
    )


def _ring_path() -> Path:
    """In memory where the system has a file system for that: a disk that is busy must not stop the loop."""
    shared = Path("/dev/shm")
    folder = shared if os.access(shared, os.W_OK) else Path(tempfile.gettempdir())
    return folder / f"rds-{secrets.token_hex(8)}.ring"
