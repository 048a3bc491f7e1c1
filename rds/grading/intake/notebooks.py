"""Notebooks as submissions: what their cells define, and no more, as one Python file.

A student's notebook also runs experiments and draws. Of its code, only the statements are kept that make the names of
the fixed interfaces, and what these need. Nothing is run: cells are JSON, and statements are looked at as a tree.
"""

from __future__ import annotations

import ast
import json
import re
import symtable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rds.grading.intake.items import Refusal

LARGEST = 16 << 20  # bytes; pictures are in notebooks too
LARGEST_CODE = 512 << 10  # bytes, of all cells: the parser takes a thousand times as much memory
INTERFACE = ("control", "derivatives", "advance", "output", "interpolate", "params", "initial_state")
_MAGIC = re.compile(r"\s*(?:[%!?]|[\w.]+\?{1,2}\s*$)")


@dataclass(frozen=True)
class Converted:
    """The Python file, UTF-8, and what its author should know of it."""

    code: bytes
    notes: tuple[str, ...] = ()


def converted(data: bytes, wanted: Sequence[str] = INTERFACE) -> Converted:
    """A notebook (JSON, nbformat 4) as the Python that defines the names in `wanted`.

    Code that cannot be parsed is kept whole, so that its author gets Python's own message. Refusal if it is no
    notebook, or has no code.
    """
    cells = _code_cells(data)
    if (size := sum(len(_encoded(source)) for source in cells)) > LARGEST_CODE:
        raise Refusal(f"its code has {size} bytes, more than {LARGEST_CODE}; keep data out of it")
    lines = ["# from a notebook"]  # and the first cell's mark below it: where Python would look for an encoding
    notes: list[str] = []
    for number, source in enumerate(cells, 1):
        kept, skipped = _without_magics(source)
        lines += [f"# cell {number}", *kept]
        if skipped:
            notes.append(f"cell {number}: {skipped} of IPython's own commands left out")
    text = "\n".join(lines) + "\n"
    try:
        body = ast.parse(text).body
        keep = _needed(body, set(wanted))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return Converted(_encoded(text), tuple(notes))
    if len(keep) < len(body):
        notes.append(f"of its {len(body)} statements {len(keep)} define what was asked for, and only these are graded")
    return Converted(_encoded(_only(text, body, keep)), tuple(notes))


def _code_cells(data: bytes) -> list[str]:
    try:
        whole: Any = json.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise Refusal("the notebook is not UTF-8 text") from None
    except (ValueError, RecursionError) as error:
        raise Refusal(f"it is no notebook: {str(error)[:200]}") from None
    if not isinstance(whole, dict) or not isinstance(whole.get("cells"), list):
        raise Refusal("it is no notebook of format 4; open and save it in JupyterLab")
    found = []
    for cell in whole["cells"]:
        if not isinstance(cell, dict) or cell.get("cell_type") != "code":
            continue
        source = cell.get("source", "")
        if isinstance(source, list) and all(isinstance(line, str) for line in source):
            source = "".join(source)
        if not isinstance(source, str):
            raise Refusal("it is no notebook: the source of a cell is no text")
        found.append(source)
    if not any(source.strip() for source in found):
        raise Refusal("the notebook has no code")
    return found


def _without_magics(source: str) -> tuple[list[str], int]:
    """A cell's lines with IPython's commands as comments, and how many there were. `%%` takes the whole cell."""
    lines = re.split(r"\r\n|\r|\n", source)
    first = next((line for line in lines if line.strip()), "")
    if first.lstrip().startswith("%%"):
        return [f"# {line}" for line in lines], len(lines)
    if _parses(source):  # a line that begins with % may go on with the one before
        return lines, 0
    kept = [re.sub(r"^(\s*).*", r"\1pass", line) if _MAGIC.match(line) else line for line in lines]
    return kept, sum(1 for line in lines if _MAGIC.match(line))


def _parses(source: str) -> bool:
    try:
        ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    return True


def _needed(body: Sequence[ast.stmt], wanted: set[str]) -> set[int]:
    """The numbers of the statements that make the wanted names, and of those that make what these use."""
    facts = [_made_and_used(statement) for statement in body]
    makers: dict[str, list[int]] = {}
    for number, (made, _) in enumerate(facts):
        for name in made:
            makers.setdefault(name, []).append(number)
    keep = {number for number, statement in enumerate(body) if _is_for_all(statement)}
    known, todo = set(wanted), list(wanted)
    while todo:
        for number in makers.get(todo.pop(), ()):
            if number not in keep:
                keep.add(number)
                new = facts[number][1] - known
                known |= new
                todo += new
    return keep


def _is_for_all(statement: ast.stmt) -> bool:
    """Whether it concerns all code: `from __future__ import`, and `from x import *`, of which nobody knows."""
    return isinstance(statement, ast.ImportFrom) and (
        statement.module == "__future__" or any(alias.name == "*" for alias in statement.names)
    )


def _made_and_used(statement: ast.stmt) -> tuple[set[str], set[str]]:
    """The names that a statement binds or changes, and those of the notebook that it needs, in functions too."""
    top = symtable.symtable(ast.unparse(statement), "notebook", "exec")
    made = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_assigned() or symbol.is_imported()}
    used = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_referenced()}
    tables = top.get_children()
    while tables:
        table = tables.pop()
        used |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        tables += table.get_children()
    if not isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        changed = [n for n in ast.walk(statement) if isinstance(n, ast.Attribute | ast.Subscript)]
        made |= {_root(node) for node in changed if not isinstance(node.ctx, ast.Load)}
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
        made.add(_root(statement.value.func))  # params.update(...)
    return made, used


def _root(node: ast.AST) -> str:
    """The name that an expression such as a.b[c].d begins with; "" if it begins otherwise, or is a name alone."""
    inner = node
    while isinstance(inner, ast.Attribute | ast.Subscript):
        inner = inner.value
    return inner.id if isinstance(inner, ast.Name) and inner is not node else ""


def _only(text: str, body: Sequence[ast.stmt], keep: set[int]) -> str:
    """The text with all other statements blanked out: lines keep their numbers."""
    lines = text.split("\n")
    kept: set[int] = set()
    for number, statement in enumerate(body):
        decorators = getattr(statement, "decorator_list", [])
        first = min([statement.lineno, *(each.lineno for each in decorators)])
        if number in keep:
            kept |= set(range(first - 1, statement.end_lineno or first))
    return "\n".join(line if n in kept or line.startswith("#") else "" for n, line in enumerate(lines))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")
