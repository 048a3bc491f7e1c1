"""Part programs that come with the package: to begin with, and to test interpolators by, as the paper's panel has them.

Each is a file `NAME.ngc` here. Its first comment says what it is; a comment `(machine: NAME)` names the machine it is
for, mini-cnc otherwise.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from rds.core.errors import InputError

_ENDING = ".ngc"
_COMMENT = re.compile(r"\(([^()]*)\)")
_MACHINE = re.compile(r"\(machine: ([^()\s]+)\)")


@dataclass(frozen=True)
class Bundled:
    """One of them: `file` is its name with .ngc."""

    file: str
    title: str
    machine: str
    path: Path

    def text(self) -> str:
        """The program."""
        return self.path.read_text(encoding="utf-8")


@cache
def bundled() -> dict[str, Bundled]:
    """All of them by file name."""
    folder = Path(str(files("rds.nc.bundled")))
    found = {}
    for path in sorted(folder.glob(f"*{_ENDING}")):
        text = path.read_text(encoding="utf-8")
        title, machine = _COMMENT.search(text), _MACHINE.search(text)
        assert title is not None
        found[path.name] = Bundled(path.name, title[1], machine[1] if machine else "mini-cnc", path)
    return found


def find_bundled(name: str) -> Bundled:
    """The one called `name`, with or without .ngc. InputError names the ones there are."""
    wanted = name if name.endswith(_ENDING) else name + _ENDING
    if wanted not in bundled():
        known = ", ".join(each.removesuffix(_ENDING) for each in bundled())
        raise InputError(f"no part program {name!r} comes with the package; there are {known}")
    return bundled()[wanted]
