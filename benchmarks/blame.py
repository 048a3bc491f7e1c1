"""Verdicts of timing against truth: correct and slow controllers on a computer under load of every kind.

python -m benchmarks.blame [--minutes 10] [--load NAME ...] [--json]

Each run is an emulation of half a second at 1 kHz. *Wrong* counts correct controllers that were missed and slow ones
that were met; a run that is *void* blames nobody, and counts apart.
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
from pathlib import Path
from typing import Any

import rds
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


@contextmanager
def _programs(*commands: list[str]) -> Iterator[None]:
    running = [subprocess.Popen([sys.executable, "-c", *command]) for command in commands]
    try:
        time.sleep(0.1)
        yield
    finally:
        for program in running:
            program.kill()
            program.wait()


@contextmanager
def _stops(folder: Path) -> Iterator[None]:
    """The target is stopped for 20 to 60 ms, again and again."""
    ended, chance = threading.Event(), random.Random(1)

    def stop() -> None:
        while not ended.wait(chance.uniform(0.02, 0.15)):
            with suppress(OSError, ValueError, KeyError):
                target = json.loads((folder / PROCESSES).read_text())["target"]
                os.kill(target, signal.SIGSTOP)
                time.sleep(chance.uniform(0.02, 0.06))
                os.kill(target, signal.SIGCONT)

    thread = threading.Thread(target=stop)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def loads(folder: Path) -> dict[str, Callable[[], Any]]:
    """What the computer does beside a run whose record goes to `folder / "run"`."""
    cpus = sorted(os.sched_getaffinity(0))
    return {
        "none": lambda: _programs(),
        "busy cores": lambda: _programs(*[[_BUSY]] * (2 * len(cpus))),
        "real-time hog": lambda: _programs(*([_HOG, str(cpu)] for cpu in cpus)),
        "stopped process": lambda: _stops(folder / "run"),
        "disk": lambda: _programs([_DISK, str(folder / "filled")]),
        "memory": lambda: _programs([_MEMORY], [_MEMORY]),
    }


def run(minutes: float, chosen: list[str] | None = None) -> Iterator[tuple[str, str, str, str]]:
    """Load, file, verdict and reason of each run, one load and file after the other until the time is over."""
    end = time.monotonic() + 60 * minutes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, text in enumerate(FILES.values()):
            (folder / f"controller{number}.py").write_text(text)
        while True:
            for load, begin in loads(folder).items():
                for number, file in enumerate(FILES):
                    if chosen and load not in chosen:
                        continue
                    if time.monotonic() > end:
                        return
                    experiment = rds.Experiment(
                        duration=PERIODS * 1e-3,
                        reference=rds.sinusoid(2.0, 1.0),
                        controller={"file": str(folder / f"controller{number}.py")},
                    )
                    with begin():
                        result = experiment.run("emulation", out=folder / "run")
                    reason = result.meta["verdict_reason"]
                    yield load, file, str(result.verdict), reason


def is_wrong(file: str, verdict: str) -> bool:
    """Whether the verdict says the opposite of the truth."""
    return verdict == ("missed" if file.startswith("correct") else "met")


def main() -> int:
    """Exit code 0 if no verdict was wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blame", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--load", action="append", help="only this one; repeatable")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout, nothing else")
    options = parser.parse_args()
    counts: dict[tuple[str, str], Counter[str]] = {}
    wrong: list[str] = []
    for load, file, verdict, reason in run(options.minutes, options.load):
        counts.setdefault((load, file), Counter())[verdict] += 1
        if is_wrong(file, verdict):
            wrong.append(f"{load}, {file}: {verdict}: {reason}")
    total = sum(count.total() for count in counts.values())
    if options.json:
        rows = [{"load": load, "file": file, **count} for (load, file), count in counts.items()]
        print(json.dumps({"runs": total, "wrong": wrong, "verdicts": rows}))
        return 1 if wrong else 0
    print("| load | controller | runs | met | missed | void |\n| --- | --- | --- | --- | --- | --- |")
    for (load, file), count in counts.items():
        print(f"| {load} | {file} | {count.total()} | {count['met']} | {count['missed']} | {count['void']} |")
    print(f"{total} runs, {len(wrong)} wrong", *wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
