"""What a machine looks like: solids on the frames that its kinematics move, as the page draws them.

A machine whose file has links looks as its links say: a rail for each axis that shifts, a drum for each that turns, a
carriage on it, arms between them. One without links is drawn as a mill of three axes: a table on two slides, a head.
Lengths are in mm.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rds.core.types import SPINDLE_UNIT
from rds.machines import Machine
from rds.machines.kinematics.chain import Chain, Joint, joined
from rds.machines.kinematics.kinematics import TIP, ZERO
from rds.machines.link_table import BED

FRAME, SLIDE, TABLE, HEAD, TOOL = "#8A9099", "#6F7F90", "#56B4E9", "#E69F00", "#5A6068"


def scene_of(machine: Machine) -> dict[str, Any]:
    """Joints, frames, solids and arms of a machine, for the page.

    `frames` are chains from the bed by name: matrices (16 numbers, row by row) with a joint after each but the last,
    [number, turns, along, sign]. A solid is a box (its three edges) or a prism (radius, length) about a point of its
    frame; an arm goes from one frame's origin to another's. `table` is how high the table is in the work's frame.
    """
    made = _of_links(machine) if machine.links else _mill(machine)
    spindle = next((name for name, axis in machine.axes.items() if axis.unit == SPINDLE_UNIT), "")
    return made | {"tip": TIP, "work": ZERO, "spindle": spindle}


def _of_links(machine: Machine) -> dict[str, Any]:
    kinematics = machine.kinematics
    frames = {BED: joined([]), **kinematics.bodies}
    places = np.array([frame[0, :3, 3] for frame in kinematics.frames(kinematics.home[None]).values()])
    low, high = np.vstack([places, np.zeros(3)]).min(axis=0), np.vstack([places, np.zeros(3)]).max(axis=0)
    size = max(float((high - low).max()), 100.0)
    solids, arms = [_box(BED, (0.5 * size, 0.5 * size, 0.03 * size), (0.0, 0.0, -0.015 * size), FRAME)], []
    works = {*_branch(machine, machine.work.link if machine.work else BED)}
    for link in machine.links:
        chain = frames[link.name]
        color = TABLE if link.name in works else HEAD
        if link.axis and chain.joints:
            joint, rail = chain.joints[-1], f"rail of {link.name}"
            frames[rail] = Chain(chain.fixed[:-1], chain.joints[:-1])
            least, most = machine.axes[link.axis].travel
            solids.append(_rail(rail, joint, least, most, size))
            arms.append((link.parent, rail, 0.05 * size, FRAME))
        else:
            arms.append((link.parent, link.name, 0.05 * size, FRAME))
        solids.append(_box(link.name, (0.1 * size, 0.1 * size, 0.06 * size), (0.0, 0.0, 0.0), color))
    arms.append((machine.tool.link if machine.tool else machine.links[-1].name, TIP, 0.04 * size, HEAD))
    arms.append((machine.work.link if machine.work else BED, ZERO, 0.05 * size, TABLE))
    solids.append(_box(ZERO, (0.3 * size, 0.3 * size, 0.02 * size), (0.0, 0.0, -0.01 * size), TABLE))
    solids += _tool(size)
    middle = (low + high) / 2.0
    return {
        "joints": list(kinematics.joints),
        "turns": list(map(bool, kinematics.turns)),
        "frames": {name: _as_numbers(chain) for name, chain in frames.items()},
        "solids": solids,
        "arms": [{"from": a, "to": b, "width": width, "color": color} for a, b, width, color in arms],
        "size": size,
        "middle": middle.tolist(),
        "table": 0.0,
    }


def _mill(machine: Machine) -> dict[str, Any]:
    """A column with a head, before it a table on two slides; at zero the tip touches the work's zero."""
    names = [name for name, axis in machine.axes.items() if axis.unit == "mm"][:3]
    travel = [machine.axes[name].travel for name in names] + [(-50.0, 50.0)] * (3 - len(names))
    (x0, x1), (y0, y1), (z0, z1) = travel
    wide, deep, high = x1 - x0, y1 - y0, z1 - z0
    size = max(wide, deep, high)
    numbers = dict(zip("XYZ", range(len(names)), strict=False))

    def chain(*moves: tuple[str, int]) -> Chain:
        """Of the axes that the machine has."""
        along = {"X": 0, "Y": 1, "Z": 2}
        return joined([Joint(numbers[name], False, along[name], sign) for name, sign in moves if name in numbers])

    frames = {
        BED: chain(),
        "saddle": chain(("Y", -1)),
        "table": chain(("Y", -1), ("X", -1)),
        "head": chain(("Z", 1)),
        TIP: chain(("Z", 1)),
        ZERO: chain(("Y", -1), ("X", -1)),
    }
    thick, top = 0.06 * size, z0
    back = y1 + 0.62 * size  # of the column's middle, clear of the table
    ground = top - 3.6 * thick
    tall = z1 + 0.75 * size - ground
    solids = [
        _box(BED, (0.9 * size, 1.15 * deep + size, 1.2 * thick), (0, 0.4 * size, ground - 0.6 * thick), FRAME),
        _box(BED, (0.42 * size, 0.3 * size, tall), (0, back, ground + tall / 2), FRAME),
        _box(BED, (0.16 * size, 0.05 * size, 0.8 * tall), (0, back - 0.17 * size, ground + 0.58 * tall), SLIDE),
        _box(BED, (0.5 * size, 1.05 * deep + 0.3 * size, thick), (0, 0, ground + 0.5 * thick), SLIDE),
        _box("saddle", (1.02 * wide + 0.3 * size, 0.5 * size, thick), (0, 0, ground + 1.6 * thick), SLIDE),
        _box("table", (0.75 * size, 0.5 * size, 1.4 * thick), (0, 0, top - 0.7 * thick), TABLE),
        _box("head", (0.3 * size, 0.26 * size, 0.42 * size), (0, back - 0.3 * size, 0.5 * size), HEAD),
        _box("head", (0.22 * size, back - 0.1 * size, 0.14 * size), (0, (back - 0.1 * size) / 2, 0.52 * size), HEAD),
        *_tool(size),
    ]
    return {
        "joints": names,
        "turns": [False] * len(names),
        "frames": {name: _as_numbers(each) for name, each in frames.items()},
        "solids": solids,
        "arms": [],
        "size": 1.5 * size,
        "table": top,
        "middle": [0.0, 0.25 * size, (z0 + z1) / 2.0 + 0.15 * size],
    }


