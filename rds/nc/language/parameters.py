"""Numbered and named parameters (#5, #<name>, #<_global>), and the file that keeps numbered ones."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from rds.core.limits import read_limited
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault

if TYPE_CHECKING:
    from pathlib import Path

    from rds.nc.language.state import State

COUNT = 5602  # numbers 1 to 5601, as in LinuxCNC
ARGUMENTS = 30  # #1 to #30 are a subroutine's own
DEBUG_SHOWN = 5599  # (DEBUG, ...) is a message while this is above 0
READ_ONLY = frozenset([*range(5400, 5414), *range(5420, 5429)])
TOOL = 5400  # number; 5401 to 5409 offsets X Y Z A B C U V W; 5410 diameter
POSITION = 5420  # X Y Z A B C
PROBED = 5061  # X Y Z A B C of the last probing; 5070: whether it touched
INPUT = 5399  # what M66 read
G28_HOME, G30_HOME = 5161, 5181
G92_APPLIED, G92 = 5210, 5211
SYSTEM = 5220  # which coordinate system is selected
_SETTING = re.compile(  # what int() and float() take and LinuxCNC does not, like 1_000, is no number here either
    r"\s*([-+]?[0-9]+)\s+([-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?|inf|nan))(?=\s*(?:$|[;#(])|\s+[a-z])",
    re.ASCII | re.IGNORECASE,
)
_REMARK = re.compile(r"\s*(?:[;#(].*)?", re.DOTALL)
_LARGEST = 4 << 20  # bytes; a line for each of 5601 parameters has far less
_SHOWN = 40  # characters of a line that is no setting
_DIGITS_MOST = 18  # of a number; more would be out of range all the same
SYSTEMS = 5200  # + 20 * system + 1...: origin X Y Z A B C U V W, rotation


class Parameters:
    """All parameters of a run. Named ones that begin with _ are global, others belong to the subroutine that runs."""

    def __init__(self, state: State, initial: Mapping[int, float] | None = None):
        self.numbers = [0.0] * COUNT
        self.numbers[DEBUG_SHOWN] = 1.0
        for number, value in (initial or {}).items():
            self.numbers[number] = float(value)
        self.globals: dict[str, float] = {}
        self.locals: list[dict[str, float]] = [{}]  # one for each subroutine being executed
        self.state = state
        self.changes = 0  # settings that gave a parameter another value
        self.known: dict[str, Callable[[], float]] = {}  # read-only names
        self._numbered: list[tuple[int, float]] = []
        self._named: list[tuple[str, float]] = []

    def has(self, index: int) -> bool:
        return 1 <= index < COUNT

    def get(self, index: int) -> float:
        if not 1 <= index < COUNT:
            raise Fault(f"there is no parameter #{index}; numbers go from 1 to {COUNT - 1}")
        if POSITION <= index < POSITION + 9:
            if self.state.comp_side:
                raise Fault(
                    f"#{index}, the position, cannot be read while the cutter is compensated; read it after G40"
                )
            return self.state.position()[index - POSITION] if index < POSITION + 6 else 0.0
        return self.numbers[index]

    def find(self, name: str) -> float | None:
        """The value of #<name>; None when it has none."""
        known = self.known.get(name)
        if known is not None:
            return known()
        return (self.globals if name[:1] == "_" else self.locals[-1]).get(name)

    # -- settings: read with the block, done when it is executed ------------------------------------------------------

    def check_settable(self, index: int) -> None:
        if not 1 <= index < COUNT:
            raise Fault(f"there is no parameter #{index}; numbers go from 1 to {COUNT - 1}")
        if index in READ_ONLY:
            raise Fault(f"#{index} can only be read; use another number")

    def declare(self, name: str) -> None:
        """A name is about to be set: from here on the block may ask for it (0 until the block is executed)."""
        if name in self.known:
            raise Fault(f"#<{name}> can only be read; use another name")
        (self.globals if name[:1] == "_" else self.locals[-1]).setdefault(name, 0.0)

    def set_later(self, index: int | str, value: float) -> None:
        if isinstance(index, str):
            self._named.append((index, value))
        else:
            self._numbered.append((index, value))

    def settle(self) -> None:
        """Do the settings of the block, in order."""
        for index, value in self._numbered:
            self.changes += self.numbers[index] != value
            self.numbers[index] = value
        for name, value in self._named:
            names = self.globals if name[:1] == "_" else self.locals[-1]
            self.changes += names[name] != value
            names[name] = value
        self._numbered.clear()
        self._named.clear()

    def settle_now(self, settings: Iterable[tuple[int | str, float]]) -> None:
        """Do settings at once, each index or declared name with its value."""
        for key, value in settings:
            if isinstance(key, str):
                names = self.globals if key[:1] == "_" else self.locals[-1]
                self.changes += names[key] != value
                names[key] = value
            else:
                self.changes += self.numbers[key] != value
                self.numbers[key] = value

    def snapshot(self) -> tuple[list[float], dict[str, float], list[dict[str, float]]]:
        """What all parameters are, to compare later."""
        return self.numbers.copy(), self.globals.copy(), [names.copy() for names in self.locals]

    # -- subroutines ---------------------------------------------------------------------------------------------------

    def enter(self, arguments: list[float] | None) -> list[float] | None:
        """A subroutine begins with its arguments in #1 to #30. Returns what they were, for leave().

        None: it has those of its caller, and what it makes of them stays (M98).
        """
        if arguments is None:
            self.locals.append({})
            return None
        kept = self.numbers[1 : ARGUMENTS + 1]
        self.numbers[1 : ARGUMENTS + 1] = arguments + [0.0] * (ARGUMENTS - len(arguments))
        self.locals.append({})
        return kept

    def leave(self, kept: list[float] | None) -> None:
        if kept is not None:
            self.numbers[1 : ARGUMENTS + 1] = kept
        self.locals.pop()


