"""The program that is open on the nodes of the machine: methods to choose, and a run by them. Without widgets."""

from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
import threading
import time
from pathlib import Path

from rds.core.errors import InputError, RdsError
from rds.core.exit_code import how_it_ended
from rds.core.parallel.pipe import receive, send
from rds.core.portable import portable
from rds.modes import load_mode
from rds.nc.run.node_methods import MOVES, check_methods, methods_of
from rds.nc.run.serial_methods import FREE
from rds.nc.run.serial_motion import MOTIONS
from rds.nc.run.serial_report import WORDS
from rds.panels.program.nodes_process import BEGINS, DONE, FAILED, NOTE
from rds.panels.program.nodes_run import CarriedOut, NodesRequest
from rds.panels.program.state import Program
from rds.panels.session.fields import Choice, Flag
from rds.panels.session.session import RUNS, Session
from rds.panels.session.task import Stopped, Task

PANEL = "program by the nodes"  # its name among the session's choices
_FIRST = ("A", "B", "C")  # what is chosen to begin with
_OWN_CLOCK = "as {}, each node by its own clock"
_TOLD = (
    WORDS
    | {f"{name}{FREE}": _OWN_CLOCK.format(name) for name in "BC"}
    | {MOVES: "from point to point, each module by its own controller"}
)
_MOTION = {"plan": "planned", "constant": "constant feed, no ramps"}
_ENDS_IN = 15.0  # s in which a process that is told to stop has stopped the nodes
_PROGRAM = "rds.panels.program.nodes_process"


class ByNodes:
    """What can be chosen of the machine's methods, none where it has none; `run()` makes a run of what is chosen."""

    def __init__(self, program: Program):
        self.program = program
        self.methods = methods_of(program.machine)
        first = _FIRST if "A" in self.methods else self.methods
        tip = "how the nodes bring the axes along the path; several are run one after the other, and compared"
        fields = [Flag(name, f"{name}: {_TOLD[name]}", tip, name in first) for name in self.methods]
        tip = "of methods A, B and C: what the nodes are sent"
        motion = Choice("motion", "Motion", tip, MOTIONS[0], {name: _MOTION[name] for name in MOTIONS})
        self.choices = program.session.choices(PANEL, [*fields, motion])

    @property
    def chosen(self) -> list[str]:
        """The methods that are chosen."""
        return [name for name in self.methods if self.choices[name]]

    def run(self) -> NodesRun:
        """A run of the program, saved first, in the mode of the program's choices; to be started.

        InputError with the reason where it cannot run.
        """
        program = self.program
        if not self.methods:
            raise InputError(f"{program.machine.name} has no nodes that carry programs out by themselves")
        if not self.chosen:
            raise InputError("choose a method first")
        if program.session.bus:
            raise InputError(
                "this page has a bus of its own, which programs are not run on here: run it by rds nc run --method in "
                "a terminal"
            )
        mode = str(program.choices["mode"])
        check_methods(self.chosen, mode)
        if program.text.changed:
            program.save()
        return NodesRun(program, self.chosen, mode, str(self.choices["motion"]))


