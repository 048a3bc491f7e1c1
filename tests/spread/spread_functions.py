"""Functions that are spread in tests."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

from rds.core.parallel import worker_count, worker_number


def square(x: float) -> float:
    """x²."""
    return x * x


def number(_: str) -> tuple[int, int | None, int | None]:
    """The process, and which of how many it is."""
    return os.getpid(), worker_number(), worker_count()


def picky(x: int) -> int:
    """An exception for 3."""
    if x == 3:
        raise ValueError("three will not do")
    return x


def deadly_once(work: tuple[int, str]) -> int:
    """The first to come for number 5 kills its process."""
    number, folder = work
    mark = Path(folder) / "died"
    if number == 5 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def deadly(x: int) -> int:
    """Number 2 always kills its process."""
    if x == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def deadly_among_many(x: int) -> int:
    """Number 7 always kills its process; the others take some time."""
    if x == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.05)
    return x


def deadly_to_its_parent(x: int) -> int:
    """Number 7 always kills the process above its own; the others take some time."""
    if x == 7:
        os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(0.05)
    return x


def slow(x: int) -> int:
    """Number 1 takes a minute."""
    if x == 1:
        time.sleep(60.0)
    return x


def loud(x: int) -> int:
    """It prints."""
    print("noise", x, flush=True)
    os.write(1, b"more noise\n")
    return x


def process(x: int) -> int:
    """The number of its process, once it has taken some time."""
    time.sleep(0.05)
    return os.getpid()


def process_of_a_long_item(x: int) -> None:
    """It prints the number of its process, and takes ten minutes."""
    print(os.getpid(), flush=True, file=sys.stderr)
    time.sleep(600.0)


def slow_first(work: tuple[int, str]) -> int:
    """Number 0 waits until another one is long done."""
    number, folder = work
    mark = Path(folder) / "done"
    while number == 0 and not mark.exists():
        time.sleep(0.01)
    if number == 0:
        time.sleep(1.0)
    mark.touch()
    return number


def meeting(work: tuple[str, int]) -> int | None:
    """Which worker it is, once so many processes are at it at the same time."""
    from rds.core.parallel import worker_number

    folder, of = work
    (Path(folder) / str(os.getpid())).touch()
    deadline = time.monotonic() + 60.0
    while len(os.listdir(folder)) < of:
        assert time.monotonic() < deadline, "the others do not come"
        time.sleep(0.01)
    return worker_number()
