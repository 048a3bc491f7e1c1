"""Joints for a place of the tool's tip with rotary joints as given, and the tip's place for joints: many at a time.

With its rotary joints at an angle, the tip of any serial chain is an affine function of the joints that shift: p = p₀ +
Σ dᵢ qᵢ, with the directions dᵢ of those joints. With three of them this is solved as it stands; for the table-table
machines it is what `trtfuncs.c` of LinuxCNC writes out. With two, the one rotary joint that carries the tip about
follows from the place (`closed_form.angles_of_place`), in one of two branches.
"""

from __future__ import annotations

import numpy as np

from rds.core.errors import InputError
from rds.machines.kinematics.closed_form import angles_of_place
from rds.machines.kinematics.kinematics import Kinematics

AXES = ("X", "Y", "Z", "A", "B", "C")  # columns of positions, as in segments of a path
_FLAT = 1e-3  # volume of the unit directions below which three shifts no longer span the space
_MISSED = 1e-6  # mm
_STEPS = 12  # of Newton's method, for directions
_DAMPING = 0.02  # sine of the angle between tool and axis below which that axis corrects little: about one degree


class Tip:
    """The tip of one machine; positions are (n, 6), X Y Z A B C, mm and degrees, of which it has the joints' columns.

    `length` (mm) is how much longer the tool is than the machine's own. Raises InputError for a machine for which the
    joints do not follow from the tip's place.
    """

    def __init__(self, kinematics: Kinematics):
        self.kinematics = kinematics
        names = kinematics.joints
        others = [name for name in names if name not in AXES]
        turns = np.array(kinematics.turns, bool)
        self.columns = np.array([AXES.index(name) for name in names if name in AXES], int)
        self.absent = np.setdiff1d(np.arange(3), self.columns)  # of X Y Z
        self.linear, self.rotary = np.flatnonzero(~turns), np.flatnonzero(turns)
        self.follows = len(self.linear) == 2 and len(self.rotary) == 1  # the rotary joint follows from the place
        if others or not (len(self.linear) == 3 or (self.follows and kinematics.structure.form.startswith("carried"))):
            raise InputError(
                f"{kinematics.name} has the joints {', '.join(names)}: tool centre point control needs three linear "
                "axes X, Y, Z (or two, and a rotary one that carries work or tool about), and rotary ones among A, B, C"
            )
        self.branch = 0  # of the two solutions where the rotary joint follows

    def joints(self, positions: np.ndarray) -> np.ndarray:
        """Joint values (n, joints) in mm and radians, of positions of the joints."""
        return self.kinematics.radians(positions[:, self.columns])

    def places(self, positions: np.ndarray, length: float | np.ndarray = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Where the tip is (n, 3), mm in work coordinates, and the tool's directions (n, 3), of joints' positions."""
        return self._places(self.joints(positions), length)

    def _places(self, q: np.ndarray, length: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        poses = self.kinematics.chain.forward(q)
        z = poses[:, :3, 2]
        return poses[:, :3, 3] - np.reshape(length, (-1, 1)) * z, z

    def positions(self, wanted: np.ndarray, length: float, near: np.ndarray) -> np.ndarray:
        """The joints' positions that bring the tip to X Y Z of `wanted` with the rotary joints of `wanted`.

        Rows of NaN where there are none. `near` (6,) is where the joints are before the first row: a rotary joint that
        follows from the place goes on from there, from row to row, without a turn that nobody asked for.
        """
        q = self.joints(wanted)
        q[:, self.linear] = 0.0
        if self.follows:
            angle = self._angles(wanted[:, :3], length, self.joints(near[None])[0])
            q[:, self.rotary[0]] = angle
        start, _ = self._places(np.nan_to_num(q), length)
        directions = self.kinematics.chain.axes(np.nan_to_num(q))[0][:, self.linear]  # (n, linear, 3)
        away = wanted[:, :3] - start
        gram = directions @ directions.swapaxes(1, 2)
        flat = np.linalg.det(gram) < _FLAT**2
        gram[flat] = np.eye(len(self.linear))
        # of the square matrix itself where it is one: the normal equations would double the digits that are lost
        if len(self.linear) == 3:
            whole = directions.swapaxes(1, 2).copy()
            whole[flat] = np.eye(3)
            shifts = np.linalg.solve(whole, away[:, :, None])[:, :, 0]
        else:
            shifts = np.linalg.solve(gram, directions @ away[:, :, None])[:, :, 0]
        missed = np.abs(np.einsum("nij,ni->nj", directions, shifts) - away).max(axis=1) > _MISSED
        q[:, self.linear] = shifts
        found = wanted.copy()
        found[:, self.absent] = near[self.absent]
        found[:, self.columns] = q * np.where(self.kinematics.turns, 180.0 / np.pi, 1.0)
        given = self.columns[self.rotary]
        if not self.follows:
            found[:, given] = wanted[:, given]  # to the last digit
        found[flat | missed] = np.nan
        return found

    def _angles(self, places: np.ndarray, length: float, near: np.ndarray) -> np.ndarray:
        """Of the rotary joint that follows from the place: one branch, unwound from `near` on; radians."""
        structure, number = self.kinematics.structure, self.rotary[0]
        own = places + length * structure.tip[:3, 2]  # where the machine's own tool has its tip
        held = np.broadcast_to(near, (len(own), len(near)))
        both = [angle[:, 0] for angle in angles_of_place(structure, own, held)]
        angle = both[self.branch]
        whole = np.where(np.isnan(angle), near[number], angle)
        return np.where(np.isnan(angle), np.nan, np.unwrap(np.concatenate([near[number : number + 1], whole]))[1:])

    def begin(self, position: np.ndarray, length: float) -> np.ndarray:
        """The tip's position (6,) of the joints' position (6,), from which motion for the tip goes on."""
        place, _ = self.places(position[None], length)
        found = position.copy()
        found[:3] = place[0]
        if self.follows:
            misses = []
            for self.branch in (0, 1):
                again = self.positions(found[None], length, position)[0]
                misses.append(np.nan_to_num(np.abs(again - position).max(), nan=np.inf))
            self.branch = int(np.argmin(misses))
        return found

    def leverage(self, positions: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
        """How far the tip goes at most for 1 mm of the linear joints, and for 1 degree of the rotary ones (n,) each."""
        q = self.joints(positions)
        place, _ = self._places(q, length)
        directions, points = self.kinematics.chain.axes(q)
        shifts = np.linalg.norm(directions[:, self.linear].swapaxes(1, 2), ord=2, axis=(1, 2))
        arms = np.cross(directions[:, self.rotary], place[:, None] - points[:, self.rotary])
        return shifts, np.radians(np.sqrt((arms**2).sum(axis=(1, 2))))

    def corrected(self, positions: np.ndarray, places: np.ndarray, directions: np.ndarray, length: float) -> np.ndarray:
        """The joints' positions, from `positions` on, that bring tip and tool where wanted: the place exactly.

        The direction as nearly as the rotary joints can; a joint that hardly changes it stays (damped least squares).
        """
        found = positions.copy()
        columns = self.columns[self.rotary]
        for _ in range(_STEPS if len(self.rotary) and not self.follows else 0):
            q = self.joints(found)
            _, z = self._places(q, length)
            axes = self.kinematics.chain.axes(q)[0][:, self.rotary]
            jacobian = np.cross(axes, z[:, None]).swapaxes(1, 2)  # (n, 3, rotary)
            square = jacobian.swapaxes(1, 2) @ jacobian
            reach = np.einsum("nii->ni", square)
            damping = np.where(reach < _DAMPING**2, _DAMPING**2, 0.0)
            square += damping[:, :, None] * np.eye(len(columns))
            right = jacobian.swapaxes(1, 2) @ (directions - z)[:, :, None]
            step = np.degrees(np.linalg.solve(square, right)[:, :, 0])
            found[:, columns] += step
            if np.abs(step).max() < 1e-10:
                break
        wanted = found.copy()
        wanted[:, :3] = places
        return self.positions(wanted, length, positions[0])
