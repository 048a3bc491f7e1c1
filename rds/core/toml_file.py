"""TOML as tables: the one door to all files of it, with limits, because a small file can keep tomllib busy for minutes.

tomllib (Python 3.11) takes time with the square of the parts of a dotted key, ends in RecursionError where brackets are
nested, and in ValueError where a number has thousands of digits. So size and dotted keys are looked at before it, and
depth, numbers and keys after it.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.limits import allow, read_limited

LARGEST = 1 << 20  # bytes; parsed in some seconds whatever it holds
MOST_PARTS = 16  # of a dotted key; ours have four
DEEPEST = 64  # tables and arrays in each other
LONGEST_KEY = 200  # characters
_LONG = re.compile(r"[+-]?(?:0x[0-9a-fA-F_]{16,}|0o[0-7_]{21,}|0b[01_]{63,}|[0-9][0-9_]{18,})")
_RULES = "; texts stand in quotation marks, numbers have a point and no unit"
_BACKSLASH = "; a backslash in double quotation marks begins a special character: write / in its place"
_REMEDIES = {  # by what tomllib says
    "Invalid value": _RULES,
    "Expected newline": _RULES,
    "Cannot overwrite": "; it stands there twice: remove one of them",
    "twice": "; remove one of them",
    "Unterminated string": "; end it with a quotation mark",
    "Illegal character '\\n'": "; a text ends in its line with a quotation mark",
    "Invalid hex value": _BACKSLASH,
    "Unescaped '\\' in a string": _BACKSLASH,
}
_WHOLE = 2**63  # TOML's whole numbers have 64 bits
# Texts and comments are a token each, closed or not: no dot in them counts, no character is looked at twice.
_TOKEN = re.compile(
    r'(?P<text>"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5}|\Z)?|\'\'\'(?:[^\']++|\'(?!\'\'))*+(?:\'{3,5}|\Z)?|#[^\n]*)'
    r'|(?P<key>"(?:[^"\\\n]++|\\.)*+"?|\'[^\'\n]*\'?|[A-Za-z0-9_-]+)'
    r"|(?P<dot>\.)|(?P<blank>[ \t]+)|(?P<end>\s|[^\s])",
    re.DOTALL,
)


def read_toml(path: str | Path) -> tuple[dict[str, Any], str]:
    """The top table of a TOML file, and its text. InputError, with file and line, for one that cannot be read."""
    where = str(path)
    try:
        data = read_limited(path, LARGEST, "a TOML file", "keep data in a file of their own, such as CSV")
        text = data.decode("utf-8-sig")
    except IsADirectoryError as error:
        raise InputError("it is a folder; name the TOML file", where) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; check the path", where) from error
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text; save it as UTF-8", where) from error
    return parse_toml(text.replace("\r\n", "\n"), where), text


def read_own_toml(path: Path) -> dict[str, Any]:
    """The top table of a file of this package, without the limits for files from outside."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The top table of a TOML text; InputError, with `where` and the line, for one that is not TOML or does harm."""
    _check_dots(text, where)
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not valid TOML: {error}{_quoted(text, str(error))}", where) from error
    except RecursionError as error:
        raise InputError("has brackets within brackets hundreds deep; write it flatter", where) from error
    except ValueError as error:  # of a number with more digits than Python reads, or a date such as February 30
        line = _line_of_digits(text)
        place = f"{where}, line {line}" if line else where
        raise InputError(f"has a number or date that cannot be read ({error!s:.100}); correct it", place) from error
    _check_tree(table, text, where)
    return table


def _quoted(text: str, said: str) -> str:
    """The line that tomllib means, and what to do where it does not say so itself."""
    found = re.search(r"at line (\d+)", said)
    line = text.split("\n")[int(found[1]) - 1].strip() if found else ""
    remedy = next((remedy for cause, remedy in _REMEDIES.items() if cause in said), "")
    if "Cannot overwrite" in said and line.startswith("[axis."):
        remedy = "; beside [axis.NAME] tables, `axes = [...]` takes the place of `axis = ...`, with one axis, too"
    return (f": `{line:.100}`" if line else "") + remedy


def _check_dots(text: str, where: str) -> None:
    """InputError for a key of too many parts, before tomllib sees it."""
    parts, after_dot = 0, False
    for token in _TOKEN.finditer(text):
        kind = token.lastgroup
        if kind == "key":
            parts = parts + 1 if after_dot else 1
            after_dot = False
            if parts > MOST_PARTS:
                line = text.count("\n", 0, token.start()) + 1
                allow(
                    parts,
                    MOST_PARTS,
                    f"a key has {parts} parts between dots or more",
                    "write fewer",
                    f"{where}, line {line}",
                )
        elif kind == "dot":
            after_dot = parts > 0
        elif kind != "blank":
            parts, after_dot = 0, False


def _check_tree(table: dict[str, Any], text: str, where: str) -> None:
    """InputError for what cannot be worked with: depth, whole numbers of more than 64 bits, endless keys."""
    found: list[tuple[Any, int, str]] = [(table, 0, "")]
    while found:
        value, depth, name = found.pop()
        if depth > DEEPEST:
            allow(
                depth, DEEPEST, f"{name:.60} holds brackets or tables {depth} deep or more", "write it flatter", where
            )
        if isinstance(value, dict):
            for key, inner in value.items():
                if len(key) > LONGEST_KEY:
                    line = text.count("\n", 0, max(text.find(key), 0)) + 1
                    what = f"the key {key[:40]!r}... has {len(key)} characters"
                    allow(len(key), LONGEST_KEY, what, "shorten it", f"{where}, line {line}")
                found.append((inner, depth + 1, f"{name:.60}.{key}" if name else key))
        elif isinstance(value, list):
            found += [(inner, depth + 1, name) for inner in value]
        elif isinstance(value, int) and not -_WHOLE <= value < _WHOLE:
            shown = (
                f"{value:#x}" if value.bit_length() > 4000 else str(value)
            )  # Python writes no longer ones as decimals
            at = _line_of_digits(text, value)
            raise InputError(
                f"{name:.60} = {shown[:20]}... is a whole number of more than 64 bits; write it shorter, or as 1e30",
                f"{where}, line {at}" if at else where,
            )


def _line_of_digits(text: str, value: int | None = None) -> int | None:
    """The line of a whole number; without `value`, of one that is too long for Python to read."""
    for found in _LONG.finditer(text):
        try:
            is_it = int(found[0].replace("_", ""), 0) == value
        except ValueError:
            is_it = value is None
        if is_it:
            return text.count("\n", 0, found.start()) + 1
    return None
