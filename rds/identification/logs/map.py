"""What the columns of a log mean: a TOML file beside the data, found as FILE.map.toml or named by --map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.identification.logs.csv_layout import DELIMITERS
from rds.identification.logs.log import QUANTITIES
from rds.identification.logs.map_file import FORCE_GAIN, JITTER_LIMIT, MAP
from rds.identification.logs.units import check_unit
from rds.machines import load_machine
from rds.machines.machine import Machine

UNKNOWN = "?"  # what a draft has for the column of a quantity that nothing in the file tells
SUFFIX = ".map.toml"
WRAPPING = ("position", "reference")  # what a counter that begins again may count
ROTARY = ("angle", "angular speed")
# what each quantity may be measured in
DIMENSIONS: Mapping[str, tuple[str, ...]] = {
    "time": ("time",),
    "command": ("voltage", "force", "torque", "current", "ratio"),
    "position": ("length", "angle", "angular speed", "counts"),
    "velocity": ("speed", "angular speed", "count speed"),
    "current": ("current",),
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
class TimeMap:
    """The column of time; None for a log in which each column has its own. `rate`: Hz, where no column tells time."""

    column: str | None = None
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    rate: float | None = None
    wrap: float | None = None  # numbers of the column, at which its counter begins again
    source: str = ""
    uncertainty: float | None = None  # s, one standard deviation of a time stamp
    place: str = ""


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


@dataclass(frozen=True)
class SecondMap:
    """A second recorder's file of the same motion, and how the two clocks are made one."""

    file: Path
    time: TimeMap
    first_column: str | None = None  # seen by both recorders: the column of the first file, and ...
    second_column: str | None = None  # ... of the second
    relation: str = "same"  # or "rate": the second column's slope follows the first (a command, and a position)
    offset: float | None = None  # s; with both given nothing is estimated
    drift: float | None = None  # s per s
    window: float = inf  # s: the largest offset that is looked for
    delimiter: str | None = None
    decimal: str | None = None
    place: str = ""


@dataclass(frozen=True)
class LogMap:
    """How a file of logged data is read. `path` is None for a map that was guessed; `said` tells then what."""

    time: TimeMap
    axes: Mapping[str, AxisMap]
    path: Path | None = None
    machine: Machine | None = None
    second: SecondMap | None = None
    delimiter: str | None = None
    decimal: str | None = None
    dbc: tuple[Path, ...] = ()
    samples: int | None = None  # that there should be
    jitter_limit: float = JITTER_LIMIT
    duplicates: str = "refuse"  # or drop
    gaps: str = "refuse"  # or split: a log for each stretch between gaps; or keep: the command was held over them
    blanks: str = "refuse"  # or drop: rows with an empty cell
    said: tuple[str, ...] = field(default=())

    @classmethod
    def read(cls, path: str | Path) -> LogMap:
        """The map in a TOML file; InputError, with file and line, for a key or value that has no meaning."""
        words = TomlTable.open(path, MAP)
        folder = Path(path).parent
        table = words.inner_or_empty("table")
        bus = words.inner_or_empty("bus")
        delimiter, decimal = _layout(table)
        machine = _machine(words, folder)
        made = cls(
            time=_time(words.inner("time"), str(path)),
            axes=_axes(words, machine),
            path=Path(path),
            machine=machine,
            second=_second(words.inner("second"), folder),
            delimiter=delimiter,
            decimal=decimal,
            dbc=_files(bus, "dbc", folder),
            samples=words.read("samples"),
            jitter_limit=words.read("jitter_limit"),
            duplicates=words.read("duplicates"),
            gaps=words.read("gaps"),
            blanks=words.read("blanks"),
        )
        for part in (table, bus, words):
            part.done()
        seconds = [column for axis in made.axes.values() for column in axis.columns.values() if column.second]
        if seconds and made.second is None:
            raise InputError("second = true, and there is no [second] table with the file", seconds[0].place)
        if made.second is not None and not seconds:
            raise InputError(
                "no column is of the second file; say of those that are: second = true, or leave [second] out",
                made.second.place,
            )
        return made


def beside(path: Path) -> Path | None:
    """The map that belongs to a data file by its name, if there is one."""
    found = path.with_name(path.name + SUFFIX)
    return found if found.is_file() else None


