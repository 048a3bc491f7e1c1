"""A tool table that is edited: a `.tbl` file as LinuxCNC keeps it, or a library with shapes (`.toml`)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from rds.core.atomic import write_whole
from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.nc.language.tools import Tool
    from rds.panels.program.check import Mark

LARGEST = 1 << 20  # bytes of a table that is edited here
STARTER = "; T number, P pocket, D diameter and Z length in mm, then a comment\nT1 P1 D6 Z0 ;end mill 6 mm\n"
LIBRARY_STARTER = """\
# mm, degrees, mm/min; shape: flat, ball, bull (with corner_radius), vee (with angle), drill
[[tool]]
number = 1
name = "end mill 6 mm"
shape = "flat"
diameter = 6.0
flutes = 2
cutting_length = 20.0
reach = 30.0
holder_diameter = 16.0
"""
_NAME = re.compile(r"[^\x00-\x1f/\\:*?\"<>|.][^\x00-\x1f/\\:*?\"<>|]{0,95}\.(tbl|toml)", re.IGNORECASE)
_LINE = re.compile(r"\bline (\d+)")


class ToolFile:
    """One table. `text` is what is edited. InputError for a name that will not do, or a file that cannot be edited."""

    def __init__(self, folder: Path, name: str):
        """A file that is not there yet begins with one tool."""
        if not _NAME.fullmatch(name):
            raise InputError(
                f"{name!r:.60} is no name of a tool table in your folder; write one like tools.toml or tools.tbl"
            )
        self.name, self.path = name, folder / name
        self._saved = self._read()
        starter = LIBRARY_STARTER if self.is_library else STARTER
        self.text = starter if self._saved is None else self._saved

    @property
    def is_library(self) -> bool:
        """Whether its tools have shapes."""
        return self.path.suffix.lower() == ".toml"

    @property
    def changed(self) -> bool:
        """Whether something is not saved."""
        return self.text != self._saved

    def tools(self) -> list[Tool]:
        """The tools as they are written now; ProgramError with line and column of the first fault, InputError of a
        library's.
        """
        from rds.nc.language.tool_library import library_of
        from rds.nc.language.tools import of_shape, tools_of

        if self.is_library:
            return [of_shape(tool) for tool in library_of(self.text, self.name)]
        return tools_of(self.text, self.name)

    def marks(self) -> list[Mark]:
        """The first fault at its word, if there is one."""
        from rds.nc.language.errors import ProgramError
        from rds.panels.program.check import Mark

        try:
            self.tools()
        except ProgramError as error:
            text = f"{error.word}: {error.reason}" if error.word else error.reason
            return [Mark(error.line, error.column, len(error.word), text)]
        except InputError as error:
            found = _LINE.search(str(error))
            return [Mark(int(found[1]) if found else 0, 0, 0, str(error))]
        return []

    def save(self) -> None:
        """Write the file. InputError with the fault where it is no table, or where somebody else has changed it."""
        self.tools()
        if self._read() != self._saved:
            raise InputError(
                f"{self.name} was changed by somebody else meanwhile; Look again shows that, and gives up yours"
            )
        write_whole(self.path, self.text.encode("utf-8"))
        self._saved = self.text

    def _read(self) -> str | None:
        """As it is on the disk; None where there is none."""
        try:
            with self.path.open("rb") as stream:
                data = stream.read(LARGEST + 1)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", str(self.path)) from error
        if len(data) > LARGEST:
            raise InputError(f"is larger than {LARGEST >> 20} MB; that is no tool table to edit here", str(self.path))
        try:
            return data.decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            raise InputError(
                f"is no UTF-8 at byte {error.start + 1}, which would be lost here; save it as UTF-8 to edit it",
                str(self.path),
            ) from error
