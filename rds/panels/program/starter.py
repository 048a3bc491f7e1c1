"""The text that a new part program begins with: one that the page's machine can run."""

from __future__ import annotations

from rds.interpolators.motion.segments import AXES
from rds.machines import Machine

SQUARE = """\
(a square with one round corner; lengths in mm, feeds in mm/min)
G21 G90 G17 G40 G49 G80 G94
G64 P0.02
S3000 M3
G0 X0 Y0 Z5
G1 Z-1 F300
X20
Y10
G3 X10 Y20 I-10
G1 X0
Y0
G0 Z5
M5
M30
"""
_REACH = {"X": (0.0, 20.0), "Y": (0.0, 20.0), "Z": (-1.0, 5.0)}  # mm, of the square
_FEED, _SPEED = 300.0, 3000.0  # mm/min, rev/min, of the square
_FARTHEST = 20.0  # mm or degrees, where each axis goes by itself


def starter(machine: Machine) -> str:
    """The square where `machine` can mill it, else a move of each of its axes from zero and back."""
    return SQUARE if _mills_the_square(machine) else _each_axis(machine)


def _mills_the_square(machine: Machine) -> bool:
    for name, (low, high) in _REACH.items():
        axis = machine.axes.get(name)
        if axis is None or axis.limits is None or axis.limits.velocity * 60.0 < _FEED:
            return False
        if low < axis.travel[0] or high > axis.travel[1]:
            return False
    return any(axis.unit == "rev/min" and axis.travel[1] >= _SPEED for axis in machine.axes.values())


def _each_axis(machine: Machine) -> str:
    lines = [
        "(each axis from zero and back; lengths in mm, angles in degrees, feeds in mm/min, degrees/min)",
        "G21 G90 G94",
    ]
    for name in AXES:
        axis = machine.axes.get(name)
        if axis is None or axis.limits is None:
            continue
        low, high = axis.travel
        way = min(max(high, -low) / 4.0, _FARTHEST)
        feed = 60.0 * axis.limits.velocity / 2.0
        lines += [f"G1 {name}{way if high >= -low else -way:.3f} F{feed:.3f}", f"{name}0"]
    return "\n".join([*lines, "M30", ""])