def _machine(words: TomlTable, folder: Path) -> Machine | None:
    name = words.read("machine")
    if name is None:
        return None
    try:
        return load_machine(str(folder / name) if name.endswith(".toml") else name)
    except InputError as error:
        raise error if error.where else InputError(str(error), words.place("machine")) from error


def _layout(table: TomlTable) -> tuple[str | None, str | None]:
    delimiter = table.read("delimiter")
    decimal = table.read("decimal")
    return DELIMITERS.get(delimiter), {"point": ".", "comma": ","}.get(decimal)


def _files(words: TomlTable, key: str, folder: Path) -> tuple[Path, ...]:
    given = words.any(key, [])
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise words.fault(key, 'must be the name of a file, or a list of names, as in ["axes.dbc"]')
    return tuple(folder / name for name in names)


def _unit(words: TomlTable, quantity: str) -> str | None:
    unit: str | None = words.read("unit")
    if unit == UNKNOWN:
        raise words.fault(
            "unit", f"is the draft's mark for what the file does not tell: give the unit of the {quantity}"
        )
    if unit is not None:
        try:
            check_unit(unit, DIMENSIONS[quantity], quantity)
        except InputError as error:
            raise InputError(str(error), words.place("unit")) from None
    return unit


def _time(words: TomlTable | None, path: str) -> TimeMap:
    if words is None:
        return TimeMap(place=path)
    rate = words.read("rate")
    column = words.read("column")
    if rate is not None and column is not None:
        raise words.fault("rate", "is for a file without a column of time; give one of rate and column")
    uncertainty = words.read("uncertainty")
    made = TimeMap(
        column=column,
        unit=_unit(words, "time"),
        scale=_scale(words),
        offset=words.read("offset"),
        rate=rate,
        wrap=words.read("wrap"),
        source=words.read("source"),
        uncertainty=uncertainty,
        place=words.place(),
    )
    words.done()
    for key in ("unit", "scale", "offset", "wrap"):
        if column is None and key in words:
            raise words.fault(key, 'is of a column of numbers, and none is named; add column = "...", or remove it')
    return made


def _scale(words: TomlTable) -> float:
    scale: float = words.read("scale")
    if scale == 0.0:
        raise words.fault("scale", "must not be 0: nothing would be left of the column")
    return scale


def _axes(words: TomlTable, machine: Machine | None) -> dict[str, AxisMap]:
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
    _check_columns(name, columns, words)
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
    words.done()
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
        raise words.fault("column", "is the draft's mark for what the file does not tell: name one of its columns")
    sign = words.any("sign", 1)
    if sign not in (1, -1) or isinstance(sign, bool):
        raise words.fault("sign", "must be 1 or -1")
    made = ColumnMap(
        column=column,
        unit=_unit(words, quantity),
        scale=_scale(words),
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


def _second(words: TomlTable | None, folder: Path) -> SecondMap | None:
    if words is None:
        return None
    name = words.read("file")
    if name is None:
        raise InputError('[second] needs file = "...", the second recorder\'s', words.place())
    delimiter, decimal = _layout(words)
    offset = words.read("offset")
    drift = words.read("drift")
    if drift is not None and offset is None:
        raise words.fault("drift", "is given without offset; give both, or neither and let them be estimated")
    for key in ("relation", "window"):
        if offset is not None and key in words:
            raise words.fault(key, "is for an offset that is estimated, and offset is given; remove one of the two")
    same = words.inner("same")
    first = second = None
    if same is not None:
        first, second = same.read("first"), same.read("second")
        if first is None or second is None:
            raise InputError('same needs both columns: { first = "...", second = "..." }', words.place("same"))
        same.done()
    if same is None and offset is None:
        raise InputError(
            'nothing says how the two clocks agree; give same = { first = "...", second = "..." }, a column of each '
            "file that saw the same motion, or offset (s) and drift (s per s)",
            words.place(),
        )
    made = SecondMap(
        file=folder / name,
        time=_time(words.inner("time"), words.place()),
        first_column=first,
        second_column=second,
        relation=words.read("relation"),
        offset=offset,
        drift=drift,
        window=words.read("window"),
        delimiter=delimiter,
        decimal=decimal,
        place=words.place(),
    )
    words.done()
    return made
