"""The transformation of a link: equation (1) of mrm-control, from its six numbers and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for

_MOTION = 1e-6  # how far a matrix may be from a rotation


def transformation(numbers: Sequence[float]) -> np.ndarray:
    """The 4x4 matrix of XA, YA, ZA (degrees) and X, Y, Z (mm): shift · turn about z · about y · about x.

    Equation (1) of mrm-control with XA = γ, YA = β, ZA = α: each word turns about the axis that it names. (The paper's
    script writes α behind XA and γ behind ZA, which contradicts its own example; see docs/machines.md.)
    """
    with needed_for("kinematics"):
        from scipy.spatial.transform import Rotation
    xa, ya, za, *shift = numbers
    made = np.eye(4)
    made[:3, :3] = _exact(Rotation.from_euler("ZYX", [za, ya, xa], degrees=True).as_matrix())
    made[:3, 3] = shift
    return made


def numbers_of(matrix: np.ndarray | Sequence[Sequence[float]], place: str = "") -> list[float]:
    """XA, YA, ZA (degrees), X, Y, Z (mm) of a homogeneous transformation; InputError for what is no rigid motion.

    Where YA is ±90 degrees, XA and ZA turn about the same axis; XA is 0 then.
    """
    with needed_for("kinematics"):
        from scipy.spatial.transform import Rotation
    given = np.asarray(matrix, dtype=float)
    turn = given[:3, :3]
    proper = np.abs(turn @ turn.T - np.eye(3)).max() < _MOTION and np.linalg.det(turn) > 0
    if not proper or np.abs(given[3] - (0, 0, 0, 1)).max() > _MOTION:
        raise InputError(
            "the matrix is no rigid motion; its first three columns must be unit vectors square to each other and "
            "right-handed, and its last row 0 0 0 1",
            place,
        )
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # YA = ±90 degrees
        za, ya, xa = Rotation.from_matrix(turn).as_euler("ZYX", degrees=True)
    return [*(float(round(angle, 12)) for angle in (xa, ya, za)), *map(float, given[:3, 3])]


def inverted(matrix: np.ndarray) -> np.ndarray:
    """The inverse of a homogeneous transformation (…, 4, 4)."""
    made = np.zeros_like(matrix)
    turn = np.swapaxes(matrix[..., :3, :3], -1, -2)
    made[..., :3, :3] = turn
    made[..., :3, 3] = -(turn @ matrix[..., :3, 3:])[..., 0]
    made[..., 3, 3] = 1.0
    return made


def _exact(turn: np.ndarray) -> np.ndarray:
    """cos 90° is 6e-17 in floating point; entries so near to -1, 0 and 1 are those."""
    near = np.round(turn)
    return np.where(np.abs(turn - near) < 1e-15, near, turn)
