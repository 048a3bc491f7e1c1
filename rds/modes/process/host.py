"""The host's side of a run: simulations here, real-time runs in a target process that this one looks after."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from rds.core import drawing
from rds.core.blame import STUDENT_ERRORS
from rds.core.errors import ContractError, InputError
from rds.core.interrupt import Endless, interruptible, limited
from rds.core.private_files import make_folder
from rds.core.progress import Progress
from rds.core.types import Ending
from rds.modes import load_mode
from rds.modes.loop.changes import Change, read_changes, timed
from rds.modes.loop.live_values import LiveValues
from rds.modes.loop.plan import Plan, dump
from rds.modes.loop.stopwatch import TIMING_COLUMNS
from rds.modes.process.blame import fault
from rds.modes.process.live import Live
from rds.modes.process.machine import BUILTIN, machine_behind
from rds.modes.process.processes import end_group, is_alive, wait_for_end
from rds.modes.process.record import ENDING, PROCESSES, UNSTARTED, claim, read_ending, read_raw, write_whole
from rds.modes.process.recorder import LOG, PLAN, Recorder, finish, patience
from rds.modes.process.ring import Ring
from rds.modes.process.shared import folders, remove_left

_PRINTED = "what your code printed during the run is in target.log, in the folder of the run"
_CHUNK = 5000  # samples between two calls of a simulation's progress
_RING_BYTES = 64 << 20
_POLL = 0.05  # s
_LOOK = 1.0  # s: the end wakes who waits for it


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
    changes: tuple[Change, ...] = ()  # of live values


class FailedSimulation(ContractError):
    """A student's code has failed in a simulation: `rows` are the samples up to then."""

    def __init__(self, reason: str, rows: Rows):
        super().__init__(reason)
        self.rows = rows


def run_plan(plan: Plan, directory: Path | None, progress: Progress | None = None, live: Live | None = None) -> Rows:
    """Run a plan in its mode. A real-time run keeps its raw record in `directory` (made if it doesn't exist).

    `live` shows the run to others while it goes on, and lets them change its live values.

    Raises InputError or ContractError for what a simulated run finds wrong in a student's code; a real-time run
    reports it in its ending.
    """
    if load_mode(plan.mode).real_time:
        assert directory is not None
        # The folder first: two runs for one folder are told so before a machine is started.
        with _folder(directory) as lock, machine_behind(plan) as reached:
            try:
                return _in_target(reached, directory, lock, progress, live or Live())
            except OSError as error:
                raise InputError(
                    f"this run could not be recorded to its end ({error.strerror or error}); look whether the disk is "
                    "full, or the folder was taken away while it went on; what was kept, if anything, can be opened",
                    str(directory),
                ) from error
    return _here(plan, progress, live)


def _here(plan: Plan, progress: Progress | None, live: Live | None) -> Rows:
    """A simulation, in this process and in virtual time."""
    mode = load_mode(plan.mode)
    columns, units = plan.columns(mode.followed, mode.simulates_plant)
    recorded = array("d")
    loop = replace(mode.build(plan, None), record=recorded.extend)
    changes = loop.changes
    assert changes is not None
    attached: contextlib.AbstractContextManager[Any] = contextlib.nullcontext()
    if live is not None:
        changes.live_values = LiveValues.create(None, plan.channels())
        changes.in_virtual_time = True
        attached = live.attach(plan, changes.live_values, columns, units, recorded=recorded)
    elif changes.is_idle:
        loop = replace(loop, changes=None)

    def run() -> Ending:
        ending = None
        process = os.getpid()
        while ending is None:
            try:
                with limited(lambda: len(recorded)) if live is None else contextlib.nullcontext():
                    ending = loop.run(loop.k + _CHUNK) if progress else loop.run()
            finally:
                if os.getpid() != process:  # the student's code has forked: the copy must not go on as the program
                    os._exit(0)
            if progress:
                progress(loop.k, plan.samples)
        return ending

    try:
        with attached:
            ending = run() if live is None else interruptible(run, lambda: live.was_stopped, lambda: len(recorded))
    except (*STUDENT_ERRORS, Endless) as error:
        reason = fault(plan, error, loop.k)
        whole = len(recorded) // len(columns) * len(columns)
        values = np.frombuffer(recorded[:whole]).reshape(-1, len(columns))
        taken = tuple(timed(changes.taken, plan.T))
        raise FailedSimulation(reason, Rows(columns, units, values, Ending.FAULT, reason, {}, changes=taken)) from error
    values = np.frombuffer(recorded).reshape(-1, len(columns))
    taken = tuple(timed(changes.taken, plan.T))
    return Rows(columns, units, values, ending, changes.reason, {}, tuple(loop.notes()), taken)


