"""A run that goes on while its caller does something else."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.modes.loop.changes import Change, timed
from rds.modes.loop.live_values import Channel
from rds.modes.loop.plan import Plan
from rds.modes.process.live import Live
from rds.modes.process.record import table
from rds.results import Result

_POLL = 0.1  # s: how often progress is told; the end wakes who waits for it


class RunLiveValues:
    """The live values of a run.

    `run.live_values.set("X.Pgain", 20.0)`, `run.live_values["X.Pgain"]`, `run.live_values.channels`.
    """

    def __init__(self, live: Live, channels: Mapping[str, Channel]):
        self._live = live
        self.channels = dict(channels)

    def set(self, name: str, value: float) -> None:
        """Let the loop take `value` at its next sample.

        InputError for a value that this run does not have, one that is out of its range (the message has its unit),
        or a run that is over.
        """
        self._live.set_all({name: value})

    def set_all(self, values: Mapping[str, float]) -> None:
        """Several live values, taken at the same sample: all of them or, on an InputError, none."""
        self._live.set_all(dict(values))

    def __getitem__(self, name: str) -> float:
        """What it was set to last; InputError if the run does not have it or is over."""
        return float(self._live.with_live_values(lambda live_values: live_values[name]))

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    def values(self) -> dict[str, float]:
        """All live values, as they were set last; InputError if the run is over."""
        return dict(self._live.with_live_values(lambda live_values: live_values.values()))


class Run:
    """A run that has been started. `wait()` gives its result; nothing else here waits for anything.

    An error of the run (ContractError, MachineError, ...) is raised by `wait()`. A real-time run goes on, to its safe
    end, if this process dies.
    """

    def __init__(self, plan: Plan, folder: Path | None, work: Callable[[Live | None, Progress | None], Result]):
        self.plan, self.folder = plan, folder
        self._live = Live()
        self._work = work
        self._result: Result | None = None
        self._error: BaseException | None = None
        self._over = threading.Event()  # not join(): a thread counts as ended where Ctrl-C interrupts that
        self._thread = threading.Thread(target=self._go, name="rds run", daemon=True)
        self.live_values = RunLiveValues(self._live, {channel.name: channel for channel in plan.channels()})

    def start(self) -> Run:
        """Begin."""
        self._thread.start()
        return self

    def ready(self, timeout: float | None = None) -> bool:
        """Wait until live values can be set and rows be read, or the run is over; false after `timeout` s."""
        if timeout is not None:
            return self._live.attached.wait(timeout) or self.done
        while not self._live.attached.wait(_POLL):
            if self.done:
                return True
        return True

    @property
    def done(self) -> bool:
        """Whether it is over: `wait()` then returns at once."""
        return self._over.is_set()

    @property
    def progress(self) -> tuple[int, int]:
        """Samples taken, samples in all (of a part program: as many as it takes without waiting)."""
        return self._live.taken, self.plan.samples

    @property
    def changes(self) -> list[Change]:
        """The changes of live values that the loop has taken so far."""
        if self._result is not None:
            return [Change(*change) for change in self._result.meta["changes"]]
        try:
            return timed(self._live.with_live_values(lambda live_values: live_values.notes())[1], self.plan.T)
        except InputError:
            return []

    @property
    def rows(self) -> Result | None:
        """What has been recorded so far, as columns with units (of a long run: its latest part); None: nothing yet."""
        if self._result is not None:
            return self._result
        _, values = self.read()
        if not len(values):
            return None
        columns, units = table(self._live.columns, self._live.units, values, self.plan.T)
        meta = {"axes": self.plan.names, "sample_period": self.plan.T, "mode": self.plan.mode}
        return Result(columns, units, meta)

    @property
    def columns(self) -> list[str]:
        """The names of the columns of `read`."""
        return self._live.columns

    @property
    def units(self) -> dict[str, str]:
        """The units of the columns."""
        return self._live.units

    def read(self, first: int = 0) -> tuple[int, Any]:
        """The rows from number `first` on (array, rows × columns), and the number of the first that is still there.

        For those who look again and again: next time ask from the end of what was read. Times are in ns here, and
        samples are numbers.
        """
        return self._live.read(first)

    def stop(self) -> None:
        """Ask for a safe end; what was recorded is kept. A part program comes to rest on its path first."""
        if not self.done:
            self._live.stop()

    def wait(self, progress: Progress | None = None, timeout: float | None = None) -> Result:
        """The result, once the run is over; TimeoutError if it is not after `timeout` s.

        `progress(samples taken, samples in all)` is called now and then. Ctrl-C asks for the end and waits on; a
        second one does not wait.
        """
        if timeout is not None and not self._over.wait(timeout):
            raise TimeoutError(f"the run is not over after {timeout:g} s")
        while not self.done:
            try:
                self._over.wait(_POLL)
                if progress and self._live.attached.is_set():
                    progress(*self.progress)
            except KeyboardInterrupt:
                if self._live.was_cut:
                    raise
                self._live.stop(hard=True)
        if self._error is not None:
            raise self._error
        assert self._result is not None
        return self._result

    def here(self, progress: Progress | None = None) -> Result:
        """Run in this thread, without live values, and return the result."""
        return self._work(None, progress)

    def _go(self) -> None:
        try:
            self._result = self._work(self._live, None)
        except BaseException as error:
            self._error = error
        finally:
            self._over.set()

    def __repr__(self) -> str:
        taken, of = self.progress
        state = "over" if self.done else "goes on"
        ending = f", {self._result.meta['ending']}" if self._result is not None else ""
        return f"<Run: {self.plan.mode} of {', '.join(self.plan.names)}, {state}{ending}, {taken} of {of} samples>"
