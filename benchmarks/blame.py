"""Verdicts of timing against truth: correct and slow controllers on a computer under load of every kind.

python -m benchmarks.blame [--minutes 10] [--runs N] [--append FILE] [--load NAME ...] [--json]

Each run is an emulation of half a second at 1 kHz. *Wrong* counts correct controllers that were missed and slow ones
that were met; a run that is *void* blames nobody, and counts apart. With `--append` each run is a line of JSON in a
file, and the next call goes on where the last one ended. Without the right to real-time priority and locked memory
(`setpriv --bounding-set=-sys_nice,-ipc_lock` where you are root) the same loads strike an ordinary process; those runs
are told apart in the table.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import rds
from rds.bus.modules.server_process import end_server, start_server
from rds.core.errors import RdsError
from rds.modes.process.recorder import PROCESSES

PERIODS = 500
_CORRECT = """
def control(t, r, y, state, params):
    return 10.0 * (r.position - y), state
"""
_SLOW = """
import time

def wait(seconds):
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass

def control(t, r, y, state, params):
    k = state or 0
    if k {when}:
        {what}
    return 10.0 * (r.position - y), k + 1
"""
FILES = {
    "correct": _CORRECT,
    "correct, computes 0.3 ms": _SLOW.format(when=">= 0", what="wait(0.0003)"),
    "slow always": _SLOW.format(when=">= 0", what="wait(0.002)"),
    "sleeps 2 ms now and then": _SLOW.format(when="% 50 == 49", what="time.sleep(0.002)"),
    "computes 5 ms now and then": _SLOW.format(when="% 50 == 49", what="wait(0.005)"),
    "computes 30 ms once": _SLOW.format(when="== 250", what="wait(0.03)"),
    "stalls 2.6 s once": _SLOW.format(when="== 250", what="time.sleep(2.6)"),
}
_BUSY = "while True: pass"
_HOG = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
while True:
    time.sleep(0.135 - time.monotonic() % 0.135)
    end = time.monotonic() + 0.015
    while time.monotonic() < end:
        pass
"""
_DISK = """
import os, sys
while True:
    with open(sys.argv[1], "wb") as file:
        for _ in range(16):
            file.write(os.urandom(1 << 20))
            os.fsync(file.fileno())
"""
_MEMORY = """
while True:
    blocks = [bytearray(1 << 20) for _ in range(256)]
"""
_PRESSURE = """
import os, sys
with open(sys.argv[1] + "/cgroup.procs", "w") as members:
    members.write(str(os.getpid()))
kept = bytearray(64 << 20)
with open(sys.argv[2], "w+b") as file:
    file.truncate(512 << 20)
    while True:
        file.seek(0)
        while file.read(1 << 20):  # pages of the file have to be given up for those that come
            kept[::4096] = bytes(len(kept[::4096]))
"""
_ROOM = 224 << 20  # bytes, for all that is in the group whose memory is limited


@contextmanager
def _programs(*commands: list[str]) -> Iterator[None]:
    running = [subprocess.Popen([sys.executable, "-c", *command]) for command in commands]
    try:
        time.sleep(0.1)
        yield
        if any(program.poll() is not None for program in running):
            raise SystemExit("a program that should load the computer has ended by itself")
    finally:
        for program in running:
            program.kill()
            program.wait()


@contextmanager
def _beside(act: Callable[[threading.Event], None]) -> Iterator[None]:
    """A thread that acts until it is told that the run has ended."""
    ended = threading.Event()
    thread = threading.Thread(target=act, args=(ended,))
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _process(folder: Path, name: str) -> int:
    """A process of the run whose record is in a folder. OSError, ValueError, KeyError before there is one."""
    return int(json.loads((folder / PROCESSES).read_text())[name])


def _stops(folder: Path) -> Any:
    """The target is stopped for 20 to 60 ms, again and again."""
    chance = random.Random(1)

    def stop(ended: threading.Event) -> None:
        while not ended.wait(chance.uniform(0.02, 0.15)):
            with suppress(OSError, ValueError, KeyError):
                target = _process(folder, "target")
                os.kill(target, signal.SIGSTOP)
                time.sleep(chance.uniform(0.02, 0.06))
                os.kill(target, signal.SIGCONT)

    return _beside(stop)


def _limit_file() -> Path:
    """Of a group of processes (cgroup, both versions): the file that limits its memory."""
    root = Path("/sys/fs/cgroup")
    name = f"rds-blame-{os.getpid()}"
    if (root / "cgroup.controllers").exists():
        return root / name / "memory.max"
    return root / "memory" / name / "memory.limit_in_bytes"


def _may_limit() -> bool:
    try:
        _limit_file().parent.mkdir()
        _limit_file().parent.rmdir()
    except OSError:
        return False
    return True


@contextmanager
def _pressed(folder: Path) -> Iterator[None]:
    """The run's processes share `_ROOM` for all that they allocate from then on with a program that needs more."""
    group = _limit_file().parent
    group.mkdir()
    _limit_file().write_text(str(_ROOM))

    def move(ended: threading.Event) -> None:
        while not ended.wait(0.01):
            for name in ("recorder", "target"):
                with suppress(OSError, ValueError, KeyError):
                    (group / "cgroup.procs").write_text(str(_process(folder / "run", name)))

    try:
        with _programs([_PRESSURE, str(group), str(folder / "read")]), _beside(move):
            yield
    finally:
        group.rmdir()


