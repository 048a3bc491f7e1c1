"""The inverse: in closed form where the structure allows, and by damped least squares otherwise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.core.extras import needed_for
from rds.machines.kinematics.closed_form import DIRECTION, PLACE, angles_of_direction, angles_of_place, shifts_for
from rds.machines.kinematics.structure import LENGTH, Structure, task_jacobian

if TYPE_CHECKING:
    from rds.machines.kinematics.kinematics import Kinematics

_OVER = 1e-9  # of a limit, for rounding: mm, degrees
_BLOCK = 4096  # poses at a time: what stays in the processor's cache
_STARTS = 30
_EVALUATIONS = 50  # a start that leads to a solution does so in some ten


def inverse(kinematics: Kinematics, poses: np.ndarray, near: np.ndarray | None, bounds: np.ndarray) -> np.ndarray:
    """Joint values (n, joints) in mm and degrees for poses (n, 4, 4); NaN where there are none within the bounds."""
    structure = kinematics.structure
    if structure.form:
        start = np.broadcast_to(kinematics.home if near is None else near, (len(poses), len(kinematics.joints)))
        parts = [slice(k, k + _BLOCK) for k in range(0, len(poses), _BLOCK)]
        made = [_closed(kinematics, structure, poses[part], start[part], bounds) for part in parts]
        return np.concatenate(made) if made else np.zeros((0, len(kinematics.joints)))
    return _numeric(kinematics, poses, near, bounds)


def _closed(
    kinematics: Kinematics, structure: Structure, poses: np.ndarray, near: np.ndarray, bounds: np.ndarray
) -> np.ndarray:
    """Angles first (two solutions at most), then the linear joints; the nearer solution that keeps the bounds."""
    turning = [*structure.tilting, *structure.carrying]
    radians = near * np.where(kinematics.turns, np.pi / 180.0, 1.0)
    if structure.carrying:
        solutions = angles_of_place(structure, poses[:, :3, 3], radians)
    else:
        solutions = angles_of_direction(structure, poses[:, :3, 2], radians)
    tries = []
    for solution in solutions:
        angles = _turned_near(np.degrees(solution), near[:, turning], bounds[turning])
        far = np.abs(angles - near[:, turning]).sum(axis=1) + np.where(np.isnan(angles).any(axis=1), np.inf, 0.0)
        tries.append((np.where(np.isnan(far), np.inf, far), angles))
    made = np.full(near.shape, np.nan)
    if len(tries) == 1:
        order = [np.zeros(len(near), dtype=int)]
    else:
        second = (tries[1][0] < tries[0][0]).astype(int)
        order = [second, 1 - second]
    left = np.arange(len(near))
    for choice in order:
        angles = tries[0][1] if len(tries) == 1 else np.where(choice[:, None] == 0, tries[0][1], tries[1][1])
        values = near[left].copy()
        values[:, turning] = angles[left]
        values[:, structure.linear] = 0.0
        good = shifts_for(kinematics, structure, values, poses[left])
        good &= _within(values, bounds, structure)
        made[left[good]] = values[good]
        left = left[~good]
        if not len(left):
            break
    return made


def _turned_near(angles: np.ndarray, near: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """The angles, whole turns added so that they are within the bounds, and there as near as can be; else NaN."""
    made = angles + 360.0 * np.round((near - angles) / 360.0)
    low, high = bounds.T
    made = np.where(made > high + _OVER, made - 360.0 * np.ceil((made - high - _OVER) / 360.0), made)
    made = np.where(made < low - _OVER, made + 360.0 * np.ceil((low - _OVER - made) / 360.0), made)
    return np.where((made > high + _OVER), np.nan, made)


def _within(values: np.ndarray, bounds: np.ndarray, structure: Structure) -> np.ndarray:
    used = [*structure.linear, *structure.tilting, *structure.carrying]
    low, high = bounds[used].T
    return ((values[:, used] >= low - _OVER) & (values[:, used] <= high + _OVER)).all(axis=1)


def _numeric(kinematics: Kinematics, poses: np.ndarray, near: np.ndarray | None, bounds: np.ndarray) -> np.ndarray:
    made = np.full((len(poses), len(kinematics.joints)), np.nan)
    start = kinematics.home
    for row, pose in enumerate(poses):
        begin = start if near is None else near[row if len(near) > 1 else 0]
        made[row] = _one(kinematics, pose, begin, bounds)
        if not np.isnan(made[row]).any():
            start = made[row]
    return made


def _one(kinematics: Kinematics, pose: np.ndarray, near: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Damped least squares within the bounds, from `near`, then from elsewhere."""
    with needed_for("an inverse that has no closed form"):
        from scipy.optimize import least_squares
    scale = np.where(kinematics.turns, np.pi / 180.0, 1.0)
    low, high = bounds.T

    def miss(values: np.ndarray) -> np.ndarray:
        at = kinematics.chain.forward((values * scale)[None])[0]
        return np.concatenate([at[:3, 3] - pose[:3, 3], LENGTH * (at[:3, 2] - pose[:3, 2])])

    def slope(values: np.ndarray) -> np.ndarray:
        return task_jacobian(kinematics, values[None])[0] * scale

    def met(values: np.ndarray) -> bool:
        missed = miss(values)
        return bool(np.linalg.norm(missed[:3]) < PLACE and np.linalg.norm(missed[3:]) < DIRECTION * LENGTH)

    first = np.clip(near, low, high)
    if met(first):
        return first
    others = np.random.default_rng(11).uniform(low, high, (_STARTS, len(low)))
    for start in (first, *others):
        inside = np.clip(start, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
        found = least_squares(
            miss, inside, slope, bounds=(low, high), method="dogbox", xtol=1e-15, ftol=1e-15, gtol=1e-15,
            max_nfev=_EVALUATIONS, x_scale=np.where(kinematics.turns, 10.0, LENGTH),
        ).x  # fmt: skip
        if met(found):
            return np.asarray(found)
    return np.full(len(low), np.nan)
