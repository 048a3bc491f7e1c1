"""The inverse: in closed form where the structure allows, and by damped least squares otherwise.

Our own, beside scipy's, because `least_squares` takes one start at a time, and from most starts an arm of six joints
ends in another valley; here 64 starts go together, up to 25 times faster.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.machines.kinematics.closed_form import DIRECTION, PLACE, angles_of_direction, angles_of_place, shifts_for
from rds.machines.kinematics.structure import LENGTH, Structure

if TYPE_CHECKING:
    from rds.machines.kinematics.kinematics import Kinematics

_OVER = 1e-9  # of a limit, for rounding: mm, degrees
_BLOCK = 4096  # poses at a time: what stays in the processor's cache
_AT_ONCE = 256  # poses whose free joint is turned at a time, each to 150 angles
_STARTS, _ROUNDS = 64, 3
_STEPS = 60
_SINGULAR = 1e-6  # of the largest singular value, and of a motion that leaves the tool where it is
_TURN, _GRID, _HALVINGS = 360.0, 5.0, 40  # degrees: how far a free joint may turn, and by which steps it is tried
_DAMPING = 1e-2  # at first, of the square of a joint's lever


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
    outside: dict[int, np.ndarray] = {}
    for choice in order:
        angles = tries[0][1] if len(tries) == 1 else np.where(choice[:, None] == 0, tries[0][1], tries[1][1])
        values = near[left].copy()
        values[:, turning] = angles[left]
        values[:, structure.linear] = 0.0
        met = shifts_for(kinematics, structure, values, poses[left])
        good = met & _within(values, bounds, structure)
        made[left[good]] = values[good]
        outside = dict(zip(left[met & ~good], values[met & ~good], strict=True)) | outside  # the nearer stays
        left = left[~good]
        if not len(left):
            break
    _turn_free_joints(kinematics, structure, poses, made, outside, bounds)
    return made


def _turn_free_joints(
    kinematics: Kinematics,
    structure: Structure,
    poses: np.ndarray,
    made: np.ndarray,
    outside: dict[int, np.ndarray],
    bounds: np.ndarray,
) -> None:
    """Solve the rows that meet their pose `outside` the bounds alone, where a free joint brings the linear ones back.

    Below an upright tool a rotary table may stand anywhere; where `near` has it, a slide may be beyond its end.
    """
    rows = np.array([row for row in outside if np.isnan(made[row]).any()], dtype=int)
    if not len(rows) or not structure.linear:
        return
    values = np.array([outside[row] for row in rows])
    slope = _missed(kinematics, poses[rows[0]], values)[1]
    still = np.eye(len(bounds)) - np.linalg.pinv(slope, rcond=_SINGULAR) @ slope  # what leaves the tool where it is
    moves = np.abs(still[:, list(structure.linear)]).max(axis=(1, 2)) > _SINGULAR
    turns = (np.abs(still).max(axis=2) > _SINGULAR) & np.array(kinematics.turns)
    for joint in np.flatnonzero(kinematics.turns):
        some = np.flatnonzero(moves & turns[:, joint] & np.isnan(made[rows]).any(axis=1))
        for k in range(0, len(some), _AT_ONCE):
            part = some[k : k + _AT_ONCE]
            motion = _SelfMotion(kinematics, structure, poses[rows[part]], values[part], bounds, int(joint))
            made[rows[part]] = motion.nearest()


class _SelfMotion:
    """Joint values at which the tool stays where it is: one free rotary joint turns, and the linear joints follow."""

    def __init__(
        self,
        kinematics: Kinematics,
        structure: Structure,
        poses: np.ndarray,
        values: np.ndarray,
        bounds: np.ndarray,
        joint: int,
    ):
        self._kinematics, self._structure, self._poses, self._values = kinematics, structure, poses, values
        self._bounds, self._joint, self._linear = bounds, joint, list(structure.linear)

    def nearest(self) -> np.ndarray:
        """The values (n, joints) at the angle nearest to the present one that keeps the bounds; NaN where none does."""
        grid = np.arange(-_TURN, _TURN + _GRID, _GRID)
        angles = self._values[:, [self._joint]] + grid
        beyond = self._at(angles)[1]
        rows = np.arange(len(angles))
        # narrow ranges lie between two angles of the grid: towards the least way beyond
        best, width = angles[rows, beyond.argmin(axis=1)], _GRID
        for _ in range(_HALVINGS):
            tried = best[:, None] + width * np.array([-0.5, 0.0, 0.5])
            best, width = tried[rows, self._at(tried)[1].argmin(axis=1)], 0.6 * width
        angles, beyond = np.column_stack([angles, best]), np.column_stack([beyond, self._at(best[:, None])[1]])
        away = np.where(beyond <= _OVER, np.abs(angles - self._values[:, [self._joint]]), np.inf)
        inside = angles[rows, away.argmin(axis=1)]
        step = -np.sign(inside - self._values[:, self._joint]) * _GRID
        for _ in range(_HALVINGS):  # back towards the present angle, as far as the bounds let it
            step = 0.5 * step
            good = self._at((inside + step)[:, None])[1][:, 0] <= 0.0
            inside = np.where(good, inside + step, inside)
        made = self._at(inside[:, None])[0][:, 0]
        made[np.isinf(away).all(axis=1)] = np.nan
        return made

    def _at(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (n, angles, joints) at these angles (n, angles), and how far the worst joint is beyond its bounds."""
        count = angles.shape[1]
        values = np.repeat(self._values, count, axis=0)
        values[:, self._joint], values[:, self._linear] = angles.ravel(), 0.0
        met = shifts_for(self._kinematics, self._structure, values, np.repeat(self._poses, count, axis=0))
        used = [*self._linear, self._joint]
        low, high = self._bounds[used].T
        beyond = np.maximum(low - values[:, used], values[:, used] - high).max(axis=1)
        beyond[~met] = np.inf
        return values.reshape(*angles.shape, -1), beyond.reshape(angles.shape)


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
    """From `near`; where that ends elsewhere, from many starts at once, of whose solutions the nearest to `near`."""
    low, high = bounds.T
    found, met = _descended(kinematics, pose, np.clip(near, low, high)[None], bounds)
    random = np.random.default_rng(11)
    for _ in range(_ROUNDS):
        if met.any():
            break
        found, met = _descended(kinematics, pose, random.uniform(low, high, (_STARTS, len(low))), bounds)
    if not met.any():
        return np.full(len(low), np.nan)
    far = np.abs((found[met] - near) / _unit(kinematics)).sum(axis=1)
    return np.asarray(found[met][np.argmin(far)])


