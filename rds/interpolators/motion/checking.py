"""Whether segments can be planned: refused by the program's line where not."""

from __future__ import annotations

import numpy as np

from rds.core.errors import InputError
from rds.interpolators.motion.segments import AXES, LINE

JUMP = 1e-6  # mm or degrees that a segment may start from where the last one ended


def check_segments(segments: np.ndarray, present: np.ndarray, before: np.ndarray | None) -> None:
    """Raises InputError for a segment that cannot be; `present`: which axes there are, `before`: where the last ended.

    That is: a position that is not finite, a rate of 0, an axis without limits, an arc without an angle, a gap.
    """
    start, end = segments["start"], segments["end"]

    def refuse(bad: np.ndarray, message: str) -> None:
        if bad.any():
            raise InputError(message, f"line {segments['line'][int(np.argmax(bad))]}")

    numbers = (start, end, segments["centre"], segments["length"][:, None], segments["sweep"][:, None])
    refuse(~np.isfinite(np.hstack(numbers)).all(axis=1), "a position of this move is not finite; mend the program")
    feed = ~segments["rapid"] & (segments["length"] > 0.0)
    refuse(feed & ~(segments["rate"] > 0.0), "this move has the rate 0; program a feed rate (F) above 0")
    moved = start != end
    arcs = segments["plane"] != LINE
    for plane, axes in ((0, (0, 1)), (1, (2, 0)), (2, (1, 2))):
        moved[np.ix_(segments["plane"] == plane, axes)] = True
    absent = moved & ~present
    if absent.any():
        k, axis = np.argwhere(absent)[0]
        raise InputError(
            f"this move wants axis {AXES[axis]}, for which there are no limits; "
            f"give the machine [axis.{AXES[axis]}.limits], or leave the axis out",
            f"line {segments['line'][k]}",
        )
    refuse(arcs & (segments["sweep"] == 0.0), "this arc has the angle 0; give it an end other than its start")
    last = np.vstack((start[:1] if before is None else before[None], end[:-1]))
    far = np.abs(start - last).max(axis=1)
    refuse(far > JUMP, "this move does not start where the last one ended; hand in all moves, in order")
