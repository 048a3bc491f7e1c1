"""The axes of a map: what each column of an axis is, in which unit, and what is known of the axis."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.identification.logs.log import QUANTITIES
from rds.identification.logs.map_file import FORCE_GAIN
from rds.identification.logs.units import check_unit
from rds.machines.machine import Machine

UNKNOWN = "?"  # what a draft has for the column of a quantity that nothing in the file tells
_LEFT_OPEN = re.compile(r"=\s*[\"']\?[\"']")
WRAPPING = ("position", "reference")  # what a counter that begins again may count
# what each quantity may be measured in
DIMENSIONS: Mapping[str, tuple[str, ...]] = {
    "time": ("time",),
    "command": ("voltage", "force", "torque", "current", "ratio"),
    "position": ("length", "angle", "angular speed", "counts"),
    "velocity": ("speed", "angular speed", "count speed"),
    "current": ("current",),
    "force": ("force", "torque"),
    "reference": ("length", "angle", "angular speed", "counts"),
    "following_error": ("length", "angle", "counts"),
}
# gains from the command to what moves the axis: the key of a map, and the unit of what is moved by
GAINS = {"force_gain": "N", "torque_gain": "Nm"}


@dataclass(frozen=True)
class ColumnMap:
    """A column that is a quantity: `sign * (scale * number + offset)` in `unit`; None: the unit that the file gives.

    `wrap`: the number at which the counter begins again, for a position that is to go on beyond it.
    """

    column: str
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    sign: int = 1
    wrap: float | None = None
    second: bool = False  # it is in the second file
    place: str = ""  # of the map, for errors


@dataclass(frozen=True)
class AxisMap:
    """One axis of the file: its quantities and what is known of it."""

    name: str
    columns: Mapping[str, ColumnMap]
    machine_axis: str | None = None
    resolution: float | None = None  # mm (or the axis's unit) per count
    closed_loop: bool | None = None
    force_gain: float | str | None = None  # per unit of the command; a text names a constant of the file
    force_unit: str = "N"  # or Nm: of what the command makes
    voltage_range: tuple[float, float] | None = None  # V
    place: str = ""


def axes_of(words: TomlTable, machine: Machine | None) -> dict[str, AxisMap]:
    """The axes by name, of the tables [axis.NAME]."""
    tables = words.inner("axis")
    if tables is None or not tables.table:
        raise InputError("there is no [axis.NAME] table; say which columns are command and position", words.place())
    made = {}
    for name in tables.table:
        axis = tables.inner(name)
        assert axis is not None
        made[name] = _axis(name, axis, machine)
    return made


def _axis(name: str, words: TomlTable, machine: Machine | None) -> AxisMap:
    columns = {q: _column(words, q) for q in QUANTITIES if q in words}
    of = words.read("machine_axis")
    if of is not None and machine is None:
        raise words.fault("machine_axis", 'names an axis of no machine; add machine = "mini-cnc" at the top')
    if machine is not None:
        if of is None and name in machine.axes:
            of = name
        if of is not None and of not in machine.axes:
            raise words.fault("machine_axis", f"is no axis of {machine.name}; it has {', '.join(machine.axes)}")
    closed = words.read("closed_loop")
    gain, force = _gain(words)
    made = AxisMap(
        name=name,
        columns=columns,
        machine_axis=of,
        resolution=_resolution(words),
        closed_loop=closed,
        force_gain=gain,
        force_unit=force,
        voltage_range=_range(words),
        place=words.place(),
    )
    words.done()  # before what is missing: a misspelt `position` is there
    _check_columns(name, columns, words)
    return made


def _check_columns(name: str, columns: Mapping[str, ColumnMap], words: TomlTable) -> None:
    """InputError where a command is missing, or all that tells a motion."""
    if "command" not in columns:
        raise InputError(f"axis {name} needs command = {{ column = ..., unit = ... }}", words.place())
    told = {"position", "velocity"} & set(columns) or {"reference", "following_error"} <= set(columns)
    if not told:
        raise InputError(
            f"axis {name} needs position = {{ column = ..., unit = ... }}; or velocity; or reference and "
            "following_error, of which the position follows",
            words.place(),
        )
    command = columns["command"]
    for q, other in columns.items():
        if q in ("position", "velocity") and (command.column, command.second) == (other.column, other.second):
            raise InputError(f"command and {q} are both {command.column!r}; one is another column", command.place)


def _column(axis: TomlTable, quantity: str) -> ColumnMap:
    if isinstance(axis.any(quantity), str):
        return ColumnMap(axis.any(quantity), place=axis.place(quantity))
    words = axis.inner(quantity)
    assert words is not None
    column = words.read("column")
    if column is None:
        raise InputError(f'{quantity} needs column = "..." ', axis.place(quantity))
    if column == UNKNOWN:
        raise _left_open(words, "column", "name one of its columns")
    sign = words.any("sign", 1)
    if sign not in (1, -1) or isinstance(sign, bool):
        raise words.fault("sign", "must be 1 or -1")
    made = ColumnMap(
        column=column,
        unit=unit_of(words, quantity),
        scale=scale_of(words),
        offset=words.read("offset"),
        sign=int(sign),
        wrap=words.read("wrap"),
        second=words.read("second"),
        place=axis.place(quantity),
    )
    words.done()
    if made.wrap is not None and quantity not in WRAPPING:
        raise words.fault("wrap", f"is for {' and '.join(WRAPPING)}, where a counter begins again; remove it")
    return made


def _resolution(words: TomlTable) -> float | None:
    if "resolution" in words and "counts_per_unit" in words:
        raise words.fault("counts_per_unit", "and resolution say the same; give one of them")
    if "counts_per_unit" in words:
        return 1.0 / float(words.read("counts_per_unit"))
    resolution: float | None = words.read("resolution")
    return resolution


def _gain(words: TomlTable) -> tuple[float | str | None, str]:
    """What one unit of the command makes, and its unit."""
    given = [key for key in GAINS if key in words]
    if not given:
        return None, "N"
    key = given[0]
    if len(given) > 1:
        raise words.fault(given[1], f"and {key} are both given; a command makes a force or a torque: give one")
    value = words.any(key)
    if isinstance(value, str):
        return value, GAINS[key]
    if (fault := FORCE_GAIN.fault(value)) is not None:
        raise words.fault(key, fault)
    gain = float(value)
    if gain == 0.0:
        raise words.fault(key, "must not be 0: the command would make no force")
    return gain, GAINS[key]


def _range(words: TomlTable) -> tuple[float, float] | None:
    value = words.any("voltage_range")
    if value is None:
        return None
    numbers = value if isinstance(value, list) else [value]
    if not all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers) or len(numbers) not in (1, 2):
        raise words.fault("voltage_range", "must be [lowest, highest] in V, or one number for both directions")
    low, high = (float(numbers[0]), float(numbers[1])) if len(numbers) == 2 else (-float(numbers[0]), float(numbers[0]))
    if not -inf < low < high < inf:
        raise words.fault("voltage_range", "must be [lowest, highest] in V, the lowest first")
    return low, high


def _left_open(words: TomlTable, key: str, remedy: str) -> InputError:
    """About the draft's mark, and in which lines there is one: all can be given at once."""
    lines = [str(k) for k, line in enumerate(words.source.splitlines(), 1) if _LEFT_OPEN.search(line)]
    among = f"; there is one in lines {', '.join(lines[:-1])} and {lines[-1]}" if len(lines) > 1 else ""
    return words.fault(key, f"is the draft's mark for what the file does not tell: {remedy}{among}")


def unit_of(words: TomlTable, quantity: str) -> str | None:
    """The `unit` of a table; InputError for one that the quantity cannot have, or that the draft left open."""
    unit: str | None = words.read("unit")
    if unit == UNKNOWN:
        raise _left_open(words, "unit", f"give the unit of the {quantity}")
    if unit is not None:
        try:
            check_unit(unit, DIMENSIONS[quantity], quantity)
        except InputError as error:
            raise InputError(str(error), words.place("unit")) from None
    return unit


def scale_of(words: TomlTable) -> float:
    """The `scale` of a table, which is not 0."""
    scale: float = words.read("scale")
    if scale == 0.0:
        raise words.fault("scale", "must not be 0: nothing would be left of the column")
    return scale
