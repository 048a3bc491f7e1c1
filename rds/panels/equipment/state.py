"""Equipment model and equipment control: choices of one system, and the experiment that they say.

The experiment is the same table that a TOML file would hold: what a panel runs, the command line repeats.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rds.core.errors import InputError, RdsError
from rds.machines import Axis, Machine, load_machine
from rds.modes import SIMULATION, load_mode
from rds.modes.experiment.experiment import Experiment
from rds.modes.loop.plan import Plan
from rds.modes.process.machine import BUILTIN
from rds.panels.equipment.build import Builds, Checked
from rds.panels.equipment.fields import (
    OF_MODEL,
    POLE,
    PREFIX,
    USER,
    controllers,
    first_fields,
    own_fields,
    parameter_fields,
    sizes,
    tracking_options,
)
from rds.panels.equipment.run import EquipmentRun
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field
from rds.panels.session.formula import formula_file
from rds.panels.session.session import Session
from rds.panels.session.task import Task

FIRST_SINE = {"system": "X", "mode": SIMULATION, "shape": "sinusoid", "model": "default", "controller": "tracking"}


@dataclass
class Equipment:
    """One system under test: `kind` is "model" (a voltage signal drives it) or "control" (a controller does)."""

    session: Session
    kind: str
    builds: Builds = field(default_factory=Builds)

    def __post_init__(self) -> None:
        self.machine: Machine = load_machine(self.session.machine)
        self._order: list[str] = []  # of the fields of parameters
        self._of: dict[str, Path] = {}  # the student's file that has the parameters of a prefix
        panel = f"equipment {self.kind}"
        fields = first_fields(self.kind, self.machine, self.session.kept(panel, "system"))
        self.choices: Choices = self.session.choices(panel, fields)
        self._fit_system()
        self.choices.watch(self._chosen)

    @property
    def axis(self) -> Axis:
        """The axis that is chosen."""
        return self.machine.axes[self.choices["system"]]

    @property
    def parameters(self) -> list[str]:
        """The names of the controller's parameters among the choices: in the library's order, or in the file's."""
        return [name for name in self._order if name.startswith(PREFIX) and name in self.choices]

    @property
    def model_parameters(self) -> list[str]:
        """The names of the parameters of the student's model among the choices, in the file's order."""
        return [name for name in self._order if name.startswith(OF_MODEL) and name in self.choices]

    @property
    def shown(self) -> list[str]:
        """The names of the choices that matter for what is chosen, in order."""
        chosen = self.choices
        idle = {name for name, owner in _FILES.items() if owner in chosen and chosen[owner] != USER}
        if chosen["shape"] == USER:
            idle |= {"amplitude", "frequency", "offset"}
        if not load_mode(str(chosen["mode"])).modelled:  # the machine alone
            idle |= {"model", "model_file"}
        return [name for name in chosen.fields if name not in idle]

    def first_sine(self) -> None:
        """The choices of a first experiment: a sine on X under the tracking controller, in simulation."""
        for name, value in FIRST_SINE.items():
            if name in self.choices and _option(self.choices.fields[name], value):
                self.choices.set(name, value)
        for name in ("amplitude", "frequency", "offset", "duration", "sample_period", *self.parameters):
            self.choices.set(name, self.choices.fields[name].default)

    def table(self) -> dict[str, Any]:
        """The experiment, as the table of a TOML file. InputError where a file is not named, or will not do."""
        chosen = self.choices
        table: dict[str, Any] = {
            "machine": self.session.machine,
            "axis": chosen["system"],
            "mode": chosen["mode"],
            "duration": chosen["duration"],
            "sample_period": chosen["sample_period"],
            "signal" if self.kind == "model" else "reference": self._shape(),
        }
        if self.kind == "control":
            table["controller"] = self._controller()
        if "model_file" in self.shown:
            table["model"] = self._own("model_file", "model", self.model_parameters)
        if self.session.bus:
            table["bus"] = dict(self.session.bus)
        return table

    def words(self) -> dict[str, str]:
        """What was chosen, for people: the controller and the model by name or file."""
        chosen, said = self.choices, {}
        for name in ("controller", "model"):
            if name in chosen:
                own = chosen[name] == USER
                said[name] = str(chosen[f"{name}_file"] if own else _option(chosen.fields[name], chosen[name]))
        return said

    def files(self) -> list[tuple[str, Path]]:
        """What the student's files stand for, and where they are; InputError where one is not named."""
        found = []
        for name, role in _ROLES.items():
            if name in self.shown and (name != "shape_file" or self._is_file()):
                found.append((role, self.session.folder / self._file(name, role)))
        return found

    def build(self) -> Task[list[Checked]]:
        """Begin to check the student's files; InputError where one is not named."""
        self.fit_parameters()
        files, T = self.files(), self.choices["sample_period"]

        def work(task: Task[list[Checked]]) -> list[Checked]:
            checked = []
            for number, (role, path) in enumerate(files):
                task.advance(number, len(files), f"checking {path.name}")
                checked.append(self.builds.check(role, path, T, task.pulse))
            return checked

        return self.session.work("build", work)

    def load(self) -> Task[str]:
        """Begin to make everything ready for a run, without running: a sentence about the samples and the machine."""
        self.fit_parameters()
        files, T, table = self.files(), self.choices["sample_period"], self.table()

        def work(task: Task[str]) -> str:
            task.note = "checking your files"
            self.builds.require(files, T, task.pulse)
            task.note = "loading"
            plan = Experiment.from_table(table, self.session.folder).plan()
            return f"loaded: {plan.samples} samples, {plan.T * 1e3:g} ms each; {machine_sentence(plan)}"

        return self.session.work("load", work)

    def run(self) -> EquipmentRun:
        """The run of what is chosen, to be started. Its files are checked first, where that was not done yet."""
        self.fit_parameters()
        files, T, table = self.files(), self.choices["sample_period"], self.table()
        return EquipmentRun(self.session, table, prepare=lambda pulse: self.builds.require(files, T, pulse))

    def _shape(self) -> dict[str, Any]:
        chosen = self.choices
        if chosen["shape"] == USER:
            given = self._file("shape_file", "signal, or a formula of t")
            if not self._is_file():
                given = formula_file(self.session.folder, given, chosen["duration"], chosen["sample_period"])
            return {"kind": "user", "file": given}
        shape = {"kind": chosen["shape"], "amplitude": chosen["amplitude"], "frequency": chosen["frequency"]}
        return shape | ({"offset": chosen["offset"]} if chosen["offset"] else {})

    def _is_file(self) -> bool:
        return str(self.choices["shape_file"]).strip().lower().endswith(".csv")

    def _controller(self) -> dict[str, Any]:
        chosen = self.choices
        if chosen["controller"] == USER:
            return self._own("controller_file", "controller", self.parameters)
        if POLE in chosen:
            return {"name": chosen["controller"]} | tracking_options(chosen.values())
        given = {name.removeprefix(PREFIX): chosen[name] for name in self.parameters}
        return {"name": chosen["controller"]} | {name: value for name, value in given.items() if value is not None}

    def _own(self, name: str, what: str, parameters: list[str]) -> dict[str, Any]:
        """A student's file, with the values that were put in place of its own."""
        given = {each.partition(".")[2]: _plain(self.choices[each]) for each in parameters}
        given = {key: value for key, value in given.items() if value is not None}
        return {"file": self._file(name, what)} | ({"params": given} if given else {})

    def _file(self, name: str, what: str) -> str:
        given = str(self.choices[name]).strip()
        if not given:
            raise InputError(f"name the file of your {what} (in {self.session.folder})")
        return given

    def _chosen(self, name: str) -> None:
        if name in ("system", "controller"):
            self._fit_system()
        elif name in ("controller_file", "model", "model_file", "mode"):
            self.fit_parameters()

    def _fit_system(self) -> None:
        """What the chosen system and controller allow."""
        fields = self.choices.fields
        fitting = sizes(self.kind, self.machine, self.axis)
        self.choices.replace(each for each in fitting if each != fields[each.name])
        if self.kind == "control" and (fitting_laws := controllers(self.axis)) != fields["controller"]:
            self.choices.replace([fitting_laws])
        self.fit_parameters()

    def fit_parameters(self) -> None:
        """The parameters of what is chosen, as a student's file has them now.

        What was put in place of a file's own value does not go over to another file.
        """
        own = self._own_files()
        others = tuple(prefix for prefix in (PREFIX, OF_MODEL) if self._of.get(prefix) != own.get(prefix))
        if others and self._order:
            self.choices.remove([name for name in self.choices.fields if name.startswith(others)])
        wanted = self._wanted(own)
        self._of, self._order = own, list(wanted)
        fields = self.choices.fields
        self.choices.remove([name for name in fields if name.startswith((PREFIX, OF_MODEL)) and name not in wanted])
        self.choices.replace(each for name, each in wanted.items() if fields.get(name) != each)

    def _own_files(self) -> dict[str, Path]:
        """The student's Python files that are chosen, by the prefix of their parameters."""
        found = {}
        for name, prefix in (("controller_file", PREFIX), ("model_file", OF_MODEL)):
            if name in self.shown and (given := str(self.choices[name]).strip()).endswith(".py"):
                found[prefix] = self.session.folder / given
        return found

    def _wanted(self, own: Mapping[str, Path]) -> dict[str, Field]:
        """The fields of the parameters of the controller and of the model that are chosen, by name."""
        found: list[Field] = []
        if self.kind == "control" and self.choices["controller"] != USER:
            found += parameter_fields(self.choices["controller"], self.axis)
        for prefix, path in own.items():
            found += own_fields(path, prefix)
        return {each.name: each for each in found}


