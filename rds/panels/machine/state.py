"""The machine as modules on a bus: started, found, asked for their data, tuned, stepped. One thing at a time."""

from __future__ import annotations

import contextlib
import subprocess
import weakref
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeVar

from rds.bus.hub.bus_settings import DEFAULT_BAUD, SERIAL
from rds.bus.modules.dcs.port import is_device, is_there
from rds.bus.modules.dialects import DEFAULT, interface_of
from rds.bus.tools.link import BUILTIN, bus_name, default_channel
from rds.core.errors import InputError, MachineError, RdsError
from rds.core.toml_file import read_toml
from rds.machines import Machine, load_machine, machine_names
from rds.panels.machine.configuration import machine_files
from rds.panels.machine.fields import SERVED, STEP, TUNING, tuning_values
from rds.panels.session.fields import Choice
from rds.panels.session.session import Session
from rds.panels.session.task import Stopped, Task
from rds.results import Result

T = TypeVar("T")
ON_LINE = "dcs"  # the dialect of units on a serial line
DESCRIBES_ITSELF = "oacs"  # the dialect whose modules say what they are


class MachineState:
    """What can be done with the modules on the bus of a session. Everything that takes time gives a Task.

    `rows` are what the last scan found, `data` what modules said of themselves, by number (as `Information.as_dict`),
    `response` the last recorded step, `kept` the folder of its tables. The simulated machine that it starts ends with
    it, or with its process.
    """

    def __init__(self, session: Session):
        self.session = session
        machines = {session.machine: session.machine} | {name: name for name in machine_names()}
        machines |= {str(path): path.name for path in machine_files(session.folder)}
        which = Choice(
            "machine", "Machine", "Whose modules are simulated, or are on the bus", session.machine, machines
        )
        said = str(session.bus.get("dialect"))
        usual = said if said in SERVED.options else self._fitting(session.machine, DEFAULT)
        self.choices = session.choices("machine", [which, replace(SERVED, default=usual), *STEP])
        if said in SERVED.options:  # goes before what was kept of another bus
            self.choices.set("dialect", said)
        self.choices.watch(self._fit_dialect)
        self.tuning = session.choices("module tuning", TUNING)
        self.rows: list[dict[str, Any]] = []
        self.data: dict[int, dict[str, Any]] = {}
        self.response: Result | None = None
        self.kept: Path | None = None
        self._responded = 0  # the module whose response that is
        self._server: subprocess.Popen[bytes] | None = None
        self._task: Task[Any] | None = None
        self._end: weakref.finalize[Any, Any] | None = None

    def offer(self, path: Path) -> None:
        """Let a machine's file that was written meanwhile be chosen; the bus in use stays the chosen one's."""
        which = self.choices.fields["machine"]
        assert isinstance(which, Choice)
        self.choices.replace([replace(which, options=dict(which.options) | {str(path): path.name})])

    def _fit_dialect(self, name: str) -> None:
        """Another machine is chosen; the dialect stays where the session's bus says it."""
        if name == "machine" and "dialect" not in self.session.bus:
            self.choices.set("dialect", self._fitting(self.choices["machine"], self.choices["dialect"]))

    @staticmethod
    def _fitting(machine: str, now: str) -> str:
        """Modules that a machine's file describes are distributed ones: what they say of themselves is the point."""
        with contextlib.suppress(InputError):  # of a file that will not do: said when it is used
            axes = load_machine(machine).axes.values()
            if any(axis.module.get("motor") for axis in axes):
                return ON_LINE
            if now == ON_LINE:
                return DEFAULT
            if all(axis.module for axis in axes):
                return DESCRIBES_ITSELF
            return DEFAULT if now == DESCRIBES_ITSELF else now
        return now

    # where

    @property
    def machine(self) -> Machine:
        """The machine that is chosen; InputError where its file will not do."""
        return load_machine(self.choices["machine"])

    @property
    def bus(self) -> tuple[str, str | None]:
        """Interface and channel: of the session's bus, else those of simulated modules of the machine chosen."""
        interface = self.session.interface
        if "interface" not in self.session.bus:
            interface = interface_of(self.choices["dialect"], interface)
        return interface, default_channel(self.machine, interface, self.session.bus.get("channel"))

    @property
    def serves(self) -> bool:
        """Whether the modules that this page has started run."""
        return self._server is not None and self._server.poll() is None

    # the simulated machine

    def start(self) -> Task[None]:
        """Start the simulated modules of the machine chosen. InputError where that cannot be."""
        interface, channel = self.bus
        machine, dialect = self.machine, self.choices["dialect"]
        on_line = dialect == ON_LINE and interface == SERIAL and not is_device(str(channel))
        if interface != BUILTIN and not on_line:
            raise InputError(
                f"the bus is {bus_name(interface, channel)}, whose modules are real: switch them on, and scan"
            )
        if self.serves:
            raise InputError("this page runs the simulated modules already; stop them first")
        if dialect == DESCRIBES_ITSELF:
            from rds.bus.modules.oacs.module_data import read_modules

            read_modules(machine)
        assert channel is not None

        def begin(task: Task[None]) -> None:
            from rds.bus.hub.address import channels
            from rds.bus.modules.calling import find_machine
            from rds.bus.modules.server_process import end_server, start_server

            there = (
                is_there(channel) if on_line else channel in channels() and find_machine(machine, interface, channel)
            )
            if there:
                raise InputError(f"modules answer on {bus_name(interface, channel)} already: press Scan to see them")
            self._server = start_server(dialect, machine.path, channel)
            self._end = weakref.finalize(self, end_server, self._server)
            if not on_line:
                self.session.channels.add(channel)

        return self._work("start the simulated modules", begin)

    def end(self) -> None:
        """Stop the simulated modules; nothing where none run."""
        if self._task is not None and not self._task.done:
            raise InputError("first stop what goes on with the modules")
        if self._end is not None:
            self._end()
        self._server = self._end = None
        self.rows, self.data = [], {}

    # who is there

    def scan(self) -> Task[list[dict[str, Any]]]:
        """Look who is on the bus; nothing moves. The data of modules that describe themselves are downloaded too."""
        interface, channel = self.bus

        def look(task: Task[Any]) -> list[dict[str, Any]]:
            from rds.bus.tools.scan import scan_all

            self.rows, self.data = [], {}
            on_line = interface == SERIAL and self.choices["dialect"] == ON_LINE
            own = interface == BUILTIN or (on_line and not is_device(str(channel)))
            if on_line:
                rows = _on_line(str(channel), self.session.bus.get("baud", DEFAULT_BAUD), own)
            else:
                rows = scan_all(interface, channel, **self.session.bus_options)
            if not rows:
                raise MachineError(
                    f"no module answers on {bus_name(interface, channel)}; "
                    + ("start the simulated modules" if own else "check their power and the cable")
                )
            numbers = [row["id"] for row in rows if row["dialect"] == DESCRIBES_ITSELF]
            for done, number in enumerate(numbers):
                task.advance(done, len(numbers), f"asking module {number} for its data")
                with self._module(number) as module:
                    self.data[number] = module.info().as_dict()
            self.rows = rows
            return rows

        return self._work("scan of the bus", look)

    def describing(self) -> dict[int, str]:
        """The modules that can be tuned, by number, with their type."""
        return {number: f"{number}: {data['type_text']}" for number, data in self.data.items()}

    # one module

    def load_tuning(self, number: int) -> None:
        """Put the tuning that the module said it uses into the fields."""
        self._put(self._data(number)["tuning"])

    def tune(self, number: int) -> Task[dict[str, Any]]:
        """Set what stands in the fields; the task's result is what is in force then."""
        self._data(number)
        controller, values = tuning_values(self.tuning)

        def act(task: Task[Any]) -> dict[str, Any]:
            with self._module(number) as module:
                set_ = asdict(module.tune(controller, **values))
            set_["controller"] = set_["controller"].name
            self.data[number]["tuning"] = set_
            return set_

        return self._work(f"tuning of module {number}", act)

    def step(self, number: int) -> Task[Result]:
        """Step the module's set point, record the response until it stands, and keep it in a new folder, step-1...

        It can be stopped, which stops it.
        """
        if self._data(number)["kind"] == "tool":
            raise InputError(f"module {number} is a tool: it has a speed and no position to step")
        by, period, settled = (self.choices[name] for name in ("step", "period", "settled"))

        def act(task: Task[Any]) -> Result:
            with self._module(number) as module:
                self.response = module.step(
                    by,
                    period,
                    settled=settled,
                    progress=lambda done, of: task.advance(abs(done), abs(of), f"the axis has gone {done} counts"),
                )
            self._responded = number
            from rds.results.files import new_folder, save_all

            self.kept = new_folder(self.session.folder, "step")
            save_all(self.response, self.kept)
            return self.response

        return self._work(f"step of module {number}", act)

    def suggest(self, number: int) -> Mapping[str, float]:
        """Gains by Ziegler and Nichols from the last step, put into the fields.

        InputError where they cannot be had, or that step was another module's.
        """
        from rds.bus.modules.oacs.tuning import gains_from_step

        if self.response is None or self._responded != number:
            raise InputError(f"there is no response of module {number} yet: press Step first")
        gains = gains_from_step(self.response, self.response.axes[0], self.tuning["controller"])._asdict()
        for name, value in gains.items():
            self.tuning.set(name, float(f"{value:.6g}"))
        return gains

    def save_tuning(self, number: int, name: str) -> Path:
        """Write what stands in the fields to a file of the folder; InputError for a name that will not do."""
        from rds.core.atomic import write_whole
        from rds.core.toml_text import toml_text

        path = self._file(name)
        if path.exists():
            raise InputError("there is such a file already; choose another name", str(path))
        table = {"module": number, "type": self._data(number)["type_text"], **self.tuning.values()}
        write_whole(path, toml_text(table, "Tuning of a module; gains in duty per count, times in s").encode())
        return path

    def read_tuning(self, name: str) -> None:
        """Put a saved tuning into the fields; InputError for a file that holds none. Nothing is set half."""
        path = self._file(name)
        table, _ = read_toml(path)
        values = {key: value for key, value in table.items() if key not in ("module", "type")}
        unknown = sorted(set(values) ^ set(self.tuning.fields))
        if unknown:
            raise InputError(f"is no saved tuning: {', '.join(unknown)} must be all there, and nothing else", str(path))
        for key, value in values.items():
            self.tuning.fields[key].check(value)
        for key, value in values.items():
            self.tuning.set(key, value)

    # parts

    def stop(self) -> None:
        """End the work that goes on; a motion is stopped."""
        if self._task is not None:
            self._task.stop()

    def _put(self, tuning: Mapping[str, Any]) -> None:
        controller = tuning["controller"]
        for name in self.tuning.fields:
            if name == "controller":
                self.tuning.set(name, "P" if controller == "PI" and not tuning["Ki"] else controller)
            else:
                self.tuning.set(name, tuning[name])

    def _data(self, number: int) -> dict[str, Any]:
        if number not in self.data:
            known = ", ".join(map(str, self.data)) or "none"
            raise InputError(f"module {number} has told no data (those that have: {known}); press Scan first")
        return self.data[number]

    def _file(self, name: str) -> Path:
        if Path(name).name != name or not name.endswith(".toml") or name.startswith("."):
            raise InputError(f"{name!r} must be a plain name that ends with .toml, as in module-4.toml")
        return self.session.folder / name

    def _work(self, title: str, work: Callable[[Task[T]], T]) -> Task[T]:
        """Begin work that has the bus for itself; InputError if the machine is in use."""

        def act(task: Task[T]) -> T:
            try:
                return work(task)
            except RdsError as error:
                if task.stopping:  # what a module says of its interrupted motion is no news
                    raise Stopped from error
                raise
            finally:
                self.session.give_machine_back(self)

        self._task = self.session.work_on_machine(self, title, act)
        return self._task

    @contextlib.contextmanager
    def _module(self, number: int) -> Iterator[Any]:
        from rds.bus.modules.oacs.remote import Module
        from rds.bus.tools.link import open_bus

        with open_bus(*self.bus, node="panel", **self.session.bus_options) as bus:
            yield Module(bus, number)


def _on_line(channel: str, baud: int, served: bool) -> list[dict[str, Any]]:
    """The units on a serial line; none where a machine's line is not served."""
    from rds.bus.modules.dcs.scan import scan_channel

    return scan_channel(channel, baud) if not served or is_there(channel) else []
