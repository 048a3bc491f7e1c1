"""What a machine's joints do to the tool, found from its chain: which tilt it, which carry it about, which are free.

Written with the product of exponentials: with all joints at zero a joint is a direction k and a point c, and the tip is
where the joints' motions, one after another, take its place at zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rds.machines.kinematics.kinematics import Kinematics

_SMALL = 1e-9
_POSES = 16
LENGTH = 100.0  # mm: how long a lever makes a turn of one radian as large as a shift


@dataclass(frozen=True)
class Structure:
    """Joints by what they do. `form` names the closed form of the inverse; empty: there is none."""

    linear: tuple[int, ...]
    tilting: tuple[int, ...]  # they change the tool's direction; in the order from the work to the tool
    carrying: tuple[int, ...]  # they turn about the tool's direction and carry the tip along
    free: tuple[int, ...]  # they do nothing that linear joints do not do
    directions: np.ndarray  # (joints, 3) at zero
    points: np.ndarray  # (joints, 3) at zero
    tip: np.ndarray  # (4, 4) at zero
    rank: int  # of the task: independent motions of tip and direction at nearly all poses
    form: str = ""


def task_jacobian(kinematics: Kinematics, values: np.ndarray) -> np.ndarray:
    """What the joints do to the task (n, 6, joints): tip in mm, direction in 1/100, per mm and per radian."""
    jacobian = kinematics.jacobian(values)
    z = kinematics.chain.forward(kinematics.radians(values))[:, :3, 2]
    tilting = np.cross(jacobian[:, 3:].swapaxes(1, 2), z[:, None]).swapaxes(1, 2)
    return np.concatenate([jacobian[:, :3], LENGTH * tilting], axis=1)


def structure_of(kinematics: Kinematics) -> Structure:
    """What the joints of a machine do, from random poses of all its travel."""
    low, high = kinematics.travel.T
    poses = np.random.default_rng(7).uniform(low, high, (_POSES, len(kinematics.joints)))
    task = task_jacobian(kinematics, poses)
    rank = int(np.linalg.matrix_rank(task, tol=1e-7 * LENGTH).max())
    order = [joint.number for joint in kinematics.chain.joints]
    moves = [n for n in order if np.abs(task[:, :, n]).max() > _SMALL * LENGTH]
    linear = tuple(n for n in moves if not kinematics.turns[n])
    tilting = tuple(n for n in moves if kinematics.turns[n] and np.abs(task[:, 3:, n]).max() > 1e-7)
    carrying = tuple(n for n in moves if kinematics.turns[n] and n not in tilting)
    shifts = int(np.linalg.matrix_rank(task[:, :3, list(linear)], tol=1e-7).max()) if linear else 0
    if shifts == 3:  # the linear joints do what a carrying one does
        carrying = ()
    moved = (*linear, *tilting, *carrying)
    free = tuple(n for n in range(len(kinematics.joints)) if n not in moved)
    zero = np.zeros((1, len(kinematics.joints)))
    directions, points = kinematics.chain.axes(zero)
    found = Structure(
        linear, tilting, carrying, free, directions[0], points[0], kinematics.chain.forward(zero)[0], rank,
    )  # fmt: skip
    return Structure(**(found.__dict__ | {"form": _form(found, order, shifts)}))


def _form(structure: Structure, order: list[int], shifts: int) -> str:
    if len(structure.linear) != shifts or structure.rank == 0:
        return ""
    if not structure.carrying and len(structure.tilting) <= 2:
        first, last = structure.tilting[:1], structure.tilting[1:]
        if last and abs(structure.directions[first[0]] @ structure.directions[last[0]]) > 1.0 - _SMALL:
            return ""
        return "tilting"
    if len(structure.carrying) == 1 and not structure.tilting and shifts == 2:
        place = order.index(structure.carrying[0])
        before = [order.index(n) < place for n in structure.linear]
        return "carried after" if all(before) else "" if any(before) else "carried before"
    return ""
