"""The `[bus.cia402]` table: how to reach each axis's drive, and what its numbers mean. `docs/cia402.md` explains it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from importlib.resources import files
from pathlib import Path
from typing import Any

from rds.bus.modules.cia402.codes import NODES, Mode
from rds.bus.modules.cia402.homing import METHODS
from rds.bus.modules.cia402.servo import SPINDLE_COUNTS
from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import Quantity
from rds.core.types import SPINDLE_UNIT
from rds.machines.machine import Axis, Machine

OUR_EDS = "axis.eds"
_HEARTBEAT = Quantity("time between two heartbeats", "s", 0.001, 20.0)  # one, and three, in 16 bits of ms
_HALF = 1 << 31  # counts: a drive's positions are of 32 bits


class Command(Enum):
    """What the host commands every cycle: mode of operation, target object."""

    CST = (Mode.CYCLIC_TORQUE, 0x6071)
    CSP = (Mode.CYCLIC_POSITION, 0x607A)
    CSV = (Mode.CYCLIC_VELOCITY, 0x60FF)
    PP = (Mode.PROFILE_POSITION, 0x607A)

    @property
    def mode(self) -> Mode:
        """The mode of operation, 0x6060."""
        return self.value[0]

    @property
    def target(self) -> int:
        """The target object's index."""
        return self.value[1]

    @property
    def leads_position(self) -> bool:
        """Whether the target is a position."""
        return self.target == 0x607A


@dataclass(frozen=True)
class DriveSettings:
    """One axis's drive."""

    axis: Axis
    command: Command
    node: int
    eds: str  # path
    counts: float  # position units of the drive per mm (degree, ...); for a spindle per revolution
    velocity_counts: float  # velocity units of the drive per mm/s; for a spindle per rev/min
    rated_voltage: float  # V: what the loop's voltage is when the drive gives 1000 ‰ torque
    torque_limit: int  # ‰
    highest_voltage: float  # V, that the loop may give; what is beyond the torque limit is sent as that
    direction: int  # 1, or -1 if the drive counts the other way round
    homing: int | None  # method 0x6098, carried out at the start
    home_offset: int | None  # 0x607C, counts: minus the position that home gets; None: as the drive has it
    fixed_mapping: bool  # its PDOs cannot be mapped: those that it has are used as they are
    write: tuple[tuple[int, int, int], ...]  # (index, sub-index, value) to write before the drive is enabled

    @property
    def name(self) -> str:
        """For messages: "X (node 2)"."""
        return f"{self.axis.name} (node {self.node})"

    @property
    def reads_velocity(self) -> bool:
        """Whether the axis's measured value is its speed."""
        return self.axis.unit == SPINDLE_UNIT


@dataclass(frozen=True)
class Settings:
    """The whole table."""

    drives: tuple[DriveSettings, ...]
    host: int  # node-ID that the host's heartbeats bear
    heartbeat: float  # s between two heartbeats, the drives' and the host's
    transmission: int  # RPDO transmission type
    absolute: bool  # positions are the drive's own; False: relative to where the axis stood at start()
    homing_timeout: float  # s


_TOP = ("mode", "host", "heartbeat", "rpdo_transmission", "positions", "homing_timeout", "axis")
_AXIS = (
    "mode",
    "node",
    "eds",
    "counts",
    "encoder",
    "gear",
    "feed",
    "velocity_counts",
    "rated_voltage",
    "torque_limit",
    "direction",
    "homing",
    "home",
    "mapping",
    "write",
)
_MORE_THAN_0 = {
    "counts": "position units of the drive per unit of the axis",
    "encoder": "position units per revolution of the motor",
    "gear": "revolutions of the motor per revolution of the shaft",
    "feed": "units of the axis per revolution of the shaft",
    "velocity_counts": "velocity units of the drive per unit/s of the axis",
    "rated_voltage": "V for 1000 per mille torque",
}


