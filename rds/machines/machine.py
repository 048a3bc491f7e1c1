"""Machines as data: axes, converter and encoders, read from TOML."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.channel_name import channel_name
from rds.core.errors import InputError
from rds.core.quantities import Choice, Flag, Items, Quantity, Table, Text, near, shortened
from rds.core.shared_quantities import NODE, SAMPLE_PERIOD
from rds.core.toml_table import TomlTable
from rds.machines.link_table import LINKS, TOOL, WORK, ChainEnd, Link, read_links
from rds.machines.module_table import CARRIES_ON, INTERFACE, MODULE, MOUNTED_BY

if TYPE_CHECKING:
    from rds.machines.kinematics import Kinematics

_RANGE, _BITS = 10.0, 12  # of a machine whose file says nothing
VOLTAGE_RANGE = Quantity("the output board's range, ±", "V", above=0.0, high=1000.0, default=_RANGE)
BITS = Quantity("the converter has 2^bits levels", "", 1, 32, default=_BITS, whole=True)
TRAVEL = Items(
    "travel; references must stay within",
    Quantity("end of the travel", "axis unit"),
    "[lowest, highest], two finite numbers in the axis's unit, the lower one first",
    2,
    rising=True,
)
DEFAULT_FEED = Quantity(
    "feed of part programs that give none (--with default-feed); by default what the slowest linear axis can do",
    "mm/min",
    above=0.0,
)
UNITS = ("mm", "deg", "rev/min")
RESOLUTION = Quantity("of the encoder", "axis unit per count", above=0.0)
PARAMETER = Quantity("parameter of the model")
_LONGEST_NAME = 200  # characters; a longer one is no file's
_SLOWEST, _FASTEST = 1e-9, 1e12  # what the planner can still divide by
LIMITS = Table(
    "what planned motion keeps to; an axis without limits takes part in no part program",
    {
        "velocity": Quantity("largest velocity", "axis unit/s", low=_SLOWEST, high=_FASTEST),
        "acceleration": Quantity("largest acceleration", "axis unit/s²", low=_SLOWEST, high=_FASTEST),
        "jerk": Quantity("largest jerk", "axis unit/s³", low=_SLOWEST, high=_FASTEST),
    },
    needed=("velocity", "acceleration", "jerk"),
)
SPINDLE_POWER = Quantity("power of a spindle's motor: the limit of cuts that name none", "W", above=0.0)
SLOT = Quantity("place of its voltage in cyclic commands; by default its place among the axes", "", 1, 8, whole=True)
AXIS = Table(
    "an axis of the machine",
    {
        "node": NODE,
        "unit": Choice(
            'unit of its position; "rev/min" makes it a spindle: first order, its speed measured', UNITS, "mm"
        ),
        "travel": TRAVEL,
        "resolution": RESOLUTION,
        "model": Table(
            "library model that experiments start from",
            {"name": Text("its name")},
            others=PARAMETER,
            needed=("name",),
        ),
        "slot": SLOT,
        "power": SPINDLE_POWER,
        "limits": LIMITS,
        "machine": Table("the axis behind the bus, for `rds machine serve`", others=PARAMETER),
        "module": MODULE,
    },
    needed=("node", "travel", "resolution"),
)
POWER = Table(
    "supply of the modules' motors, for `rds machine power`",
    {"voltage": Quantity("its voltage", "V", above=0.0), "current": Quantity("what it bears", "A", above=0.0)},
    needed=("voltage", "current"),
)
_NAMES = Items("names of outputs, from number 0 on", Text("name"), "a list of names", default=())
OUTPUTS = Table("outputs that part programs switch", {"digital": _NAMES, "analog": _NAMES})
LIMIT_FEED = Flag("feeds above an axis's speed are limited, with a note; otherwise they are faults", default=False)
MACHINE = Table(
    "A machine: its axes, its converter and its sample period.",
    {
        "name": Text("name of the machine; by default the file's"),
        "title": Text("heading of reports", ""),
        "sample_period": SAMPLE_PERIOD,
        "default_feed": DEFAULT_FEED,
        "limit_feed": LIMIT_FEED,
        "outputs": OUTPUTS,
        "converter": Table("digital-to-analogue converter", {"range": VOLTAGE_RANGE, "bits": BITS}),
        "power": POWER,
        "axis": Table("axes by name, in the order of their voltages in the command frame", others=AXIS),
        "link": LINKS,
        "tool": TOOL,
        "work": WORK,
    },
    needed=("sample_period", "axis"),
)


@dataclass(frozen=True)
class Converter:
    """The digital-to-analogue converter of the output board: ±`range` V in 2^`bits` levels."""

    range: float = _RANGE
    bits: int = _BITS


@dataclass(frozen=True)
class Power:
    """The supply of the modules' motors: V, A."""

    voltage: float
    current: float


