"""Model structures by name. Each module has `OPTIONS` and `make(options) -> Structure`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rds.core.errors import InputError
from rds.core.registry import Registry
from rds.identification.structures.structure import Structure

LIBRARY = Registry(
    "structure",
    {
        "axis": "rds.identification.structures.axis_structure",
        "axis-mass": "rds.identification.structures.axis_mass",
        "spindle": "rds.identification.structures.spindle_structure",
    },
)


def structure(name: str | Path, options: Sequence[str] = ()) -> Structure:
    """The structure called `name` with these options; a path that ends in .py is a model of the user's own.

    InputError for an unknown structure or option, or an option given twice.
    """
    if str(name).endswith(".py"):
        from rds.identification.structures.student_structure import make_from_file

        if options:
            raise InputError(f"{name}: a file has no options, but {', '.join(options)} was given; leave it out")
        return make_from_file(name)
    module = LIBRARY.module(str(name))
    known: Sequence[str] = module.OPTIONS
    for option in options:
        if option not in known:
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise InputError(f"structure {name} has no option {option!r}; {has}")
        if list(options).count(option) > 1:
            raise InputError(f"structure {name}: option {option!r} is given twice")
    made: Structure = module.make(tuple(option for option in known if option in options))
    return made
