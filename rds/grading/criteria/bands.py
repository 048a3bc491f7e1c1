"""Bands: which share of a criterion's points a value earns.

A value at `full` or better earns all points, one at `none` or worse earns nothing. Between the two the share falls in a
straight line, or is the fixed `partial` where the assignment gives one.
"""

from __future__ import annotations

from dataclasses import dataclass

from rds.grading.grade import Band


@dataclass(frozen=True)
class Bands:
    """The bounds `full` and `none`, in the criterion's unit; which of them is larger says which way is worse."""

    full: float
    none: float
    partial: float | None = None  # share of the points between the bounds; None: in a straight line

    @property
    def more_is_worse(self) -> bool:
        """Whether larger values earn less."""
        return self.none > self.full

    def band(self, value: float) -> Band:
        """Where `value` lies. NaN is in no band but the last."""
        margin = self.margin(value)
        if not margin > 0.0:
            return Band.NONE
        return Band.FULL if margin >= 1.0 else Band.PARTIAL

    def share(self, value: float) -> float:
        """Of the points, 0 to 1."""
        band = self.band(value)
        if band is not Band.PARTIAL:
            return 1.0 if band is Band.FULL else 0.0
        return self.margin(value) if self.partial is None else self.partial

    def margin(self, value: float) -> float:
        """How far `value` is from `none` towards `full`: 0 at `none`, 1 at `full`, more beyond, less than 0 before."""
        if value == self.full:  # to the bit, whatever the division would round to
            return 1.0
        return (self.none - value) / (self.none - self.full) or 0.0  # not -0
