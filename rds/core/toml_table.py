"""Reading the words of a TOML file: every key is known and every value is of its kind, or an error says where."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import AnyValue, Declaration, Quantity, Table, Tables, near, shortened
from rds.core.toml_file import read_toml


class TomlTable:
    """One table of a file, read by its declaration. `done()` at the end refuses the keys that nobody asked for.

    With `general`, keys that the table lacks are looked for in that one, among those in `shared`.
    """

    def __init__(
        self,
        table: dict[str, Any],
        declared: Table | None = None,
        text: str = "",
        path: str = "",
        name: str = "",
        general: TomlTable | None = None,
        shared: Sequence[str] = (),
        lines_before: int = 0,
    ):
        self.table, self.declared, self.path, self.name = table, declared, path, name
        self._text, self._general, self._shared = text, general, shared
        self.lines_before = lines_before  # of the file, above `text`, for the lines in errors
        self._asked: list[str] = []
        self._top = declared if not name else None  # what the file's own keys are, above its tables

    def over_written(self, table: dict[str, Any]) -> TomlTable:
        """The same file with another top table: errors still tell the file's places."""
        return TomlTable(table, self.declared, self._text, self.path)

    @property
    def source(self) -> str:
        """The text of the whole file."""
        return self._text

    @classmethod
    def open(cls, path: str | Path, declared: Table | None = None) -> TomlTable:
        """The top table of a TOML file; InputError if it cannot be read or is not TOML."""
        table, text = read_toml(path)
        return cls(table, declared, text, str(path))

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
        return InputError(f"{owner.full_name(key)} = {shortened(owner.table.get(key))} {remedy}", owner.place(key))

    def full_name(self, key: str) -> str:
        """The key with the names of the tables that it stands in."""
        return f"{self.name}.{key}" if self.name else key

    def __contains__(self, key: str) -> bool:
        owner = self._owner(key)
        owner._asked.append(key)
        self._asked.append(key)
        return key in owner.table

    def any(self, key: str, default: Any = None) -> Any:
        """Whatever stands there."""
        return self._owner(key).table[key] if key in self else default

    def read(self, key: str, default: Any = None) -> Any:
        """The value of a declared key as it is used; where the file has none, `default`, or that of the declaration.

        InputError for a value that is refused, and for a key that is needed and not there.
        """
        declared = self._of(key)
        if key not in self:
            if default is None and self.declared is not None and key in self.declared.needed:
                raise self.missing(key)
            return declared.default if default is None else default
        value = self.any(key)
        if (fault := declared.fault(value)) is not None:
            raise self.fault(key, fault)
        return declared.taken(value)

    def missing(self, key: str) -> InputError:
        """The error that a key that is needed is not there."""
        declared = self._of(key)
        remedy = f"add it ({declared.meaning})"
        if isinstance(declared, Quantity):
            unit = f"it in {declared.unit}" if declared.unit else "a number"
            remedy = f"give {unit}, as in `{key} = {1 if declared.whole else 1.0}`"
        return InputError(f"{key} is missing; {remedy}{self.slip(key)}", self.place())

    def slip(self, key: str) -> str:
        """A hint at a key that nobody has asked for and that may be meant to be `key`, which is missing."""
        tables = [self] if self._general is None else [self, self._general]
        known = self.declared.keys if self.declared is not None else ()
        others = [name for table in tables for name in table.table if name not in table._asked and name not in known]
        close = get_close_matches(key, others, n=1)
        if close:
            return f"; is '{close[0]}' meant to be it?"
        for name, value in self.table.items():
            if not self.name and isinstance(value, dict) and key in value:
                line = _line_of(self._text, name, key)
                where = f" in line {line}" if line else ""
                return f"; the one{where} belongs to [{name}]: move it above the first [table]"
        return ""

    def _of(self, key: str) -> Declaration:
        assert self.declared is not None, f"{key} is read from a table without a declaration"
        return self.declared.of(key)

    def over(self, general: TomlTable, shared: Sequence[str]) -> TomlTable:
        """This table, and `general` behind it for the keys in `shared`."""
        made = TomlTable(
            self.table, self.declared, self._text, self.path, self.name, general, shared, self.lines_before
        )
        made._top = self._top
        return made

    def _owner(self, key: str | None) -> TomlTable:
        """The table in which `key` stands."""
        if key in self._shared and key not in self.table and self._general is not None and key in self._general.table:
            return self._general
        return self

    def inner(self, key: str) -> TomlTable | None:
        """The table under `key`, if there is one."""
        value = self.any(key)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.fault(key, f"must be a table; write [{self._owner(key).full_name(key)}]")
        return self.table_of(key, value)

    def inner_or_empty(self, key: str) -> TomlTable:
        """The table under `key`; an empty one where there is none."""
        return self.inner(key) or self.table_of(key, {})

    def tables(self, key: str) -> list[TomlTable]:
        """The tables of a list such as `[[logs]]`; none where there is no such list."""
        values = self.any(key, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            raise self.fault(key, f"must be tables, each under `[[{key}]]`")
        owner = self._owner(key)
        name = owner.full_name(key)
        texts = _texts_of(owner._text, name, len(values))
        declared = self._declared_under(key)
        return [
            TomlTable(value, declared, text, owner.path, name, lines_before=owner.lines_before + before)
            for value, (text, before) in zip(values, texts, strict=True)
        ]

    def table_of(self, key: str, table: dict[str, Any]) -> TomlTable:
        """A table that stands for the value of `key`."""
        owner = self._owner(key)
        name, declared = owner.full_name(key), self._declared_under(key)
        made = TomlTable(table, declared, owner._text, owner.path, name, lines_before=owner.lines_before)
        made._top = owner._top
        return made

    def _declared_under(self, key: str) -> Table | None:
        """The declaration of the table, or of each table, that `key` holds; None where it has none of its own."""
        declared = None if self.declared is None else self.declared.of(key)
        if isinstance(declared, AnyValue):
            declared = next((form for form in declared.forms if isinstance(form, Table)), None)
        if isinstance(declared, Tables):
            declared = declared.table
        return declared if isinstance(declared, Table) else None

    def done(self) -> None:
        """Refuse keys that have not been asked for."""
        known = list(dict.fromkeys(self._asked))
        for key in self.table:
            if key not in known:
                table = f" in [{self.name}]" if self.name else ""
                hint = near(key, known)
                if self.name and self._top is not None and key in self._top.keys:
                    hint = f"; if the file's own '{key}' is meant, move it above the first [table]"
                raise InputError(
                    f"unknown key '{key}'{table}; known keys: {', '.join(sorted(known))}{hint}", self.place(key)
                )


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
