"""What a part program is read with: tool table, parameter file, options of the dialect."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import Flag, Quantity, checked, near, shortened
from rds.machines import Machine
from rds.nc.configuration import corrects
from rds.nc.language.canon import Call, MotionBlock
from rds.nc.language.dialect import Dialect
from rds.nc.language.interpreter import interpret
from rds.nc.language.parameters import read_parameters
from rds.nc.language.source import NOT_A_FILE, not_a_file
from rds.nc.language.tools import Tool, read_tools
from rds.nc.passed_over import Report
from rds.nc.tool_centre import has_tool_centre

_FILES = ("tools", "parameters")
_NUMBERS = {
    "probe_surface": Quantity("where a probe touches, a height along Z", "mm"),
    "max_jumps": Quantity("calls and jumps back, after which a program is taken for endless", low=1, whole=True),
    "max_depth": Quantity("subroutine calls inside one another", low=1, whole=True),
}


@dataclass(frozen=True)
class Setup:
    """What a part program is read with: tool table and parameter file of LinuxCNC's formats (paths), options of the
    dialect. Raises InputError for what is none of these.
    """

    tools: Path | None = None
    parameters: Path | None = None
    options: Dialect = field(default_factory=Dialect)
    correct: bool = False  # for the assembly errors in the machine's links

    def __post_init__(self) -> None:
        for name in _FILES:
            value = getattr(self, name)
            if isinstance(value, str):
                object.__setattr__(self, name, Path(value))
            elif not isinstance(value, Path | None):
                raise InputError(f"setup: {name} = {shortened(value)} must be the path of a file")
        if not isinstance(self.options, Dialect):
            object.__setattr__(self, "options", _dialect(self.options))
        checked(Flag(""), self.correct, "correct", "setup")

    @classmethod
    def of(cls, given: Setup | Mapping[str, Any] | None) -> Setup:
        """The setup that is given, or that of a table: files and options of the dialect by name, side by side.

        Raises InputError for a word that there is not, and for a value that will not do.
        """
        if isinstance(given, Setup):
            return given
        if given is None:
            return cls()
        if not isinstance(given, Mapping):
            raise InputError(f"setup = {shortened(given)} must be a table, as in setup={{'tools': 'tools.tbl'}}")
        own = {name: given[name] for name in (*_FILES, "correct") if name in given}
        return cls(**own, options=_dialect({name: value for name, value in given.items() if name not in own}))

    def on(self, machine: Machine, program: Path) -> Setup:
        """The same for a program on a machine: links with rotary axes read G43.4, and RF03 at its head corrects."""
        if not_a_file(program):
            raise InputError(NOT_A_FILE, str(program))
        tcp = self.options.tcp or has_tool_centre(machine)
        return replace(
            self, options=self.options._replace(tcp=tcp), correct=self.correct or corrects(program, self.options)
        )

    def tool_list(self) -> list[Tool]:
        """The tools of the table; none without one. Raises ProgramError for a table that is wrong."""
        return read_tools(self.tools) if self.tools else []

    def interpret(self, program: Path, remark: Report | None = None) -> Iterator[MotionBlock | Call]:
        """The canonical calls of a program; `remark` gets what is no fault and worth a look. Raises ProgramError."""
        parameters = read_parameters(self.parameters) if self.parameters else None
        tools, name = self.tool_list(), str(program)
        return interpret(program, tools=tools, parameters=parameters, options=self.options, name=name, remark=remark)


def _dialect(given: Any) -> Dialect:
    if not isinstance(given, Mapping):
        raise InputError(f"setup: options = {shortened(given)} must be a table, as in {{'block_delete': True}}")
    known = (*_FILES, "correct", *Dialect._fields)
    made = {}
    for name, value in given.items():
        if name not in Dialect._fields:
            raise InputError(f"setup: there is no {name!r}; there are {', '.join(known)}{near(name, known)}")
        if name != "probe_surface" or value is not None:
            made[name] = checked(_NUMBERS.get(name, Flag("")), value, name, "setup")
    return Dialect(**made)
