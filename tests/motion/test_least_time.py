"""The least time of a path without a limit of the jerk: what is known of it, and that no plan is faster."""

from __future__ import annotations

from itertools import pairwise
from math import inf, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings

from rds.interpolators.motion import Limits, plan
from rds.interpolators.motion.certificate import Certificate, certified
from rds.interpolators.motion.least_time import LeastTime
from rds.interpolators.motion.segments import BLEND, EXACT_STOP, arc, line

from .chains import MACHINES, Event, PathBlock, chains, polygon
from .test_planned_motion import SQUARE, wave

T = 1e-3


def least(path: object, limits: Limits = MACHINES[0]) -> tuple[float, float]:
    """The least time, and that of the plan."""
    found = LeastTime(limits, T)
    samples = sum(map(len, plan(path if isinstance(path, list) else [path], limits, T, least_time=found)))
    return found.seconds, (samples - 1) * T


def test_a_line_takes_its_way_over_its_feed_and_a_ramp() -> None:
    found, planned = least(line((0, 0, 0), (30, 0, 0), 10.0))
    assert found == pytest.approx(30 / 10 + 10 / 200, rel=1e-9)
    assert planned == pytest.approx(found + 200 / 1e4, abs=2 * T)  # and the ramp of the acceleration


def test_a_line_that_is_too_short_for_its_feed() -> None:
    assert least(line((0, 0, 0), (0.2, 0, 0), 10.0))[0] == pytest.approx(2 * sqrt(0.2 / 200), rel=1e-9)


def test_the_slower_axis_of_a_line_counts() -> None:
    """Z may do 11 mm/s and 150 mm/s², X 13 and 200."""
    found, _ = least(line((0, 0, 0), (30, 0, 30), inf, rapid=True))
    assert found == pytest.approx(30 / 11 + 11 / 150, rel=1e-9)


def test_a_circle_is_gone_round_as_fast_as_two_axes_allow_together() -> None:
    """Radius 0.5 mm, 200 mm/s²: 10 mm/s where one axis has all of v²/r, up to √√2 times that where both share it."""
    turns = arc((0, 0, 0), (0, 0, 0), (0.5, 0, 0), 100.0, turns=99)
    found, _ = least(turns)
    even = 100 * 2 * pi * 0.5 / 10.0
    assert even / 2**0.25 < found < even


def test_rests_and_dwells_are_part_of_it() -> None:
    path = polygon(SQUARE, 10.0, mode=EXACT_STOP)
    assert least(path)[0] == pytest.approx(4 * (10 / 10 + 10 / 200), rel=1e-9)
    waits = PathBlock(path, [Event(1, "dwell", 0.5)])
    assert least([waits])[0] == pytest.approx(4 * (10 / 10 + 10 / 200) + 0.5, rel=1e-9)


def test_it_does_not_matter_how_the_path_is_portioned_out() -> None:
    """12,000 lines without a stop, which are looked at part by part."""
    path = wave(12000, 0.02)
    whole, planned = least(path)
    portions, _ = least([path[a:b] for a, b in pairwise([*range(0, 12000, 1700), 12000])])
    assert whole == pytest.approx(portions, rel=1e-9)
    assert whole < planned < 1.25 * whole


@settings(max_examples=60, deadline=None)
@given(segments=chains(low=-1.0))
def test_no_plan_is_faster(segments: np.ndarray) -> None:
    if len(segments) and segments["length"].sum() < 200.0:
        found, planned = least(segments, MACHINES[0])
        assert planned >= found * (1.0 - 2e-3) - T


def test_the_certificate_tells_the_ratio() -> None:
    path = polygon(SQUARE, 10.0, mode=BLEND, tolerance=0.02)
    found = LeastTime(MACHINES[0], T)
    certificate = Certificate(MACHINES[0], least_time=found)
    for _ in certified(plan([path], MACHINES[0], T, least_time=found), certificate):
        pass
    assert certificate.ratio == pytest.approx((certificate.time - T) / found.seconds)
    assert certificate.ratio is not None and 1.0 < certificate.ratio < 1.05
    assert f"It takes {certificate.ratio:.3f} times the {found.seconds:.3f} s" in certificate.sentence()
    assert certificate.to_dict()["times_least_time"] == certificate.ratio
    assert Certificate(MACHINES[0]).ratio is None
