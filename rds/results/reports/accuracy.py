"""Accuracy and repeatability from encoder counts after commanded moves.

Repeatability compares each end with the average of the ends, accuracy with the expected count, which is the commanded
distance times the counts per unit. Source: tables 14 to 17, figures 86 to 89 and tables O32 to O34 of the thesis on
the open architecture control system (docs/thesis-reports.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.reading import columns_in, read_columns, read_toml
from rds.results.reports.settings import Setting, read_settings
from rds.results.reports.statistics import Summary, summary

if TYPE_CHECKING:
    from rds.core.figure import Picture

UNITS = ("mm", "deg")

ABOUT_MOVES = {
    "distance": Setting("the commanded move", "mm or deg", more_than=0),
    "counts_per_unit": Setting("encoder counts for one mm or degree", "counts/mm or counts/deg", more_than=0),
    "unit": Setting("the unit of the move: mm or deg; mm if nothing else is said", text=True),
    "name": Setting("what to call the axis; else the name of its file", text=True),
    "accuracy": Setting("largest deviation from the commanded move that is allowed", "mm or deg", more_than=0),
    "repeatability": Setting("largest deviation from the average that is allowed", "mm or deg", more_than=0),
}
SETTINGS = {
    **ABOUT_MOVES,
    "about": Setting(
        "a TOML file with a table of the options above per data file, called like the file without its ending; "
        "without it, NAME.toml beside NAME.csv",
        text=True,
    ),
}


@dataclass(frozen=True)
class Moves:
    """Ends of the same move made several times, per direction, in counts; and what the move should have been."""

    name: str
    unit: str  # mm or deg
    distance: float
    counts_per_unit: float
    ends: Mapping[str, Sequence[float]]  # counts, by direction
    accuracy: float | None = None  # allowed, in the unit
    repeatability: float | None = None

    @property
    def expected(self) -> float:
        """The count that the move should end at."""
        return self.distance * self.counts_per_unit

    def inaccurate(self) -> int:
        """How many moves end further from the expected count than `accuracy` allows."""
        allowed = (self.accuracy or 0.0) * self.counts_per_unit
        return sum(abs(end - self.expected) > allowed for ends in self.ends.values() for end in ends)


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Read the files and report on them. InputError for data or options that will not do."""
    return report_on([read(path, settings) for path in files], [path.name for path in files], settings)


def report_on(sets: Sequence[Moves], sources: Sequence[str] = (), settings: Mapping[str, Any] | None = None) -> Report:
    """The report on moves, from files or made by our own modules."""
    tables = []
    for unit in dict.fromkeys(moves.unit for moves in sets):
        alike = [moves for moves in sets if moves.unit == unit]
        tables += [_repeatability(alike, unit), _accuracy(alike, unit)]
    return Report(
        "accuracy",
        "Accuracy and repeatability",
        sources,
        settings or {},
        tables,
        {"Encoder counts": lambda: picture(sets)},
        [finding for moves in sets for finding in _findings(moves)],
    )


def read(path: Path, settings: Mapping[str, Any]) -> Moves:
    """Moves from a CSV file with a column per direction, in counts (or in mm or deg, which become counts)."""
    if not path.is_file():
        kind = "is a folder" if path.is_dir() else "there is no such file"
        raise InputError(f"{kind}; check the name of the file", str(path))
    about = _about(path, settings)
    missing = [name for name in ("distance", "counts_per_unit") if about[name] is None]
    if missing:
        where = f"write {path.stem}.toml beside it with"
        if settings.get("about"):
            where = f"give {settings['about']} a table [{path.stem}] with"
        raise InputError(
            f"{' and '.join(missing)} not known; give the option{'s' if len(missing) > 1 else ''}, "
            f"or {where} lines such as 'distance = 80.0' and 'counts_per_unit = 169'",
            str(path),
        )
    unit = about["unit"] or UNITS[0]
    if unit not in UNITS:
        raise InputError(f"unit = {unit!r} is neither mm nor deg; give one of them", str(path))
    columns = columns_in(path, read_columns(path), ("counts", unit), "ends of moves", "cw_counts")
    ends = {}
    for column in columns:
        factor = 1.0 if column.unit == "counts" else about["counts_per_unit"]
        ends[column.name] = [factor * value for value in column.numbers(blanks=True)]
    name = about["name"] or path.stem
    return Moves(
        name, unit, about["distance"], about["counts_per_unit"], ends, about["accuracy"], about["repeatability"]
    )


def _about(path: Path, settings: Mapping[str, Any]) -> dict[str, Any]:
    """What is known of the moves: the options, then what a file says, then the defaults."""
    given: dict[str, Any] = {}
    beside = path.with_suffix(".toml")
    owner = ""
    if settings.get("about"):
        owner = f"{settings['about']}, table {path.stem}"
        tables = read_toml(Path(settings["about"]))
        given = tables.get(path.stem, {})
        if not isinstance(given, dict):
            raise InputError(f"{path.stem} = {given!r} must be a table: [{path.stem}]", settings["about"])
    elif beside != path and beside.is_file():
        owner, given = str(beside), read_toml(beside)
    known = read_settings(given, ABOUT_MOVES, owner)
    for name in ABOUT_MOVES:
        if settings.get(name) is not None:
            known[name] = settings[name]
    return known


