"""The `[[link]]` tables of a machine's file, its `[tool]` and its `[work]`: which bodies carry which, and what moves.

The links form a tree that grows from the bed. A machine of modules put one upon another (mrm-control, section 5) has
its work at the bed and its tool at the last link; a machine tool with a moving table has one branch to each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rds.core.errors import InputError
from rds.core.quantities import Choice, Items, Quantity, Table, Tables, Text, near
from rds.core.toml_table import TomlTable

if TYPE_CHECKING:
    from rds.machines.machine import Axis

BED = "bed"
ENTRIES = ("XA", "YA", "ZA", "X", "Y", "Z")  # the six numbers of a link, in the order of the script's words
ROTARY = ENTRIES[:3]
Three = tuple[float, float, float]
_ANGLE, _LENGTH = Quantity("angle", "degrees"), Quantity("shift", "mm")
_ROW = Items("row of the matrix", Quantity("entry of the matrix"), "4 numbers", 4)
_LIMITS = Items(
    "virtual limits of its axis, within the travel: the operational workspace",
    Quantity("limit", "axis unit"),
    "[lower, upper], two finite numbers in the axis's unit, the lower one first",
    2,
    rising=True,
)


def angles_of(meaning: str) -> Items:
    return Items(meaning, _ANGLE, "[XA, YA, ZA], three angles in degrees about x, y and z", 3)


def offset_of(meaning: str) -> Items:
    return Items(meaning, _LENGTH, "[X, Y, Z], three lengths in mm", 3)


ANGLES, OFFSET = "Euler angles: turned about x, then y, then z", "shift of its frame"
MATRIX = Items("homogeneous transformation, instead of angles and offset", _ROW, "4 rows of 4 numbers", 4)
JOINT = Choice("which of its six numbers its axis changes", ENTRIES)
LINK = Table(
    "a link: a body of the machine, where it stands on its parent, and what moves it",
    {
        "name": Text("its name; by default that of its axis, or its module"),
        "parent": Text("the link that carries it, or bed; by default the link before it"),
        "module": Text("its entry in the library of modules (`rds machine modules`)"),
        "axis": Text("the axis that moves it; a link without one is fixed"),
        "joint": JOINT,
        "sign": Quantity("1, or -1 where the axis counts against the frame", "", -1, 1, default=1, whole=True),
        "matrix": MATRIX,
        "angles": angles_of(ANGLES),
        "offset": offset_of(OFFSET),
        "error_angles": angles_of("assembly error, added to the angles"),
        "error_offset": offset_of("assembly error, added to the offset"),
        "limits": _LIMITS,
        "interface": Text("interface by which it is mounted; by default its module's first"),
        "parent_interface": Text("interface of its parent that it is mounted on; by default the parent module's last"),
    },
)


def _end(what: str) -> Table:
    return Table(
        f"where the {what} is",
        {
            "link": Text(f"the link that holds the {what}, or bed"),
            "angles": angles_of(ANGLES),
            "offset": offset_of(f"from the link's frame to the {what}"),
        },
    )


LINKS = Tables("links of the machine, each after the one that carries it", LINK)
TOOL, WORK = _end("tool's tip"), _end("work")


@dataclass(frozen=True)
class Link:
    """A link as the file says it. `None` for matrix, angles and offset: its module says them.

    `place` is where it stands in its file.
    """

    name: str
    parent: str = BED
    module: str = ""
    axis: str = ""
    joint: str = ""
    sign: int = 1
    matrix: tuple[tuple[float, ...], ...] | None = None
    angles: Three | None = None  # XA, YA, ZA, degrees
    offset: Three | None = None  # mm
    error_angles: Three = (0.0, 0.0, 0.0)  # degrees
    error_offset: Three = (0.0, 0.0, 0.0)  # mm
    limits: tuple[float, float] | None = None  # axis unit
    interface: str = ""
    parent_interface: str = ""
    place: str = ""

    @property
    def turns(self) -> bool:
        """Whether its axis turns it."""
        return self.joint in ROTARY


@dataclass(frozen=True)
class ChainEnd:
    """The tool's tip, or the work: a frame on a link."""

    link: str = BED
    angles: Three = (0.0, 0.0, 0.0)  # XA, YA, ZA, degrees
    offset: Three = (0.0, 0.0, 0.0)  # mm


