"""Forward and inverse of a million poses of the 4- and the 5-axis mill, beside Pinocchio and plain numpy per pose."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, atan2, cos, radians, sin
from time import perf_counter

import numpy as np

from benchmarks.figures import Figure
from rds.machines import Machine, load_machine
from rds.machines.urdf import TIP, ZERO, urdf_text

POSES = 1_000_000
FEW = 20_000  # of a peer that takes one pose at a time; its time is told for a million
ROUNDS = 3
MACHINES = {"mrm-mill-4": "4 axes", "xyzac": "5 axes"}


def run() -> list[Figure]:
    """Seconds for a million poses; both sides must agree."""
    return [figure for name, axes in MACHINES.items() for figure in _of(load_machine(name), axes)]


def _of(machine: Machine, axes: str) -> list[Figure]:
    kinematics = machine.kinematics
    q = kinematics.random(POSES, seed=1)
    poses = kinematics.forward(q)
    np.testing.assert_allclose(kinematics.inverse(poses, near=q), q, atol=1e-4)
    per_pose = _five_axes if machine.name == "xyzac" else _four_axes
    found = np.array([per_pose(pose) for pose in poses[:FEW]])
    np.testing.assert_allclose(kinematics.forward(found)[:, :3, 3], poses[:FEW, :3, 3], atol=1e-6)
    few = _timed(lambda: [per_pose(pose) for pose in poses[:FEW]], POSES / FEW)
    return [
        Figure(f"forward, {axes}", "s", _timed(lambda: kinematics.forward(q))),
        _pinocchio(machine, q[:FEW], poses[:FEW], axes),
        Figure(f"inverse, {axes}", "s", _timed(lambda: kinematics.inverse(poses, near=q))),
        Figure(f"inverse, {axes}, numpy per pose", "s", few, note=f"of {FEW:,} poses"),
    ]


def _timed(work: Callable[[], object], scale: float = 1.0) -> tuple[float, ...]:
    seconds = []
    for _ in range(ROUNDS):
        begun = perf_counter()
        work()
        seconds.append(scale * (perf_counter() - begun))
    return tuple(seconds)


def _pinocchio(machine: Machine, q: np.ndarray, poses: np.ndarray, axes: str) -> Figure:
    """Its forward kinematics of the same chain, read from our URDF, called from Python pose by pose."""
    name = f"forward, {axes}, Pinocchio"
    try:
        import pinocchio
    except ImportError:
        return Figure(name, note="pip install pin to measure it")
    kinematics = machine.kinematics
    model = pinocchio.buildModelFromXML(urdf_text(machine))
    data = model.createData()
    tip, zero = model.getFrameId(TIP), model.getFrameId(ZERO)
    order = [kinematics.joints.index(joint) for joint in list(model.names)[1:]]
    rows = (q * np.where(kinematics.turns, np.pi / 180.0, 1e-3))[:, order]

    def pose(row: np.ndarray) -> object:
        pinocchio.forwardKinematics(model, data, row)
        frame = pinocchio.updateFramePlacement(model, data, tip)
        return pinocchio.updateFramePlacement(model, data, zero).actInv(frame)

    theirs = np.array([pose(row).translation for row in rows[:100]]) * 1e3  # type: ignore[attr-defined]
    np.testing.assert_allclose(theirs, poses[:100, :3, 3], atol=1e-9)
    return Figure(name, "s", _timed(lambda: [pose(row) for row in rows], POSES / FEW), note=f"of {FEW:,} poses")


_ROT, _OFFSET, _LENGTH = np.array([0.0, 0.0, -80.0]), np.array([0.0, 20.0, 10.0]), np.array([0.0, 0.0, 50.0])


def _five_axes(pose: np.ndarray) -> list[float]:
    """The inverse of xyzac as a text book writes it, for one pose."""
    i, j, k = pose[:3, 2]
    a, c = acos(min(max(k, -1.0), 1.0)), atan2(i, -j)
    tilt = np.array([[1, 0, 0], [0, cos(a), sin(a)], [0, -sin(a), cos(a)]])
    table = np.array([[cos(c), sin(c), 0], [-sin(c), cos(c), 0], [0, 0, 1]])
    slides = tilt @ (table @ (pose[:3, 3] - _ROT) - _OFFSET) + _OFFSET + _LENGTH + _ROT
    return [*slides, a / radians(1.0), c / radians(1.0)]


_CENTRE = np.array([0.0, 10.0, -40.0])  # of the rotary axis's frame, where the tip is zero with all axes at zero


def _four_axes(pose: np.ndarray) -> list[float]:
    """The inverse of mrm-mill-4: A from the tool's direction, the slides from what is left."""
    a = atan2(-pose[1, 2], pose[2, 2])
    tilt = np.array([[1, 0, 0], [0, cos(a), sin(a)], [0, -sin(a), cos(a)]])
    slides = tilt @ (pose[:3, 3] - _CENTRE) + _CENTRE
    return [*slides, a / radians(1.0)]
