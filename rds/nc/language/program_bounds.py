"""Where a program begins and ends in its file: %, a configuration script at its head, M2 or M30, and what is behind."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

from rds.core.errors import InputError
from rds.nc.language.context import Context
from rds.nc.language.control import Control
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault
from rds.nc.language.left_over import LeftOver
from rds.nc.language.source import LONGEST

if TYPE_CHECKING:
    from rds.machines.ncc import Script


class Bounds:
    """Of one run of a program. `remark` is called with what is no fault and worth a look."""

    def __init__(self, context: Context, control: Control, remark: Callable[[ProgramError], None] | None):
        self._context, self._control, self._remark = context, control, remark
        self._options = context.dialect
        self._source = control.source  # the program's own; a subroutine may stand in another file
        self.percent = False  # the program stands between % and %
        self.configuration: Script | None = None  # what the program's head says of the machine (option ncc)
        self._left_over: LeftOver | None = None  # what stands behind M2 or M30, once it has been met

    def open(self) -> None:
        """See whether the program stands between % and %."""
        self._source.fill()
        first = self._source.following()
        while raw := self._source.read():
            if len(raw) > LONGEST + 1:
                break
            if stripped := raw.strip():
                self.percent = stripped == b"%"
                break
        else:
            raise ProgramError("the program is empty; write blocks and end with M2", file=self._source.name, line=1)
        if not self.percent:
            self._source.go_to(first)
        if self._options.ncc:
            self._read_configuration()

    def _read_configuration(self) -> None:
        """Read the configuration script at the program's head, if there is one. Raises ProgramError."""
        from rds.machines.ncc import Script

        script, source = Script(), self._source
        behind = source.following()
        try:
            while (raw := source.read()) and script.take(raw.decode("latin-1"), source.line):
                if script.line == source.line:
                    behind = source.following()
            if script.line:
                script.check_built(source.line, f"{raw.decode('latin-1').strip():.30}" if raw else "the program's end")
                self.configuration = script
                if self._remark is not None:
                    said = (
                        f"the configuration of {len(script.links)} links, built in line {script.built}, has no fault; "
                        "a machine that runs the program must have this chain (`rds machine new` makes one of a script)"
                        if script.links
                        else "limits and errors at the program's head are about the links of the machine that runs it "
                        "(`rds machine script` numbers them)"
                    )
                    self._remark(ProgramError(said, file=source.name, line=script.built))
        except InputError as error:
            said = str(error).removeprefix(f"{error.where}: ")
            raise ProgramError(said, file=source.name, line=script.line) from None
        source.go_to(behind)

    def file_ended(self) -> None:
        """Raises ProgramError, but where the last line of the program may be its end."""
        source = self._control.source
        try:
            self._control.check_end()
        except ProgramError as error:
            raise error.at(source.name, source.line) from None
        if self._options.open_end and not self.percent and source is self._source and not self._control.depth:
            self._end_here()
            if self._remark is not None:
                said = "the program has no M2, M30 or %: its last line is taken for its end (option open-end)"
                self._remark(ProgramError(said, file=source.name, line=source.line))
            return
        what = "% on its last line"
        if not self.percent:
            own = "or let its last line be its end (`--with open-end`)"
            what = f"M2, M30 or % (then with % on the first line, too) on its last line, {own}"
        raise ProgramError(f"the program does not end; write {what}", file=source.name, line=source.line)

    def percent_sign(self) -> bool:
        """% ends a program that began with one; in a subroutine's file that is being searched it says nothing."""
        if self._control.skipping:
            if self._control.source is not self._source:
                return False
            self.file_ended()
        self._context.out.digits = 0
        if self._control.source is not self._source:
            raise Fault("% inside a subroutine; end it with ENDSUB before", at=0)
        self._end_here()
        return True

    def _end_here(self) -> None:
        """End without M2 or M30: modes, spindle and coolant stay as they are."""
        compensation = self._context.out.compensation
        if compensation is not None:
            self._context.out.put(compensation.stop(self._context.out.line))
        self._context.out.call("FINISH")

    def look_behind(self) -> None:
        """Remark on blocks behind the end; a program may also end in a subroutine's file."""
        source = self._source
        if self._remark is None or self._control.source is not source:
            return
        if self._left_over is None:
            self._left_over = LeftOver("%", source.line)
        while raw := source.read():
            self._left_over.look(raw, source.line)
        if found := self._left_over.remark(source.name):
            self._remark(found)

    def after_end(self, word: str) -> None:
        """A program that began with % ends with one, after M2."""
        source = self._control.source
        self._left_over = LeftOver(word, source.line)
        if not self.percent:
            return
        last = b""
        while raw := source.read():
            self._left_over.look(raw, source.line)
            if len(raw) <= LONGEST + 1:
                if raw.strip() == b"%":
                    return
                last = raw
        if last:
            self._context.out.digits = 0
            match = re.match(rb"[\t /]*[nN]([0-9]{1,9})", last)
            if match:
                self._context.out.digits, self._context.out.n = len(match[1]), int(match[1])
        self._context.out.comment("interpreter: percent sign missing from end of file")
