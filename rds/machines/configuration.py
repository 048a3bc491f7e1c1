"""The verdict on a configuration: whether links and modules make a machine, and if not, which module and why.

mrm-control, section 5, and OACS thesis, sections 4.2, 7.1 and 8.4. Whatever the verdict, the axes can be moved one by
one (`identity_of`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.machines.kinematics.build import kinematics_of, resolved
from rds.machines.kinematics.kinematics import Kinematics
from rds.machines.kinematics.workspace import workspace
from rds.machines.library import LibraryModule, library_module, told_module
from rds.machines.link_table import BED, Link, path_to
from rds.machines.machine import Machine, load_machine

_POSES, _POSES_NUMERIC = 200, 30
_SMALL = 1e-6
ROUND_TRIP = 1e-5  # mm: how far the tool may stand from where it was after inverse and forward
JUMP = 1e-4  # mm or degrees: how far a joint may go where nothing is to move


@dataclass(frozen=True)
class Check:
    """One question of the verdict: `passed` is None where it could not be asked. `link` is the one at fault."""

    name: str
    passed: bool | None
    text: str
    link: str = ""


@dataclass(frozen=True)
class Verdict:
    """The answer to all questions."""

    machine: str
    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """Whether the links make a machine."""
        return all(check.passed is not False for check in self.checks)

    @property
    def faults(self) -> list[Check]:
        """The checks that failed."""
        return [check for check in self.checks if check.passed is False]

    def to_json(self) -> dict[str, Any]:
        """As a table of plain values."""
        return {"machine": self.machine, "ok": self.ok, "checks": [check.__dict__ for check in self.checks]}

    def __str__(self) -> str:
        if self.ok:
            return f"{self.machine} is a machine: " + "; ".join(check.text for check in self.checks if check.passed)
        return f"{self.machine} is no machine: " + "; ".join(fault.text for fault in self.faults)


Finding = tuple[str, str]  # link at fault, and why


def verdict(machine: Machine | str | Path) -> Verdict:
    """Whether the links of a machine, or of the one of a name or file, make one.

    InputError for modules that the library does not have.
    """
    machine = machine if isinstance(machine, Machine) else load_machine(machine)
    if not machine.links:
        return Verdict(
            machine.name, (Check("chain", None, "it has no links: its axes are all that is known"), _IDENTITY)
        )
    links = {link.name: resolved(link) for link in machine.links}
    modules = _modules(machine, links)
    checks: list[Check] = []

    def ask(name: str, right: str, findings: Iterator[Finding]) -> None:
        found = list(findings)
        checks.extend(Check(name, False, text, link) for link, text in found)
        if not found:
            checks.append(Check(name, True, right))

    count = sum(bool(link.axis) for link in links.values())
    ask("chain", f"the chain of {len(links)} links and {count} joints is complete", _chain(machine, links))
    ask("order", "the tool is at one end and the work at the other", _order(machine, links, modules))
    if modules:
        unknown = [name for name in links if name not in modules]
        said = f" (not known of {', '.join(unknown)})" if unknown else ""
        ask("interfaces", f"every interface fits its neighbour's{said}", _interfaces(links, modules))
        ask("accessories", "accessories are where they may be", _accessories(machine, links, modules))
    else:
        checks.append(Check("interfaces", None, "no link names its module: interfaces are not checked"))
    try:
        kinematics = kinematics_of(machine)
    except InputError as error:
        return Verdict(machine.name, (*checks, Check("chain", False, str(error)), _IDENTITY))
    if not kinematics.joints:
        return Verdict(machine.name, (*checks, _IDENTITY))
    ask("motion", "every joint moves the tool in a way of its own", _motion(machine, kinematics, links))
    ask("tool", "the joints move the tool as it works", _feeds(machine, kinematics, links, modules))
    checks += _numbers(kinematics)
    return Verdict(machine.name, (*checks, _IDENTITY))


def _modules(machine: Machine, links: dict[str, Link]) -> dict[str, LibraryModule]:
    """What is known of the links' modules: by what they say of themselves, else by the library."""
    found = {}
    for name, link in links.items():
        axis = machine.axes.get(link.axis or name)
        known = library_module(link.module, link.place) if link.module else None
        if module := told_module(axis.module, known) if axis is not None else known:
            found[name] = module
    return found


_IDENTITY = Check("identity", True, "its axes can be moved one by one")


