"""Model structures by name. Each module has `OPTIONS`, `OUTPUTS` and `make(options, output, command) -> Structure`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rds.core.errors import InputError
from rds.core.registry import Registry
from rds.identification.structures.signals import check_signals
from rds.identification.structures.structure import Structure

if TYPE_CHECKING:
    from rds.identification.logs.log import Log

LIBRARY = Registry(
    "structure",
    {
        "axis": "rds.identification.structures.axis_structure",
        "axis-mass": "rds.identification.structures.axis_mass",
        "axis-inertia": "rds.identification.structures.axis_inertia",
        "spindle": "rds.identification.structures.spindle_structure",
    },
)


def structure(name: str | Path, options: Sequence[str] = (), output: str = "", command: str = "V") -> Structure:
    """The structure called `name` with these options; a path that ends in .py is a model of the user's own.

    `output` and `command` are the units of what it answers and of what commands it (see `signals`); the first of the
    structure's own outputs where none is given. InputError for an unknown structure or option, an option given twice,
    or units that the structure does not have.
    """
    if str(name).endswith(".py"):
        from rds.identification.structures.student_structure import make_from_file

        if options:
            raise InputError(f"{name}: a file has no options, but {', '.join(options)} was given; leave it out")
        return replace(make_from_file(name), output_unit=output or "mm", command_unit=command)
    module = LIBRARY.module(str(name))
    known: Sequence[str] = module.OPTIONS
    options = (options,) if isinstance(options, str) else options
    for option in options:
        if option not in known:
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise InputError(f"structure {name} has no option {option!r}; {has}")
        if list(options).count(option) > 1:
            raise InputError(f"structure {name}: option {option!r} is given twice")
    output = output or module.OUTPUTS[0]
    check_signals(str(name), module.OUTPUTS, output, command)
    made: Structure = module.make(tuple(option for option in known if option in options), output, command)
    return made


def for_logs(made: Structure, logs: Sequence[Log]) -> Structure:
    """The structure in the units of the logs; InputError where it does not have them, or where the logs differ."""
    signals = {_signals_of(log, made) for log in logs}
    if len(signals) > 1:
        said = "; ".join(f"{log.name}: {', '.join(_signals_of(log, made))}" for log in logs)
        raise InputError(f"the logs are in different units ({said}); state the same for all in their maps")
    output, command = signals.pop()
    if (output, command) == (made.output_unit, made.command_unit):
        return made
    log = logs[0]
    if made.name not in LIBRARY.names():  # a file of one's own: its numbers are in whatever units its logs are
        return replace(made, output_unit=output, command_unit=command)
    try:
        return structure(made.name, made.options, output, command)
    except InputError as error:
        raise InputError(str(error), log.source or log.name) from error


def _signals_of(log: Log, made: Structure) -> tuple[str, str]:
    return log.units.get("position") or made.output_unit, log.units.get("command") or made.command_unit
