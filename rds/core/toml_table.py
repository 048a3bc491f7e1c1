"""Reading the words of a TOML file: every key is known and every value is of its kind, or an error says where."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_file import read_toml


class Words:
    """One table of a file. `done()` at the end refuses the keys that nobody asked for.

    With `general`, keys that the table lacks are looked for in that one, among those in `shared`.
    """

    def __init__(
        self,
        table: dict[str, Any],
        text: str = "",
        path: str = "",
        name: str = "",
        general: Words | None = None,
        shared: Sequence[str] = (),
        lines_before: int = 0,
    ):
        self.table, self.path, self.name = table, path, name
        self._text, self._general, self._shared = text, general, shared
        self.lines_before = lines_before  # of the file, above `text`, for the lines in errors
        self._asked: list[str] = []

    def over_written(self, table: dict[str, Any]) -> Words:
        """The same file with another top table: errors still tell the file's places."""
        return Words(table, self._text, self.path)

    @property
    def source(self) -> str:
        """The text of the whole file."""
        return self._text

    @classmethod
    def read(cls, path: str | Path) -> Words:
        """The top table of a TOML file; InputError if it cannot be read or is not TOML."""
        table, text = read_toml(path)
        return cls(table, text, str(path))

    def place(self, key: str | None = None) -> str:
        """File and line of a key of this table, as far as they are known."""
        owner = self._owner(key)
        if owner is not self:
            return owner.place(key)
        line = _line_of(self._text, self.name, key)
        line = None if line is None else line + self.lines_before
        inside = f"[{self.name}]" if self.name else ""
        where = ", ".join(part for part in (self.path, f"line {line}" if line else inside) if part)
        return where or "experiment"

    def fault(self, key: str, remedy: str) -> InputError:
        """The error that this value of `key` will not do."""
        owner = self._owner(key)
        prefix = f"{owner.name}." if owner.name else ""
        return InputError(f"{prefix}{key} = {owner.table.get(key)!r:.200} {remedy}", owner.place(key))

    def __contains__(self, key: str) -> bool:
        owner = self._owner(key)
        owner._asked.append(key)
        self._asked.append(key)
        return key in owner.table

    def any(self, key: str, default: Any = None) -> Any:
        """Whatever stands there."""
        return self._owner(key).table[key] if key in self else default

    def over(self, general: Words, shared: Sequence[str]) -> Words:
        """This table, and `general` behind it for the keys in `shared`."""
        return Words(self.table, self._text, self.path, self.name, general, shared, self.lines_before)

    def _owner(self, key: str | None) -> Words:
        """The table in which `key` stands."""
        if key in self._shared and key not in self.table and self._general is not None and key in self._general.table:
            return self._general
        return self

    def number(
        self,
        key: str,
        default: float | None,
        unit: str,
        low: float,
        high: float,
    ) -> float:
        """A number in `unit` from `low` to `high`; without a default it must be there."""
        value = self.any(key, default)
        if value is None:
            slip = get_close_matches(key, [name for name in self.table if name not in self._asked], n=1)
            hint = f"; is '{slip[0]}' meant to be it?" if slip else ""
            raise InputError(f"{key} is missing; give it in {unit}, as in `{key} = 1.0`{hint}", self.place())
        if isinstance(value, bool) or not isinstance(value, int | float) or value != value:
            raise self.fault(key, f"must be a number in {unit}, without quotes")
        if not low <= value <= high:
            raise self.fault(key, f"must be from {low:g} to {high:g} {unit}")
        return float(value)

    def whole(self, key: str, default: int | None, meaning: str, low: int = 0, high: int = 10**9) -> int | None:
        """A whole number from `low` to `high`."""
        value = self.any(key, default)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.fault(key, f"must be a whole number from {low} to {high} ({meaning})")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """true or false."""
        value = self.any(key, default)
        if not isinstance(value, bool):
            raise self.fault(key, "must be true or false")
        return value

    def text(self, key: str, default: str | None = None) -> str | None:
        """A text in quotes."""
        value = self.any(key, default)
        if value is not None and not isinstance(value, str):
            raise self.fault(key, "must be a text in quotes")
        return value

    def choice(self, key: str, default: str, choices: Sequence[str]) -> str:
        """One of several words."""
        value = self.any(key, default)
        if not isinstance(value, str) or value not in choices:
            raise self.fault(key, f"is unknown; known: {', '.join(choices)}{_near(value, choices)}")
        return str(value)

    def inner(self, key: str) -> Words | None:
        """The table under `key`, if there is one."""
        value = self.any(key)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.fault(key, f"must be a table, as in `[{key}]`")
        return self.table_of(key, value)

    def tables(self, key: str) -> list[Words]:
        """The tables of a list such as `[[logs]]`; none where there is no such list."""
        values = self.any(key, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            raise self.fault(key, f"must be tables, each under `[[{key}]]`")
        owner = self._owner(key)
        name = f"{owner.name}.{key}" if owner.name else key
        texts = _texts_of(owner._text, name, len(values))
        return [
            Words(value, text, owner.path, name, lines_before=owner.lines_before + before)
            for value, (text, before) in zip(values, texts, strict=True)
        ]

    def table_of(self, key: str, table: dict[str, Any]) -> Words:
        """A table that stands for the value of `key`."""
        owner = self._owner(key)
        name = f"{owner.name}.{key}" if owner.name else key
        return Words(table, owner._text, owner.path, name, lines_before=owner.lines_before)

    def done(self) -> None:
        """Refuse keys that have not been asked for."""
        known = list(dict.fromkeys(self._asked))
        for key in self.table:
            if key not in known:
                table = f" in [{self.name}]" if self.name else ""
                raise InputError(
                    f"unknown key '{key}'{table}; known keys: {', '.join(sorted(known))}{_near(key, known)}",
                    self.place(key),
                )


def _near(word: Any, known: Sequence[str]) -> str:
    close = get_close_matches(str(word), known, n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


def _texts_of(text: str, name: str, count: int) -> list[tuple[str, int]]:
    """For each table of a list its own lines, in which its keys are found, and how many lines are above them."""
    lines = text.splitlines()
    header = re.compile(rf"\s*\[\[\s*{re.escape(name)}\s*\]\]")
    starts = [number for number, line in enumerate(lines) if header.match(line)]
    if not starts or len(starts) != count:
        return [(text, 0)] * count  # written as an array in one line
    ends = [*starts[1:], len(lines)]
    return [("\n".join(lines[start:end]), start) for start, end in zip(starts, ends, strict=True)]


def _line_of(text: str, table: str, key: str | None) -> int | None:
    """The line on which a table's key (or its header, or the key whose value it is) stands; None if it can't be told.

    Names and lines only, as tomllib tells no places: good enough to find the line in an editor.
    """
    current, header_line = "", None
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[{1,2}\s*([^\[\]]+?)\s*\]", line)
        if header:
            current = ".".join(part.strip().strip("\"'") for part in header[1].split("."))
            if current == table:
                header_line = number
            if key is not None and f"{current}.".startswith(f"{table}.{key}." if table else f"{key}."):
                return number
        elif key is not None and current == table and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*[=.]", line):
            return number
    if header_line is None and table:
        parent, _, name = table.rpartition(".")
        return _line_of(text, parent, name)
    return header_line
