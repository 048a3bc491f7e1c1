"""What the columns of a log mean: a TOML file beside the data, found as FILE.map.toml or named by --map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.identification.logs.csv_cells import DELIMITERS
from rds.identification.logs.map_axis import AxisMap, axes_of, scale_of, unit_of
from rds.identification.logs.map_file import JITTER_LIMIT, MAP
from rds.machines import load_machine
from rds.machines.machine import Machine

SUFFIX = ".map.toml"


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
    blanks: str = "refuse"  # or drop: rows with an empty cell; or hold: the last value of each column goes on
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
            axes=axes_of(words, machine),
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
    if not path.name:  # the folder that one is in
        return None
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
        unit=unit_of(words, "time"),
        scale=scale_of(words),
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
