"""Notebooks as submissions: what their cells define, and no more, as one Python file.

A student's notebook also runs experiments and draws. Of its code, only the statements are kept that make the names of
the fixed interfaces, and what these need. Nothing is run: cells are JSON, and statements are looked at as a tree.
"""

from __future__ import annotations

import ast
import json
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rds.grading.intake.items import Refusal
from rds.grading.intake.needed import NotFollowed, needed

LARGEST = 16 << 20  # bytes; pictures are in notebooks too
LARGEST_CODE = 512 << 10  # bytes, of all cells: the parser takes a thousand times as much memory
INTERFACE = ("control", "derivatives", "advance", "output", "interpolate", "params", "initial_state", "signals")
_MAGIC = re.compile(r"\s*(?:[%!?]|[\w.]+\?{1,2}\s*$|[A-Za-z_][\w, ]*=\s*[%!])")  # also `files = !ls`
_TIMED = re.compile(r"\s*%time(?:it)?\s+(?:-\w+\s+(?:\d+\s+)?)*(.+)")  # what it times is run
_FROM_OUTSIDE = re.compile(r"\s*%(?:run|load|loadpy|store\s+-r|macro|recall|rerun)\b[^\n]*")
_RUNS_THE_CELL = ("%%time", "%%capture", "%%prun")  # as if the line were not there
_WRITES = re.compile(r"%%(?:writefile|file)\s+(?:-a\s+)?(\S+)")
_CELL = re.compile(r"# cell \d+")
_LINES = re.compile(r"\r\n|\r|\n")
_LONGEST = 8000  # characters of what is graded, in the notes for its author
_MOST_MAGICS = 50  # that are looked for one by one


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
        text = _as_main(_with_single_imports(text))
        body = ast.parse(text).body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, SyntaxError) and error.lineno is not None and 2 < error.lineno <= len(lines):
            place = f"line {error.lineno} is {_place(lines, error.lineno)} of the notebook"
            notes.append(f"{place}: {error.msg}; mend it, and run the whole notebook before it is handed in again")
        return Converted(_encoded(text), tuple(notes))
    try:
        keep, elsewhere = needed(body, set(wanted))
    except (SyntaxError, ValueError, RecursionError):
        return Converted(_encoded(text), tuple(notes))
    except NotFollowed as fault:
        raise Refusal(_not_followed(lines, fault)) from None
    except MemoryError:
        said = f"what its {len(body)} statements do takes too much memory to follow"
        raise Refusal(f"{said}; hand in a notebook that holds only what is graded") from None
    if not keep and (written := _written(cells)):
        raise Refusal(f"{written}, and its code is not run; hand in that file, or take that line away")
    if len(keep) < len(body):
        notes.append(f"of its {len(body)} statements {len(keep)} define what was asked for, and only these are graded")
    if elsewhere:
        names = ", ".join(f"{name}()" for name in elsewhere)
        notes.append(
            f"calls of {names} are left out: what they change is needed, and so are modules that are not there"
        )
    graded = _only(text, body, keep)
    shown = "\n".join(line for line in graded.split("\n")[1:] if line.strip())
    notes.append(f"this is what was graded of it:\n{shown[:_LONGEST]}" + ("\n..." if len(shown) > _LONGEST else ""))
    return Converted(_encoded(graded), tuple(notes))


def _not_followed(lines: Sequence[str], fault: NotFollowed) -> str:
    """Where it is in the notebook, and what its author can do."""
    place = _place(lines, fault.line)
    said = f"the notebook cannot be graded as what it ran: {place} ({lines[fault.line - 1].strip()[:80]}): {fault.why}"
    return f"{said}; set what is graded in statements of their own, such as params[...] = ..., behind all others"


def _place(lines: Sequence[str], line: int) -> str:
    """The cell, and the line in it, of a line of all cells' code."""
    at = max(number for number in range(line) if _CELL.fullmatch(lines[number]))
    return f"{lines[at][2:]}, line {line - at - 1}"


def _written(cells: Sequence[str]) -> str:
    """Which cell is only written into a file, where IPython does not run it; nothing if there is none."""
    found = ((number, _WRITES.match(source.lstrip())) for number, source in enumerate(cells, 1))
    return next((f"cell {number} only writes {match[1]} (%%writefile)" for number, match in found if match), "")


