"""What every method asks of a segment before it starts: numbers that make sense, an arc that closes."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isfinite, sqrt

import numpy as np

from rds.core.errors import InputError
from rds.core.geometry import length, radius, sweep
from rds.core.types import ArcSegment, LineSegment, Segment

# An arc whose end is off its circle by more than both is refused, as LinuxCNC does (SPIRAL_ABSOLUTE_TOLERANCE for mm,
# SPIRAL_RELATIVE_TOLERANCE); a smaller difference is spread along the arc.
_OFF, _OFF_SHARE = 0.02 * sqrt(2.0), 0.001  # mm; of the radius
_WHOLE = 1e-9  # of a sample: a move of 100.00000000001 samples takes 100


def checked(segment: Segment, T: float) -> Segment:
    """`segment` if it and the sample period `T` (s) can be interpolated, else InputError."""
    if not (isfinite(T) and T > 0.0):
        raise InputError(f"sample period T = {T!r} s must be a finite number above 0")
    if not isinstance(segment, LineSegment | ArcSegment):
        raise InputError(f"{segment!r:.100} is no segment; interpolators take a LineSegment or an ArcSegment")
    points = [segment.start, segment.end, *([segment.centre] if isinstance(segment, ArcSegment) else [])]
    if len({len(point) for point in points}) != 1 or not segment.start:
        raise InputError(f"{segment}: its points differ in the number of axes; give each a position per axis, mm")
    if not all(isfinite(value) for point in points for value in point):
        raise InputError(f"{segment}: its positions must be finite numbers, mm")
    if not (isfinite(segment.feed_rate) and segment.feed_rate > 0.0):
        raise InputError(f"feed_rate = {segment.feed_rate!r} mm/s must be a finite number above 0")
    if isinstance(segment, ArcSegment):
        if not isinstance(segment.clockwise, bool | np.bool_):
            raise InputError(f"{segment}: clockwise = {segment.clockwise!r} must be True or False")
        _check_arc(segment)
    return segment


def samples(segment: Segment, T: float) -> int:
    """How many sample periods `T` (s) the segment takes at its feed rate, rounded up."""
    return ceil(length(segment) / segment.feed_rate / T - _WHOLE)


@dataclass(frozen=True)
class Arc:
    """An arc or helix: complex numbers in its plane (first axis + i second), mm, and all axes together.

    `arm` leads from the centre to the start and turns by `sweep` (rad, + counter-clockwise). `rest` is what the axes
    move besides, in proportion to the angle: along the helix, and a spread difference of the end from the circle.
    """

    start: np.ndarray  # mm, per axis
    arm: complex
    sweep: float
    plane: tuple[int, int]
    rest: np.ndarray  # mm, per axis

    @classmethod
    def of(cls, segment: ArcSegment) -> Arc:
        """The arc that a checked segment describes."""
        i, j = segment.plane
        arm = complex(segment.start[i] - segment.centre[i], segment.start[j] - segment.centre[j])
        angle = sweep(segment)
        arc = cls(np.array(segment.start), arm, angle, (i, j), np.zeros(len(segment.start)))
        rest = np.array(segment.end) - arc.points(np.array([1.0]))[0]
        return cls(arc.start, arm, angle, (i, j), rest)

    @property
    def radius(self) -> float:
        """mm."""
        return abs(self.arm)

    def points(self, share: np.ndarray) -> np.ndarray:
        """Positions (shape (n, axes), mm) at these shares (0 to 1) of the way."""
        angle = self.sweep * share
        # the arm's change, without cancellation where the angle is small
        turned = self.arm * (1j * np.sin(angle) - 2.0 * np.sin(0.5 * angle) ** 2)
        points = self.start + np.outer(share, self.rest)
        return self._in_plane(points, turned)

    def motion(self, share: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities and accelerations (mm, s) at these shares, at constant speed for `duration` s."""
        speed = self.sweep / duration  # rad/s
        arm = self.arm * np.exp(1j * self.sweep * share)
        velocity = self._in_plane(np.tile(self.rest / duration, (len(share), 1)), 1j * speed * arm)
        acceleration = self._in_plane(np.zeros_like(velocity), -(speed**2) * arm)
        return self.points(share), velocity, acceleration

    def at(self, arm: complex, share: float) -> np.ndarray:
        """The position of all axes where the arm is `arm`, at this share of the way."""
        point = self.start + share * self.rest
        i, j = self.plane
        change = arm - self.arm
        point[i] += change.real
        point[j] += change.imag
        return point

    def _in_plane(self, rows: np.ndarray, values: np.ndarray) -> np.ndarray:
        i, j = self.plane
        rows[:, i] += values.real
        rows[:, j] += values.imag
        return rows


def _check_arc(segment: ArcSegment) -> None:
    axes, plane = len(segment.start), segment.plane
    if len(plane) != 2 or plane[0] == plane[1] or not all(0 <= axis < axes for axis in plane):
        raise InputError(f"plane = {plane!r} must be two different axes by index, 0 to {axes - 1}")
    i, j = plane
    first = radius(segment)
    last = float(np.hypot(segment.end[i] - segment.centre[i], segment.end[j] - segment.centre[j]))
    if first == 0.0 or last == 0.0:
        raise InputError(f"{segment}: the centre of the arc is its start or its end; give the centre of its circle")
    off = abs(last - first)
    if off > _OFF and off > _OFF_SHARE * first:
        raise InputError(
            f"the end of the arc is {last:.4f} mm from the centre {segment.centre} and its start {first:.4f} mm; "
            f"move end or centre so that both are on one circle"
        )
