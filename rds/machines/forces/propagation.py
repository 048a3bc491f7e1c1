"""Force and torque from the tool's tip to the joints, link by link (mrm-control, equations 6 to 9).

    ⁱfᵢ = R ⁱ⁺¹fᵢ₊₁        ⁱnᵢ = R ⁱ⁺¹nᵢ₊₁ + ⁱPᵢ₊₁ × ⁱfᵢ        τᵢ = fᵢ·Zᵢ (a joint that shifts), nᵢ·Zᵢ (one that turns)

R and P are those of the transformation between two links, Z the joint's axis. f and n are what the outer link exerts on
the inner one, so that a load is what the process does to the joint in its positive direction; its motor gives the
opposite.
"""

from __future__ import annotations

import numpy as np

from rds.machines.kinematics import Kinematics
from rds.machines.kinematics.chain import Joint, turned
from rds.machines.kinematics.kinematics import Joints

PER_METRE = 1000.0  # mm


def joint_loads(
    kinematics: Kinematics, joints: Joints, force: np.ndarray, torque: np.ndarray | None = None
) -> np.ndarray:
    """Loads (n, joints) of joint values (n, joints): N where a joint shifts, N m where it turns.

    `force` (n, 3) or (3,), N, and `torque`, N m, act on the tool at its tip, in the work's directions.
    """
    q = kinematics.radians(joints)
    n = len(q)
    turn = kinematics.chain.forward(q)[:, :3, :3]
    f = _inside(turn, np.broadcast_to(np.asarray(force, dtype=float), (n, 3)))
    m = np.zeros((n, 3))
    if torque is not None:
        m = _inside(turn, np.broadcast_to(np.asarray(torque, dtype=float) * PER_METRE, (n, 3)))
    loads = np.zeros((n, len(kinematics.joints)))
    chain = kinematics.chain
    for joint, fixed in zip(reversed((None, *chain.joints)), reversed(chain.fixed), strict=True):
        f, m = _inwards(fixed[None, :3, :3], fixed[None, :3, 3], f, m)
        if joint is not None:
            f, m = _inwards(*_step(joint, q[:, joint.number]), f, m)
            loads[:, joint.number] = joint.sign * (m[:, joint.along] / PER_METRE if joint.turns else f[:, joint.along])
    return loads


def _inwards(turn: np.ndarray, shift: np.ndarray, f: np.ndarray, m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Equations 6 and 7 over one transformation."""
    f = np.einsum("nij,nj->ni", np.broadcast_to(turn, (len(f), 3, 3)), f)
    m = np.einsum("nij,nj->ni", np.broadcast_to(turn, (len(m), 3, 3)), m)
    return f, m + np.cross(shift, f)


def _step(joint: Joint, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and shifts (n, 3) of a joint of value q (n,)."""
    value, shift = joint.sign * q, np.zeros((len(q), 3))
    if joint.turns:
        return turned(np.eye(3)[:, :, None], joint.along, value).transpose(2, 0, 1), shift
    shift[:, joint.along] = value
    return np.broadcast_to(np.eye(3), (len(q), 3, 3)), shift


def _inside(turn: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) of the outer frame in the directions of the inner one."""
    found: np.ndarray = np.einsum("nji,nj->ni", turn, vector)
    return found
