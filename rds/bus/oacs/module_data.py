"""What a distributed module knows of itself and what its board does: the table modules.toml, beside a machine's file.

The machine's file (rds/machines) has an axis's number, travel, resolution and physics; this table adds what only the
oacs dialect needs. An axis without a table here gets what its machine file says, and a quick board.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib.resources import files
from typing import Any

from rds.bus.oacs.transfer import UNITS, Matrix, ModuleDescription
from rds.bus.oacs.words import Kind, check_node
from rds.core.errors import InputError
from rds.machines.machine import Axis, Machine

IDENTITY: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
_KINDS = {"translational": Kind.TRANSLATIONAL, "rotary": Kind.ROTARY, "tool": Kind.TOOL}


@dataclass(frozen=True)
class ModuleData:
    """One module. Lengths in the axis's unit (mm, degrees; rev/min of a tool), times in s."""

    name: str
    node: int
    kind: Kind
    letter: str
    lowest: float
    highest: float
    counts_per_unit: float
    board: str = ""
    kind_text: str = "ServM"
    type_text: str = ""
    response_call: float = 1e-3  # to a general call, and before any other reply than the two others
    response_download: float = 1e-3
    accuracy: float = 0.0
    repeatability: float = 0.0
    counts_per_turn: int = 1024  # of the encoder; 0: no encoder
    initial: float = 0.0  # position at delivery
    start: float = 0.0  # where the virtual axis stands when it is switched on
    least_speed: float = 0.0  # unit/min
    clockwise_speed: float = 0.0
    counterclockwise_speed: float = 0.0
    supply: float = 12.0  # V at full duty
    matrix: Matrix = IDENTITY
    joint: str = ""
    switches: bool = False
    overtravel: float = 2.0  # from the end of the travel to the limit switch
    debounce: float = 0.1  # oacs-thesis 6.10
    current_start: float = 0.0  # A, at the supply and at rest
    current_run: float = 0.0  # A, at the supply and full speed
    accelerometer: tuple[int, int, int] | None = None  # readings at rest; None: it has none
    vibration: tuple[int, int, int] = (0, 0, 0)  # amplitude of the readings at full speed
    interrupt_service: float = 4e-6
    interrupt_pause: float = 0.0  # during which no interrupt is served
    interrupt_every: float = 0.0  # from one such pause to the next; 0: none

    @property
    def unit(self) -> str:
        """Unit of positions and lengths."""
        return UNITS[self.kind]

    def describe(self, serial: int) -> ModuleDescription:
        """What a download of this module carries."""
        return ModuleDescription(
            self.kind,
            self.letter,
            self.type_text,
            serial,
            self.accuracy,
            self.repeatability,
            self.lowest,
            self.highest,
            self.initial,
            self.counts_per_unit,
            self.least_speed,
            self.clockwise_speed,
            self.counterclockwise_speed,
            self.supply,
            self.matrix,
            self.joint,
        )


_KNOWN = {f.name for f in fields(ModuleData)} - {"name", "node"}


def read_modules(machine: Machine) -> dict[str, ModuleData]:
    """The data of each axis of `machine` by its name. InputError for a table that is wrong, or a number over 15."""
    text = files("rds.bus.oacs").joinpath("modules.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text) if machine.name == "mrmt-oacs" else {}
    return {axis.name: module_data(axis, tables.get(axis.name, {})) for axis in machine.axes.values()}


def module_data(axis: Axis, table: Mapping[str, Any]) -> ModuleData:
    """The data of one axis: its table, completed by what the machine's file says of it."""
    where = f"oacs module {axis.name}"
    values = dict(table)
    for key in values:
        if key not in _KNOWN:
            raise InputError(f"unknown key {key!r}; known keys: {', '.join(sorted(_KNOWN))}", where)
    kind = values.pop("kind", _kind_by_unit(axis.unit))
    if kind not in _KINDS:
        raise InputError(f"kind = {kind!r} must be one of {', '.join(_KINDS)}", where)
    letter = values.pop("letter", axis.name[:1].upper() if kind != "tool" else "T")
    defaults: dict[str, Any] = {
        "lowest": axis.travel[0],
        "highest": axis.travel[1],
        "counts_per_unit": 1.0 / axis.resolution,
        "kind_text": "SpinM" if kind == "tool" else "ServM",
        "type_text": {"translational": f"Linr{letter}a", "rotary": f"Rotr{letter}a", "tool": "ToolT"}[kind],
        "counts_per_turn": 0 if kind == "tool" else 1024,
        "switches": kind == "translational",
        "joint": letter.lower() if kind != "tool" and letter.lower() in "xyzabc" else "",
    }
    values = defaults | values
    for key in ("accelerometer", "vibration"):
        if key in values:
            values[key] = tuple(values[key])
    if "matrix" in values:
        values["matrix"] = tuple(tuple(float(value) for value in row) for row in values["matrix"])
    return ModuleData(axis.name, check_node(axis.node), _KINDS[kind], letter, **values)


def _kind_by_unit(unit: str) -> str:
    return {"rev/min": "tool", "deg": "rotary", "°": "rotary", "degrees": "rotary"}.get(unit, "translational")
