"""Reading the words of a case, and what all kinds of cases have in common."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable

_SHARE = re.compile(r"(?:±|\+-|\+/-)\s*(\d+(?:\.\d*)?(?:e-?\d+)?)\s*(%?)")

Ranges = dict[str, tuple[float, float]]


@dataclass(frozen=True)
class CommonFields:
    """What a case of any kind says."""

    name: str
    title: str
    is_visible: bool
    runs: int


def as_own_file(words: TomlTable, defaults: dict[str, Any]) -> TomlTable:
    """A table `[[case]]` as if it were a file of its own: errors tell the places in the assignment."""
    prefix = rf"(\s*\[{{1,2}}\s*){re.escape(words.name)}\."
    lines = [
        "" if re.match(rf"\s*\[\[\s*{re.escape(words.name)}\s*\]\]", line) else re.sub(rf"^{prefix}", r"\1", line)
        for line in words.source.split("\n")
    ]
    return TomlTable(
        defaults | words.table, words.declared, "\n".join(lines), words.path, lines_before=words.lines_before
    )


def read_common(words: TomlTable) -> CommonFields:
    """Name, title, visibility and number of runs."""
    name = words.read("name")
    if not name or not re.fullmatch(r"[\w .()+-]{1,80}", name):
        raise InputError(
            f"name = {name!r} of a case must be a short text of letters, digits, spaces and . ( ) + - _",
            words.place("name"),
        )
    runs = words.read("runs")
    return CommonFields(name, words.read("title", name) or name, words.read("visible"), runs)


def inside(words: TomlTable, key: str, folder: Path) -> str | None:
    """A file of the assignment that is named under `key`, counted from its folder; InputError if there is none."""
    name: str | None = words.read(key) if key in words else None  # a table's other kinds need no file
    if name is None:
        return None
    path = folder / name
    if Path(name).is_absolute() or not path.resolve().is_relative_to(folder.resolve()):
        raise words.fault(key, "is outside the assignment's folder; put it there, so that it goes with the assignment")
    if not path.is_file():
        raise words.fault(key, f"will not do: there is no file {path}")
    return name


def read_spread(words: TomlTable, values: dict[str, float]) -> Ranges:
    """`[case.vary]`: of each parameter a range: "±10 %" or "±0.001" about `values`, or [lowest, highest]."""
    table = words.inner("vary")
    if table is None:
        return {}
    ranges = {key: _range(table, key, values) for key in list(table.table)}
    table.done()
    return ranges


def _range(table: TomlTable, key: str, values: dict[str, float]) -> tuple[float, float]:
    given = table.any(key)
    if key not in values:
        raise InputError(f"the plant has no parameter {key!r}; it has {', '.join(values)}", table.place(key))
    middle = values[key]
    if isinstance(given, str) and (found := _SHARE.fullmatch(given.strip())):
        half = float(found[1]) * (abs(middle) / 100.0 if found[2] else 1.0)
        return middle - half, middle + half
    pair = isinstance(given, list) and len(given) == 2
    if not pair or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in given):
        raise table.fault(key, 'must be a range: "±10 %", "±0.001", or [lowest, highest]')
    if not float("-inf") < given[0] <= given[1] < float("inf"):
        raise table.fault(key, "must be finite, lowest first")
    return float(given[0]), float(given[1])
