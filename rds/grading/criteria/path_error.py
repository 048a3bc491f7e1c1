"""The largest distance of an interpolation's samples from the segment."""

from __future__ import annotations

from math import degrees, pi

import numpy as np

from rds.core.geometry import sweep
from rds.core.types import ArcSegment
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options
from rds.grading.criteria.rows import positions
from rds.interpolators.deviation import distances

MEANING = "the largest distance of a sample from the path"
UNIT = "mm"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In mm. NotMeasured where the samples go round another number of turns than the arc, or the other way round.

    A full circle ends where it begins: samples that stay near there, or go the wrong way, are on the path as well.
    """
    segment, samples = run.fact("segment"), positions(run)
    if isinstance(segment, ArcSegment):
        wanted, turned = sweep(segment), _turned(segment, samples)
        if abs(turned - wanted) > pi:
            raise NotMeasured(
                f"the rows turn by {degrees(turned):.0f}° about the centre, and the arc by {degrees(wanted):.0f}° "
                "(counter-clockwise is positive)"
            )
    return float(distances(segment, samples).max())


def _turned(segment: ArcSegment, samples: np.ndarray) -> float:
    """The angle by which the samples go round the centre from first to last, rad; counter-clockwise is positive."""
    i, j = segment.plane
    angles = np.arctan2(samples[:, j] - segment.centre[j], samples[:, i] - segment.centre[i])
    whole = np.unwrap(angles)
    return float(whole[-1] - whole[0])