_FILES = {"shape_file": "shape", "model_file": "model", "controller_file": "controller"}  # shown for what is the user's
_ROLES = {"shape_file": "signal", "model_file": "model", "controller_file": "controller"}


def _plain(number: float | None) -> float | int | None:
    """A whole number as one: a file may count with it."""
    return int(number) if number is not None and number == int(number) else number


def _option(field: Field, value: str) -> str:
    """The words that stand for a choice; none where it cannot be chosen."""
    return field.options.get(value, "") if isinstance(field, Choice) else ""


def machine_sentence(plan: Plan) -> str:
    """What a run of `plan` will find on its bus. Sends nothing that moves anything."""
    if not load_mode(plan.mode).real_time:
        return "no machine is needed"
    from rds.bus.hub.address import channels
    from rds.bus.modules.dialects import DEFAULT, is_served
    from rds.bus.tools.link import bus_name, bus_options, default_channel

    bus = {"interface": BUILTIN, **plan.bus}
    interface = str(bus["interface"])
    channel = default_channel(plan.machine, interface, bus.get("channel"))
    builtin = interface == BUILTIN
    if builtin:
        channel = str(channel)  # 0 is a channel's name there
    options = {} if builtin else bus_options(bus)
    where = bus_name(interface, channel)
    if builtin and channel not in channels():
        return "no machine is on the built-in bus yet: a simulated one is started for the run"
    try:
        there = is_served(bus.get("dialect", DEFAULT), plan.machine, interface, channel, **options)
    except (RdsError, OSError) as error:
        return f"but the machine does not answer: {error}"
    if there:
        return f"the machine answers on {where}"
    return f"but no module of {plan.machine.name} answers on {where}; switch it on before you run"