@dataclass(frozen=True)
class AxisLimits:
    """What an axis may be asked for by planned motion: mm/s, mm/s², mm/s³ (degrees of a rotary axis)."""

    velocity: float
    acceleration: float
    jerk: float


@dataclass(frozen=True)
class Axis:
    """One axis of a machine.

    `model` names the library model that a student starts from, with its parameters; `machine` holds the
    parameters of the simulated machine behind the bus, which the student does not see. `module` is what a distributed
    module of this axis knows of itself (module_table.py). `limits` are those of planned motion.
    """

    name: str
    node: int
    unit: str
    travel: tuple[float, float]
    resolution: float  # unit per encoder count
    model: dict[str, Any] = field(default_factory=dict)
    machine: dict[str, float] = field(default_factory=dict)
    module: dict[str, Any] = field(default_factory=dict)
    limits: AxisLimits | None = None
    slot: int | None = None  # from 1; None: its place among the axes
    power: float | None = None  # W, of a spindle's motor

    @property
    def is_spindle(self) -> bool:
        """Whether its speed is measured, and not a position."""
        return self.unit == "rev/min"


@dataclass(frozen=True)
class Machine:
    """A machine: its axes by name, its converter, its sample period in s, and the file it was read from.

    `default_feed` (mm/min) is that of part programs that give none; None: what the slowest linear axis can do.
    `links`, `tool` and `work` say how the axes move the tool relative to the work; without links it is a machine whose
    axes are all that is known. `limit_feed`: part programs' feeds above an axis's speed are limited to it, with a note.
    `digital` and `analog` name its outputs by their numbers (P of M62 to M65, E of M67 and M68).
    """

    name: str
    title: str
    sample_period: float
    converter: Converter
    axes: dict[str, Axis]
    path: str
    default_feed: float | None = None
    power: Power | None = None
    links: tuple[Link, ...] = ()
    tool: ChainEnd | None = None
    work: ChainEnd | None = None
    limit_feed: bool = False
    digital: tuple[str, ...] = ()
    analog: tuple[str, ...] = ()

    def __repr__(self) -> str:
        axes = ", ".join(f"{axis.name} in {axis.unit}" for axis in self.axes.values())
        return f"<Machine {self.name}: {axes}; {self.sample_period:g} s>"

    @property
    def channel(self) -> str:
        """Where its modules meet if no channel is named: its name, or one made of it where no channel can have that."""
        return channel_name(self.name)

    @cached_property
    def kinematics(self) -> Kinematics:
        """How its joints move the tool relative to the work; of a machine without links the identity.

        InputError for links that make no chain. Needs scipy.
        """
        from rds.machines.kinematics import kinematics_of

        return kinematics_of(self)

    @property
    def spindle_power(self) -> float | None:
        """What the motor of its spindle has, W; None where nobody says so."""
        return next((axis.power for axis in self.axes.values() if axis.power is not None), None)

    def too_fast(self, axes: Iterable[str]) -> list[str]:
        """A sentence for each of these axes whose limit of velocity is more than its model reaches at full voltage."""
        said = []
        for axis in map(self.axis, axes):
            most = abs(float(axis.model.get("K", inf))) * self.converter.range
            if axis.limits is not None and axis.limits.velocity > most * (1.0 + 1e-9):
                said.append(
                    f"the limit of velocity of axis {axis.name}, {axis.limits.velocity:g} {axis.unit}/s, is more than "
                    f"its model reaches at {self.converter.range:g} V, {most:.4g} {axis.unit}/s: motion planned to it "
                    f"leaves the axis behind; lower velocity in [axis.{axis.name}.limits], or correct the model's K"
                )
        return said

    def unlinked(self) -> list[str]:
        """A sentence for each position axis of a machine with links that moves none of them."""
        moved = {link.axis for link in self.links}
        return [
            f"axis {axis.name} moves no link: where it is changes nothing of the tool's pose on the work; name it as "
            f'axis = "{axis.name}" of a link'
            for axis in self.axes.values()
            if self.links and not axis.is_spindle and axis.name not in moved
        ]

    @cached_property
    def slots(self) -> dict[str, int]:
        """The place of each axis's voltage in cyclic commands, from 0."""
        return {
            name: place if axis.slot is None else axis.slot - 1 for place, (name, axis) in enumerate(self.axes.items())
        }

    def axis(self, name: str) -> Axis:
        """The axis called `name`; InputError names the ones there are."""
        if name not in self.axes:
            raise InputError(f"machine {self.name!r} has no axis {name!r}; it has {', '.join(self.axes)}", self.path)
        return self.axes[name]


