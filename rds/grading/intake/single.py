"""One file that its author tries: a Python file as it is, a notebook as the Python that its cells define."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rds.core.errors import InputError
from rds.core.private_files import write_private
from rds.grading.assignment.assignment import Assignment
from rds.grading.intake.folders import read_regular
from rds.grading.intake.items import Refusal
from rds.grading.intake.notebooks import INTERFACE, LARGEST, converted


def wanted(assignment: Assignment) -> tuple[str, ...]:
    """The names that a notebook may define for an assignment: the interfaces', and functions that are tested."""
    tests = {test.function for criterion in assignment.criteria for test in criterion.tests}
    return (*INTERFACE, *sorted(tests))


@contextmanager
def as_python(assignment: Assignment, file: Path) -> Iterator[Path]:
    """The path of a Python file: `file` itself, or what a notebook becomes in a batch. InputError if it is none."""
    if file.suffix.lower() != ".ipynb":
        yield file
        return
    with tempfile.TemporaryDirectory(prefix="rds-notebook-") as folder:
        path = Path(folder) / f"{file.stem}.py"
        try:
            write_private(path, converted(read_regular(file, LARGEST), wanted(assignment)).code, is_own=True)
        except Refusal as error:
            raise InputError(f"{error}", str(file)) from error
        yield path