def _code_cells(data: bytes) -> list[str]:
    try:
        whole: Any = json.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise Refusal("the notebook is not UTF-8 text") from None
    except (ValueError, RecursionError) as error:
        raise Refusal(f"it is no notebook: {str(error)[:200]}; if it is Python, hand it in as .py") from None
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
    lines = _LINES.split(source)
    first = next((n for n, line in enumerate(lines) if line.strip()), 0)
    words = lines[first].split()[:1]
    skipped = 0
    if words and words[0].startswith("%%"):
        if words[0] not in _RUNS_THE_CELL:
            return [f"# {line}" for line in lines], len(lines)
        lines[first], skipped = f"# {lines[first]}", 1
    if _fault("\n".join(lines)) is not None:
        lines = textwrap.dedent("\n".join(lines)).split("\n")  # as IPython does
    for _ in range(_MOST_MAGICS):  # only where Python fails: a line that begins with % may be within a text, or go on
        at = _fault("\n".join(lines))
        if at is None:
            return lines, skipped
        if not 1 <= at <= len(lines) or not _MAGIC.match(lines[at - 1]):
            break
        skipped += _leave_out(lines, at - 1)
    at = 0
    while at < len(lines):
        at += 1
        if _MAGIC.match(lines[at - 1]):
            skipped += _leave_out(lines, at - 1)
    return lines, skipped


def _leave_out(lines: list[str], at: int) -> int:
    """Put `pass` in place of the command at `lines[at]`, which a backslash continues; how many lines it had."""
    if found := _FROM_OUTSIDE.match(lines[at]):
        said = f"the notebook cannot be graded as what it ran: {found[0].strip()} brings in what is not in it"
        raise Refusal(f"{said}; put the code itself into a cell")
    count = 1
    while lines[at + count - 1].rstrip().endswith("\\") and at + count < len(lines):
        count += 1
    indent = lines[at][: len(lines[at]) - len(lines[at].lstrip())]
    timed = _TIMED.match(lines[at])
    does = timed[1] if timed and count == 1 and _fault(timed[1]) is None else "pass"
    lines[at : at + count] = [f"{indent}{does}", *[""] * (count - 1)]
    return count


def _fault(source: str) -> int | None:
    """None if Python can read it; else the number of the line at which it cannot, 0 if it does not say."""
    try:
        ast.parse(source)
    except SyntaxError as error:
        return error.lineno or 0
    except (ValueError, RecursionError, MemoryError):
        return 0
    return None


def _with_single_imports(text: str) -> str:
    """`import numpy as np, pandas as pd` as two statements of one line: it may be that only one of them is there."""
    lines = [_encoded(line) for line in text.split("\n")]  # columns are counted in bytes
    for each in reversed(ast.parse(text).body):
        if isinstance(each, ast.Import) and len(each.names) > 1 and each.lineno == each.end_lineno:
            line = lines[each.lineno - 1]
            one_by_one = "; ".join(ast.unparse(ast.Import([name])) for name in each.names)
            lines[each.lineno - 1] = line[: each.col_offset] + _encoded(one_by_one) + line[each.end_col_offset :]
    return "\n".join(line.decode("utf-8", "surrogatepass") for line in lines)


def _as_main(text: str) -> str:
    """The text with "__main__" in place of `__name__`: so it is in a notebook that is run, wherever it is asked."""
    lines = [_encoded(line) for line in text.split("\n")]  # columns are counted in bytes
    tree = ast.parse(text)
    within = {id(each) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for each in ast.walk(node)}
    names = [each for each in ast.walk(tree) if isinstance(each, ast.Name) and each.id == "__name__"]
    if any(not isinstance(each.ctx, ast.Load) for each in names):
        return text
    for each in sorted(names, key=lambda name: (name.lineno, name.col_offset), reverse=True):
        if id(each) not in within:  # a text in a text needs other quotation marks
            line = lines[each.lineno - 1]
            lines[each.lineno - 1] = line[: each.col_offset] + b'"__main__"' + line[each.end_col_offset :]
    return "\n".join(line.decode("utf-8", "surrogatepass") for line in lines)


def _only(text: str, body: Sequence[ast.stmt], keep: set[int]) -> str:
    """The text with all other statements blanked out: lines keep their numbers."""
    lines = [_encoded(line) for line in text.split("\n")]  # columns are counted in bytes
    kept: set[int] = set()
    for number, statement in enumerate(body):
        decorators = getattr(statement, "decorator_list", [])
        first = min([statement.lineno, *(each.lineno for each in decorators)])
        if number in keep:
            kept |= set(range(first - 1, statement.end_lineno or first))
    for number, statement in reversed(list(enumerate(body))):
        if number not in keep:  # behind or before a `;` of what is kept: the last first, or columns would be others
            first, last = statement.lineno - 1, (statement.end_lineno or statement.lineno) - 1
            before, behind = lines[first][: statement.col_offset], lines[last][statement.end_col_offset :]
            if first in kept:
                lines[first] = before + b"pass" + (behind if first == last else b"")
            if last in kept and first != last:
                lines[last] = b"pass" + behind
    whole = (line.decode("utf-8", "surrogatepass") for line in lines)
    return "\n".join(line if n in kept or line.startswith("#") else "" for n, line in enumerate(whole))


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")