def read_settings(table: Mapping[str, Any], machine: Machine, axes: Sequence[str] | None = None) -> Settings:
    """The settings for `axes` (names; default all) of `machine`, from a `[bus.cia402]` table.

    Raises InputError for an unknown key or axis, or a value that can't be.
    """
    where = "[bus.cia402]"
    if not isinstance(table, Mapping):
        raise InputError(f"cia402 = {table!r} must be a table, [bus.cia402]", where)
    check_known(table, _TOP, where)
    given = table.get("axis", {})
    if not isinstance(given, Mapping):
        raise InputError(f"axis = {given!r} must be tables, one for each axis: [bus.cia402.axis.X]", where)
    for name, of_axis in given.items():
        machine.axis(name)
        if not isinstance(of_axis, Mapping):
            raise InputError(f"axis.{name} = {of_axis!r} must be a table, [bus.cia402.axis.{name}]", where)
    used = [machine.axis(name) for name in (machine.axes if axes is None else axes)]
    mode = table.get("mode", "cst")
    _command(mode, where)
    drives = tuple(_drive(axis, {"mode": mode} | given.get(axis.name, {}), machine) for axis in used)
    nodes = [drive.node for drive in drives]
    host = _whole(table, "host", 127, NODES, where)
    if len(set(nodes)) != len(nodes) or host in nodes:
        raise InputError(f"nodes {nodes} and host {host} must all differ", where)
    positions = table.get("positions", "start")
    if positions not in ("start", "drive"):
        raise InputError(f'positions = {positions!r} must be "start" or "drive"', where)
    transmission = _whole(table, "rpdo_transmission", 1, (*range(241), 254, 255), where)
    return Settings(
        drives=drives,
        host=host,
        heartbeat=float(_HEARTBEAT.check(table.get("heartbeat", 0.1), "heartbeat", where)),
        transmission=transmission,
        absolute=positions == "drive",
        homing_timeout=_more_than_0(table, "homing_timeout", 60.0, "s", where),
    )


# what the loop hands out, by the drive's mode: the names of rds.modes.loop.commands
_HANDED_OUT = {Command.CST: "voltage", Command.CSV: "velocity", Command.CSP: "position", Command.PP: "profile"}


def commands(table: Mapping[str, Any], machine: Machine, axes: Sequence[str]) -> dict[str, str]:
    """What each axis is commanded by. InputError for a table that will not do, and a spindle led along positions."""
    handed = {}
    for drive in read_settings(table, machine, axes).drives:
        name = drive.axis.name
        if drive.axis.is_spindle and drive.command.leads_position:
            raise InputError(
                f'mode = "{drive.command.name.lower()}" leads along positions, and {name} is a spindle: give it '
                f'[bus.cia402.axis.{name}] with mode = "csv" (or "cst")'
            )
        handed[name] = _HANDED_OUT[drive.command]
    return handed


def _command(name: Any, where: str) -> Command:
    names = {command.name.lower(): command for command in Command}
    if not isinstance(name, str) or name not in names:
        raise InputError(f"mode = {name!r} must be one of {', '.join(map(repr, names))}", where)
    return names[name]