def _in_target(plan: Plan, directory: Path, lock: int, progress: Progress | None, live: Live) -> Rows:
    """A real-time run, in a target process that a recorder starts; `lock` holds the folder."""
    drawing.ready()  # a process that still imports matplotlib would make samples late
    mode = load_mode(plan.mode)
    columns, units = plan.columns(mode.followed, mode.simulates_plant)
    columns[1:1] = TIMING_COLUMNS
    units |= dict.fromkeys(TIMING_COLUMNS, "ns")
    write_whole(directory / PLAN, _dumped(plan), is_own=True)
    has_rows = _recorded(plan, directory, columns, units, lock, progress, live)
    report = read_ending(directory, ENDING if has_rows else UNSTARTED)
    ending, reason = Ending(report["ending"]), report.get("reason", "")
    if has_rows:
        values, changes = read_raw(directory)[1], tuple(read_changes(directory))
        notes = [*report.get("notes", ()), *([_PRINTED] if (directory / LOG).exists() else ())]
        return Rows(columns, units, values, ending, reason, report, tuple(notes), changes)
    (directory / UNSTARTED).unlink()
    return Rows(columns, units, np.empty((0, len(columns))), ending, reason, report)


def _recorded(
    plan: Plan,
    directory: Path,
    columns: list[str],
    units: dict[str, str],
    lock: int,
    progress: Progress | None,
    live: Live,
) -> bool:
    """Let a recorder start the target, and wait for the end of the run; whether there is a sample."""
    about: dict[str, Any] = {"units": units, "mode": plan.mode, "machine": plan.machine.name, "axes": plan.names}
    about |= {"sample_period": plan.T, "samples": plan.samples, "run": secrets.token_hex(8)}
    if plan.bus.get("interface") == BUILTIN:
        about["channel"] = plan.bus["channel"]
    capacity = min(plan.most_samples, max(_RING_BYTES // (8 * len(columns)), 1000))
    ring, live_values = _shared(plan, columns, capacity, about)
    try:
        with tempfile.TemporaryFile() as said:  # by the recorder, which says something only if it fails
            command = [sys.executable, "-P", "-m", "rds.modes.process.recorder", str(directory), str(ring.path)]
            recorder = subprocess.Popen(
                [*command, "rds.modes.process.target"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=said,
                start_new_session=True,
                pass_fds=(lock,) if os.name == "posix" else (),
            )
            try:
                with live.attach(plan, live_values, columns, units, ring=ring):
                    _follow(recorder, ring, plan, progress)
            finally:
                if recorder.poll() is None:
                    ring.ask_to_stop()
                    recorder.wait()
                if recorder.returncode != 0:
                    _take_over(directory, ring, plan.T, _how_it_ended(recorder.returncode, said))
        return bool(ring.head)
    finally:
        ring.close()
        live_values.close()
        for left in (ring.live_values_path, ring.path):  # a ring left alone is found by `remove_left`
            with contextlib.suppress(OSError):
                left.unlink()


def _shared(plan: Plan, columns: list[str], capacity: int, about: dict[str, Any]) -> tuple[Ring, LiveValues]:
    """The memory that the run's processes share, in the first folder that has room; InputError if none has."""
    full = []
    for folder in folders():
        remove_left(folder)
        path = folder / f"rds-{about['run']}.ring"
        try:
            ring = Ring.create(path, columns, capacity, **about)
            try:
                return ring, LiveValues.create(ring.live_values_path, plan.channels())
            except OSError:
                ring.close()
                path.unlink()
                raise
        except OSError as error:
            full.append(f"{folder}: {error.strerror or error}")
    size = 8 * capacity * len(columns) / 1e6
    raise InputError(
        f"the memory that the run's processes share ({size:.1f} MB) finds no room ({'; '.join(full)}); make some "
        "there, or set TMPDIR to a folder that has it"
    )


def _dumped(plan: Plan) -> bytes:
    """The plan as bytes; ContractError if the student's code holds what cannot be sent to another process."""
    try:
        return dump(plan)
    except Exception as error:  # pickle raises whatever comes to hand
        raise ContractError(
            f"the controller or the model cannot be handed to the target process: {error}; keep open files, locks, "
            f"threads and devices out of params, initial_state and the variables that its functions use"
        ) from error


@contextlib.contextmanager
def _folder(directory: Path) -> Iterator[int]:
    """The folder of a run, claimed for it (see `record.claim`), and taken away if nothing came into it."""
    try:
        is_new = not directory.is_dir()
        make_folder(directory)
    except OSError as error:
        raise InputError(f"this folder cannot be made: {error.strerror}; name another one", str(directory)) from error
    lock = claim(directory)
    try:
        yield lock
    finally:
        for name in (PLAN, PROCESSES):
            with contextlib.suppress(OSError):
                (directory / name).unlink()
        os.close(lock)
        if is_new:
            with contextlib.suppress(OSError):
                directory.rmdir()


def _follow(recorder: subprocess.Popen[bytes], ring: Ring, plan: Plan, progress: Progress | None) -> None:
    """Wait for the end of the run; an interrupt asks it to end safely, and waits on."""
    while recorder.poll() is None:
        try:
            if progress:
                progress(ring.head, plan.samples)
            wait_for_end(recorder, _POLL if progress else _LOOK)
        except KeyboardInterrupt:
            if ring.stop_asked():
                raise
            ring.ask_to_stop()
    if progress:
        progress(ring.head, plan.samples)


def _how_it_ended(code: int, said: IO[bytes]) -> str:
    """What became of a recorder that did not end well, by its exit code and what it said on stderr."""
    if code < 0:
        how = f"was ended from outside, by signal {-code}"
    else:
        said.seek(0)
        lines = said.read().decode(errors="replace").strip().splitlines()
        how = f"failed with code {code}" + (f"; the last that it said: {lines[-1][:300]}" if lines else "")
    return f"the recorder process {how}"


def _take_over(directory: Path, ring: Ring, period: float, reason: str) -> None:
    """The recorder died: ask the target for a safe end, copy what it still writes, and conclude."""
    recorder = Recorder(directory, ring)
    ring.ask_to_stop()
    try:
        target = int(json.loads((directory / PROCESSES).read_text())["target"])
    except (OSError, ValueError, KeyError):
        target = 0  # it died before it started one
    seen, since = (-1, -1), time.monotonic()
    while target and is_alive(target, str(ring.path)):
        now = (recorder.drain(), ring.heartbeat)
        if now != seen:
            seen, since = now, time.monotonic()
        if time.monotonic() - since > patience(ring, period):
            os.kill(target, getattr(signal, "SIGKILL", signal.SIGTERM))  # Windows has the second alone, which ends it
            break
        time.sleep(_POLL)
    if target:
        end_group(target)
    recorder.close()
    kept = "; the samples up to then are kept" if ring.head else ", before the first sample"
    finish(directory, ring, {"ending": Ending.KILLED, "reason": f"{reason}{kept}", "rows": ring.head})
