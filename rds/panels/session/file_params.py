"""The numbers in `params` of a student's file, read from its text: the file is not run for it."""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path
from typing import NamedTuple

from rds.panels.equipment.build import LARGEST

MOST = 40  # parameters that are offered


class FileParam(NamedTuple):
    """One of them: its value in the file, and the comment on its line."""

    name: str
    value: float
    comment: str


def file_params(path: Path) -> list[FileParam]:
    """The numbers that the last `params = {...}` at the file's outermost level writes out, in its order.

    None where there is no such file or it cannot be read as Python: a build says what is wrong with it. What the file
    computes is left out, because only running it would tell.
    """
    try:
        with path.open("rb") as stream:
            source = stream.read(LARGEST)
        body = ast.parse(source).body  # as Python reads it: a byte order mark, and a coding that the file names
        comments = _comments(source)
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError, tokenize.TokenError):
        return []
    found: list[FileParam] = []
    for statement in body:
        if (
            isinstance(statement, ast.Assign)
            and any(isinstance(target, ast.Name) and target.id == "params" for target in statement.targets)
            and isinstance(statement.value, ast.Dict)
        ):
            entries = zip(statement.value.keys, statement.value.values, strict=True)
            found = [
                FileParam(name, number, comments.get(value.lineno, ""))
                for key, value in entries
                if (name := _name(key)) and (number := _number(value)) is not None
            ]
    return found[:MOST]


def _name(key: ast.expr | None) -> str:
    """The key, where it is a name; else nothing."""
    named = isinstance(key, ast.Constant) and isinstance(key.value, str) and key.value.isidentifier()
    return str(key.value) if named else ""  # type: ignore[union-attr]


def _number(value: ast.expr) -> float | None:
    """The value, where it is written out as a number."""
    try:
        number = ast.literal_eval(value)
        is_number = isinstance(number, int | float) and not isinstance(number, bool)
        return float(number) if is_number else None
    except (ValueError, TypeError, SyntaxError, OverflowError, RecursionError, MemoryError):
        return None


def _comments(source: bytes) -> dict[int, str]:
    """The comment of each line that has one."""
    tokens = tokenize.tokenize(io.BytesIO(source).readline)
    return {each.start[0]: each.string.lstrip("#").strip() for each in tokens if each.type == tokenize.COMMENT}
