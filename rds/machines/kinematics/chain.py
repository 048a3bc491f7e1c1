"""A serial chain from the work to the tool: fixed transformations and joints in turn, multiplied for many poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_SAME = np.eye(3)
_BLOCK = 4096  # poses at a time: what stays in the processor's cache


@dataclass(frozen=True)
class Joint:
    """A joint: a shift along, or a turn about, x, y or z of the frame that it stands in."""

    number: int  # of the joint in the machine's order
    turns: bool
    along: int  # 0, 1, 2: x, y, z
    sign: int  # 1, or -1 where the joint counts against it


@dataclass(frozen=True)
class Chain:
    """`fixed[0]`, joint 0, `fixed[1]`, joint 1, ... `fixed[-1]`: one fixed matrix more than joints.

    Joints take mm, and radians.
    """

    fixed: tuple[np.ndarray, ...]  # (4, 4) each
    joints: tuple[Joint, ...]

    def forward(self, q: np.ndarray) -> np.ndarray:
        """Poses (n, 4, 4) of the end of the chain for joint values (n, j) in mm and radians."""
        made = np.zeros((len(q), 4, 4))
        made[:, 3, 3] = 1.0
        for part in _parts(len(q)):
            turn, shift = self._walk(q[part])
            made[part, :3, :3] = turn.transpose(2, 0, 1)
            made[part, :3, 3] = shift.T
        return made

    def axes(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Directions and points (n, j, 3) of the joints' axes, in the frame in which the chain begins.

        The direction is that of a positive joint value, in the machine's order of joints.
        """
        return self.forward_and_axes(q)[1:]

    def forward_and_axes(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What `forward` and `axes` give, by one walk along the chain."""
        made, directions, points = np.zeros((len(q), 4, 4)), np.zeros((*q.shape, 3)), np.zeros((*q.shape, 3))
        made[:, 3, 3] = 1.0
        for part in _parts(len(q)):
            turn, shift = self._walk(q[part], directions[part], points[part])
            made[part, :3, :3] = turn.transpose(2, 0, 1)
            made[part, :3, 3] = shift.T
        return made, directions, points

    def _walk(
        self, q: np.ndarray, directions: np.ndarray | None = None, points: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3, n or 1) and shift (3, n or 1) at the end; the axes on the way are written where asked for.

        The poses stand last, so that each number of a frame is one array in memory.
        """
        turn, shift = self.fixed[0][:3, :3, None], self.fixed[0][:3, 3:]
        for joint, fixed in zip(self.joints, self.fixed[1:], strict=True):
            if directions is not None and points is not None:
                directions[:, joint.number] = joint.sign * turn[:, joint.along].T
                points[:, joint.number] = shift.T
            value = joint.sign * q[:, joint.number]
            if joint.turns:
                turn = turned(turn, joint.along, value)
            else:
                shift = shift + turn[:, joint.along] * value
            if fixed[:3, 3].any():
                shift = shift + np.einsum("ijn,j->in", turn, fixed[:3, 3])
            if not np.array_equal(fixed[:3, :3], _SAME):
                turn = np.einsum("ijn,jk->ikn", turn, fixed[:3, :3])
        return turn, shift


def turned(turn: np.ndarray, along: int, angle: np.ndarray) -> np.ndarray:
    """Rotations behind a turn about their own x, y or z: the two columns square to it turn in their plane."""
    cosine, sine = np.cos(angle), np.sin(angle)
    first, second = (along + 1) % 3, (along + 2) % 3
    made = np.empty((3, 3, len(angle)))
    made[:, along] = turn[:, along]
    made[:, first] = turn[:, first] * cosine + turn[:, second] * sine
    made[:, second] = turn[:, second] * cosine - turn[:, first] * sine
    return made


def _parts(n: int) -> list[slice]:
    return [slice(start, start + _BLOCK) for start in range(0, n, _BLOCK)]


def joined(steps: list[np.ndarray | Joint]) -> Chain:
    """A chain of matrices and joints in any order, neighbouring matrices multiplied."""
    fixed, joints = [np.eye(4)], []
    for step in steps:
        if isinstance(step, Joint):
            joints.append(step)
            fixed.append(np.eye(4))
        else:
            fixed[-1] = fixed[-1] @ step
    return Chain(tuple(fixed), tuple(joints))
