"""The tool table: as LinuxCNC keeps it in a file, and which of its tools is in the spindle."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from rds.core.limits import read_limited
from rds.nc.language.errors import ProgramError
from rds.nc.language.expressions import Fault

if TYPE_CHECKING:
    from pathlib import Path

    from rds.nc.language.tool_library import ShapedTool

_WORD = re.compile(r"([A-Za-z])([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)")
_WHOLE = "TPQ"
_LETTERS = "TPDXYZABCUVWIJQ"
_LARGEST = 4 << 20  # bytes
_MOST = 1000  # tools in a table, as in LinuxCNC


class Tool(NamedTuple):
    """A line of the table; lengths in the machine's units, angles in degrees.

    `offset`: X Y Z A B C. `front`, `back`: angles of a lathe tool; `orientation`: of its nose (0: no lathe tool).
    """

    number: int
    pocket: int = 0
    diameter: float = 0.0
    offset: tuple[float, ...] = (0.0,) * 6
    front: float = 0.0
    back: float = 0.0
    orientation: int = 0
    comment: str = ""


NO_TOOL = Tool(0)


class ToolTable:
    """Tools in the table's order; which one is in the spindle.

    LinuxCNC counts its slots from 1 in that order; slot 0 is the spindle.
    """

    def __init__(self, tools: Iterable[Tool] = ()):
        self.slots: list[Tool] = [NO_TOOL, *tools]
        self.selected = -1  # slot that T chose
        self.loaded = 0  # slot whose tool is in the spindle

    @property
    def spindle(self) -> Tool:
        return self.slots[0]

    def find(self, number: int) -> int:
        """The slot of a tool; 0 (the spindle) for tool 0. Raises Fault."""
        if number == 0:
            return 0
        for slot, tool in enumerate(self.slots):
            if slot and tool.number == number:
                return slot
        known = ", ".join(str(tool.number) for tool in self.slots[1:9]) + (", ..." if len(self.slots) > 9 else "")
        has = f"it has {known}" if known else "it is empty; give one with --tools"
        raise Fault(f"the tool table has no tool {number}; {has}")

    def change(self) -> None:
        """The selected tool goes into the spindle."""
        self.put(self.selected)

    def put(self, slot: int) -> None:
        """The tool of a slot is in the spindle; none is for 0."""
        self.loaded = slot
        self.slots[0] = self.slots[slot] if slot else NO_TOOL


def read_tools(path: Path) -> list[Tool]:
    """A tool table as LinuxCNC keeps it: `T1 P1 Z0.511 D0.125 ;comment` on each line, in the machine's units.

    Of a tool library (.toml, docs/paths.md) the lengths and diameters, in mm.

    Raises ProgramError with line and column for a word that is none of the table's, a line without T or P (LinuxCNC
    passes over the first and misreads the second), or a tool that comes twice.
    """
    if path.suffix.lower() == ".toml":
        from rds.nc.language.tool_library import read_library  # with numpy

        return [of_shape(tool) for tool in read_library(path)]
    try:
        text = read_limited(path, _LARGEST, "a tool table", "check its path").decode("utf-8-sig", "replace")
    except OSError as error:
        raise ProgramError(
            f"the tool table cannot be read ({error.strerror}); check its path", file=str(path)
        ) from None
    return tools_of(text, str(path))


def of_shape(tool: ShapedTool) -> Tool:
    """A tool of a library as a table has it."""
    most = [("S", tool.most_spindle), ("F", tool.most_feed)]
    words = " ".join(f"{letter}{value:g}" for letter, value in most if value is not None)
    offset = (0.0, 0.0, tool.length, 0.0, 0.0, 0.0)
    return Tool(
        *(tool.number, tool.number, tool.diameter, offset), comment=tool.said + (f", max {words}" if words else "")
    )


def tools_of(table: str, file: str) -> list[Tool]:
    """The tools of a table's text; `file` is where faults are said to be. Raises ProgramError as `read_tools` does."""
    tools: list[Tool] = []
    for line, text in enumerate(table.split("\n"), start=1):  # as editors count them
        tool = _read_line(text, file, line)
        if tool is None:
            continue
        if any(tool.number == other.number for other in tools):
            raise ProgramError("this tool comes twice; leave one line", file=file, line=line, word=f"T{tool.number}")
        if len(tools) >= _MOST:
            raise ProgramError(f"more than {_MOST} tools; shorten the table", file=file, line=line)
        tools.append(tool)
    return tools


def _read_line(text: str, file: str, line: int) -> Tool | None:
    words, _, comment = text.partition(";")
    found: dict[str, float] = {}
    for match in re.finditer(r"\S+", words):
        word = _WORD.fullmatch(match[0])
        letter = word[1].upper() if word else ""
        place = {"file": file, "line": line, "column": match.start() + 1, "word": match[0]}
        if word is None or letter not in _LETTERS:
            raise ProgramError(
                f"is no word of a tool table; write {' '.join(_LETTERS)}, each with a number",
                **place,  # type: ignore[arg-type]
            )
        value = float(word[2])
        if letter in found:
            raise ProgramError("comes twice on this line; leave one", **place)  # type: ignore[arg-type]
        if value - value != 0.0 or abs(value) > 1e9 or (letter in _WHOLE and value != int(value)):
            raise ProgramError("must be a whole number" if letter in _WHOLE else "is too large", **place)  # type: ignore[arg-type]
        found[letter] = value
    if not found:
        return None
    if "T" not in found or "P" not in found or found["T"] < 0:  # T0 is a slot that LinuxCNC counts, and no tool
        raise ProgramError("a tool needs its number T (from 1) and its pocket P; add them", file=file, line=line)
    offset: Sequence[float] = [found.get(letter, 0.0) for letter in "XYZABC"]
    if any(found.get(letter) for letter in "UVW"):
        raise ProgramError("offsets along U, V, W are of no use: there are no such axes", file=file, line=line)
    return Tool(
        number=int(found["T"]),
        pocket=int(found["P"]),
        diameter=found.get("D", 0.0),
        offset=tuple(offset),
        front=found.get("I", 0.0),
        back=found.get("J", 0.0),
        orientation=int(found.get("Q", 0.0)),
        comment=comment.strip(),
    )
