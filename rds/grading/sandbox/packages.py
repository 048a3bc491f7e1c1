"""Which installed packages are visible inside: those a submission may import, and what these need. Nothing else."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib import metadata
from pathlib import Path

ALLOWED = ("numpy", "scipy", "control")
"""Packages that a submission may import, each with what it requires; and the standard library."""


@lru_cache
def package_paths(names: tuple[str, ...] = ALLOWED) -> dict[str, Path]:
    """Files and folders of the packages `names` and their requirements: name inside site-packages -> where it is."""
    paths: dict[str, Path] = {}
    waiting, seen = list(names), set()
    while waiting:
        name = re.sub(r"[-_.]+", "-", waiting.pop()).lower()
        if name in seen:
            continue
        seen.add(name)
        try:
            found = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue  # an optional requirement, or one of another system
        for top in _tops(found):
            if top not in ("..", "__pycache__") and top not in paths:
                paths[top] = Path(str(found.locate_file(top)))
        waiting += [_name(line) for line in _required(found) if "extra ==" not in line]
    return {top: path for top, path in sorted(paths.items()) if path.exists()}


def _tops(found: metadata.Distribution) -> set[str]:
    """The first parts of the names of its files. `files` makes a path of each, of which scipy has thousands."""
    record = found.read_text("RECORD")
    if record is None:
        return {file.parts[0] for file in found.files or ()}
    return {line.split("/", 1)[0].split(",", 1)[0].strip('"') for line in record.splitlines() if line}


def _required(found: metadata.Distribution) -> list[str]:
    """What it requires, as it says. `requires` reads the whole description as an e-mail, which takes much longer."""
    said = found.read_text("METADATA")
    if said is None:
        return list(found.requires or ())
    head = said.replace("\r\n", "\n").partition("\n\n")[0]
    return [line.partition(":")[2].strip() for line in head.splitlines() if line.startswith("Requires-Dist:")]


def _name(requirement: str) -> str:
    found = re.match(r"[\w.-]+", requirement)
    return found.group() if found else requirement
