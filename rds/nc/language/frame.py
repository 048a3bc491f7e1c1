"""Where the program's coordinates lie in the machine's, and moves turned from the one into the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rds.interpolators.motion.segments import FULL_CIRCLE, LINE, SEGMENT, XY, YZ, ZX, in_plane
from rds.nc.language.canon import ARC, TRAVERSE

INCH = 25.4  # mm
PLANES = {"XY": XY, "XZ": ZX, "YZ": YZ}  # canon's names
PLANE_WORDS = {"XY": "G17", "XZ": "G18", "YZ": "G19"}
SYSTEMS = ("", "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
DECIMALS = 9  # of machine positions: an axis that stands still does so in whatever units it was sent there
_NO_WAY = 2e-9  # mm or degrees; less is what that rounding may leave


class Frame:
    """Units, plane and offsets in force; offsets are kept in mm and degrees whatever the program's units become."""

    def __init__(self) -> None:
        self.unit = 1.0  # mm per program unit
        self.plane = "XY"
        self.system = "G54"
        self.rotation = 0.0  # degrees
        self._origin = np.zeros(6)
        self._g92 = np.zeros(6)
        self._tool = np.zeros(6)

    @property
    def plane_word(self) -> str:
        return PLANE_WORDS[self.plane]

    def set_units(self, name: str) -> None:
        """MM or INCHES."""
        self.unit = {"MM": 1.0, "INCHES": INCH}[name]

    def set_origin(self, index: int, values: Sequence[Any]) -> None:
        self.system = SYSTEMS[int(index)]
        self._origin = self._offset(values)

    def set_g92(self, values: Sequence[Any]) -> None:
        self._g92 = self._offset(values)

    def set_tool_length(self, values: Sequence[Any]) -> None:
        self._tool = self._offset(values)

    def _offset(self, values: Sequence[Any]) -> np.ndarray:
        offset = np.zeros(6)
        offset[: min(len(values), 6)] = values[:6]  # a tool's offset has U V W as well, which nothing here has
        offset[:3] *= self.unit
        return offset

    def to_machine(self, points: np.ndarray) -> np.ndarray:
        """Positions (n × 6, mm and degrees) of the program in machine coordinates."""
        moved = points + self._g92
        if self.rotation:
            cosine, sine = np.cos(np.radians(self.rotation)), np.sin(np.radians(self.rotation))
            moved[:, :2] = np.column_stack(
                (moved[:, 0] * cosine - moved[:, 1] * sine, moved[:, 0] * sine + moved[:, 1] * cosine)
            )
        return np.round(moved + self._origin + self._tool, DECIMALS)


def segments_of(rows: np.ndarray, position: np.ndarray, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Segments for rows of moves (dtype MOTION without RATE) from `position` on, without rates and modes.

    Also which of them are arcs that lie in no plane of the machine, which are given as lines.
    """
    values = rows["values"]
    arcs = np.flatnonzero(rows["kind"] == ARC)
    first, second, normal = in_plane(PLANES[frame.plane])
    ends = values[:, :6].copy()
    of_arcs = np.empty((len(arcs), 6))
    of_arcs[:, [first, second, normal, 3, 4, 5]] = values[arcs][:, [0, 1, 5, 6, 7, 8]]
    ends[arcs] = of_arcs
    ends[:, :3] *= frame.unit

    segments = np.zeros(len(rows), SEGMENT)
    segments["line"] = rows["line"]
    segments["rapid"] = rows["kind"] == TRAVERSE
    segments["plane"] = LINE
    segments["end"] = frame.to_machine(ends)
    segments["start"][0] = position
    segments["start"][1:] = segments["end"][:-1]
    way = segments["end"] - segments["start"]
    linear, rotary = np.sqrt(np.sum(way[:, :3] ** 2, axis=1)), np.sqrt(np.sum(way[:, 3:] ** 2, axis=1))
    segments["length"] = np.where(linear > _NO_WAY, linear, np.where(rotary > _NO_WAY, rotary, 0.0))

    tilted = np.zeros(len(rows), bool)
    if len(arcs) and frame.plane != "XY" and frame.rotation % 360.0:
        tilted[arcs] = True
    elif len(arcs):
        centres = np.zeros((len(arcs), 6))
        centres[:, [first, second]] = values[arcs][:, [2, 3]] * frame.unit
        bend(segments, arcs, PLANES[frame.plane], frame.to_machine(centres)[:, :3], values[arcs, 4])
    return segments, tilted


def only_rotary(segments: np.ndarray) -> np.ndarray:
    """Which segments move only A, B, C: their length and rate are in degrees."""
    way = segments["end"][:, :3] - segments["start"][:, :3]
    return (segments["plane"] == LINE) & (np.sum(way**2, axis=1) <= _NO_WAY**2)


def bend(segments: np.ndarray, arcs: np.ndarray, plane: int, centres: np.ndarray, turns: np.ndarray) -> None:
    """Make arcs of the lines at the indices `arcs`: sweep and length from centre (machine, X Y Z) and signed turns."""
    first, second, normal = in_plane(plane)
    start, end = segments["start"][arcs], segments["end"][arcs]
    centres = centres.copy()
    centres[:, normal] = start[:, normal]
    arm_1, arm_2 = start[:, first] - centres[:, first], start[:, second] - centres[:, second]
    arrival = np.arctan2(end[:, second] - centres[:, second], end[:, first] - centres[:, first])
    angle = arrival - np.arctan2(arm_2, arm_1)
    sign = np.where(turns < 0, -1.0, 1.0)
    part = np.mod(sign * angle, 2 * np.pi)
    part += 2 * np.pi * (part < FULL_CIRCLE)
    sweep = part + 2 * np.pi * (np.abs(turns) - 1)
    segments["plane"][arcs] = plane
    segments["centre"][arcs] = centres
    segments["sweep"][arcs] = sign * sweep
    segments["length"][arcs] = np.hypot(np.hypot(arm_1, arm_2) * sweep, end[:, normal] - start[:, normal])
