"""A schedule of faults as a TOML file: one [[fault]] table each, with the words of fault_kinds.py.

[[fault]]
at = 2.0        # s after the start
node = "Y"
kind = "unplug"
for = 1.0       # s
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from rds.bus.medium.fault_kinds import KINDS, WORDS, Fault
from rds.core.errors import InputError
from rds.core.quantities import Parts, Table, Tables
from rds.core.toml_table import TomlTable

FAULTS = Table(
    "A schedule of faults on the built-in bus.",
    {
        "fault": Tables(
            "faults",
            Table("a fault", chosen_by="kind", parts=Parts(lambda: list(KINDS), lambda kind: _of_kind(kind))),
            least=1,
        )
    },
    needed=("fault",),
)


def _of_kind(name: str) -> Table:
    kind = KINDS[name]
    needed = (*kind.needed, *(("by",) if name == "delay" else ()))
    return Table(kind.meaning, {word: WORDS[word] for word in ("at", *kind.words)}, needed=needed)


def read_faults(path: str | Path) -> tuple[Fault, ...]:
    """The faults of a file, in the order of their times. InputError names file and line, and what is known."""
    words = TomlTable.open(path, FAULTS)
    text, content = words.source, words.table
    for key in content:
        if key != "fault":
            raise InputError(f"unknown key {key!r}; a schedule consists of [[fault]] tables", words.place(key))
    tables = content.get("fault", [])
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise InputError("holds no [[fault]] tables; each fault is one", str(path))
    faults = []
    for number, table in enumerate(tables):
        try:
            faults.append(Fault.from_table(table))
        except InputError as error:
            line = _line(text, number, table, str(error))
            raise InputError(str(error), f"{path}, line {line}" if line else f"{path}, fault {number + 1}") from error
    return tuple(sorted(faults, key=lambda fault: fault.at))


def _line(text: str, number: int, table: dict[str, Any], message: str) -> int | None:
    """The line of the word that the message is about, else of the table's header; None where there is no header."""
    lines = text.splitlines()
    headers = [k for k, line in enumerate(lines) if re.match(r"\s*\[\[\s*fault\s*\]\]", line)]
    if len(headers) <= number:
        return None
    end = headers[number + 1] if number + 1 < len(headers) else len(lines)
    for word in sorted(table, key=lambda word: _place(word, message)):
        if _place(word, message) < len(message):
            for k in range(headers[number], end):
                if re.match(rf"\s*{re.escape(word)}\s*=", lines[k]):
                    return k + 1
    return headers[number] + 1


def _place(word: str, message: str) -> int:
    """Where the message names a word, or the end of the message."""
    found = re.search(rf"'{re.escape(word)}'|\b{re.escape(word)} =|of {re.escape(word)} ", message)
    return found.start() if found else len(message)
