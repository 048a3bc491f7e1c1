"""Lines of text logs on their way to python-can's readers, watched: a damaged line is named, never skipped in silence.

python-can's readers pass over what they don't know, and take half of a byte for a whole one. So each line is looked at
before it is handed out, and once more if no frame came of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import NamedTuple, TextIO

from rds.core.errors import InputError
from rds.core.limits import allow_unpacked, lifted, refusal

_LONGEST = 1 << 16  # characters of a line: a frame of 64 bytes takes some hundred
_FEW = 1 << 28  # characters that a compressed log may hold in any case

_CANDUMP = re.compile(
    r"\(\d+\.\d+\)\s+\S+\s+([0-9A-F]{3}|[0-9A-F]{8})#"
    r"(R\d*|#[0-9A-F]([0-9A-F]{2}){0,64}|([0-9A-F]{2}){0,64})(\s+[RT])?",
    re.IGNORECASE,
)
# SocketCAN's identifier of an error frame: the classes of the error, of which 0x80 is a bus error
_ERROR = re.compile(r"(?<=\s)[23][0-9A-F]{7}(?=#)", re.IGNORECASE)
_BUS_ERROR = 0x80
# time, channel, identifier and, if it was not cut off there, the direction: an event has a word for an identifier
_ASC_FRAME = re.compile(r"\d+\.\d+\s+(CANFD\s+)?\d+(\s+(Rx|Tx))?(\s+[0-9A-F]+x?(\s.*)?)?", re.IGNORECASE)
_ASC_HEADING = re.compile(
    r"(date|base|begin|end|previous log file)\b.*|(no\s*)?internal\s+events\s+logged.*|[/;*].*", re.IGNORECASE
)
_ASC_MARKER = re.compile(r"\d+\.\d+\s.*\bGMGroup:.*")  # CANoe's global markers begin with numbers, as frames do
_EVENT = re.compile(r"\d")  # something at some time, or with some number
_ASC_TIME_ONLY = re.compile(r"\d+(\.\d*)?")
_TRC_FRAME = {"DT", "FD", "FB", "FE", "BI", "RR", "RX", "TX"}
_TRC_OTHER = {"ST", "EC", "ER", "EV"}  # status, error counters, error frames, events: python-can reads none of them
_CSV_HEADING = "timestamp,arbitration_id,extended,remote,error,dlc,data"


class Rules(NamedTuple):
    """Of a text format: what is wrong with a line, and whether it should have given a frame (None: a comment).

    `opening` is a line that the reader needs above the first line that is no heading: it passes over the next one.
    `handed` makes of a line what the reader understands as the same frame.
    """

    check: Callable[[str, int], str | None]
    is_frame: Callable[[str], bool | None]
    opening: str = ""
    handed: Callable[[str], str] = str


class Lines:
    """The lines of a text log; what python-can's readers need of a file. `frames` is for whoever gets the frames.

    `number` is that of the last line, from 1. Raises InputError, with the file and the line, at a damaged one.
    """

    def __init__(self, file: TextIO, path: str, rules: Rules, packed: int = 0):
        self._file = file
        self._packed = packed  # bytes of a compressed file
        self._characters = 0
        self._longest = int(_LONGEST * lifted())
        self._path = path
        self._check, self._is_frame, self._opening, self._handed = rules
        self._line = self._held = ""
        self.number = 0
        self.frames = 0  # that came of the last line
        self.skipped = 0  # lines of other things than frames, comments and headings
        self._first_strange = 0  # number of the first of them that is no event either

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        self._look_back()
        while not self._held:
            self._line = self._next()
            self.number += 1
            self.frames = 0
            if self._line.strip():
                break
        if self._held:
            self._line, self._held, self.frames = self._held, "", 0
        elif self._opening and self._is_frame(self._line.strip()) is not None:
            self._held, self._line, self._opening = self._line, self._opening, ""
            return self._line
        problem = self._check(self._line.strip(), self.number)
        if problem:
            raise self.fault(problem)
        return self._handed(self._line)

    def _next(self) -> str:
        line = self._file.readline(self._longest)
        if not line:
            raise StopIteration
        if len(line) == self._longest and not line.endswith("\n"):
            where = f"{self._path}:{self.number + 1}"
            what = f"it has a line of more than {self._longest} characters"
            raise refusal(what, _LONGEST, "take another copy", where=where)
        self._characters += len(line)
        if self._packed and self._characters > _FEW:
            allow_unpacked(self._characters, self._packed, self._path, counting=True)
        return line

    def _look_back(self) -> None:
        if self.number and not self.frames:
            line = self._line.strip()
            is_frame = self._is_frame(line)
            if is_frame:
                raise self.fault(f"it is cut off or damaged: {_short(line)}")
            if is_frame is False:
                self.skipped += 1
                if not _EVENT.match(line):
                    self._first_strange = self._first_strange or self.number
            self.frames = 1  # it is looked at once

    def nothing(self) -> InputError | None:
        """The error to raise if no frame came of these lines; None if all are headings, comments and events."""
        if not self._first_strange:
            return None
        return InputError(
            "no line of the file is a frame, and this is the first that is no heading, comment or event either; is "
            "it a log of this format?",
            f"{self._path}:{self._first_strange}",
        )

    def fault(self, problem: str) -> InputError:
        """The error to raise for the last line."""
        return InputError(f"{problem}; correct the line, or take it out", f"{self._path}:{self.number}")

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _check_candump(line: str, number: int) -> str | None:
    if _CANDUMP.fullmatch(line):
        return None
    return f"{_short(line)} is no line of `candump -L`, as in '(1700000000.000000) can0 123#11223344'"


def _candump_error(line: str) -> str:
    """An error frame is one to python-can's reader if a bus error is among its classes, and else a frame with data."""
    return _ERROR.sub(lambda found: f"{int(found[0], 16) | _BUS_ERROR:08X}", line)


def _check_csv(line: str, number: int) -> str | None:
    if number == 1 and line != _CSV_HEADING:
        return f"the first line must be {_CSV_HEADING!r}, not {_short(line)}"
    return None


def _anything(line: str, number: int) -> str | None:
    return None


# Whether a line of which no frame came should have been one: False counts as skipped, None is a comment or the like.


def _asc_frame(line: str) -> bool | None:
    if _ASC_MARKER.fullmatch(line):
        return False
    if _ASC_FRAME.fullmatch(line) or _ASC_TIME_ONLY.fullmatch(line):
        return True
    return None if _ASC_HEADING.fullmatch(line) or "Start of measurement" in line else False


def _trc_frame(line: str) -> bool | None:
    if line.startswith(";"):
        return None
    words = line.upper().split()
    if not _TRC_OTHER.isdisjoint(words[1:4]):
        return False
    return len(words) < 4 or not _TRC_FRAME.isdisjoint(words)


def _always(line: str) -> bool | None:
    return True


def _csv_frame(line: str) -> bool | None:
    return None if line == _CSV_HEADING else True


ASC = Rules(_anything, _asc_frame, "no internal events logged\n")
CANDUMP = Rules(_check_candump, _always, handed=_candump_error)
TRC = Rules(_anything, _trc_frame)
CSV = Rules(_check_csv, _csv_frame)


def _short(line: str) -> str:
    return repr(line if len(line) <= 60 else line[:57] + "...")
