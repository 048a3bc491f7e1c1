"""Where a machine's tool can be, and where its joints lose a direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.extras import needed_for
from rds.machines.kinematics.structure import LENGTH, task_jacobian

if TYPE_CHECKING:
    from rds.machines.kinematics.kinematics import Kinematics

SINGULAR = 1e-4  # smallest singular value of the task, where a regular pose has about 1
_GRID = 4000  # poses
_POLISHED = 12


@dataclass(frozen=True)
class Workspace:
    """Places (n, 3) of the tool's tip relative to the work, mm, and the box around them."""

    points: np.ndarray
    low: np.ndarray  # (3,)
    high: np.ndarray  # (3,)
    tilt: float  # degrees: the largest angle between the tool and its direction with the joints at home

    @property
    def is_empty(self) -> bool:
        """Whether the tool can be nowhere but in one place and one direction."""
        return bool((self.high - self.low).max() < 1e-9 and self.tilt < 1e-9)


def workspace(kinematics: Kinematics, within: str = "limits", n: int = 20_000, seed: int = 0) -> Workspace:
    """Where the tip can be: within "travel" the reachable workspace, within "limits" the operational one.

    From n random poses and all corners of the joints' ranges.
    """
    low, high = kinematics.range(within).T
    q = np.random.default_rng(seed).uniform(low, high, (n, len(low)))
    corners = np.array(np.meshgrid(*np.stack([low, high], 1), indexing="ij")).reshape(len(low), -1).T
    poses = kinematics.forward(np.concatenate([q, corners[: 2**12]]))
    points, z = poses[:, :3, 3], poses[:, :3, 2]
    home = kinematics.forward(kinematics.home)[:3, 2]
    tilt = np.degrees(np.arccos(np.clip(z @ home, -1.0, 1.0))).max() if np.ptp(z, axis=0).max() > 1e-12 else 0.0
    return Workspace(points, points.min(axis=0), points.max(axis=0), float(tilt))


def regularity(kinematics: Kinematics, values: np.ndarray) -> np.ndarray:
    """How far poses (n, joints) are from singular ones (n,): 0 where the joints lose a direction, about 1 elsewhere.

    The smallest singular value that is not zero at nearly all poses, of the task's Jacobian with lengths in 100 mm.
    """
    rank = kinematics.structure.rank
    if not rank:
        return np.zeros(len(values))
    task = task_jacobian(kinematics, values) / LENGTH
    task[:, :, ~np.array(kinematics.turns)] *= LENGTH  # a joint that shifts by 100 mm
    return np.asarray(np.linalg.svd(task, compute_uv=False)[:, rank - 1])


def singularities(kinematics: Kinematics, within: str = "travel") -> list[dict[str, float]]:
    """Singular poses, as joint values by name: one of each kind that a search from a grid of poses finds.

    Only the joints that matter are named: those whose change ends the singularity.
    """
    with needed_for("a search for singular poses"):
        from scipy.optimize import minimize
    low, high = kinematics.range(within).T
    q = np.concatenate([np.random.default_rng(5).uniform(low, high, (_GRID, len(low))), kinematics.home[None]])
    span = high - low
    found: dict[tuple[str, ...], dict[str, float]] = {}

    def far(x: Any) -> float:
        return float(regularity(kinematics, (low + np.clip(x, 0, 1) * span)[None])[0])

    precise: Any = {"xatol": 1e-10, "fatol": 1e-10, "maxiter": 600}
    for start in q[np.argsort(regularity(kinematics, q))[:_POLISHED]]:
        best = minimize(far, (start - low) / span, method="Nelder-Mead", options=precise).x
        at = low + np.clip(best, 0, 1) * span
        if regularity(kinematics, at[None])[0] < SINGULAR:
            names = _that_matter(kinematics, at, span)
            found.setdefault(tuple(names), {name: round(float(at[i]), 3) + 0.0 for name, i in names.items()})
    return list(found.values())


def _that_matter(kinematics: Kinematics, at: np.ndarray, span: np.ndarray) -> dict[str, int]:
    """The joints without whose value the pose is regular."""
    made = {}
    for number, name in enumerate(kinematics.joints):
        moved = np.repeat(at[None], 2, axis=0)
        moved[:, number] += np.array([0.013, -0.017]) * span[number]
        if regularity(kinematics, moved).min() > SINGULAR:
            made[name] = number
    return made
