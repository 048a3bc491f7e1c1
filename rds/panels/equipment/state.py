"""Equipment model and equipment control: choices of one system (an axis, or some together), and their experiment.

The experiment is the same table that a TOML file would hold: what a panel runs, the command line repeats.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rds.core.errors import InputError, RdsError
from rds.core.types import SPINDLE_UNIT
from rds.machines import Axis, Machine, load_machine
from rds.modes import SIMULATION, load_mode
from rds.modes.experiment.experiment import Experiment
from rds.modes.loop.plan import Plan
from rds.modes.process.machine import BUILTIN
from rds.nc.run.run import usual_controller
from rds.panels.code.versions import keep_file
from rds.panels.equipment.build import Builds, Checked
from rds.panels.equipment.fields import (
    CIRCLE,
    FERROR,
    OF_MODEL,
    OF_SIGNAL,
    OF_SPINDLE,
    PATH,
    POLE,
    PREFIX,
    SIZES,
    USER,
    axes_of,
    controllers,
    first_fields,
    own_fields,
    parameter_fields,
    shapes,
    signal_fields,
    sizes,
    sizes_of,
    tracking_options,
)
from rds.panels.equipment.run import EquipmentRun
from rds.panels.interpolator.motion import ARC_FILE, MADE, OWN, PLANNED, filter_of, idle_motion
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, value_of
from rds.panels.session.formula import formula_file
from rds.panels.session.session import Session
from rds.panels.session.task import Task

FIRST_SINE = {"system": "X", "mode": SIMULATION, "shape": "sinusoid", "model": "default"}


@dataclass
class Equipment:
    """One system under test: `kind` is "model" (a voltage signal drives it) or "control" (a controller does).

    A system is one axis, or with controllers several, which may follow a path together.
    """

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
    def axes(self) -> list[str]:
        """The axes of the system that is chosen."""
        return axes_of(self.choices["system"])

    @property
    def axis(self) -> Axis:
        """The axis that is chosen; the first of several, whose unit and travel the fields have."""
        return self.machine.axes[self.axes[0]]

    @property
    def on_path(self) -> bool:
        """Whether the axes follow a path together, which says how long the run lasts."""
        return self.choices["shape"] in (CIRCLE, PATH)

    @property
    def coupled(self) -> bool:
        """Whether one controller of the student's drives all axes."""
        return "coupled" in self.shown and bool(self.choices["coupled"])

    @property
    def parameters(self) -> list[str]:
        """The names of the controller's parameters among the choices: in the library's order, or in the file's."""
        return [name for name in self._order if name.startswith(PREFIX) and name in self.choices]

    @property
    def of_signal(self) -> list[str]:
        """The names of what the chosen kind of signal needs besides its size, among the choices."""
        return [name for name in self.choices.fields if name.startswith(OF_SIGNAL)]

    @property
    def model_parameters(self) -> list[str]:
        """The names of the parameters of the student's model among the choices, in the file's order."""
        return [name for name in self._order if name.startswith(OF_MODEL) and name in self.choices]

    @property
    def shown(self) -> list[str]:
        """The names of the choices that matter for what is chosen, in order."""
        chosen = self.choices
        idle = {name for name, owner in _FILES.items() if owner in chosen and chosen[owner] != USER}
        idle |= {*SIZES} - {*sizes_of(str(chosen["shape"]))}
        if self.on_path:
            idle |= {"duration", *idle_motion(chosen.values())}
        else:
            idle |= _OF_PATH
        idle |= {"radius", "feed", "laps"} if chosen["shape"] != CIRCLE else {"path_file"}
        if len(self.axes) == 1 or chosen["controller"] != USER:
            idle.add("coupled")
        if self.axis.unit == SPINDLE_UNIT:
            idle.add(FERROR)
        if not load_mode(str(chosen["mode"])).modelled:  # the machine alone
            idle |= {"model", "model_file"}
        return [name for name in chosen.fields if name not in idle]

    def first_sine(self) -> None:
        """The choices of a first experiment: a sine on X under the tracking controller, in simulation."""
        for name, value in (FIRST_SINE | {"controller": usual_controller(self.machine)}).items():
            if name in self.choices and _option(self.choices.fields[name], value):
                self.choices.set(name, value)
        watched = (FERROR,) if FERROR in self.choices else ()
        for name in (*SIZES, "duration", "sample_period", *watched, *self.parameters):
            self.choices.set(name, self.choices.fields[name].default)

    def own_controller(self) -> None:
        """The controller is the student's own."""
        if "controller" in self.choices and _option(self.choices.fields["controller"], USER):
            self.choices.set("controller", USER)

    def table(self) -> dict[str, Any]:
        """The experiment, as the table of a TOML file. InputError where a file is not named, or will not do."""
        chosen = self.choices
        table: dict[str, Any] = {
            "machine": self.session.machine,
            **({"axis": self.axes[0]} if len(self.axes) == 1 else {"axes": self.axes}),
            "mode": chosen["mode"],
            **({} if self.on_path else {"duration": chosen["duration"]}),
            "sample_period": chosen["sample_period"],
            "signal" if self.kind == "model" else "reference": self._shape(),
        }
        if self.kind == "control":
            table["controller"] = self._controller()
            if FERROR in self.shown and chosen[FERROR] is not None:
                table["following_error"] = {FERROR: chosen[FERROR]}
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
            if name not in self.shown or (name == ARC_FILE and not str(self.choices[name]).strip()):
                continue
            if name != "shape_file" or self._is_file():
                found.append((role, self.session.folder / self._file(name, role)))
        return found

    @property
    def checked_axes(self) -> int:
        """How many axes a coupled controller is checked with; 0 for one of a single axis."""
        return len(self.axes) if self.coupled else 0

    def build(self) -> Task[list[Checked]]:
        """Begin to check the student's files; InputError where one is not named."""
        self.fit_parameters()
        files, T, axes = self.files(), self.choices["sample_period"], self.checked_axes

        def work(task: Task[list[Checked]]) -> list[Checked]:
            checked = []
            for number, (role, path) in enumerate(files):
                task.advance(number, len(files), f"checking {path.name}")
                checked.append(self.builds.check(role, path, T, task.pulse, axes))
            return checked

        return self.session.work("build", work)

    def load(self) -> Task[str]:
        """Begin to make everything ready for a run, without running: a sentence about the samples and the machine."""
        self.fit_parameters()
        files, T, table, axes = self.files(), self.choices["sample_period"], self.table(), self.checked_axes

        def work(task: Task[str]) -> str:
            task.note = "checking your files"
            self.builds.require(files, T, task.pulse, axes)
            task.note = "loading"
            plan = Experiment.from_table(table, self.session.folder).plan()
            return f"loaded: {plan.samples} samples, {plan.T * 1e3:g} ms each; {machine_sentence(plan)}"

        return self.session.work("load", work)

    def run(self) -> EquipmentRun:
        """The run of what is chosen, to be started. Its files are checked first, where that was not done yet."""
        self.fit_parameters()
        files, T, table, axes = self.files(), self.choices["sample_period"], self.table(), self.checked_axes
        made = EquipmentRun(self.session, table, prepare=lambda pulse: self.builds.require(files, T, pulse, axes))
        for _, path in files:
            keep_file(path, made.folder.name)
        return made

    def _shape(self) -> dict[str, Any]:
        chosen = self.choices
        if self.on_path:
            return self._path() | self._motion()
        if chosen["shape"] == USER:
            given = self._file("shape_file", "signal, or a formula of t")
            if not self._is_file():
                given = formula_file(self.session.folder, given, chosen["duration"], chosen["sample_period"])
            return {"kind": "user", "file": given}
        shape: dict[str, Any] = {"kind": chosen["shape"]}
        for name in (*sizes_of(str(chosen["shape"])), *self.of_signal):
            value = value_of(chosen.fields[name], chosen[name])
            if value is not None and (name != "offset" or value):
                shape[name.removeprefix(OF_SIGNAL)] = value
        return shape

    def _path(self) -> dict[str, Any]:
        """What the axes follow together: a path file, a part program, or a circle that begins at 0."""
        chosen = self.choices
        if chosen["shape"] == PATH:
            return {"kind": "path", "file": self._file("path_file", "path, or of your part program")}
        nowhere, centre = [0.0] * len(self.axes), [chosen["radius"], *[0.0] * (len(self.axes) - 1)]
        lap = {"kind": "arc", "end": nowhere, "centre": centre}
        return {"kind": "path", "start": nowhere, "feed": chosen["feed"], "segment": [lap] * int(chosen["laps"])}

    def _motion(self) -> dict[str, Any]:
        chosen = self.choices
        if chosen["interpolator"] == PLANNED:
            return {"profile": PLANNED}
        own = chosen["interpolator"] == USER
        name = self._file("interpolator_file", "interpolator") if own else chosen["interpolator"]
        told = {key: value for key, value in filter_of(chosen.values()).items() if value}
        arcs = str(chosen[ARC_FILE]).strip() if own else ""
        return {"interpolator": name, **({"arc_interpolator": arcs} if arcs else {}), **told}

    def _is_file(self) -> bool:
        return str(self.choices["shape_file"]).strip().lower().endswith(".csv")

    def _controller(self) -> dict[str, Any]:
        chosen = self.choices
        if chosen["controller"] == USER:
            own = self._own("controller_file", "controller", self.parameters)
            return own | ({"coupled": True} if self.coupled else {})
        if POLE in chosen or OF_SPINDLE in chosen:
            return {"name": chosen["controller"]} | tracking_options(chosen.values())
        given = {name.removeprefix(PREFIX): value_of(chosen.fields[name], chosen[name]) for name in self.parameters}
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
        elif name == "shape":
            self._fit_signal()
        elif name in ("controller_file", "model", "model_file", "mode"):
            self.fit_parameters()

    def _fit_system(self) -> None:
        """What the chosen system and controller allow."""
        fields = self.choices.fields
        fitting = sizes(self.kind, self.machine, self.axis)
        self.choices.replace(each for each in [*fitting, shapes(self.kind, self.axes)] if each != fields[each.name])
        if self.kind == "control" and (fitting_laws := controllers(self.machine, self.axis)) != fields["controller"]:
            self.choices.replace([fitting_laws])
        self._fit_signal()
        self.fit_parameters()

    def _fit_signal(self) -> None:
        """What the chosen kind of signal needs."""
        unit = "V" if self.kind == "model" else self.axis.unit
        wanted = {each.name: each for each in signal_fields(str(self.choices["shape"]), unit)}
        fields = self.choices.fields
        self.choices.remove([name for name in self.of_signal if name not in wanted])
        self.choices.replace(each for name, each in wanted.items() if fields.get(name) != each)

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
_ROLES = {
    "shape_file": "signal",
    **dict.fromkeys(OWN, "interpolator"),
    "model_file": "model",
    "controller_file": "controller",
}
_OF_PATH = {"path_file", "radius", "feed", "laps", "interpolator", *OWN, *MADE}


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
