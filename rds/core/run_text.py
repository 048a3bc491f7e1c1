"""The text of a student's file, run as a module of its own, and what went wrong while it ran."""

from __future__ import annotations

import re
import sys
import types
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rds.core.blame import student_error, student_line
from rds.core.errors import InputError
from rds.core.folder_kept import folder_kept

STUDENT_MODULE = "rds_student_"  # how the names of modules begin that a student's file was loaded as
_SYNTAX = {  # by what Python says, what to do, where that does not say it
    "tabs and spaces|unindent|unexpected indent|expected an indented": " (indent with four spaces a level, no tabs)",
    "invalid character '[“”„‘’]'": " (type plain quotation marks, \" or ')",
}
_PYTHON = f"Python {sys.version_info.major}.{sys.version_info.minor}"


def run_text(text: str, file: Path) -> dict[str, Any]:
    """Variables of the module that `text` makes when it runs; the module's name is new each time."""
    module = types.ModuleType(f"{STUDENT_MODULE}{file.stem}_{uuid.uuid4().hex[:12]}")
    module.__file__ = str(file)
    sys.modules[module.__name__] = module  # dataclasses and pickle look it up there
    try:
        with _siblings(file.parent), folder_kept():
            exec(compile(text, str(file), "exec", dont_inherit=True), module.__dict__)
    except BaseException as error:
        del sys.modules[module.__name__]
        if isinstance(error, KeyboardInterrupt):
            raise
        raise load_error(error, file) from error
    return module.__dict__


@contextmanager
def _siblings(folder: Path) -> Iterator[None]:
    """Files of `folder` can be imported, last of all; afterwards the next student's file finds none of them.

    They are imported without leaving byte code in the student's folder: a stale one would hide an edit.
    """
    before, path, no_bytecode = set(sys.modules), list(sys.path), sys.dont_write_bytecode
    sys.path.append(str(folder))
    sys.dont_write_bytecode = True
    try:
        yield
    finally:
        sys.path[:] = path
        sys.dont_write_bytecode = no_bytecode
        sys.path_importer_cache.pop(str(folder), None)
        for name in set(sys.modules) - before:
            origin = getattr(sys.modules[name], "__file__", None)
            is_part = name.partition(".")[0] in before  # of a package that the student's folder only happens to hold
            if origin and not is_part and _is_inside(origin, folder):
                del sys.modules[name]


def _is_inside(origin: str, folder: Path) -> bool:
    """Imported through `folder`; an environment that merely lies below it holds installed packages."""
    path = Path(origin)
    return path.is_relative_to(folder) and "site-packages" not in path.relative_to(folder).parts


def load_error(error: BaseException, file: Path) -> InputError:
    """What `file` raised while it was run as a module, with its place and the remedy."""
    line = student_line(error, file)
    where = f"{file}:{line}" if line else str(file)
    if isinstance(error, SyntaxError) and isinstance(error.filename, str) and Path(error.filename) == file:
        text = str(error.text or "").strip()
        remedy = next((each for said, each in _SYNTAX.items() if re.search(said, str(error.msg))), "")
        said = f"syntax error: {error.msg}{remedy}{f': `{text}`' if text else ''}"
        return InputError(f"{said}; {_PYTHON} cannot read it", where)
    if line is None and isinstance(error, MemoryError | RecursionError):  # the parser's: no line of it has run
        said = "brackets, operators or `elif` lie too deep in each other; split them"
        return InputError(f"{_PYTHON} cannot read it: {said}", where)
    said = student_error(error, file)
    if isinstance(error, SystemExit):
        return InputError(f"it ends the program while it loads: {said}; remove the exit", where)
    if isinstance(error, ModuleNotFoundError) and str(error.name).startswith("rds."):
        remedy = "where files are graded, rds holds the interfaces only: move what runs experiments under "
        remedy += '`if __name__ == "__main__":`'
    elif isinstance(error, ModuleNotFoundError):
        remedy = f"install {error.name}, or put {error.name}.py next to the file (where files are graded, "
        remedy += "no other file is there, and only numpy, scipy and control: what is graded must be in one file)"
    elif isinstance(error, FileNotFoundError):
        remedy = "check its name; where files are graded, no other file is there: write what it holds into this one"
    elif isinstance(error, NameError) and error.name in ("get_ipython", "display"):
        remedy = "a notebook that was saved as Python has such lines: remove them, or hand in the notebook itself"
    elif isinstance(error, PermissionError):
        remedy = "where files are graded there is no network, which asyncio.run() needs as well, no other program, and "
        remedy += "no folder to write to but the current one: remove what needs them"
    elif type(error) is ImportError and "relative import" in str(error):
        remedy = "import a file next to it by its name alone, without the dot; what is graded must be in one file"
    else:
        remedy = 'correct it, or move what is not a definition under `if __name__ == "__main__":`'
    return InputError(f"it fails while it loads: {said}; {remedy}", where)