def _tool(size: float) -> list[dict[str, Any]]:
    """A spindle and a tool over the tip; the page gives the tool its diameter."""
    return [
        _prism(TIP, 0.06 * size, 0.28 * size, 0.16 * size, HEAD) | {"spins": True},
        _prism(TIP, 0.025 * size, 0.06 * size, 0.1 * size, TOOL) | {"spins": True},
        _prism(TIP, 0.012 * size, 0.1 * size, 0.0, TOOL) | {"spins": True, "tool": True},
    ]


def _rail(frame: str, joint: Joint, least: float, most: float, size: float) -> dict[str, Any]:
    """What a carriage goes along, or turns on."""
    if joint.turns:
        return _prism(frame, 0.11 * size, 0.05 * size, -0.025 * size, SLIDE) | {"along": joint.along}
    edges, at = [0.05 * size] * 3, [0.0] * 3
    edges[joint.along], at[joint.along] = most - least + 0.12 * size, joint.sign * (least + most) / 2.0
    return _box(frame, tuple(edges), tuple(at), SLIDE)


def _box(frame: str, edges: Any, at: Any, color: str) -> dict[str, Any]:
    return {"frame": frame, "kind": "box", "size": list(map(float, edges)), "at": list(map(float, at)), "color": color}


def _prism(frame: str, radius: float, length: float, begin: float, color: str) -> dict[str, Any]:
    """Along z from `begin` on."""
    return {"frame": frame, "kind": "prism", "size": [radius, length], "at": [0.0, 0.0, begin], "color": color}


def _as_numbers(chain: Chain) -> dict[str, Any]:
    return {
        "fixed": [matrix.ravel().tolist() for matrix in chain.fixed],
        "joints": [[joint.number, int(joint.turns), joint.along, joint.sign] for joint in chain.joints],
    }


def _branch(machine: Machine, end: str) -> list[str]:
    """The links from the bed to that one."""
    parents = {link.name: link.parent for link in machine.links}
    found = []
    while end in parents:
        found.append(end)
        end = parents[end]
    return found