def loads(folder: Path) -> dict[str, Callable[[], Any]]:
    """What the computer does beside a run whose record goes to `folder / "run"`; what this user may not is left out."""
    cpus = sorted(os.sched_getaffinity(0))
    found: dict[str, Callable[[], Any]] = {
        "none": lambda: _programs(),
        "busy cores": lambda: _programs(*[[_BUSY]] * len(cpus)),
        "stopped process": lambda: _stops(folder / "run"),
        "disk": lambda: _programs([_DISK, str(folder / "filled")]),
        "memory filled": lambda: _programs([_MEMORY], [_MEMORY]),
    }
    if _may_raise_priority():
        found["real-time hog"] = lambda: _programs(*([_HOG, str(cpu)] for cpu in cpus))
    if _may_limit():
        found["memory limited"] = lambda: _pressed(folder)
    return found


def _may_raise_priority() -> bool:
    """Whether this user's processes may have real-time priority."""
    ask = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"
    return subprocess.run([sys.executable, "-c", ask], capture_output=True).returncode == 0


@dataclass
class Run:
    """One run: what was tried, and what was said of it."""

    load: str
    file: str
    verdict: str
    reason: str
    stolen: int | None = None  # clock ticks that the hypervisor took
    prioritized: bool = True

    @property
    def is_wrong(self) -> bool:
        """Whether the verdict says the opposite of the truth."""
        return self.verdict == ("missed" if self.file.startswith("correct") else "met")

    @property
    def row(self) -> tuple[str, str]:
        """Of the table."""
        return self.load + ("" if self.prioritized else ", no priority"), self.file


@contextmanager
def _served() -> Iterator[str]:
    """The channel of a machine that all runs use: one of its own takes each a second to start."""
    channel = f"blame-{os.getpid()}"
    server = start_server("rds", "mini-cnc", channel)
    try:
        yield channel
    finally:
        end_server(server)


def run(minutes: float, runs: int | None, before: list[Run], chosen: list[str] | None = None) -> Iterator[Run]:
    """Runs, of the load and file that has had fewest, until the time is over or there are so many."""
    end = time.monotonic() + 60 * minutes
    with tempfile.TemporaryDirectory() as name, _served() as channel:
        folder = Path(name)
        for number, text in enumerate(FILES.values()):
            (folder / f"controller{number}.py").write_text(text)
        beside, prioritized = loads(folder), _may_raise_priority()
        counts = {(load, file): 0 for load in beside if not chosen or load in chosen for file in FILES}
        for earlier in before:
            if earlier.prioritized == prioritized and (earlier.load, earlier.file) in counts:
                counts[earlier.load, earlier.file] += 1
        done = len(before)
        while time.monotonic() < end and (runs is None or done < runs):
            load, file = min(counts, key=lambda pair: counts[pair])
            experiment = rds.Experiment(
                duration=PERIODS * 1e-3,
                reference=rds.sinusoid(2.0, 1.0),
                controller={"file": str(folder / f"controller{list(FILES).index(file)}.py")},
                bus={"channel": channel},
            )
            try:
                with beside[load]():
                    meta = experiment.run("emulation", out=folder / "run").meta
                environment = meta["environment"]
                told = meta["verdict"], meta["verdict_reason"], environment.get("stolen_ticks")
            except RdsError as error:
                told = "not run", str(error), None
            yield Run(load, file, *told, prioritized)
            counts[load, file] += 1
            done += 1


def read_runs(path: Path) -> list[Run]:
    """The runs of a file that `--append` has written; its last line may be torn."""
    if not path.exists():
        return []
    found = []
    for line in path.read_text().splitlines():
        with suppress(ValueError):
            found.append(Run(**json.loads(line)))
    return found


def table(runs: list[Run]) -> list[str]:
    """Lines of the table, a row of each load and file."""
    counts: dict[tuple[str, str], Counter[str]] = {}
    for one in runs:
        counts.setdefault(one.row, Counter())[one.verdict] += 1
    verdicts = ("met", "missed", "void", "not run")
    lines = [f"| load | controller | runs | {' | '.join(verdicts)} |", "| --- | --- |" + " --- |" * (1 + len(verdicts))]
    for (load, file), count in sorted(counts.items(), key=lambda item: (item[0][0], list(FILES).index(item[0][1]))):
        lines.append(f"| {load} | {file} | {count.total()} | {' | '.join(str(count[name]) for name in verdicts)} |")
    return lines


def main() -> int:
    """Exit code 0 if no verdict was wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blame", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--runs", type=int, help="end when there are so many, those of the file included")
    parser.add_argument("--append", type=Path, metavar="FILE", help="keep each run there, and go on from it")
    parser.add_argument("--load", action="append", help="only this one; repeatable")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout, nothing else")
    options = parser.parse_args()
    runs = [] if options.append is None else read_runs(options.append)
    for one in run(options.minutes, options.runs, list(runs), options.load):
        runs.append(one)
        if options.append is not None:
            with open(options.append, "a") as file:
                file.write(json.dumps(asdict(one)) + "\n")
    wrong = [f"{', '.join(one.row)}: {one.verdict}: {one.reason}" for one in runs if one.is_wrong]
    if options.json:
        print(json.dumps({"runs": len(runs), "wrong": wrong, "verdicts": [asdict(one) for one in runs]}))
        return 1 if wrong else 0
    stolen = sum(bool(one.stolen) for one in runs)
    print(*table(runs), f"{len(runs)} runs, {len(wrong)} wrong; the hypervisor took time in {stolen}", *wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
