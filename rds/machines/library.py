"""The library of modules: bodies that machines are assembled of, with their transformation, joint and interfaces.

The entries are data, in `modules/*.toml`. A module has two interfaces or more: the first one by which it is mounted,
the last one on which it carries the next. Two interfaces fit where kind and size are the same and one is male, the
other female, or both are neutral.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import Choice, Items, Quantity, Table, Text, near
from rds.core.toml_table import TomlTable
from rds.machines.link_table import ANGLES, ENTRIES, JOINT, MATRIX, OFFSET, ROTARY, Three, angles_of, offset_of
from rds.machines.module_table import CARRIES_ON, INTERFACE, MOUNTED_BY

KINDS = ("linear", "rotary", "head", "table", "accessory", "frame")
FEEDS = ("along", "across")
MODULE_ENTRY = Table(
    "a module of the library",
    {
        "title": Text("what it is", ""),
        "source": Text("where its numbers are from"),
        "kind": Choice("kind of module", KINDS),
        "type_text": Text("what it answers to a general call on the bus"),
        "matrix": MATRIX,
        "angles": angles_of(ANGLES),
        "offset": offset_of(OFFSET),
        "joint": JOINT,
        "travel": Items("travel", Quantity("end of the travel", "mm or degrees"), "[lowest, highest]", 2, rising=True),
        "resolution": Quantity("of its encoder", "mm or degrees per count", above=0.0),
        "speed": Quantity("its largest speed", "mm/min, degrees/min or rev/min", above=0.0),
        "feeds": Items("a head works along its axis, across it, or both", Choice("", FEEDS), "along, across or both"),
        "carries": Items("an accessory: kinds of modules that it may carry", Choice("", KINDS), "kinds of modules"),
        "mounts_on": Items("an accessory: kinds that it may be mounted on", Choice("", KINDS), "kinds of modules"),
        "interface": Table("its interfaces, by name", others=INTERFACE),
    },
    needed=("kind", "interface"),
)
LIBRARY = Table("Modules that machines are assembled of.", {"module": Table("modules by name", others=MODULE_ENTRY)})


@dataclass(frozen=True)
class Interface:
    """One side of the joint between two modules."""

    name: str
    kind: str
    size: float  # mm
    gender: str

    def fits(self, other: Interface) -> bool:
        """Whether the two can be joined."""
        opposite = {"male": "female", "female": "male", "neutral": "neutral"}[self.gender]
        return (self.kind, self.size, opposite) == (other.kind, other.size, other.gender)

    def __str__(self) -> str:
        return f"{self.gender} {self.kind} {self.size:g} mm ({self.name})"


@dataclass(frozen=True)
class LibraryModule:
    """A module of the library. Lengths in mm, angles in degrees."""

    name: str
    kind: str
    interfaces: dict[str, Interface]
    title: str = ""
    source: str = ""
    type_text: str = ""
    matrix: tuple[tuple[float, ...], ...] | None = None
    angles: Three | None = None
    offset: Three | None = None
    joint: str = ""
    travel: tuple[float, float] | None = None
    resolution: float | None = None
    speed: float | None = None
    feeds: tuple[str, ...] = ()
    carries: tuple[str, ...] = ()
    mounts_on: tuple[str, ...] = field(default=())

    def interface(self, name: str, last: bool) -> Interface:
        """The interface called `name`; where it is empty, the last or the first one. KeyError if there is none."""
        return self.interfaces[name] if name else list(self.interfaces.values())[-1 if last else 0]


@lru_cache(maxsize=1)
def library() -> dict[str, LibraryModule]:
    """The modules that come with the package, by name."""
    found: dict[str, LibraryModule] = {}
    for path in sorted(Path(str(files("rds.machines").joinpath("modules"))).glob("*.toml")):
        table = TomlTable.open(path, LIBRARY)
        modules = table.inner_or_empty("module")
        for name in modules.table:
            if name in found:
                raise InputError(f"the library has two modules called {name!r}", str(path))
            inner = modules.inner(name)
            assert inner is not None
            found[name] = _module(name, inner)
        table.done()
    return found


def library_module(name: str, place: str = "") -> LibraryModule:
    """The module called `name`; InputError names the ones there are."""
    known = library()
    if name not in known:
        raise InputError(f"there is no module {name!r}; modules: {', '.join(known)}{near(name, list(known))}", place)
    return known[name]


def by_type_text(text: str) -> LibraryModule | None:
    """The module that answers a general call with this text, if the library has one."""
    return next((module for module in library().values() if text and module.type_text == text), None)


def told_module(told: Mapping[str, Any], known: LibraryModule | None) -> LibraryModule | None:
    """The module that says of itself what `told` has (keys of `[axis.NAME.module]`); `known` where it says nothing.

    None where neither says how it is mounted.
    """
    sides = [_side(each, told[each]) if told.get(each) else None for each in (MOUNTED_BY, CARRIES_ON)]
    if known is not None:
        names = list(known.interfaces)
        places = dict(zip((names[0], names[-1]), sides, strict=True)) if len(names) > 1 else {names[0]: sides[0]}
        own = {name: replace(side, name=name) for name, side in places.items() if side is not None}
        return replace(known, interfaces=known.interfaces | own)
    if sides[0] is None:
        return None
    kind = {"translational": "linear", "rotary": "rotary", "tool": "head"}.get(told.get("kind", ""), "frame")
    found = {side.name: side for side in sides if side is not None}
    return LibraryModule(told.get("type_text") or kind, kind, found, "as it says of itself")


def _side(name: str, table: Mapping[str, Any]) -> Interface:
    return Interface(name, table["kind"], table["size"], table.get("gender", "neutral"))


def _module(name: str, table: TomlTable) -> LibraryModule:
    tables = table.inner_or_empty("interface")
    interfaces = {}
    for each in tables.table:
        inner = tables.inner(each)
        assert inner is not None
        interfaces[each] = Interface(each, inner.read("kind"), inner.read("size"), inner.read("gender"))
        inner.done()
    keys = [key for key in MODULE_ENTRY.keys if key not in ("interface", "kind") and key in table]
    made = LibraryModule(name, table.read("kind"), interfaces, **{key: table.read(key) for key in keys})
    table.done()
    if (made.kind in ("linear", "rotary")) != bool(made.joint) or (made.kind == "rotary") != (made.joint in ROTARY):
        raise InputError(
            f"a {made.kind} module cannot have joint {made.joint!r}; joints: {', '.join(ENTRIES)}", table.place()
        )
    if len(interfaces) < (1 if made.kind in ("head", "table") else 2):
        raise InputError("a module needs the interface it is mounted by, and one that carries the next", table.place())
    return made
