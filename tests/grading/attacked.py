"""What tests of attacks share: a hostile submission run as a grader does, and a look at what it left behind."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from rds.core.types import Reference
from rds.grading.grade import Status
from rds.grading.sandbox import Limits, Pool, SubmissionError

HONEST = """
import math, random
import numpy as np
initial_state = (0.0, 0)
params = {"kp": 31.7}
def control(t, r, y, state, params):
    integral, k = state
    error = r.position - y
    integral += 1e-3 * error
    noise = 0.01 * random.random() + 0.01 * np.random.rand()
    return params["kp"] * math.sin(error) + float(np.tanh(integral)) + noise, (integral, k + 1)
"""
SAMPLES = 40


class Outcome(NamedTuple):
    """How a submission ended, what it answered before, in two runs, and what it printed."""

    status: Status
    reason: str
    answers: list[Any]
    output: str


def run(pool: Pool, path: Path, limits: Limits) -> Outcome:
    """Two short cases of the controller at `path`, the second one beside its end."""
    answers: list[Any] = []
    output = ""
    try:
        with pool.open(path, limits) as subject:
            try:
                for samples in (SAMPLES, 3):
                    subject.begin_control()
                    for k in range(samples):
                        voltage = subject.control(k * 1e-3, Reference(0.1 * k, 100.0, 0.0), 0.05 * k)
                        answers.append(voltage)
            finally:
                output = subject.output
    except SubmissionError as error:
        return Outcome(error.status, error.reason, answers, output)
    return Outcome(Status.OK, "", answers, output)


def below(process: int) -> set[int]:
    """The numbers of all processes below `process`."""
    children: set[int] = set()
    with suppress(OSError):  # it has just ended
        for thread in os.listdir(f"/proc/{process}/task"):
            children.update(map(int, Path(f"/proc/{process}/task/{thread}/children").read_text().split()))
    return children.union(*map(below, children))


class Machine:
    """The computer as it was before: looked at again by `fault`."""

    def __init__(self, pool: Pool):
        self._pool = pool
        self._processes, end = self._below(), time.monotonic() + 0.5
        while time.monotonic() < end:  # until those that have just ended are gone
            self._processes = self._below()
            time.sleep(0.01)
        self._descriptors = len(os.listdir("/proc/self/fd"))

    def fault(self) -> str:
        """What is not as it was before; nothing if all is. Waits for up to 3 s for the kernel to take things down."""
        end = time.monotonic() + 3.0
        while (said := self._look()) and time.monotonic() < end:
            time.sleep(0.005)
        return said

    def _look(self) -> str:
        user = self._pool._user
        if more := self._below() - self._processes:
            return f"processes {more} are left"
        if self._processes - self._below():
            return "a warm interpreter is gone"
        if user and (more := self._of(user) - self._processes - self._tops()):
            return f"processes {more} of the sandbox's user are left"
        if user and (files := [p for folder in ("/tmp", "/dev/shm") for p in _files_of(user, folder)]):
            return f"files are left: {files}"
        if len(os.listdir("/proc/self/fd")) != self._descriptors:
            return "descriptors are left open"
        return ""

    def _tops(self) -> set[int]:
        return {each._process.pid for each in self._pool._interpreters.values()}

    def _below(self) -> set[int]:
        return set().union(*map(below, self._tops()))

    @staticmethod
    def _of(user: int) -> set[int]:
        found = set()
        for process in Path("/proc").glob("[0-9]*"):
            try:
                if process.stat().st_uid == user:
                    found.add(int(process.name))
            except OSError:
                continue
        return found


def _files_of(user: int, folder: str) -> list[str]:
    found = []
    for entry in os.scandir(folder):
        try:
            if entry.stat(follow_symlinks=False).st_uid == user:
                found.append(entry.path)
        except OSError:
            continue
    return found