def _drive(axis: Axis, table: Mapping[str, Any], machine: Machine) -> DriveSettings:
    where = f"[bus.cia402.axis.{axis.name}]"
    check_known(table, _AXIS, where)
    counts = _counts(axis, table, where)
    spindle = axis.unit == SPINDLE_UNIT
    homing = table.get("homing")
    if homing is not None:
        homing = _whole(table, "homing", 0, range(-128, 128), where)
        if "eds" not in table and homing not in METHODS:
            raise InputError(f"homing = {homing} must be one of {', '.join(map(str, METHODS))}", where)
    direction = _whole(table, "direction", 1, (1, -1), where)
    converter = machine.converter.range
    rated = _more_than_0(table, "rated_voltage", converter, _MORE_THAN_0["rated_voltage"], where)
    torque = _whole(table, "torque_limit", 1000, range(1, 32768), where)
    return DriveSettings(
        axis=axis,
        command=_command(table["mode"], where),
        node=_whole(table, "node", axis.node, NODES, where),
        eds=_eds(table.get("eds"), machine, where),
        counts=counts,
        velocity_counts=_more_than_0(
            table, "velocity_counts", counts / 60.0 if spindle else counts, _MORE_THAN_0["velocity_counts"], where
        ),
        rated_voltage=rated,
        torque_limit=torque,
        highest_voltage=max(converter, 1e-3 * torque * rated),
        direction=direction,
        homing=homing,
        home_offset=_home_offset(table, direction * counts, where),
        fixed_mapping=_is_fixed(table.get("mapping", "dynamic"), where),
        write=_writes(table.get("write", ()), where),
    )


def _home_offset(table: Mapping[str, Any], counts: float, where: str) -> int | None:
    """0x607C that gives home the position `home`: zero is home plus offset, so home is at minus the offset."""
    if "home" not in table:
        return None
    if "homing" not in table:
        raise InputError(
            f"home = {table['home']!r} says where homing ends; give its method as well: homing = 17", where
        )
    offset: int = round(-counts * Quantity("position that home gets", "axis unit").check(table["home"], "home", where))
    if not -_HALF <= offset < _HALF:
        raise InputError(f"home = {table['home']!r} is beyond what a drive can count", where)
    return offset


def _counts(axis: Axis, table: Mapping[str, Any], where: str) -> float:
    parts = ("encoder", "gear", "feed")
    if "counts" in table or not any(part in table for part in parts):
        if any(part in table for part in parts):
            raise InputError("give either counts, or encoder, gear and feed", where)
        ours = float(SPINDLE_COUNTS) if axis.unit == SPINDLE_UNIT else 1.0 / axis.resolution
        return _more_than_0(table, "counts", ours, _MORE_THAN_0["counts"], where)
    encoder, gear, feed = (_more_than_0(table, part, 1.0, _MORE_THAN_0[part], where) for part in parts)
    return encoder * gear / feed


def _eds(path: Any, machine: Machine, where: str) -> str:
    if path is None:
        return str(files("rds.bus.modules.cia402").joinpath(OUR_EDS))
    found = [place for place in (Path(machine.path).parent / str(path), Path(str(path))) if place.is_file()]
    if not found:
        raise InputError(f"eds = {path!r}: there is no such file, neither beside {machine.path} nor here", where)
    return str(found[0])


def _is_fixed(mapping: Any, where: str) -> bool:
    if mapping not in ("dynamic", "fixed"):
        raise InputError(f'mapping = {mapping!r} must be "dynamic" or "fixed"', where)
    return bool(mapping == "fixed")


def _writes(entries: Any, where: str) -> tuple[tuple[int, int, int], ...]:
    lists = isinstance(entries, Sequence) and all(isinstance(entry, Sequence) and len(entry) == 3 for entry in entries)
    if not lists or not all(isinstance(number, int) for entry in entries for number in entry):
        raise InputError(f"write = {entries!r} must be a list of [index, sub-index, value]", where)
    return tuple((entry[0], entry[1], entry[2]) for entry in entries)


def _whole(table: Mapping[str, Any], key: str, default: int, allowed: Sequence[int], where: str) -> int:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or value not in allowed:
        if isinstance(allowed, range):
            what = f"from {allowed[0]} to {allowed[-1]}"
        else:
            what = "one of 0 to 240, 254 and 255" if len(allowed) > 8 else f"one of {', '.join(map(str, allowed))}"
        raise InputError(f"{key} = {value!r} must be a whole number, {what}", where)
    return value


def _more_than_0(table: Mapping[str, Any], key: str, default: float, meaning: str, where: str) -> float:
    return float(Quantity(meaning, above=0.0).check(table.get(key, default), key, where))