def read_parameters(path: Path) -> dict[int, float]:
    """A parameter file as LinuxCNC keeps it (.var): a number and a value on each line, numbers ascending.

    Empty lines, remarks (behind `;`, `#` or `(`, or words behind the value) and a heading without digits say nothing.
    LinuxCNC passes over any other line too, and what it should have set with it; here that is a fault. Lengths are in
    the machine's units. Raises ProgramError with the line for a number out of range or out of order as well.
    """
    values: dict[int, float] = {}
    last = 0
    try:
        lines = (
            read_limited(path, _LARGEST, "a parameter file", "check its path")
            .decode("utf-8-sig", "replace")
            .split("\n")
        )  # as editors count them
    except OSError as error:
        raise ProgramError(
            f"the parameter file cannot be read ({error.strerror}); check its path", file=str(path)
        ) from None
    for line, text in enumerate(lines, start=1):
        match = _SETTING.match(text)
        if match is None:
            if _REMARK.fullmatch(text) or not (last or any(map(str.isdigit, text))):
                continue
            shown = text.strip()[:_SHOWN]
            raise ProgramError(
                f"{shown!r} is no setting; write a parameter's number, blanks and its value, as in 5221 1.5, or a ;"
                " before a remark",
                file=str(path),
                line=line,
            )
        number, value = int(match[1][:_DIGITS_MOST]), float(match[2])
        if not 1 <= number < COUNT:
            raise ProgramError(
                f"there is no parameter {number}; numbers go from 1 to {COUNT - 1}", file=str(path), line=line
            )
        if number <= last:
            raise ProgramError(
                f"parameter {number} comes after {last}; put the lines in ascending order", file=str(path), line=line
            )
        if value - value != 0.0:
            raise ProgramError(
                f"{match[2]} is no finite number; correct the value of parameter {number}", file=str(path), line=line
            )
        values[number] = value
        last = number
    return values
