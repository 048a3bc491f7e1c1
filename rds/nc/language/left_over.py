"""What stands behind the end of a program and is never run: told, because it may be meant to be run."""

from __future__ import annotations

import re

from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.words import line_number, tidy

_COMMENTS = re.compile(r"\([^()]*\)|;.*", re.DOTALL)
_SUB = re.compile(r"o(?:<[^>]*>|[0-9]+)(sub|endsub)")
_PROGRAM = re.compile(r"o[0-9]+")  # a subprogram, which M98 calls, up to its M99
_RETURN = re.compile(r"m0*99(?![0-9.])")


class LeftOver:
    """Looks at the blocks after M2, M30 or the last %, and keeps the first that says something.

    Definitions of subroutines may stand there: calls find them.
    """

    def __init__(self, ended: str, line: int):
        self._ended, self._by = ended, line
        self._defining = False
        self.line = 0  # of the first such block; 0: there is none

    def look(self, raw: bytes, line: int) -> None:
        """The next block after the end."""
        if self.line:
            return
        try:
            text = _COMMENTS.sub("", tidy(raw))
            text = text[line_number(text)[2] :]
        except Fault:
            self.line = 0 if self._defining else line
            return
        match = _SUB.match(text)
        if match:
            self._defining = match[1] == "sub"
        elif _PROGRAM.fullmatch(text):
            self._defining = True
        elif self._defining and _RETURN.search(text):
            self._defining = False
        elif text not in ("", "%") and not self._defining:
            self.line = line

    def remark(self, file: str) -> ProgramError | None:
        """What to tell of it; None where nothing is left over."""
        if not self.line:
            return None
        return ProgramError(
            f"the program ends by {self._ended} in line {self._by}, and what follows is not run; move the end behind"
            " it, or remove it",
            file=file,
            line=self.line,
        )
