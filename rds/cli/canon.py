"""`rds nc canon`: canonical calls as text. Without options it needs no reader of command lines, which takes longer to
import than some ten thousand lines of a program take to read.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rds.nc.language.batch import Batch
    from rds.nc.language.canon import Call, MotionBlock


def print_canon(items: Iterable[MotionBlock | Call | Batch]) -> None:
    """Print the calls as LinuxCNC's `rs274 -g` does, as they come."""
    from rds.nc.language.canon_text import written

    with until_nobody_reads():
        sys.stdout.writelines(written(items))
        sys.stdout.flush()


@contextmanager
def until_nobody_reads() -> Iterator[None]:
    """For printing that ends without a word where the reader has: `| head` has seen enough."""
    try:
        yield
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def canon_alone(words: Sequence[str]) -> int | None:
    """The exit code of the command line `nc canon FILE`, done here; None for any other, and for a file that is not
    there, which the whole command line is to judge.
    """
    if (
        list(words[:2]) != ["nc", "canon"]
        or len(words) != 3
        or words[2].startswith("-")
        or not os.path.isfile(words[2])
    ):
        return None
    from rds.core.errors import RdsError
    from rds.nc.language.dialect import Dialect
    from rds.nc.language.interpreter import Interpreter
    from rds.nc.language.source import open_file

    try:
        interpreter = Interpreter(open_file(words[2], words[2]), options=Dialect(any_exit=True))
        print_canon(interpreter.run_in_batches())
        interpreter.close()
    except RdsError as error:
        sys.stdout.flush()
        sys.stderr.write(f"rds: {error}\n")
        return 2
    return 0
