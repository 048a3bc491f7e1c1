"""Kinematics of one machine: where its joints take the tool relative to the work, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import near as near_word
from rds.machines.kinematics.chain import Chain
from rds.machines.kinematics.transform import inverted

if TYPE_CHECKING:
    from rds.machines.kinematics.structure import Structure

TIP, ZERO = "tool tip", "work zero"  # frames beside those of the links
Joints = np.ndarray | Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Kinematics:
    """The chain from the work to the tool, with its joints by name.

    Joint values are arrays (n, joints) in the order of `joints`, or (joints,) for one pose, or a value by name; in mm,
    and in degrees where `turns`. The pose is that of the tool's tip relative to the work; its z axis points from the
    tip into the tool. `travel` (joints, 2) is what the axes can do, `limits` what they may do (RF02 of a script).
    """

    name: str
    joints: tuple[str, ...]
    turns: tuple[bool, ...]
    travel: np.ndarray
    limits: np.ndarray
    chain: Chain  # from the work's zero to the tool's tip
    bodies: dict[str, Chain]  # from the bed to each link's frame, to the tool's tip and to the work's zero

    def __repr__(self) -> str:
        joints = zip(self.joints, self.turns, self.travel, strict=True)
        said = [f"{name} {low:g} to {high:g} {'deg' if turns else 'mm'}" for name, turns, (low, high) in joints]
        return f"<Kinematics {self.name}: {', '.join(said)}>"

    def values(self, joints: Joints) -> np.ndarray:
        """Joint values as an array (n, joints); those that a mapping does not name are 0. InputError for others."""
        if isinstance(joints, Mapping):
            for name in joints:
                if name not in self.joints:
                    known = ", ".join(self.joints)
                    raise InputError(f"{self.name} has no joint {name!r}; it has {known}{near_word(name, self.joints)}")
            return np.array([[float(joints.get(name, 0.0)) for name in self.joints]])
        made = np.asarray(joints, dtype=float)
        if made.ndim not in (1, 2) or made.shape[-1] != len(self.joints):
            raise InputError(
                f"joint values of shape {made.shape} must be (n, {len(self.joints)}): {', '.join(self.joints)}"
            )
        return made.reshape(-1, len(self.joints))

    def radians(self, joints: Joints) -> np.ndarray:
        """Joint values (n, joints) in mm and radians."""
        return self.values(joints) * np.where(self.turns, np.pi / 180.0, 1.0)

    def forward(self, joints: Joints) -> np.ndarray:
        """Poses (n, 4, 4) of the tool's tip relative to the work; (4, 4) for one pose."""
        made = self.chain.forward(self.radians(joints))
        return made if np.ndim(joints) == 2 else made[0]  # type: ignore[arg-type]

    def frames(self, joints: Joints, relative_to: str = "bed") -> dict[str, np.ndarray]:
        """Frames (n, 4, 4) of all links, "tool tip" and "work zero", relative to the bed or to one of them."""
        q = self.radians(joints)
        made = {name: body.forward(q) for name, body in self.bodies.items()}
        if relative_to == "bed":
            return made
        if relative_to not in made:
            known = ["bed", *made]
            raise InputError(f"there is no frame {relative_to!r}; frames: {', '.join(known)}")
        back = inverted(made[relative_to])
        return {"bed": back} | {name: back @ frame for name, frame in made.items()}

    def axes(self, joints: Joints) -> tuple[np.ndarray, np.ndarray]:
        """Directions and points (n, joints, 3) of the joints' axes relative to the work.

        A direction says where the tool goes (relative to the work) when the joint grows; zero for a joint that moves
        neither.
        """
        return self.chain.axes(self.radians(joints))

    def jacobian(self, joints: Joints) -> np.ndarray:
        """The geometric Jacobian (n, 6, joints) at the tool's tip, in the work's directions.

        Rows: velocity of the tip, then angular velocity of the tool; columns: per mm/s of a joint that shifts, per
        rad/s of one that turns. Its transpose brings a force (N) and torque (N·mm) at the tip to the joints.
        """
        at, directions, points = self.chain.forward_and_axes(self.radians(joints))
        tip = at[:, None, :3, 3]
        turns = np.array(self.turns)[None, :, None]
        linear = np.where(turns, np.cross(directions, tip - points), directions)
        return np.concatenate([linear, np.where(turns, directions, 0.0)], axis=2).swapaxes(1, 2)

    def inverse(self, poses: np.ndarray, near: Joints | None = None, within: str = "limits") -> np.ndarray:
        """Joint values (n, joints) that bring the tip to the poses (n, 4, 4), and the tool into their z direction.

        The tool's own turn about its axis is free. Of several solutions the one nearest to `near` (by default the
        joints' zero, and the row before where there is no closed form) within "limits" or "travel"; a pose that cannot
        be reached gives a row of NaN. (joints,) for one pose (4, 4).
        """
        from rds.machines.kinematics.inverse import inverse

        given = np.asarray(poses, dtype=float)
        if given.ndim not in (2, 3) or given.shape[-2:] != (4, 4):
            raise InputError(f"poses of shape {given.shape} must be (n, 4, 4)")
        bounds = self.range(within)
        start = None if near is None else self.values(near)
        made = inverse(self, given.reshape(-1, 4, 4), start, bounds)
        return made if given.ndim == 3 else made[0]

    def range(self, within: str) -> np.ndarray:
        """Ranges (joints, 2): "limits" or "travel"; InputError for another word."""
        if within not in ("limits", "travel"):
            raise InputError(f"within = {within!r} is unknown; known: limits, travel")
        return self.limits if within == "limits" else self.travel

    def random(self, n: int, seed: int = 0) -> np.ndarray:
        """Joint values (n, joints), uniform within the limits."""
        low, high = self.limits.T
        return np.random.default_rng(seed).uniform(low, high, (n, len(self.joints)))

    @cached_property
    def structure(self) -> Structure:
        """What its joints do to the tool, and whether its inverse has a closed form."""
        from rds.machines.kinematics.structure import structure_of

        return structure_of(self)

    @property
    def home(self) -> np.ndarray:
        """Joint values (joints,) of zero, or the middle of the limits where zero is not within them."""
        low, high = self.limits.T
        return np.where((low <= 0.0) & (high >= 0.0), 0.0, (low + high) / 2.0)


def pose(position: Any, direction: Any = (0.0, 0.0, 1.0)) -> np.ndarray:
    """Poses (n, 4, 4) of positions (n, 3), mm, and tool directions (n, 3) or (3,), from the tip into the tool."""
    positions = np.atleast_2d(np.asarray(position, dtype=float))
    z = np.broadcast_to(np.asarray(direction, dtype=float), positions.shape)
    length = np.linalg.norm(z, axis=1, keepdims=True)
    if not (length > 0.0).all():
        raise InputError("the tool's direction must not be 0 0 0; upright is 0 0 1")
    z = z / length
    across = np.where(np.abs(z[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    y = np.cross(z, across)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    made = np.zeros((len(z), 4, 4))
    made[:, :3, 0], made[:, :3, 1], made[:, :3, 2] = np.cross(y, z), y, z
    made[:, :3, 3], made[:, 3, 3] = positions, 1.0
    return made
