"""TOML text of tables, for files that people read and edit: the standard library reads TOML but does not write it.

tomli-w writes no comments and puts each item of a list on a line of its own: a link's matrix would take 22 lines.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import isinf, isnan
from numbers import Integral, Real
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}


def toml_text(table: Mapping[str, Any], comment: str = "") -> str:
    """A table of texts, numbers, truth values, lists and tables as TOML, under `comment`.

    Lists of tables become `[[...]]`, except inside lists. Floats are written so that they read back to the bit.
    ValueError for a value of another kind: a mistake of the caller.
    """
    lines = [f"# {line}" for line in comment.splitlines()]
    return "\n".join([*lines, *([""] if lines else []), *_lines(table, ())]).rstrip("\n") + "\n"


def _lines(table: Mapping[str, Any], name: tuple[str, ...]) -> list[str]:
    tables = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    lists = {key: value for key, value in table.items() if _is_tables(value)}
    lines = [f"{toml_key(key)} = {toml_value(v)}" for key, v in table.items() if key not in tables and key not in lists]
    if name and (lines or not (tables or lists)):
        lines.insert(0, f"[{'.'.join(map(toml_key, name))}]")
    for key, inner in tables.items():
        lines += ["", *_lines(inner, (*name, key))] if lines else _lines(inner, (*name, key))
    for key, items in lists.items():
        for item in items:
            flat = [f"{toml_key(word)} = {toml_value(value)}" for word, value in item.items()]
            lines += ["", f"[[{'.'.join(map(toml_key, (*name, key)))}]]", *flat]
    return lines


def _is_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(item, Mapping) for item in value)


def toml_key(key: str) -> str:
    """A key as TOML has it, in quotes where it must be."""
    return key if _BARE.fullmatch(key) else _text(key)


def toml_value(value: Any) -> str:
    """A value as TOML has it; see `toml_text`."""
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        return _float(float(value))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml_key(key)} = {toml_value(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, Sequence):
        items = [toml_value(item) for item in value]
        if sum(map(len, items)) > 100:
            return "[\n" + "".join(f"    {item},\n" for item in items) + "]"
        return f"[{', '.join(items)}]"
    raise ValueError(f"{value!r:.100} ({type(value).__name__}) cannot be written as TOML")


def _float(value: float) -> str:
    if isnan(value):
        return "nan"
    if isinf(value):
        return "inf" if value > 0.0 else "-inf"
    return repr(value)


def _text(text: str) -> str:
    return '"' + "".join(_character(c) for c in text) + '"'


def _character(c: str) -> str:
    if c in _ESCAPES:
        return _ESCAPES[c]
    if ord(c) < 0x20 or c == "\x7f":
        return f"\\u{ord(c):04x}"
    return "\N{REPLACEMENT CHARACTER}" if "\ud800" <= c <= "\udfff" else c
