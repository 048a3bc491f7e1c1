"""From a machine's links to its kinematics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rds.core.errors import InputError
from rds.machines.kinematics.chain import Joint, joined
from rds.machines.kinematics.kinematics import TIP, ZERO, Kinematics
from rds.machines.kinematics.transform import inverted, numbers_of, transformation
from rds.machines.library import library_module
from rds.machines.link_table import ENTRIES, ChainEnd, Link, check_unit, path_to

if TYPE_CHECKING:
    from rds.machines.machine import Machine

Step = np.ndarray | Joint
_LETTERS = {letter: (False, k) for k, letter in enumerate("XYZ")}
_LETTERS |= {letter: (False, k) for k, letter in enumerate("UVW")}
_LETTERS |= {letter: (True, k) for k, letter in enumerate("ABC")}


def kinematics_of(machine: Machine) -> Kinematics:
    """The kinematics of a machine's links, or the identity where it has none. InputError for links that do not fit.

    Joints are the axes that move links, in the machine's order of axes; travel is theirs.
    """
    if not machine.links:
        return identity_of(machine)
    links = {link.name: resolved(link) for link in machine.links}
    for link in links.values():
        if link.axis:
            check_unit(link, machine.axes[link.axis], link.place)
    moving = {link.axis: link for link in links.values() if link.axis}
    names = [name for name in machine.axes if name in moving]
    numbers = {name: number for number, name in enumerate(names)}
    tool, work = machine.tool or ChainEnd(list(links)[-1]), machine.work or ChainEnd()
    to_tool, to_work = _path(links, tool.link), _path(links, work.link)
    while to_tool and to_work and to_tool[0] == to_work[0]:  # what carries both moves neither against the other
        to_tool, to_work = to_tool[1:], to_work[1:]
    steps = [step for link in to_work for step in steps_of(link, numbers)] + [_end(work)]
    backwards = [_backwards(step) for step in reversed(steps)]
    forwards = [step for link in to_tool for step in steps_of(link, numbers)] + [_end(tool)]
    travel = np.array([machine.axes[name].travel for name in names]).reshape(-1, 2)
    limits = np.array([moving[name].limits or machine.axes[name].travel for name in names]).reshape(-1, 2)
    ends = {name: (name, np.eye(4)) for name in links} | {TIP: (tool.link, _end(tool)), ZERO: (work.link, _end(work))}
    bodies = {
        name: joined([step for link in _path(links, on) for step in steps_of(link, numbers)] + [frame])
        for name, (on, frame) in ends.items()
    }
    turns = tuple(moving[name].turns for name in names)
    return Kinematics(machine.name, tuple(names), turns, travel, limits, joined(backwards + forwards), bodies)


def identity_of(machine: Machine) -> Kinematics:
    """The joints as coordinates: X, Y, Z (U, V, W) shift the tool along x, y, z and A, B, C turn it about them.

    It can be had of every machine, whatever its links are, so that its axes can always be moved one by one. An axis
    with another letter is a joint that moves nothing.
    """
    axes = [axis for axis in machine.axes.values() if not axis.is_spindle]
    turns = tuple(axis.unit == "deg" for axis in axes)
    steps: list[Step] = []
    for kind in (False, True):
        for number, axis in enumerate(axes):
            means = _LETTERS.get(axis.name[:1].upper())
            if means == (kind, means[1] if means else 0) and turns[number] == kind:
                steps.append(Joint(number, kind, means[1], 1))
    travel = np.array([axis.travel for axis in axes]).reshape(-1, 2)
    names = tuple(axis.name for axis in axes)
    chain = joined(steps)
    return Kinematics(machine.name, names, turns, travel, travel, chain, {TIP: chain, ZERO: joined([])})


def resolved(link: Link) -> Link:
    """The link with joint and transformation of its module where it says none itself."""
    if not link.module:
        return link
    module = library_module(link.module, link.place)
    if link.axis and not link.joint:
        if not module.joint:
            raise InputError(
                f"link {link.name!r} moves with {link.axis}, and its module {module.name} is fixed; say its joint, or "
                "leave out the axis",
                link.place,
            )
        link = replace(link, joint=module.joint)
    if link.matrix is None and link.angles is None and link.offset is None:
        link = replace(link, matrix=module.matrix, angles=module.angles, offset=module.offset)
    return link


def steps_of(link: Link, numbers: dict[str, int]) -> list[Step]:
    """The transformation of a resolved link as fixed matrices around its joint, errors included.

    Its six numbers are given + error, and that of its joint sign · q more: a shift acts before all turns of the link,
    a turn about z before those about y and x, as equation (1) has it.
    """
    if link.matrix is not None:
        values = numbers_of(link.matrix, link.place)
        if link.joint == "YA" and abs(abs(values[1]) - 90.0) < 1e-6:
            raise InputError(
                f"link {link.name!r} turns about y from YA = {values[1]:g} degrees, where a matrix does not tell XA "
                "from ZA; give angles and offset instead of the matrix",
                link.place,
            )
    else:
        values = [*(link.angles or (0.0, 0.0, 0.0)), *(link.offset or (0.0, 0.0, 0.0))]
    total = dict(zip(ENTRIES, np.add(values, [*link.error_angles, *link.error_offset]).tolist(), strict=True))
    if not link.axis:
        return [transformation(list(total.values()))]
    order = ("X", "Y", "Z", "ZA", "YA", "XA")  # of equation (1), the six from left to right
    place = order.index(link.joint)
    before = {key: total[key] if order.index(key) <= place or key in "XYZ" else 0.0 for key in ENTRIES}
    after = {key: 0.0 if order.index(key) <= place or key in "XYZ" else total[key] for key in ENTRIES}
    joint = Joint(numbers[link.axis], link.turns, "XYZ".index(link.joint[0]), link.sign)
    return [transformation(list(before.values())), joint, transformation(list(after.values()))]


def _path(links: dict[str, Link], end: str) -> list[Link]:
    """The links from the bed to one of them."""
    return [links[name] for name in path_to(links, end)]


def _end(end: ChainEnd) -> np.ndarray:
    return transformation([*end.angles, *end.offset])


def _backwards(step: Step) -> Step:
    return replace(step, sign=-step.sign) if isinstance(step, Joint) else inverted(step)