class NodesRun:
    """One run, in a process of its own that stops the nodes when this one asks it to, or dies. `start()` returns at
    once; it is work that a progress bar can follow, and `result` is what came of it.
    """

    def __init__(self, program: Program, methods: list[str], mode: str, motion: str):
        self.session: Session = program.session
        self.file = program.text.path
        stamp = f"{time.strftime('%Y%m%d-%H%M%S')}-{self.file.stem}-by-{'-'.join(methods)}-{time.time_ns() % 10**6:06d}"
        self.folder: Path = self.session.folder / RUNS / stamp
        self.real_time = load_mode(mode).real_time
        self.order = NodesRequest(
            self.file, program.machine.path, program.setup(), tuple(methods), mode, motion, folder=self.folder
        )
        self.notes: list[str] = []  # what of the program is not carried out, told before anything moves
        self._process: subprocess.Popen[bytes] | None = None
        self._task: Task[CarriedOut] | None = None
        self._since = 0.0  # s, of the monotonic clock: when what goes on now began
        self._seconds: float | None = None  # that it takes, where this is known

    def start(self) -> Task[CarriedOut]:
        """Begin; InputError if the machine is in use."""
        title = f"{self.file.name} by the nodes"
        if self.real_time:
            self._task = self.session.work_on_machine(self, title, self._work, self._end)
        else:
            self._task = self.session.work(title, self._work, self._end)
        return self._task

    def stop(self) -> None:
        """Tell the nodes to stop; what was carried out until then is not kept."""
        if self._task is not None:
            self._task.stop()

    def _work(self, task: Task[CarriedOut]) -> CarriedOut:
        try:
            return self._carried_out(task)
        finally:
            self.session.give_machine_back(self)

    def _carried_out(self, task: Task[CarriedOut]) -> CarriedOut:
        process = self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", _PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        assert process.stdin is not None and process.stdout is not None
        try:
            with contextlib.suppress(OSError, ValueError):  # stopped already
                send(process.stdin, portable(self.order))
            if task.stopping:
                self._end()
            while True:
                kind, *words = pickle.loads(receive(process.stdout))
                if kind == BEGINS:
                    self._tell(task, *words)
                elif kind == NOTE:
                    self.notes.append(words[0])
                elif kind == DONE:
                    return words[0]
                elif kind == FAILED:
                    raise RdsError(words[0])
        except EOFError:
            code = process.wait()
            if task.stopping:
                raise Stopped from None
            raise RdsError(f"the process that carries the program out {how_it_ended(code)}; run it again") from None
        finally:
            self._close(process)
            try:
                process.wait(_ENDS_IN)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            process.stdout.close()

    def _tell(self, task: Task[CarriedOut], what: str, share: float, seconds: float | None) -> None:
        self._since, self._seconds = time.monotonic(), seconds
        task.advance(share, 1.0, "" if task.stopping else what)

    def _end(self) -> None:
        """Its process shall stop the nodes and end; from any thread."""
        if (process := self._process) is None:
            return  # it is about to be started, and hears of it then
        self._close(process)
        killer = threading.Timer(_ENDS_IN, process.kill)  # the nodes' own watchdogs stop them then
        killer.daemon = True
        killer.start()

    def _close(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        with contextlib.suppress(OSError, ValueError):
            process.stdin.close()

    # what a progress bar follows

    @property
    def share(self) -> float | None:
        """0 to 1; None where that is not known."""
        if self._task is None:
            return None
        share, each = self._task.share, 1.0 / len(self.order.methods)
        return share if share is None or self._part is None else share + each * self._part

    @property
    def seconds_left(self) -> float | None:
        """s; None where that is not known."""
        if self._task is None:
            return None
        if self._seconds is None or self._part is None:
            return self._task.seconds_left
        behind = round((self._task.share or 0.0) * len(self.order.methods))
        return self._seconds * (len(self.order.methods) - behind - self._part)

    @property
    def _part(self) -> float | None:
        """How much of the method that runs now is over; None where its time is not known."""
        return None if not self._seconds or self.done else min((time.monotonic() - self._since) / self._seconds, 1.0)

    @property
    def note(self) -> str:
        """What it does now."""
        return self._task.note if self._task is not None else ""

    @property
    def done(self) -> bool:
        """Whether it is over, and its report is written."""
        return self._task is not None and self._task.done

    @property
    def stopping(self) -> bool:
        """Whether it was asked to end."""
        return self._task is not None and self._task.stopping

    @property
    def stopped(self) -> bool:
        """Whether it ended because it was asked to."""
        return self._task is not None and self._task.stopped

    @property
    def error(self) -> BaseException | None:
        """Why it failed; None where it was only stopped."""
        return None if self._task is None or self._task.stopped else self._task.error

    @property
    def result(self) -> CarriedOut | None:
        """What came of it, when it is over."""
        return self._task.result if self._task is not None else None

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for its end; false after `timeout` s."""
        return self._task is None or self._task.wait(timeout)
