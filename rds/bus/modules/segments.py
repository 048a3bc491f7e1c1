"""Method B: a segment travels as the coefficients of its difference equations, and the node interpolates.

dcs-thesis, equations 3.1 to 3.4, of a point (x, y) about the centre of its arc, in BLU:

    x(k) = A x(k-1) - B y(k-1)        A = D = cos Δθ, B = C = sin Δθ
    y(k) = C x(k-1) + D y(k-1)
    x(k) = E x(k-1) + F               E = 1 for a straight line, F its BLU in a step

Each node gets the equations of its own coordinate and, of an arc, those of the other one, for it cannot do without.
With cos Δθ ≅ 1 (equation 6.10) the radius would grow by a factor of √(1 + Δθ²) in each step; exact coefficients cost
nothing here. A segment takes 24 bytes whatever its length:

    uint16 steps, uint8 1 for an arc, int8 sign, float64 BLU of a step or, of an arc, its angle (rad), float32 own
    start, other start from the centre, centre

The angle is sent, not its cosine: a float32 of that would be 3 BLU wrong after a circle of 40 mm in steps of 10 ms.
"""

from __future__ import annotations

from math import atan2, cos, isfinite, sin
from struct import Struct
from typing import NamedTuple

_SEGMENT = Struct("<HBbdfff")
SIZE = _SEGMENT.size


class NodeSegment(NamedTuple):
    """What one node needs of a segment: `steps` steps from its own coordinate `own`, in BLU from its zero.

    A line adds `a` in each step. An arc turns (`own` - `centre`, `other`) by the angle whose cosine and sine are `a`
    and `b`; `sign` is -1 for the first coordinate of the plane, +1 for the second.
    """

    steps: int  # 1 to 65535
    arc: bool
    sign: int
    a: float
    b: float
    own: float
    other: float
    centre: float

    def pack(self) -> bytes:
        """The bytes of the segment."""
        each = atan2(self.b, self.a) if self.arc else self.a
        return _SEGMENT.pack(self.steps, self.arc, self.sign, each, self.own, self.other, self.centre)


def unpack(data: bytes | bytearray) -> NodeSegment:
    """The segment in its bytes, whatever they are: an angle that is no number leads to places that are none."""
    steps, arc, sign, each, own, other, centre = _SEGMENT.unpack(data)
    a, b = (cos(each), sin(each)) if arc and isfinite(each) else (each, 0.0)
    return NodeSegment(steps, bool(arc), sign, a, b, own, other, centre)


def line(start: float, end: float, steps: int) -> NodeSegment:
    """A straight line of one coordinate (BLU) in `steps` steps."""
    return NodeSegment(steps, False, 1, (end - start) / steps, 0.0, start, 0.0, 0.0)


def arc(own: float, other: float, centre: float, angle: float, steps: int, first: bool) -> NodeSegment:
    """One coordinate (BLU) of an arc through `angle` (rad, + counter-clockwise) in `steps` steps.

    `own` starts at that absolute coordinate, `centre` is the centre's; `other` is the other one from the centre.
    `first` says whether it is the first coordinate of the plane.
    """
    step = angle / steps
    return NodeSegment(steps, True, -1 if first else 1, cos(step), sin(step), own, other, centre)


class Equations:
    """A segment while a node carries it out: one whole number of BLU in each step, remainders carried."""

    def __init__(self, segment: NodeSegment):
        self._segment = segment
        self._own, self._other = segment.own - (segment.centre if segment.arc else 0.0), segment.other
        self.left = segment.steps

    def next(self) -> float:
        """The coordinate after one more step, BLU from the node's zero."""
        s = self._segment
        self.left -= 1
        if not s.arc:
            self._own += s.a
            return self._own
        own, other = self._own, self._other
        self._own = s.a * own + s.sign * s.b * other
        self._other = s.a * other - s.sign * s.b * own
        return self._own + s.centre