def machine_names() -> list[str]:
    """Names of the machines that come with the package."""
    return sorted(f.name.removesuffix(".toml") for f in files("rds.machines").iterdir() if f.name.endswith(".toml"))


def load_machine(name: str | Path) -> Machine:
    """The machine called `name`, or the one described by the TOML file at that path.

    Raises InputError for an unknown name, a missing file or a file that does not describe a machine.
    """
    name = str(name)
    path = Path(name) if name.endswith(".toml") else Path(str(files("rds.machines").joinpath(f"{name}.toml")))
    if len(name) > _LONGEST_NAME or not path.is_file():
        names = machine_names()
        known = f"known machines: {', '.join(names)}, or the path of a .toml file{near(name, names)}"
        raise InputError(f"there is no machine {shortened(name, 80)}; {known}")
    return machine_from(TomlTable.open(path, MACHINE))


def machine_from(table: TomlTable) -> Machine:
    """The machine that a table of a file describes; InputError where it describes none."""
    if "machine" in table.table and "converter" not in table.table:
        raise InputError(
            "describes an experiment, not a machine; run it by `rds run` or rds.Experiment.from_toml", table.path
        )
    tables = table.inner("axis")
    if tables is None or not tables.table:
        raise InputError("needs at least one [axis.NAME] table", table.path)
    axes = {name: _axis(name, tables) for name in tables.table}
    nodes = [axis.node for axis in axes.values()]
    if len(set(nodes)) != len(nodes):
        raise InputError(f"two axes share a node; nodes are {nodes}", table.path)
    converter = table.inner_or_empty("converter")
    outputs = table.inner_or_empty("outputs")
    links, tool, work = read_links(table, axes)
    made = Machine(
        name=table.read("name", Path(table.path).stem),
        title=table.read("title"),
        sample_period=table.read("sample_period"),
        converter=Converter(range=converter.read("range"), bits=converter.read("bits")),
        axes=axes,
        path=table.path,
        default_feed=table.read("default_feed", None),
        power=_power(table.inner("power")),
        links=links,
        tool=tool,
        work=work,
        limit_feed=table.read("limit_feed"),
        digital=outputs.read("digital"),
        analog=outputs.read("analog"),
    )
    for each in (converter, outputs, table):
        each.done()
    slots = made.slots
    if len(set(slots.values())) != len(slots):
        said = ", ".join(f"{name} {slot + 1}" for name, slot in slots.items())
        raise InputError(f"two axes share a slot, and so a voltage; slots are {said}", table.path)
    return made


def _axis(name: str, tables: TomlTable) -> Axis:
    table = tables.inner(name)
    assert table is not None
    module, model = table.inner_or_empty("module"), table.inner("model")
    if model is not None and "name" not in model:
        raise model.missing("name")
    travel = table.read("travel")
    made = Axis(
        name=name,
        node=table.read("node"),
        unit=table.read("unit"),
        travel=(travel[0], travel[1]),
        resolution=table.read("resolution"),
        model=_values(model),
        machine=_values(table.inner("machine")),
        module={key: _of_module(module, key) for key in MODULE.keys if key in module},
        limits=_limits(table.inner("limits")),
        slot=table.read("slot", None),
        power=table.read("power", None),
    )
    if made.resolution > travel[1] - travel[0]:
        raise InputError(
            f"axis.{name}.resolution = {made.resolution:g} {made.unit} per count is more than all of its travel; it is "
            f"not counts per {made.unit}, but the way of one count",
            table.place("resolution"),
        )
    if made.power is not None and not made.is_spindle:
        raise InputError(
            f"power is that of a spindle's motor, and {name} is none (unit {made.unit!r}); leave it out", table.path
        )
    for each in (module, table):
        each.done()
    return made


def _of_module(module: TomlTable, key: str) -> Any:
    if key not in (MOUNTED_BY, CARRIES_ON):
        return module.read(key)
    side = module.inner(key)
    assert side is not None
    read = {each: side.read(each) for each in INTERFACE.keys}
    side.done()
    return read


def _values(table: TomlTable | None) -> dict[str, Any]:
    """The values of a model's table: a name, and parameters that the model itself knows."""
    return {} if table is None else {key: table.read(key) for key in table.table}


def _power(table: TomlTable | None) -> Power | None:
    if table is None:
        return None
    power = Power(**{key: table.read(key) for key in POWER.keys})
    table.done()
    return power


def _limits(table: TomlTable | None) -> AxisLimits | None:
    if table is None:
        return None
    limits = AxisLimits(**{key: table.read(key) for key in LIMITS.keys})
    table.done()
    return limits
