"""Closed forms of the inverse: angles from the tool's direction or place, and shifts from what is left.

Angles by the subproblems of Paden and Kahan (Murray, Li, Sastry, A Mathematical Introduction to Robotic Manipulation,
section 3.3), for many poses at a time. With no, one or two joints that tilt the tool and up to three that shift it they
cover machines of linear axes, with one rotary table, and 5-axis machines with table or head turned, in any mounting.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rds.machines.kinematics.structure import Structure

if TYPE_CHECKING:
    from rds.machines.kinematics.kinematics import Kinematics

_UNDECIDED = 1e-7  # sine of the angle between tool and axis below which the axis may stand anywhere
_ROUNDED = 1e-15  # a square that is so small is rounding
DIRECTION = 1e-7  # how exactly a pose's direction is met, radians
PLACE = 1e-6  # and its place, mm


def angles_of_direction(structure: Structure, directions: np.ndarray, near: np.ndarray) -> list[np.ndarray]:
    """Angles (n, tilting), radians, that turn the tool into `directions` (n, 3): one or two solutions, NaN for none.

    `near` (n, joints) has the angle of a joint that the direction leaves undecided.
    """
    home = structure.tip[:3, 2]
    if not structure.tilting:
        return [np.zeros((len(directions), 0))]
    if len(structure.tilting) == 1:
        number = structure.tilting[0]
        k = structure.directions[number]
        angle = _angle(k, np.broadcast_to(home, directions.shape), directions, near[:, number])
        off = np.abs(directions @ k - home @ k) > DIRECTION
        return [np.where(off, np.nan, angle)[:, None]]
    first, second = structure.tilting
    k1, k2 = structure.directions[first], structure.directions[second]
    between, on_second = k1 @ k2, home @ k2
    on_first = directions @ k1
    square = 1.0 - between**2
    along1, along2 = (on_first - between * on_second) / square, (on_second - between * on_first) / square
    left = (1.0 - along1**2 - along2**2 - 2.0 * along1 * along2 * between) / square
    off = left < -DIRECTION
    height = np.sqrt(np.where(left < _ROUNDED, 0.0, left))
    solutions = []
    for sign in (1.0, -1.0):
        middle = along1[:, None] * k1 + along2[:, None] * k2 + (sign * height)[:, None] * np.cross(k1, k2)
        angle2 = _angle(k2, np.broadcast_to(home, directions.shape), middle, near[:, second])
        angle1 = _angle(k1, middle, directions, near[:, first])
        solutions.append(np.where(off[:, None], np.nan, np.column_stack([angle1, angle2])))
    return solutions


def angles_of_place(structure: Structure, places: np.ndarray, near: np.ndarray) -> list[np.ndarray]:
    """Angles (n, 1), radians, of the one joint that carries the tip, with two linear joints: two solutions.

    The linear joints reach a plane with normal m; the joint must turn the place into it: m·R(±θ)w = h, which is
    A cos θ + B sin θ = C.
    """
    number = structure.carrying[0]
    k, c = structure.directions[number], structure.points[number]
    m = np.cross(*structure.directions[list(structure.linear)])
    m /= np.linalg.norm(m)
    tip = structure.tip[:3, 3]
    if structure.form == "carried before":  # the linear joints stand on the turning one: turn the place back
        w, sign, height = places - c, -1.0, np.full(len(places), m @ (tip - c))
    else:
        w, sign, height = np.broadcast_to(tip - c, places.shape), 1.0, (places - c) @ m
    along = (m @ k) * (w @ k)
    a, b, rest = w @ m - along, sign * (np.cross(k, w) @ m), height - along
    size = np.hypot(a, b)
    undecided = size < PLACE
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = rest / size
    off = np.where(undecided, np.abs(rest) > PLACE, np.abs(ratio) > 1.0 + 1e-12)
    middle, half = np.arctan2(b, a), np.arccos(np.clip(np.where(undecided, 0.0, ratio), -1.0, 1.0))
    angles = (np.where(undecided, near[:, number], middle + way * half) for way in (1.0, -1.0))
    return [np.where(off, np.nan, angle)[:, None] for angle in angles]


def shifts_for(kinematics: Kinematics, structure: Structure, values: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Put the linear joints into `values` (n, joints; their own are 0 before), and say which rows meet their pose."""
    lost = np.isnan(values).any(axis=1)
    values[lost] = 0.0
    radians = kinematics.radians(values)
    at = kinematics.chain.forward(radians)
    missing = poses[:, :3, 3] - at[:, :3, 3]
    lost |= np.linalg.norm(poses[:, :3, 2] - at[:, :3, 2], axis=1) > DIRECTION
    if linear := list(structure.linear):
        ways = kinematics.chain.axes(radians)[0][:, linear]  # (n, linear, 3)
        grown = ways @ ways.swapaxes(1, 2)
        flat = np.linalg.det(grown) < _UNDECIDED
        grown[flat] = np.eye(len(linear))
        shift = np.linalg.solve(grown, ways @ missing[:, :, None])[:, :, 0]
        values[:, linear] = shift
        missing = missing - (shift[:, None] @ ways)[:, 0]
        lost |= flat
    return ~lost & (np.linalg.norm(missing, axis=1) < PLACE)


def _angle(k: np.ndarray, start: np.ndarray, end: np.ndarray, near: np.ndarray) -> np.ndarray:
    """The angle (n,) about k that turns `start` into `end` (n, 3); `near` where both are along k."""
    start, end = start - np.outer(start @ k, k), end - np.outer(end @ k, k)
    sine, cosine = np.cross(start, end) @ k, (start * end).sum(axis=1)
    return np.where(np.hypot(sine, cosine) < _UNDECIDED**2, near, np.arctan2(sine, cosine))
