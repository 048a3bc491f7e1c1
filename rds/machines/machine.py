"""Machines as data: axes, converter and encoders, read from TOML."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.resources import files
from math import isfinite
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_file import read_toml
from rds.machines.module_table import module_table


@dataclass(frozen=True)
class Converter:
    """The digital-to-analogue converter of the output board: ±`range` V in 2^`bits` levels."""

    range: float = 10.0
    bits: int = 12


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


@dataclass(frozen=True)
class Machine:
    """A machine: its axes by name, its converter, its sample period in s, and the file it was read from."""

    name: str
    title: str
    sample_period: float
    converter: Converter
    axes: dict[str, Axis]
    path: str

    def axis(self, name: str) -> Axis:
        """The axis called `name`; InputError names the ones there are."""
        if name not in self.axes:
            raise InputError(f"machine {self.name!r} has no axis {name!r}; it has {', '.join(self.axes)}", self.path)
        return self.axes[name]


def machine_names() -> list[str]:
    """Names of the machines that come with the package."""
    return sorted(f.name.removesuffix(".toml") for f in files("rds.machines").iterdir() if f.name.endswith(".toml"))


def load_machine(name: str) -> Machine:
    """The machine called `name`, or the one described by the TOML file at that path.

    Raises InputError for an unknown name, a missing file or a file that does not describe a machine.
    """
    path = Path(name) if name.endswith(".toml") else Path(str(files("rds.machines").joinpath(f"{name}.toml")))
    if not path.is_file():
        raise InputError(
            f"there is no machine {name!r}; known machines: {', '.join(machine_names())}, or the path of a .toml file"
        )
    data, _ = read_toml(path)
    return _machine(data, str(path))


_TOP = {"name", "title", "sample_period", "converter", "axis"}
_AXIS = {"node", "unit", "travel", "resolution", "model", "machine", "module", "limits"}
_LIMITS = {"velocity", "acceleration", "jerk"}


def _machine(data: dict[str, Any], path: str) -> Machine:
    _known(data, _TOP, path, "")
    axes = {}
    for name, table in _table(data, "axis", path).items():
        place = f"{path}, [axis.{name}]"
        _known(table, _AXIS, path, f"axis.{name}.")
        travel = table.get("travel", [])
        if not _rises(travel):
            raise InputError(f"travel = {travel!r:.200} must be [lowest, highest]", place)
        resolution = _number(table, "resolution", place)
        if not (isfinite(resolution) and resolution > 0):
            raise InputError(f"resolution = {resolution!r} must be more than 0 (unit per encoder count)", place)
        node = _number(table, "node", place)
        if not (isfinite(node) and node == int(node)):
            raise InputError(f"node = {node!r} must be a whole number", place)
        for key in ("model", "machine"):
            _must_be_table(table.get(key, {}), f"axis.{name}.{key}", path)
        axes[name] = Axis(
            name=name,
            node=int(node),
            unit=str(table.get("unit", "mm")),
            travel=(float(travel[0]), float(travel[1])),
            resolution=resolution,
            model=dict(table.get("model", {})),
            machine=dict(table.get("machine", {})),
            module=module_table(table.get("module", {}), f"{path}, [axis.{name}.module]"),
            limits=_limits(table["limits"], path, name) if "limits" in table else None,
        )
    nodes = [axis.node for axis in axes.values()]
    if len(set(nodes)) != len(nodes):
        raise InputError(f"two axes share a node; nodes are {nodes}", path)
    converter = data.get("converter", {})
    _known(converter, {"range", "bits"}, path, "converter.")
    return Machine(
        name=str(data.get("name", Path(path).stem)),
        title=str(data.get("title", "")),
        sample_period=_number(data, "sample_period", path),
        converter=Converter(**converter),
        axes=axes,
        path=path,
    )


def _limits(table: Any, path: str, name: str) -> AxisLimits:
    place = f"{path}, [axis.{name}.limits]"
    if not isinstance(table, dict):
        raise InputError(f"limits = {table!r:.200} must be a table", place)
    _known(table, _LIMITS, path, f"axis.{name}.limits.")
    values = {key: _number(table, key, place) for key in sorted(_LIMITS)}
    for key, value in values.items():
        if not (isfinite(value) and value > 0):
            raise InputError(f"{key} = {value!r} must be more than 0 and finite", place)
    return AxisLimits(**{key: float(value) for key, value in values.items()})


def _table(data: dict[str, Any], key: str, path: str) -> dict[str, Any]:
    table = data.get(key)
    if not isinstance(table, dict) or not table:
        raise InputError(f"needs at least one [{key}.NAME] table", path)
    return table


def _rises(travel: Any) -> bool:
    """Whether it is two finite numbers, the lower one first."""
    numbers = isinstance(travel, list) and all(isinstance(each, int | float) and isfinite(each) for each in travel)
    return numbers and len(travel) == 2 and travel[0] < travel[1]


def _must_be_table(table: Any, name: str, path: str) -> None:
    if not isinstance(table, dict):
        raise InputError(f"{name} = {table!r:.200} must be a table; write [{name}]", path)


def _known(table: Any, known: set[str], path: str, prefix: str) -> None:
    _must_be_table(table, prefix.rstrip("."), path)
    for key in table:
        if key not in known:
            raise InputError(f"unknown key '{prefix}{key}'; known keys: {', '.join(sorted(known))}", path)


def _number(table: dict[str, Any], key: str, where: str) -> float:
    value = table.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key} = {value!r:.200} must be a number", where)
    return value
