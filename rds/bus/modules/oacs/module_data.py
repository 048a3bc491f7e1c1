"""What a distributed module knows of itself and what its board does: `[axis.NAME.module]` of a machine's file.

The other tables of the file (rds/machines) have an axis's number, travel, resolution and physics, and its link says
which module of the library it is; what this one does not say follows from them, with a quick board. So every machine
can be served, if its nodes are from 2 to 14.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rds.bus.modules.oacs.codes import Kind, check_node
from rds.bus.modules.oacs.transfer import JOINTS, UNITS, Matrix, ModuleDescription, encode_description
from rds.bus.modules.rds.module import machine_parameters
from rds.core.errors import InputError
from rds.machines.library import Interface
from rds.machines.link_modules import said_by_link
from rds.machines.machine import Axis, Machine
from rds.machines.module_table import CARRIES_ON, MOUNTED_BY
from rds.models.machine_axis import MachineParameters

IDENTITY: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
_KINDS = {"translational": Kind.TRANSLATIONAL, "rotary": Kind.ROTARY, "tool": Kind.TOOL}
_MODELS = ("linear-axis", "spindle", "machine-axis")  # whose parameters are those of a machine's axis
_OF_OTHERS = ("drift", "motor", "load_cell")  # what modules of other dialects have
_ROUNDING = 1e-4  # of a resolution that is written with few digits


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
    counterclockwise_current_start: float | None = None  # A; None: as clockwise
    counterclockwise_current_run: float | None = None
    current_swing: float = 0.0  # A about the mean at full speed, once in each turn of the screw
    lead: float = 0.0  # way in a turn of the screw
    current_peak: float = 0.0  # A, the largest
    accelerometer: tuple[int, int, int] | None = None  # readings at rest; None: it has none
    vibration: tuple[int, int, int] = (0, 0, 0)  # amplitude of the readings at full speed
    interrupt_service: float = 4e-6
    interrupt_pause: float = 0.0  # during which no interrupt is served
    interrupt_every: float = 0.0  # from one such pause to the next; 0: none
    mounted_by: Interface | None = None  # None: it does not say
    carries_on: Interface | None = None
    accessory: str = ""  # type text of the accessory mounted on it

    @property
    def unit(self) -> str:
        """Unit of positions and lengths."""
        return UNITS[self.kind]

    def currents(self, clockwise: bool) -> tuple[float, float]:
        """A, at the supply that way round: at rest, and at full speed."""
        start, run = self.counterclockwise_current_start, self.counterclockwise_current_run
        if clockwise:
            return self.current_start, self.current_run
        return self.current_start if start is None else start, self.current_run if run is None else run

    def describe(self, serial: int, slot: int = 0) -> ModuleDescription:
        """What a download of this module carries; `slot` is the place of its voltage in cyclic commands, from 1."""
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
            self.mounted_by,
            self.carries_on,
            self.accessory,
            slot,
        )


def read_modules(machine: Machine) -> dict[str, ModuleData]:
    """The data of each axis of `machine` by its name. InputError for a table that is wrong, or a number over 15."""
    return {
        axis.name: module_data(axis, machine.converter.range, machine.path, said_by_link(machine, axis))
        for axis in machine.axes.values()
    }


def module_data(axis: Axis, supply: float, path: str = "", mounted: Mapping[str, Any] | None = None) -> ModuleData:
    """The data of one axis: its `module` table, completed by what else is known of it.

    `mounted` is what its link says of the module (`said_by_link`), `supply` is the motor's, V, where the table names
    none; `path` is the machine's file, for errors. Raises InputError for a number that no module can have, and for
    data that a download can't carry.
    """
    where = f"{path}, [axis.{axis.name}.module]" if path else f"[axis.{axis.name}.module]"
    told = {key: value for key, value in axis.module.items() if key not in _OF_OTHERS}
    values = {**(mounted or {}), **told}
    kind = values.pop("kind", _kind_by_unit(axis.unit))
    letter = values.pop("letter", "T" if kind == "tool" else _first_letter(axis.name))
    supply = values.setdefault("supply", supply)
    clockwise, counterclockwise = _speeds(axis, supply, 1.0 if kind == "tool" else 60.0)
    defaults: dict[str, Any] = {
        "counts_per_unit": 1.0 / axis.resolution,
        "kind_text": "SpinM" if kind == "tool" else "ServM",
        "type_text": {"translational": f"Linr{letter}a", "rotary": f"Rotr{letter}a", "tool": "ToolT"}[kind],
        "counts_per_turn": 0 if kind == "tool" else 1024,
        "clockwise_speed": clockwise,
        "counterclockwise_speed": counterclockwise,
        "switches": kind == "translational",
        "joint": letter.lower() if kind != "tool" and letter.lower() in JOINTS else "",
        "initial": (inside := min(max(0.0, axis.travel[0]), axis.travel[1])),
        "start": inside,
    }
    values = defaults | values
    for side in (MOUNTED_BY, CARRIES_ON):
        if side in values:
            values[side] = Interface(side, **values[side])
    if abs(values["counts_per_unit"] * axis.resolution - 1.0) > _ROUNDING:
        raise InputError(
            f"counts_per_unit = {values['counts_per_unit']:g} contradicts the axis's resolution of {axis.resolution:g}"
            f" {axis.unit} per count, which makes {1.0 / axis.resolution:g}; leave it out, or mend one of them",
            where,
        )
    if not (values["kind_text"].isascii() and values["kind_text"].isprintable() and 1 <= len(values["kind_text"]) <= 5):
        raise InputError(f"kind_text = {values['kind_text']!r} must be 1 to 5 printable ASCII characters", where)
    try:
        data = ModuleData(axis.name, check_node(axis.node), _KINDS[kind], letter, *axis.travel, **values)
        encode_description(data.describe(0))
    except InputError as error:
        raise InputError(error.args[0], where) from None
    return data


def _speeds(axis: Axis, supply: float, scale: float) -> tuple[float, float]:
    """The speeds at the full supply, both ways, by K and friction of the axis's model, else of its machine table.

    `scale` makes speeds per minute of those of the axis: 60, or 1 of a tool.
    """
    known = machine_parameters(axis)
    if axis.model.get("name") in _MODELS:  # what is said of the axis, not what it turns out to be
        table = {key: value for key, value in axis.model.items() if key != "name"}
        known = MachineParameters.from_table(table, f"[axis.{axis.name}.model]")
    full = known.K * supply
    return max(0.0, full - known.friction_plus) * scale, max(0.0, full + known.friction_minus) * scale


def _first_letter(name: str) -> str:
    """Of an axis's name, in capitals; X where there is none that a message can carry."""
    return next((letter.upper() for letter in name if letter.isascii() and letter.isalpha()), "X")


def _kind_by_unit(unit: str) -> str:
    return {"rev/min": "tool", "deg": "rotary", "°": "rotary", "degrees": "rotary"}.get(unit, "translational")
