"""Warm interpreters, and submissions opened in fresh cells below them."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from rds.grading.sandbox.errors import SandboxError
from rds.grading.sandbox.interpreter import Interpreter
from rds.grading.sandbox.limits import Limits
from rds.grading.sandbox.loaded_submission import LoadedSubmission
from rds.grading.sandbox.processors import Processors
from rds.grading.sandbox.requirements import available, fault_of, missing
from rds.grading.sandbox.submission import read_submission
from rds.grading.sandbox.supervise import Supervisor
from rds.grading.sandbox.user import sandbox_user

KITS = (("numpy",), ("numpy", "scipy"), ("numpy", "scipy", "control", "matplotlib"))
"""What warm interpreters have imported; a submission gets the first that has all it imports."""


class Pool:
    """Opens submissions. `jobs` is how many run at the same time on this computer, in all its pools together.

    Interpreters for the packages in `preload` are started at once, others when a submission needs them. `slot`, from 0
    to `jobs` - 1, tells pools that run at the same time apart, so that each has a processor of its own. Use a pool in
    the thread that made it: its sandboxes end with that thread. SandboxError where the sandbox does not hold here, with
    the remedy: there is no other way to run a submission. `is_tried` says that another process of this program has
    tried the walls of this computer, just now, and that they hold.
    """

    def __init__(
        self, jobs: int = 1, preload: Sequence[str] = ("numpy",), slot: int | None = None, is_tried: bool = False
    ):
        fault = missing() if is_tried else available()
        if fault:
            raise SandboxError(fault)
        self._user = sandbox_user()
        self._jobs, self._slot = jobs, slot
        self._lock = threading.Lock()
        self._supervisor = Supervisor()
        self._interpreters: dict[tuple[str, ...], Interpreter] = {}
        try:
            for kit in sorted({_kit(preload[: n + 1]) for n in range(len(preload))} or {KITS[0]}, key=len):
                self._interpreters[kit] = Interpreter(kit, self._user)
        except BaseException:
            self.close()
            raise

    counts_work = True

    def share(self, jobs: int, slot: int | None) -> None:
        """From now on `jobs` run at the same time, and this pool's are in `slot`."""
        self._jobs, self._slot = jobs, slot

    def fault(self) -> str | None:
        """As `available`, tried on an interpreter of this pool."""
        return fault_of(lambda: self._interpreter(KITS[0]))

    def open(self, path: str | Path, limits: Limits | None = None, kind: str = "controller") -> LoadedSubmission:
        """The submission at `path`, loaded in a fresh cell: a context manager that ends its processes.

        `kind` is "controller", "model", "interpolator" or "functions". SubmissionError if it cannot be loaded.
        """
        submission = read_submission(Path(path))
        kit = _kit([name for name in KITS[-1] if submission.imports(name)])
        processors = Processors.of(self._jobs, self._slot)
        return LoadedSubmission(
            submission, kind, limits or Limits(), lambda: self._interpreter(kit), self._supervisor, processors
        )

    def close(self) -> None:
        """End all processes."""
        for interpreter in self._interpreters.values():
            interpreter.close()
        self._interpreters.clear()
        self._supervisor.close()

    def __enter__(self) -> Pool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _interpreter(self, kit: tuple[str, ...]) -> Interpreter:
        with self._lock:
            found = self._interpreters.get(kit)
            if found is None or not found.is_alive:  # the first time, or somebody killed it
                if found is not None:
                    found.close()
                found = self._interpreters[kit] = Interpreter(kit, self._user)
            found.wait()
            return found


def _kit(names: Sequence[str]) -> tuple[str, ...]:
    return next(kit for kit in KITS if set(names) & set(KITS[-1]) <= set(kit))
