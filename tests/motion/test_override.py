"""Planned samples followed at another rate, as override and hold do: on the path, within the limits of each axis."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from rds.interpolators.motion.deviation import allowed, deviation
from rds.interpolators.motion.segments import BLEND, chain
from rds.modes.loop.program import Program
from rds.modes.loop.retimed import EXCESS, RetimedProgram

from .chains import MACHINES, chains, planned, polygon

T = 1e-3
LIMITS = MACHINES[0]


def followed(segments: np.ndarray, wanted: list[float], every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, how far off the path they are beyond its tolerance, and the rates, at overrides that change."""
    motion, _, _ = planned(segments, LIMITS, T)
    table = np.stack((LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk))[:, :4]
    rows = {name: getattr(motion, name)[:, :4].copy() for name in ("position", "velocity", "acceleration")}
    program = Program(("X", "Y", "Z", "A"), None, **rows, line=motion.line, happenings=(), home=(), limits=table)
    follower = RetimedProgram(program, T)
    last = len(motion) - 1
    positions, places, rates = [follower.position], [0.0], [1.0]
    k = 0
    while follower.place < last:
        follower.advance(wanted[k // every % len(wanted)] if k < 40 * every else 1.0, last)
        positions.append(follower.position)
        places.append(follower.place)
        rates.append(follower.rate)
        k += 1
    full = np.zeros((len(positions), 6))
    full[:, :4] = positions
    at = np.minimum(np.array(places).astype(int), last)
    own = motion.segment[at]
    starts = np.concatenate(([0.0], np.cumsum(segments["length"])))
    share = np.clip((motion.distance[at] - starts[own]) / np.maximum(segments["length"][own], 1e-12), 0.0, 1.0)
    off = deviation(full, segments, own, share) - allowed(segments, 0.05)[own]
    return full, off, np.array(rates)


def shares(position: np.ndarray) -> list[float]:
    """Largest velocity, acceleration and jerk of any axis, as shares of its limits, by differences of the samples."""
    padded = np.pad(position[:, :4], ((3, 3), (0, 0)), mode="edge")
    limits = (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk)
    return [
        float((np.abs(np.diff(padded, order, axis=0)).max(axis=0) / T**order / limit[:4]).max())
        for order, limit in enumerate(limits, 1)
    ]


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
@given(
    segments=chains(most=6, low=-1.0),
    wanted=st.lists(st.sampled_from((0.0, 0.1, 0.5, 1.0, 1.5, 2.0)), min_size=1, max_size=6),
    every=st.sampled_from((17, 100, 333)),
)
def test_no_override_leaves_the_path_or_breaks_a_limit(segments: np.ndarray, wanted: list[float], every: int) -> None:
    assume(len(segments) and segments["length"].sum() < 50.0)
    segments["rate"] = np.maximum(segments["rate"], 1.0)  # or it takes minutes
    position, off, rates = followed(segments, wanted, every)
    assert off.max() < 1e-6  # mm
    assert (position[-1] == segments["end"][-1]).all()
    assert rates.min() >= 0.0 and rates.max() <= 2.0
    assert max(shares(position)) <= 1.0 + EXCESS + 1e-6


def test_at_100_percent_the_samples_are_the_planned_ones() -> None:
    segments = polygon([(0, 0), (5, 0), (5, 5)], 10.0, mode=BLEND)
    motion, _, _ = planned(segments, LIMITS, T)
    position, _, _ = followed(segments, [1.0], 10)
    assert (position == motion.position).all()


def test_a_corner_passed_after_a_change_of_rate_keeps_the_limits() -> None:
    """Between the planned samples, where it came back to 100 % at any place, it had 0.14 % too much jerk."""
    first = polygon([(0, 0), (1, 0), (0.8, -1)], 1.0, mode=BLEND, tolerance=0.001)
    segments = chain(first, polygon([(0.8, -1), (1.8, -1), (2.8, -1)], 1.0))
    position, _, _ = followed(segments, [1.0, 1.0, 0.5], 17)
    assert max(shares(position)) <= 1.0 + EXCESS


def test_back_at_100_percent_the_samples_are_the_planned_ones_again() -> None:
    segments = polygon([(0, 0), (20, 0), (20, 20), (0, 20)], 10.0, mode=BLEND)
    motion, _, _ = planned(segments, LIMITS, T)
    position, _, rates = followed(segments, [0.37, 1.0, 1.7, 1.0, 0.0, 0.998, 1.0], 150)
    last = int(np.flatnonzero(rates != 1.0)[-1])
    rest = position[last + 1 :]
    assert len(rest) > 500 and (rest == motion.position[-len(rest) :]).all()


def test_it_never_goes_back_at_a_long_sample_period() -> None:
    """From 0 to 100 % in 4 samples of 10 ms, it went back by up to 0.7 % of a sample to land on one of the plan."""
    T = 0.01
    motion, _, _ = planned(polygon([(0, 0), (3, 0)], 1.0), LIMITS, T)
    table = np.stack((LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk))[:, :4]
    rows = {name: getattr(motion, name)[:, :4].copy() for name in ("position", "velocity", "acceleration")}
    program = Program(("X", "Y", "Z", "A"), None, **rows, line=motion.line, happenings=(), home=(), limits=table)
    for every in range(1, 30):
        follower = RetimedProgram(program, T)
        k = place = 0
        while follower.place < len(motion) - 1:
            follower.advance(float(k // every % 2 if k < 800 else 1.0), len(motion) - 1)
            assert follower.place >= place and follower.rate >= 0.0
            place, k = follower.place, k + 1


def test_200_percent_is_reached_where_the_axes_have_it_to_spare() -> None:
    segments = polygon([(0, 0), (40, 0), (40, 30)], 5.0, mode=BLEND)
    _, _, rates = followed(segments, [2.0], 10)
    assert rates.max() == 2.0
    half, _, _ = followed(segments, [0.5], 800)
    normal, _, _ = followed(segments, [1.0], 800)
    assert len(half) > 1.9 * len(normal)