def _each(sets: Iterable[Moves]) -> Iterable[tuple[Moves, str, Summary]]:
    return ((moves, direction, summary(ends)) for moves in sets for direction, ends in moves.ends.items())


def _repeatability(sets: Sequence[Moves], unit: str) -> Table:
    deviation = f"largest deviation [{unit}]"
    columns = ["axis", "direction", "moves", "average [counts]", "std [counts]", "smallest [counts]"]
    columns += ["smallest: variation [%]", "largest [counts]", "largest: variation [%]"]
    columns += ["largest deviation [counts]", deviation]
    rows = [
        [
            *(moves.name, direction, s.n, s.mean, s.std, s.low),
            *(100 * (s.mean - s.low) / s.mean if s.mean else None, s.high),
            *(100 * (s.high - s.mean) / s.mean if s.mean else None, s.worst, s.worst / moves.counts_per_unit),
        ]
        for moves, direction, s in _each(sets)
    ]
    note = "Variation and deviation are from the average; std is that of a sample (n − 1)."
    digits = {name: 1 for name in columns if "counts" in name} | {name: 2 for name in columns if "%" in name}
    whole = {"smallest [counts]": 0, "largest [counts]": 0}
    return Table(f"Repeatability [{unit}]", columns, rows, note, {**digits, **whole, deviation: 3})


def _accuracy(sets: Sequence[Moves], unit: str) -> Table:
    columns = ["axis", "direction", f"move [{unit}]", "expected [counts]", f"average [counts/{unit}]"]
    columns += ["smallest − expected [counts]", f"smallest − expected [{unit}]"]
    columns += ["largest − expected [counts]", f"largest − expected [{unit}]"]
    columns += ["largest deviation [counts]", "largest deviation [%]", f"largest deviation [{unit}]"]
    rows = []
    for moves, direction, s in _each(sets):
        low, high = s.low - moves.expected, s.high - moves.expected
        worst = max(abs(low), abs(high))
        per_unit = moves.counts_per_unit
        rows.append(
            [
                *(moves.name, direction, moves.distance, moves.expected, s.mean / moves.distance),
                *(low, low / per_unit, high, high / per_unit),
                *(worst, 100 * worst / moves.expected, worst / per_unit),
            ]
        )
    note = "Expected is the commanded move times the counts per unit; deviation is from the expected count."
    digits = {name: 1 for name in columns if name.endswith("[counts]")}
    digits |= {name: 3 for name in columns if name.endswith(f"[{unit}]")}
    return Table(
        f"Accuracy [{unit}]",
        columns,
        rows,
        note,
        {**digits, f"average [counts/{unit}]": 2, "largest deviation [%]": 2, f"move [{unit}]": 1},
    )


def _findings(moves: Moves) -> list[str]:
    unit, per_unit = moves.unit, moves.counts_per_unit
    said = []
    for direction, ends in moves.ends.items():
        s = summary(ends)
        off = max(abs(s.low - moves.expected), abs(s.high - moves.expected)) / per_unit
        said.append(
            f"{moves.name} {direction}: at most {s.worst / per_unit:.2f} {unit} from the average of {s.mean:.1f} counts"
            f"{_verdict(s.worst / per_unit, moves.repeatability, unit)}, at most {off:.2f} {unit} from the "
            f"commanded {moves.distance:g} {unit}{_verdict(off, moves.accuracy, unit)}."
        )
    if moves.accuracy is not None:
        total = sum(map(len, moves.ends.values()))
        good = total - moves.inaccurate()
        said.append(f"{moves.name}: {good} of {total} moves end within {moves.accuracy:g} {unit} of the command.")
    return said


def _verdict(value: float, allowed: float | None, unit: str) -> str:
    if allowed is None:
        return ""
    return f" ({'meets' if value <= allowed else 'misses'} ±{allowed:g} {unit})"


def picture(sets: Sequence[Moves]) -> Picture:
    """Counts of each move with the averages of both directions and the expected count; a panel per axis."""
    from rds.core.figure import CYCLE, GREY, Picture, dress, legend

    drawn = Picture(2.6 * len(sets) + 0.4)
    for axes, moves in zip(drawn.subplots(len(sets), 1, squeeze=False)[:, 0], sets, strict=True):
        for (direction, ends), colour, marker in zip(moves.ends.items(), CYCLE * 2, "osD^vPX*<>hd", strict=False):
            mean = summary(ends).mean
            count = range(1, len(ends) + 1)
            axes.plot(count, ends, marker, color=colour, label=f"{direction}, average {mean:.1f}")
            axes.axhline(mean, color=colour, linewidth=1.1, linestyle=(0, (5, 2)))
        axes.axhline(moves.expected, color=GREY, linewidth=3, alpha=0.55, label=f"expected {moves.expected:g}")
        dress(axes, f"{moves.name} [counts]", "move [number]")
        axes.margins(x=0.05)
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.yaxis.get_major_formatter().set_useOffset(False)
        legend(axes)
    drawn.align_ylabels()
    return drawn