def _ends(machine: Machine) -> tuple[str, str]:
    tool = machine.tool.link if machine.tool else machine.links[-1].name
    return tool, machine.work.link if machine.work else BED


def _chain(machine: Machine, links: dict[str, Link]) -> Iterator[Finding]:
    tool, work = _ends(machine)
    if tool == work:
        yield tool, f"tool and work are both on {tool}: nothing can move between them"
    used = {*path_to(links, tool), *path_to(links, work)}
    for name in links:
        if name not in used:
            yield (
                name,
                f"link {name!r} leads neither to the tool nor to the work; remove it, or mount one of them on it",
            )
    if not any(link.axis for link in links.values()):
        yield "", "no link has an axis: nothing moves; there must be one axis at least"


def _order(machine: Machine, links: dict[str, Link], modules: dict[str, LibraryModule]) -> Iterator[Finding]:
    tool, work = _ends(machine)
    for name, module in modules.items():
        carried = [other for other, link in links.items() if link.parent == name]
        if module.kind == "head" and name != tool:
            yield (
                name,
                f"{name!r} is a cutting head ({module.name}) in the middle of the chain; it must be its end, the tool",
            )
        if module.kind in ("head", "table") and carried:
            yield (
                carried[0],
                f"{carried[0]!r} is mounted on {name!r}, a {module.kind} ({module.name}), which carries no module",
            )
        if module.kind == "table" and name != work:
            yield name, f"{name!r} is a work table ({module.name}), and the work is on {work!r}"
    if tool in modules and modules[tool].kind != "head":
        said = f"the tool is on {tool!r}, a module of kind {modules[tool].kind} ({modules[tool].name})"
        yield tool, f"{said}; mount a cutting head on it"


def _interfaces(links: dict[str, Link], modules: dict[str, LibraryModule]) -> Iterator[Finding]:
    taken: dict[tuple[str, str], str] = {}
    for name, link in links.items():
        for owner, chosen in ((name, link.interface), (link.parent, link.parent_interface)):
            if chosen and owner in modules and chosen not in modules[owner].interfaces:
                known = ", ".join(modules[owner].interfaces)
                yield name, f"{owner!r} ({modules[owner].name}) has no interface {chosen!r}; it has {known}"
                return
        own = modules[name].interface(link.interface, last=False) if name in modules else None
        if own is not None and taken.setdefault((name, own.name), link.parent) != link.parent:
            yield name, f"interface {own.name} of {name!r} is taken twice"
        if link.parent not in modules:
            continue
        below = modules[link.parent].interface(link.parent_interface, last=True)
        other = taken.setdefault((link.parent, below.name), name)
        if other != name:
            yield name, f"{name!r} and {other!r} are both on interface {below.name} of {link.parent!r}"
        if own is not None and not own.fits(below):
            yield name, f"{name!r} ({modules[name].name}: {own}) does not fit on {link.parent!r} ({below})"


def _accessories(machine: Machine, links: dict[str, Link], modules: dict[str, LibraryModule]) -> Iterator[Finding]:
    for name, module in modules.items():
        if module.kind != "accessory":
            continue
        below = modules.get(links[name].parent)
        if module.mounts_on and below is not None and below.kind not in module.mounts_on:
            allowed = " or ".join(module.mounts_on)
            yield (
                name,
                f"{name!r} ({module.name}) may be mounted on a {allowed} module, not on a {below.kind} ({below.name})",
            )
        carried = [other for other, link in links.items() if link.parent == name]
        if not carried and name not in _ends(machine):
            yield name, f"{name!r} ({module.name}) carries nothing"
        for other in carried:
            if module.carries and other in modules and modules[other].kind not in module.carries:
                allowed = " or a ".join(module.carries)
                yield other, f"{name!r} ({module.name}) may carry a {allowed}, not a {modules[other].kind} ({other!r})"


def _motion(machine: Machine, kinematics: Kinematics, links: dict[str, Link]) -> Iterator[Finding]:
    """A joint that adds no motion to those nearer to the tool, at any pose."""
    jacobian = kinematics.jacobian(kinematics.random(16, seed=1))
    carriers = {link.axis: link.name for link in links.values() if link.axis}
    kept: list[int] = []
    for number in [joint.number for joint in reversed(kinematics.chain.joints)]:
        name = kinematics.joints[number]
        before = np.linalg.matrix_rank(jacobian[:, :, kept], tol=_SMALL).max() if kept else 0
        if np.linalg.matrix_rank(jacobian[:, :, [*kept, number]], tol=_SMALL).max() > before:
            kept.append(number)
            continue
        does = "turns" if kinematics.turns[number] else "shifts"
        said = f"{name} {does} the tool in a direction in which the modules nearer to the tool do already"
        yield carriers[name], f"{said}: leave it out, or mount it in another direction"