def _descended(
    kinematics: Kinematics, pose: np.ndarray, starts: np.ndarray, bounds: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, joints) that damped least squares reaches from each start within the bounds, until one meets the pose.

    Also which of them meet it.
    """
    unit = _unit(kinematics)
    low, high = (bounds / unit[:, None]).T
    x = np.clip(starts / unit, low, high)
    missed, slope = _missed(kinematics, pose, x * unit)
    damping = np.full(len(x), _DAMPING)
    for _ in range(_STEPS):
        off = np.linalg.norm(missed.reshape(-1, 2, 3), axis=2)
        met = (off[:, 0] < PLACE) & (off[:, 1] < DIRECTION * LENGTH)
        if met.any():
            return x * unit, met
        downhill = -(missed[:, None] @ slope)[:, 0]
        held = ((x <= low) & (downhill < 0.0)) | ((x >= high) & (downhill > 0.0))  # at a bound, and pressed against it
        free = np.where(held[:, None], 0.0, slope)
        square = free.swapaxes(1, 2) @ free + (damping * LENGTH**2)[:, None, None] * np.eye(len(unit))
        step = np.linalg.solve(square, np.where(held, 0.0, downhill)[:, :, None])[:, :, 0]
        tried = np.clip(x + step, low, high)
        after, steeper = _missed(kinematics, pose, tried * unit)
        better = (after**2).sum(axis=1) < (missed**2).sum(axis=1)
        x[better], missed[better], slope[better] = tried[better], after[better], steeper[better]
        damping = np.clip(np.where(better, damping / 5.0, damping * 5.0), 1e-14, 1e6)
    return x * unit, np.zeros(len(x), dtype=bool)


def _unit(kinematics: Kinematics) -> np.ndarray:
    """How many mm or degrees of each joint count alike: LENGTH, and a radian."""
    return np.where(kinematics.turns, 180.0 / np.pi, LENGTH)


def _missed(kinematics: Kinematics, pose: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By how much the tool misses the pose (n, 6): mm, and LENGTH times the difference of the directions.

    Also how that changes with the joints (n, 6, joints), per LENGTH and per radian.
    """
    at, axes, points = kinematics.chain.forward_and_axes(kinematics.radians(values))
    missed = np.concatenate([at[:, :3, 3] - pose[:3, 3], LENGTH * (at[:, :3, 2] - pose[:3, 2])], axis=1)
    turns = np.array(kinematics.turns)[:, None]
    shifts = np.where(turns, np.cross(axes, at[:, None, :3, 3] - points), LENGTH * axes)
    tilts = np.where(turns, LENGTH * np.cross(axes, at[:, None, :3, 2]), 0.0)
    return missed, np.concatenate([shifts, tilts], axis=2).swapaxes(1, 2)
