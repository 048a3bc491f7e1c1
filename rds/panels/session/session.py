"""One sitting: the folder of a student's files, what was chosen in each panel, the work that goes on, the machine."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from rds.bus.hub.bus_settings import DEFAULT_BAUD, SERIAL
from rds.bus.tools.link import BUILTIN, bus_options
from rds.core.atomic import write_whole
from rds.core.errors import InputError, MachineError
from rds.panels.session.choices import Choices
from rds.panels.session.claim import Claim
from rds.panels.session.fields import Field
from rds.panels.session.kept_runs import KeptRun, kept_runs, runs_that_go_on
from rds.panels.session.task import Task

KEPT = "session.json"  # the choices of all panels
RUNS = "runs"
MOST_UNWRITTEN = 8  # runs at once whose pictures and reports are still to come: each keeps its samples in memory
T = TypeVar("T")


@dataclass(frozen=True)
class Message:
    """Something that happened, for the line that everybody sees: `kind` is note, warning or error."""

    when: float  # s since 1970
    kind: str
    text: str


class Session:
    """What all panels share. Nothing here waits for anything; long work is a `Task`, a run has a handle of its own.

    `folder` holds the student's files, `runs/` and what was chosen (`session.json`). A second session on the same
    folder, of another page, shares the files and finds the machine in use while this one runs something.
    """

    def __init__(self, folder: str | Path = ".", machine: str = "mini-cnc", bus: Mapping[str, Any] | None = None):
        """`bus` holds the arguments of can.Bus, as in the `[bus]` table of an experiment; none: the built-in bus."""
        self.folder = Path(folder).resolve()
        self.machine = machine
        self.bus = dict(bus or {})
        if self.interface == BUILTIN and self.bus.get("channel") is not None:
            self.bus["channel"] = str(self.bus["channel"])  # 0 is a channel's name there
        self.language = ""  # of the page, for what is drawn: the name of a file of texts, "" for English
        self.messages: list[Message] = []
        self.tasks: list[Task[Any]] = []
        self.machine_user: Any = None  # what holds the machine now: something with stop()
        self.channels: set[str] = set()  # of the built-in bus, on which this page has started other machines
        self._choices: dict[str, Choices] = {}
        self._watchers: list[Callable[[Message], None]] = []
        self.writing = threading.Lock()  # held by whoever makes pictures and reports of a run: one after another
        self.unwritten = threading.BoundedSemaphore(MOST_UNWRITTEN)  # held from a run's start until they are made
        self._lock = threading.Lock()
        self._claim: Claim | None = None
        self._kept = self._read_kept()
        self._own: str | None = None
        self._own_channel()

    # the bus

    @property
    def interface(self) -> str:
        """python-can's name for the kind of bus."""
        return str(self.bus.get("interface", BUILTIN))

    @property
    def bus_options(self) -> dict[str, Any]:
        """What goes to can.Bus beside interface and channel: without the bit rate, modules hear nothing."""
        return bus_options(self.bus)

    # choices

    def choices(self, panel: str, fields: Iterable[Field]) -> Choices:
        """The choices of a panel: those that were kept in this folder, else the defaults. Changes are kept."""
        if panel not in self._choices:
            made = Choices(fields)
            for sentence in made.load(self._kept.get(panel, {})):
                self.say(f"{panel}: {sentence}; the default was taken", "warning")
            made.watch(lambda name: self.keep(panel))
            self._choices[panel] = made
        return self._choices[panel]

    def kept(self, panel: str, name: str) -> Any:
        """The value of a panel's choice as it was kept in this folder, unchecked; None where it was not."""
        return self._kept.get(panel, {}).get(name)

    def keep(self, panel: str) -> None:
        """Write the choices of a panel to the folder, beside what any page has kept of others.

        A folder that cannot be written to is said once, and nothing else breaks.
        """
        with contextlib.suppress(OSError, ValueError, RecursionError):  # what cannot be read is written anew
            self._kept |= _kept_in(self.folder / KEPT)
        self._kept[panel] = self._choices[panel].values()
        try:
            write_whole(self.folder / KEPT, json.dumps(self._kept, indent=1, default=str).encode())
        except InputError as error:
            if not any(message.text.startswith("choices are not kept") for message in self.messages):
                self.say(f"choices are not kept: {error}", "warning")

    def refresh(self) -> None:
        """Take over the choices that another page of this folder has kept since, and defaults where none is kept."""
        kept = self._read_kept()
        self._kept = dict(kept)  # which each choice that is taken over writes anew
        for panel, choices in self._choices.items():
            defaults = {name: field.default for name, field in choices.fields.items() if "." not in name}
            choices.load(defaults | kept.get(panel, {}))

    def _read_kept(self) -> dict[str, dict[str, Any]]:
        path = self.folder / KEPT
        try:
            return _kept_in(path)
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, RecursionError) as error:
            self.say(f"{path} cannot be read ({error}); panels begin with their defaults", "warning")
            return {}

    # messages

    def say(self, text: str, kind: str = "note") -> None:
        """A message for whoever is at the page."""
        message = Message(time.time(), kind, text)
        self.messages.append(message)
        del self.messages[:-200]
        for watcher in tuple(self._watchers):
            watcher(message)

    def watch(self, watcher: Callable[[Message], None]) -> Callable[[], None]:
        """Call `watcher(message)` for each new message, in whichever thread says it; the answer ends that."""
        self._watchers.append(watcher)
        return lambda: self._watchers.remove(watcher)

    # work

    def work(
        self,
        title: str,
        work: Callable[[Task[T]], T],
        on_stop: Callable[[], None] | None = None,
        own_code: bool = False,
    ) -> Task[T]:
        """Begin long work; see Task."""
        task = Task(title, work, on_stop, own_code)
        with self._lock:
            self.tasks = [each for each in self.tasks if not each.done] + [task]
        return task.start()

    # the machine

    def take_machine(self, what: str, user: Any) -> None:
        """The machine is used for `what` from now on; InputError that says by whom it is in use already.

        `user.stop()` ends that use; `give_machine_back(user)` is due at its end.
        """
        with self._lock:
            if self.machine_user is not None:
                assert self._claim is not None  # both are set and cleared together
                raise InputError(f"the machine is in use on this page: {self._claim.what}; stop that first")
            claim = Claim(self.folder, what)
            if going := self.runs_that_go_on():  # its page was killed, or it was begun in a terminal
                claim.release()
                raise InputError(
                    f"the machine is in use by a run that goes on without a page, {going[0].name}; wait for its end, "
                    "or press Emergency stop, which ends it"
                )
            self._claim, self.machine_user = claim, user

    def work_on_machine(
        self,
        user: Any,
        title: str,
        work: Callable[[Task[T]], T],
        on_stop: Callable[[], None] | None = None,
        held_for: str | None = None,
    ) -> Task[T]:
        """Take the machine for `user` and begin; the work itself gives it back. InputError if it is in use.

        Other pages are told `held_for`, by default `title`.
        """
        self.take_machine(held_for or title, user)
        try:
            return self.work(title, work, on_stop)
        except BaseException:  # there is no thread to be had
            self.give_machine_back(user)
            raise

    def give_machine_back(self, user: Any) -> None:
        """The use is over; whoever is not the user changes nothing."""
        with self._lock:
            if self.machine_user is user:
                self.machine_user = None
                if self._claim is not None:
                    self._claim.release()
                self._claim = None

    def emergency_stop(self) -> str:
        """Zero volts for all modules of this session's machine, now; a sentence that says who acknowledged.

        Ends the run that goes on here or in another page of this folder. Raises MachineError where the bus fails:
        then cut the power.
        """
        user = self.machine_user
        try:
            stopped = self._stop_modules()
        finally:
            if user is not None:
                with contextlib.suppress(Exception):
                    user.stop()
            for run in self.runs_that_go_on():
                run.stop()
        if stopped and self._line() is not None:
            text = f"emergency stop: {len(stopped)} units on the serial line stand; home the machine"
        elif stopped:
            text = f"emergency stop: {len(stopped)} modules are at zero volts and stay so until they are released"
        else:
            text = (
                "emergency stop sent; no module is on the bus that acknowledges it. If something moves, cut the power"
            )
        self.say(text, "warning")
        return text

    def release_emergency_stop(self) -> str:
        """Let the modules be used again; a sentence. MachineError where a button is still pressed."""
        from rds.bus.tools.estop import reset_everything

        free = [node for channel in self._channels() for node in self._on(channel, reset_everything)]
        if free:
            text = f"{len(free)} modules are free again"
        else:
            text = "no module is on the bus that is to be released; a machine that a run or Jog starts ends with it"
        self.say(text)
        return text

    def _stop_modules(self) -> list[int]:
        from concurrent.futures import ThreadPoolExecutor

        from rds.bus.tools.estop import stop_everything

        line = self._line()
        channels = self._channels()
        with ThreadPoolExecutor(len(channels) + 1) as pool:  # none waits for another's answers, or fails with it
            asked = [] if line is None else [pool.submit(self._stop_units, line)]
            asked += [pool.submit(self._on, channel, stop_everything) for channel in channels]
        stopped = [node for each in asked for node in each.result()]
        if line is None and self.interface == BUILTIN and self._own is None:  # nobody may believe that it was stopped
            raise MachineError(
                f"emergency stop: {self.machine} cannot be read, so the channel of its modules is not known; "
                "cut the power, or correct the file and press again"
            )
        return stopped

    def _line(self) -> str | None:
        """The serial line that the machine's units are on; None where its modules are on CAN."""
        from rds.bus.modules.dialects import SERIAL_DIALECTS, bus_interface
        from rds.machines import load_machine

        with contextlib.suppress(Exception):  # a broken file: what there was before is stopped on the built-in bus
            machine = load_machine(self.machine)
            dialect = self.bus.get("dialect", SERIAL_DIALECTS[0])
            if dialect in SERIAL_DIALECTS and bus_interface(machine, self.bus) == SERIAL:
                return str(self.bus.get("channel") or machine.channel)
        return None

    def _stop_units(self, line: str) -> list[int]:
        """Those on the line of a served machine, or behind a port; who is on a run's own line stops with the run."""
        from rds.bus.modules.dcs.port import is_device, is_there
        from rds.bus.modules.dcs.scan import stop_channel

        there = is_device(line) or is_there(line)
        return stop_channel(line, float(self.bus.get("baud", DEFAULT_BAUD))) if there else []

    def _channels(self) -> list[str | None]:
        """Where modules of this session, or of a run in its folder, may be: the machine's own channel first."""
        line = self._line()
        if line is None and self.interface != BUILTIN:
            return [self.bus.get("channel")]
        own = [] if line is not None or (channel := self._own_channel()) is None else [channel]
        runs = {channel for run in self.runs_that_go_on() if (channel := run.channel) is not None}
        return [*own, *sorted((self.channels | runs).difference(own))]

    def _own_channel(self) -> str | None:
        """The machine's on the built-in bus, as its file said last: one that is broken by now is no reason not to stop.

        None if it never could be read.
        """
        from rds.machines import load_machine

        with contextlib.suppress(Exception):  # whatever is wrong in it, what was known before is stopped
            self._own = self.bus.get("channel") or load_machine(self.machine).name
        return self._own

    def _on(self, channel: str | None, act: Callable[[Any], list[int]]) -> list[int]:
        from rds.bus.tools.link import open_bus

        # the built-in bus takes whoever comes as it is, also where a run has given it another timing
        interface = self.interface if self._line() is None else BUILTIN
        options = {} if interface == BUILTIN else self.bus_options
        with open_bus(interface, channel, **options) as bus:
            return act(bus)

    # runs

    def runs(self, most: int | None = None) -> list[KeptRun]:
        """The runs kept in this folder, the latest first, at most `most`."""
        return kept_runs(self.folder / RUNS, most)

    def runs_that_go_on(self) -> list[KeptRun]:
        """The runs of this folder that any page or terminal has going now."""
        return runs_that_go_on(self.folder / RUNS)


def _kept_in(path: Path) -> dict[str, dict[str, Any]]:
    """The choices in a file, by panel. OSError, ValueError or RecursionError where it cannot be read."""
    kept = json.loads(path.read_text())
    if not isinstance(kept, dict):
        return {}
    return {panel: values for panel, values in kept.items() if isinstance(values, dict)}
