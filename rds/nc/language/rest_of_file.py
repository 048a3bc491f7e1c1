"""The words of the lines after a fault: read, not run, so that one check finds all that can be found.

A program stops at its first fault, since nobody knows where the tool would be after it. Words outside the dialect,
clashes of modal groups and bad numbers can be seen without running anything: all of a line, and those of subroutines
that nothing calls. Lines with parameters or expressions, whose values come from running, and O words are passed over.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from rds.nc.language.blocks import STOP, Block
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.interpreter import Interpreter
from rds.nc.language.words import tidy

_WORD = re.compile(r"[A-Z@^][-+]?[0-9.]*")
_SUB_OR_CALL = re.compile(rb"/?(?:n[0-9.]+)?(?:o|gr(?=[0-9<]))(<[^>]*>|[-+0-9.]+)(sub|endsub|call)")
_O_NUMBER = re.compile(r"o([0-9]+\.?[0-9]*|\.[0-9]+)")
_VALUES_FROM_RUNNING = frozenset("#[")


class _Reading(Interpreter):
    """An interpreter that reads blocks and does nothing."""

    def _execute(self, block: Block) -> bool:
        return block.m.get(STOP) in (2, 30)

    def _other(self, text: str) -> bool:
        word = text.lstrip("/").lstrip("n0123456789.")
        number = _O_NUMBER.match(word)
        if number is not None and float(number[1]) != int(float(number[1])):
            raise Fault(f"O{number[1]} is not whole; the numbers of O words are", at=text.index("o"))
        if text == "%" or word[:1] == "o" or word[:2] == "gr" or not _VALUES_FROM_RUNNING.isdisjoint(text):
            return False
        return super()._other(text)

    def _fanuc_turning(self, text: str) -> bool:
        from rds.nc.language.fanuc_turning import is_line

        return is_line(text)

    some = False  # whether there was anything after that line

    def faults(self, first: ProgramError) -> Iterator[ProgramError]:
        """Those besides `first` of its line, and those of the lines after it, up to M2 or M30."""
        self.out.file = self.source.name
        while raw := self.source.read():
            if self.source.line < first.line:
                continue
            if self.source.line == first.line:
                if not self._is_cycle(raw):
                    yield from self._of_line(_without(raw, first))
                continue
            self.some = self.some or bool(raw.strip())
            yield from self._of_line(raw)
            if self._ended:
                return

    def _is_cycle(self, raw: bytes) -> bool:
        """Whether it is one of Fanuc's lines, of which no word means anything without the others."""
        try:
            return b"7" in raw and self._fanuc_turning(tidy(raw))
        except Fault:
            return False

    def faults_between(self, lines: Iterable[range]) -> Iterator[ProgramError]:
        """Those of some lines of the file."""
        self.out.file = self.source.name
        wanted = {line for some in lines for line in some}
        while raw := self.source.read():
            if self.source.line in wanted:
                yield from self._of_line(raw)

    def _of_line(self, raw: bytes) -> Iterator[ProgramError]:
        """All faults of a line: read again without each word that is wrong."""
        while raw:
            try:
                self._ended = self._line(raw)
                return
            except ProgramError as fault:
                yield fault
                raw = _without(raw, fault)

    _ended = False  # the line read last ends the program


def _without(raw: bytes, fault: ProgramError) -> bytes:
    """The line with blanks in place of the word that is wrong; nothing where the fault is of no one word, and of a
    line that is no O word without its number.
    """
    at = fault.column - 1
    word = fault.word.encode()
    if at < 0 or fault.word[:1] == "O" or not _WORD.fullmatch(fault.word) or raw[at : at + len(word)].upper() != word:
        return b""
    return raw[:at] + b" " * len(word) + raw[at + len(word) :]


def uncalled(text: Iterable[bytes]) -> list[range]:
    """The lines inside of subroutines that no line of the program calls."""
    bodies: dict[bytes, range] = {}
    called: set[bytes] = set()
    name, begin = b"", 0
    for number, raw in enumerate(text, start=1):
        match = _SUB_OR_CALL.match(raw.lower().translate(None, b" \t"))
        if match is None:
            continue
        if match[2] == b"sub":
            name, begin = match[1], number + 1
        elif match[2] == b"endsub" and match[1] == name:
            bodies[name] = range(begin, number)
        elif match[2] == b"call":
            called.add(match[1])
    return [lines for name, lines in bodies.items() if name not in called]


def faults_never_run(path: Path, options: Dialect) -> list[ProgramError]:
    """What is wrong with words in subroutines that the program never calls."""
    with path.open("rb") as stream:
        lines = uncalled(stream)
    if not lines:
        return []
    reading = _Reading(path, options=options, name=str(path))
    try:
        return list(reading.faults_between(lines))
    finally:
        reading.close()


class RestOfFile:
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
            yield from reading.faults(self._first)
        finally:
            self.some = reading.some
            reading.close()