def _feeds(
    machine: Machine, kinematics: Kinematics, links: dict[str, Link], modules: dict[str, LibraryModule]
) -> Iterator[Finding]:
    """A drill needs a slide along its axis, a turning tool one across it."""
    tool, _ = _ends(machine)
    if tool not in modules or not modules[tool].feeds:
        return
    q = kinematics.random(16, seed=2)
    jacobian, z = kinematics.jacobian(q)[:, :3], kinematics.forward(q)[:, :3, 2]
    slides = jacobian[:, :, [not turns for turns in kinematics.turns]]
    along = np.abs(np.einsum("nij,ni->nj", slides, z))
    across = np.linalg.norm(slides - z[:, :, None] * np.einsum("nij,ni->nj", slides, z)[:, None], axis=1)
    able: dict[str, Callable[[], bool]] = {
        "along": lambda: bool(along.size and along.max() > _SMALL),
        "across": lambda: bool((across.size and across.max() > _SMALL) or any(kinematics.turns)),
    }
    ways = modules[tool].feeds
    if not any(able[way]() for way in ways):
        names = [name for name, turns in zip(kinematics.joints, kinematics.turns, strict=True) if not turns]
        where = "square to" if ways[0] == "along" else "along"
        said = f"{', '.join(names)} shift it {where} its axis" if names else "there is no linear axis"
        works = f"the tool on {tool!r} ({modules[tool].name}) works {' or '.join(ways)} its axis"
        yield tool, f"{works}, and no slide moves it so: {said}"


def _numbers(kinematics: Kinematics) -> list[Check]:
    """Forward and inverse at random poses, and how large the workspace is."""
    count = _POSES if kinematics.structure.form else _POSES_NUMERIC
    q = np.concatenate([kinematics.random(count, seed=3), kinematics.home[None]])
    poses = kinematics.forward(q)
    made = []
    again = kinematics.inverse(poses)
    lost = int(np.isnan(again).any(axis=1).sum())
    met = kinematics.forward(np.nan_to_num(again))[~np.isnan(again).any(axis=1)]
    given = poses[~np.isnan(again).any(axis=1)]
    off = float(np.abs(met[:, :3, 3] - given[:, :3, 3]).max()) if len(met) else 0.0
    aim = float(np.degrees(np.abs(met[:, :3, 2] - given[:, :3, 2]).max())) if len(met) else 0.0
    closed = "in closed form" if kinematics.structure.form else "numerically"
    if lost:
        text = f"the inverse finds no joint values for {lost} of {len(q)} poses that the joints can take"
        made.append(Check("inverse", False, text))
    elif off > ROUND_TRIP or aim > ROUND_TRIP:
        text = f"forward and inverse do not agree: the tool is off by {off:.3g} mm and {aim:.3g} degrees"
        made.append(Check("inverse", False, text))
    else:
        text = f"the inverse ({closed}) returns to {len(q)} random poses within {max(off, 1e-12):.1e} mm"
        made.append(Check("inverse", True, text))
    jumps = np.abs(kinematics.inverse(poses, near=q) - q)
    far = np.unravel_index(np.argmax(np.nan_to_num(jumps, nan=np.inf)), jumps.shape)
    if not jumps[far] <= JUMP:
        name = kinematics.joints[far[1]]
        text = f"{name} would jump by {jumps[far]:.3g} where tool coordinates are switched on"
        made.append(Check("switching", False, text, name))
    else:
        made.append(Check("switching", True, "switching to tool coordinates moves no joint"))
    room = workspace(kinematics, n=4000)
    size = " x ".join(f"{extent:.4g}" for extent in room.high - room.low)
    tilt = f", tilted by up to {room.tilt:.3g} degrees" if room.tilt else ""
    if room.is_empty:
        made.append(Check("workspace", False, "the workspace is empty: the tool stays in one place"))
    else:
        made.append(Check("workspace", True, f"the tool reaches {size} mm{tilt}"))
    return made