def read_links(table: TomlTable, axes: Mapping[str, Axis]) -> tuple[tuple[Link, ...], ChainEnd | None, ChainEnd | None]:
    """Links, tool and work of a machine's file; none of them where it has no `[[link]]`. Raises InputError."""
    tables = table.tables("link")
    if not tables:
        for key in ("tool", "work"):
            if key in table:
                raise InputError(f"[{key}] needs links; add [[link]] tables, or leave it out", table.place(key))
        return (), None, None
    links: list[Link] = []
    for each in tables:
        links.append(_link(each, links, axes))
    names = [link.name for link in links]
    return tuple(links), _chain_end(table, "tool", names, names[-1]), _chain_end(table, "work", names, BED)


def _chain_end(table: TomlTable, key: str, names: list[str], usual: str) -> ChainEnd:
    inner = table.inner_or_empty(key)
    link = inner.read("link", usual)
    if link not in (*names, BED):
        raise inner.fault("link", f"is no link; links: {', '.join((BED, *names))}{near(link, names)}")
    made = ChainEnd(link, inner.read("angles") or (0.0, 0.0, 0.0), inner.read("offset") or (0.0, 0.0, 0.0))
    inner.done()
    return made


def _link(table: TomlTable, before: list[Link], axes: Mapping[str, Axis]) -> Link:
    module, axis = table.read("module", ""), table.read("axis", "")
    name = table.read("name", "") or axis or module
    if not name:
        raise InputError('a link needs a name, a module or an axis; add name = "..."', table.place())
    names = [link.name for link in before]
    if name in (*names, BED):
        raise InputError(f"two links are called {name!r}; give each a name of its own", table.place())
    parent = table.read("parent", names[-1] if names else BED)
    if parent not in (*names, BED):
        raise table.fault("parent", f"is no link before this one; those are {', '.join((BED, *names))}")
    made = Link(
        name, parent, module, axis, table.read("joint", ""), table.read("sign"),
        table.read("matrix"), table.read("angles"), table.read("offset"),
        table.read("error_angles") or (0.0, 0.0, 0.0), table.read("error_offset") or (0.0, 0.0, 0.0),
        table.read("limits"), table.read("interface", ""), table.read("parent_interface", ""), table.place(),
    )  # fmt: skip
    table.done()
    if made.matrix is not None and (made.angles or made.offset):
        raise table.fault("matrix", "says what angles and offset say, too; leave out one of them")
    if made.sign == 0:
        raise table.fault("sign", "must be 1 or -1")
    if axis:
        _check_axis(table, made, before, axes)
    elif made.joint or made.limits or "sign" in table:
        key = next(key for key in ("joint", "limits", "sign") if key in table)
        raise table.fault(key, "belongs to a link that moves; name its axis, or leave it out")
    return made


def _check_axis(table: TomlTable, link: Link, before: list[Link], axes: Mapping[str, Axis]) -> None:
    if link.axis not in axes:
        raise table.fault("axis", f"is no axis of the machine; axes: {', '.join(axes)}{near(link.axis, list(axes))}")
    axis = axes[link.axis]
    if (other := next((each.name for each in before if each.axis == link.axis), None)) is not None:
        raise table.fault("axis", f"moves link {other!r} already; an axis moves one link")
    if axis.is_spindle:
        raise table.fault("axis", "is a spindle, whose speed is measured; it moves no link")
    if link.joint:
        check_unit(link, axis, table.place("joint"))
    elif not link.module:
        raise InputError(f"joint is missing; say which number its axis changes: {', '.join(ENTRIES)}", table.place())
    if link.limits and not (axis.travel[0] <= link.limits[0] and link.limits[1] <= axis.travel[1]):
        raise table.fault("limits", f"must stay within the axis's travel, {axis.travel[0]:g} to {axis.travel[1]:g}")


def check_unit(link: Link, axis: Axis, place: str) -> None:
    """InputError where a joint that turns has an axis that is not in degrees, or the other way round."""
    if link.turns != (axis.unit == "deg"):
        kind = 'turns the link: its axis needs unit = "deg"' if link.turns else "shifts the link: its axis is in mm"
        raise InputError(f"joint = {link.joint!r} {kind}, and {axis.name} has {axis.unit!r}", place)


def path_to(links: Mapping[str, Link], end: str) -> list[str]:
    """The names of the links from the bed to one of them; none to the bed itself."""
    found = []
    while end in links:
        found.append(end)
        end = links[end].parent
    return found[::-1]
