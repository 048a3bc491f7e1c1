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

from rds.bus.medium.fault_kinds import Fault
from rds.core.errors import InputError
from rds.core.toml_file import read_toml


def read_faults(path: str | Path) -> tuple[Fault, ...]:
    """The faults of a file, in the order of their times. InputError names file and line, and what is known."""
    content, text = read_toml(path)
    for key in content:
        if key != "fault":
            raise InputError(f"unknown key {key!r}; a schedule consists of [[fault]] tables", str(path))
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
