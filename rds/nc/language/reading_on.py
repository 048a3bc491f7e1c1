"""The words of the lines after a fault: read, not run, so that one check finds all that can be found.

A program stops at its first fault, since nobody knows where the tool would be after it. Words outside the dialect,
clashes of modal groups and bad numbers can be seen without running anything. Lines with parameters or expressions,
whose values come from running, and O words are passed over.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rds.nc.language.blocks import STOP, Block
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.interpreter import Interpreter

_VALUES_FROM_RUNNING = frozenset("#[")


class _Reading(Interpreter):
    """An interpreter that reads blocks and does nothing."""

    def _execute(self, block: Block) -> bool:
        return block.m.get(STOP) in (2, 30)

    def _other(self, text: str) -> bool:
        word = text.lstrip("/").lstrip("n0123456789.")
        if text == "%" or word[:1] == "o" or word[:2] == "gr" or not _VALUES_FROM_RUNNING.isdisjoint(text):
            return False
        return super()._other(text)

    some = False  # whether there was anything after that line

    def faults(self, after: int) -> Iterator[ProgramError]:
        """Those of the lines after line `after`, up to M2 or M30."""
        self.out.file = self.source.name
        while raw := self.source.read():
            if self.source.line <= after:
                continue
            self.some = self.some or bool(raw.strip())
            try:
                if self._line(raw):
                    return
            except ProgramError as fault:
                yield fault


class Later:
    """The rest of the file in which a fault ended a program: `faults` of its words; `some`: there was something."""

    def __init__(self, first: ProgramError, options: Dialect):
        self._first, self._options = first, options
        self.some = False

    def faults(self) -> Iterator[ProgramError]:
        """What is wrong with words after the fault."""
        path = Path(self._first.file)
        if not self._first.line or not path.is_file():
            return
        reading = _Reading(path, options=self._options, name=self._first.file)
        try:
            yield from reading.faults(self._first.line)
        finally:
            self.some = reading.some
            reading.close()
