"""Part programs and paths that come with the package: to begin with, and to test interpolators by, as in the paper.

Each is a file `NAME.ngc` or `NAME.toml` here. Its first comment says what it is; a comment `(machine: NAME)`, or
`# machine: NAME`, names the machine it is for, mini-cnc otherwise.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from rds.core.errors import InputError

PROGRAM, PATH = ".ngc", ".toml"
_COMMENT = {PROGRAM: re.compile(r"\(([^()]*)\)"), PATH: re.compile(r"# (.*)")}
_MACHINE = {PROGRAM: re.compile(r"\(machine: ([^()\s]+)\)"), PATH: re.compile(r"# machine: (\S+)")}


@dataclass(frozen=True)
class Bundled:
    """One of them: `file` is its name with its ending."""

    file: str
    title: str
    machine: str
    path: Path

    def text(self) -> str:
        """Its text."""
        return self.path.read_text(encoding="utf-8")


def bundled() -> dict[str, Bundled]:
    """All part programs by file name."""
    return _of(PROGRAM)


def bundled_paths() -> dict[str, Bundled]:
    """All paths by file name: files that `[reference] file`, `rds interpolate` and `rds nc methods` take."""
    return _of(PATH)


def find_bundled(name: str) -> Bundled:
    """The program called `name`, with or without .ngc, or the path `name`, with .toml; InputError names them all."""
    every = bundled() | bundled_paths()
    wanted = name if name.endswith((PROGRAM, PATH)) else name + PROGRAM
    if wanted not in every:
        known = ", ".join(each.removesuffix(PROGRAM) for each in every)
        raise InputError(f"no part program or path {name!r} comes with the package; there are {known}")
    return every[wanted]


@cache
def _of(ending: str) -> dict[str, Bundled]:
    found = {}
    for path in sorted(Path(str(files("rds.nc.bundled"))).glob(f"*{ending}")):
        text = path.read_text(encoding="utf-8")
        title, machine = _COMMENT[ending].search(text), _MACHINE[ending].search(text)
        assert title is not None
        found[path.name] = Bundled(path.name, title[1], machine[1] if machine else "mini-cnc", path)
    return found
