"""The profiles of three-axis-mill as numbers, and jerk-limited moves beside ruckig's."""

from __future__ import annotations

from itertools import pairwise
from math import ceil, sqrt

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.interpolators import blended, trapezoid
from rds.interpolators.motion.blended import ACCEL, CRUISE, DECEL
from rds.interpolators.motion.point_to_point import point_to_point
from rds.interpolators.motion.segments import line

from .chains import MACHINES, planned

T = 1e-2
# The strokes of the character for the sun: a box with a bar across, in a unit square, drawn without lifting.
SUN = [(0, 0), (1, 0), (1, 1), (1, 2), (0, 2), (0, 1), (1, 1), (0, 1), (0, 0)]


@given(distance=st.floats(-500, 500), feed=st.floats(1, 200), accel=st.floats(10, 5000))
def test_profile_keeps_its_limits(distance: float, feed: float, accel: float) -> None:
    profile = trapezoid(distance, feed, accel, T=1e-3)
    assert abs(profile.velocity).max() <= feed * (1 + 1e-9)
    assert abs(profile.acceleration).max() <= accel
    padded = np.pad(profile.position, (2, 2), mode="edge")
    assert abs(np.diff(padded, 2)).max() <= accel * 1e-6 * (1 + 1e-6) + 1e-12
    assert profile.position[-1] == distance and profile.velocity[-1] == 0.0
    top = min(feed, sqrt(accel * abs(distance)))
    expected = abs(distance) / top + top / accel if distance else 0.0
    assert profile.duration == pytest.approx(expected)
    assert len(profile.time) == ceil(profile.duration / 1e-3 - 1e-9) + 1


def test_figure_9_is_a_trapezoid() -> None:
    """10 mm at 5 mm/s with 10 mm/s²: 0.5 s up, 1.5 s level, 0.5 s down."""
    profile = trapezoid(10.0, 5.0, 10.0, T)
    assert profile.duration == pytest.approx(2.5)
    at = {t: profile.velocity[round(t / T)] for t in (0.25, 0.5, 1.0, 2.0, 2.25, 2.5)}
    assert list(at.values()) == pytest.approx([2.5, 5.0, 5.0, 5.0, 2.5, 0.0])
    with pytest.raises(InputError, match=r"feed = 0.0 must be more than 0 \(mm/s\)"):
        trapezoid(1.0, 0.0, 1.0, T)


def test_figure_10_velocity_is_held_until_the_target_is_reached() -> None:
    """One axis of a path whose direction changes: X goes 3, 4, 3 mm/s, with the change after each corner."""
    points = [(0, 0), (6, 8), (14, 14), (20, 22)]  # X takes 0.6, 0.8, 0.6 of the way, Y 0.8, 0.6, 0.8
    motion = blended(points, 5.0, T)
    assert motion.held.tolist() == [True, True, False]
    before = motion.targets - 1
    for velocities, expected in zip(motion.velocity.T, ([3, 4, 3], [4, 3, 4]), strict=True):
        assert velocities[before[:2]] == pytest.approx(expected[:2], rel=0.1)  # held up to the corner
        assert velocities[motion.targets[:2]] == pytest.approx(velocities[before[:2]])  # the change begins there
    assert motion.position[motion.targets] == pytest.approx(np.array(points[1:]))
    assert motion.speed[motion.targets[0] - 50 : motion.targets[1]].min() > 4.8  # mm/s, of 5
    assert motion.stage[before].tolist() == [CRUISE, CRUISE, DECEL]


def test_figure_11_without_blending_each_move_is_accel_cruise_decel() -> None:
    motion = blended([(0, 0), (10, 0), (20, 10)], 5.0, T, blend=False)
    assert not motion.held.any()
    for move in (0, 1):
        stages = motion.stage[motion.move == move]
        assert [a for a, b in pairwise([*stages.tolist(), None]) if a != b] == [ACCEL, CRUISE, DECEL]
    assert motion.speed[motion.targets] == pytest.approx([0.0, 0.0])


def test_figure_19_a_polygon_keeps_its_speed_at_corners_where_no_axis_turns_back() -> None:
    octagon = [(10 * np.cos(a), 10 * np.sin(a)) for a in np.pi / 8 + np.pi / 4 * np.arange(9)]
    motion = blended(octagon, 2.0, T)
    # the first side goes up to the left; sides along an axis stop the other, and turn it back after them
    for k, (way, after) in enumerate(pairwise(np.diff(octagon, axis=0))):
        if (way * after < -1e-9).any():
            assert not motion.held[k]
    speeds = motion.speed[motion.targets]
    assert (speeds[motion.held] > 1.5).all() and speeds[~motion.held] == pytest.approx(0.0, abs=1e-12)


def test_figures_20_to_23_a_circle_stops_only_where_an_axis_turns_back() -> None:
    """Chords of 10°: X is a cosine, and the speed is the feed but at the four ends of the axes."""
    angle = np.radians(np.arange(37) * 10.0)
    motion = blended(np.column_stack((10 * np.cos(angle), 10 * np.sin(angle))), 1.0, T)
    assert np.flatnonzero(~motion.held).tolist() == [8, 17, 26, 35]  # the last chords before 90°, 180°, 270°, 360°
    radius = np.linalg.norm(motion.position, axis=1)
    assert radius.min() > 9.95 and radius.max() < 10.02
    assert np.median(motion.speed) == pytest.approx(1.0, rel=0.03) and motion.speed.max() <= 1.0 + 1e-9


def test_figures_24_to_28_the_sun_stops_at_its_corners_and_passes_where_strokes_meet() -> None:
    motion = blended(10.0 * np.array(SUN), 5.0, T)
    assert motion.held.tolist() == [False, True, False, False, False, False, False, False]
    assert motion.speed[motion.targets[1]] == pytest.approx(5.0)  # where the bar ends on the side
    assert motion.speed.max() == pytest.approx(5.0)
    assert motion.position[motion.targets] == pytest.approx(10.0 * np.array(SUN[1:]))


points = st.lists(
    st.tuples(*(st.floats(-50, 50).map(lambda x: round(x, 2)),) * 3), min_size=2, max_size=12, unique=True
)


@given(points=points, feed=st.floats(0.5, 20.0), share=st.floats(0.05, 0.5), blend=st.booleans())
def test_blended_motion_meets_every_target_and_never_turns_back_within_a_move(
    points: list[tuple[float, ...]], feed: float, share: float, blend: bool
) -> None:
    motion = blended(points, feed, T, share=share, blend=blend)
    assert np.abs(motion.position[motion.targets] - np.array(points[1:])).max() < 1e-9
    assert np.abs(np.diff(motion.position, axis=0) / T - motion.velocity[:-1]).max() <= (
        0.5 * T * np.abs(motion.acceleration).max() + 1e-6
    )
    ways = np.diff(np.array(points), axis=0)
    wanted = np.abs(ways[motion.move]) / np.linalg.norm(ways[motion.move], axis=1)[:, None] * feed
    before = np.abs(motion.velocity[np.maximum(motion.targets[np.maximum(motion.move - 1, 0)], 0)])
    assert (np.abs(motion.velocity) <= np.maximum(wanted, before) * (1 + 1e-9) + 1e-9).all()
    assert (motion.velocity * ways[motion.move] >= -1e-9).all()
    for k, (way, after) in enumerate(pairwise(ways)):
        if motion.held[k]:
            assert blend and (way * after >= 0.0).all()
        else:
            assert not motion.velocity[motion.targets[k]].any() or k == len(ways) - 1


def test_blended_motion_refuses_what_cannot_be() -> None:
    for words, message in (
        ({"points": [(0, 0), (0, 0)]}, "at least two that differ"),
        ({"feed": 0.0}, "feed = 0.0"),
        ({"share": 0.6}, "share = 0.6"),
        ({"points": [(0, np.nan), (1, 1)]}, "finite"),
    ):
        given_words = {"points": [(0, 0), (1, 1)], "feed": 1.0, "T": T} | words
        with pytest.raises(InputError, match=message):
            blended(**given_words)  # type: ignore[arg-type]


ends = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-20, 20))


@settings(max_examples=35, deadline=None)
@given(end=ends)
def test_our_moves_take_as_long_as_the_fastest_there_are(end: tuple[float, ...]) -> None:
    """ruckig's moves are the fastest within the same limits: ours take at most a few ms and 1 % more, never less."""
    pytest.importorskip("ruckig")
    if max(map(abs, end)) < 1e-3:
        return
    limits = MACHINES[0]
    three = (limits.velocity[:3], limits.acceleration[:3], limits.jerk[:3])
    best = point_to_point((0, 0, 0), end, *three, T=1e-3)
    assert (best.position[-1] == end).all()
    motion, certificate, _ = planned(line((0, 0, 0), end, np.inf, rapid=True))
    assert certificate.ok
    ours = (len(motion) - 1) * 1e-3
    assert best.duration - 1e-9 <= ours
    if max(map(abs, end)) > 3.0:  # long enough for full acceleration
        assert ours <= 1.01 * best.duration + 2e-3
    else:
        assert ours <= 1.35 * best.duration + 2e-3


def test_point_to_point_refuses_what_cannot_be() -> None:
    pytest.importorskip("ruckig")
    with pytest.raises(InputError, match=r"jerk = \(0,\) must each be more than 0"):
        point_to_point((0,), (1,), (1,), (1,), (0,), T=1e-3)
    with pytest.raises(InputError, match="2 finite numbers"):
        point_to_point((0, 0), (1,), (1, 1), (1, 1), (1, 1), T=1e-3)
    for T, message in ((np.inf, "T = inf must be a finite number"), (1e-12, "more than 20,000,000 samples")):
        with pytest.raises(InputError, match=message):
            point_to_point((0,), (9,), (5,), (50,), (500,), T)
    for start in ((), (np.nan,), (np.inf,)):
        with pytest.raises(InputError, match="a finite number for each axis, and one axis or more"):
            point_to_point(start, start, start, start, start, 1e-3)
    with pytest.raises(InputError, match="beyond ruckig's arithmetic"):
        point_to_point((0,), (1e9,), (5e8,), (5e9,), (5e11,), 0.01)
    with pytest.raises(InputError, match="beyond ruckig's arithmetic"):  # 13 hours
        point_to_point((0, 0), (1, 1), (1, 1), (1000, 1000), (20, 20), 0.01, start_acceleration=[300, 0])
    moving = point_to_point((0,), (5,), (10,), (100,), (1e4,), T=1e-3, start_velocity=[5.0])
    assert moving.velocity[0, 0] == 5.0 and moving.position[-1, 0] == 5.0
    with pytest.raises(InputError, match=r"end_velocity = \(0.0, 1.5\) must be 2 finite numbers within \(1, 1\)"):
        point_to_point((0, 0), (1, 1), (1, 1), (1, 1), (1, 1), T=1e-3, end_velocity=[0.0, 1.5])
    with pytest.raises(InputError, match=r"only after 54\.43 mm/s, .*; give less end_acceleration, or more jerk"):
        point_to_point((0,), (9,), (50,), (400,), (1.2e4,), 1e-3, end_velocity=[47.85], end_acceleration=[-397.5])
    with pytest.raises(InputError, match="start_acceleration"):
        point_to_point((0,), (1,), (1,), (1,), (1,), T=1e-3, start_acceleration=[np.nan])


SPEEDS = st.tuples(*[st.integers(-5000, 5000).map(lambda hundredths: hundredths / 100)] * 2)  # mm/s


@settings(max_examples=30, deadline=None)
@given(way=st.tuples(st.integers(-20, 20), st.integers(1, 20)), first=SPEEDS, last=SPEEDS)
def test_a_move_begins_and_ends_with_the_velocities_that_are_asked_for(
    way: tuple[float, ...], first: tuple[float, ...], last: tuple[float, ...]
) -> None:
    """From any velocity within the limits to any other: both are met, at the right places, within all limits."""
    pytest.importorskip("ruckig")
    T, limits = 1e-3, ((50.0, 50.0), (400.0, 400.0), (12000.0, 12000.0))
    found = point_to_point((0, 0), way, *limits, T, start_velocity=first, end_velocity=last)
    assert found.position[0].tolist() == [0.0, 0.0] and found.position[-1].tolist() == list(way)
    assert found.velocity[0].tolist() == list(first) and found.velocity[-1].tolist() == list(last)
    assert np.abs(found.velocity).max() <= 50.0 * (1 + 1e-6)
    assert np.abs(found.acceleration).max() <= 400.0 * (1 + 1e-6)
    whole = slice(None) if any(last) else slice(-1)  # at rest the end may come before the last sample
    assert np.abs(np.diff(found.position, axis=0)[whole]).max(initial=0.0) <= 50.0 * T * (1 + 1e-6)
    assert np.abs(np.diff(found.velocity, axis=0)[whole]).max(initial=0.0) <= 400.0 * T * (1 + 1e-6)
    assert np.abs(np.diff(found.acceleration, axis=0)[whole]).max(initial=0.0) <= 12000.0 * T * (1 + 1e-6)


STATES = st.tuples(st.floats(-40, 40), st.floats(-40, 40), st.floats(-300, 300), st.floats(-300, 300))


@settings(max_examples=30, deadline=None)
@given(way=st.tuples(st.floats(-20, 20), st.floats(-20, 20)), there=STATES)
def test_a_move_that_ends_in_motion_hands_over_to_the_next(way: tuple[float, ...], there: tuple[float, ...]) -> None:
    """There and to rest again: one sequence of samples, within the limits where the two moves meet as elsewhere."""
    pytest.importorskip("ruckig")
    assume(any(there))  # a move that ends at rest takes its least time, whatever the sample period is
    T, limits = 1e-3, ((50.0, 50.0), (400.0, 400.0), (12000.0, 12000.0))
    room = [min(40.0, 50.0 - a * a / 24000.0) for a in there[2:]]  # a velocity that the acceleration does not overrun
    speed, push = np.clip(there[:2], -np.array(room), room).tolist(), list(there[2:])
    first = point_to_point((0, 0), way, *limits, T, end_velocity=speed, end_acceleration=push)
    assert first.position[-1].tolist() == list(way)
    assert first.velocity[-1].tolist() == speed and first.acceleration[-1].tolist() == push
    assert first.duration == pytest.approx((len(first.position) - 1) * T, abs=1e-8)
    then = point_to_point(way, (way[0] + 30, way[1] - 30), *limits, T, start_velocity=speed, start_acceleration=push)
    position = np.concatenate((first.position, then.position[1:]))
    velocity = np.concatenate((first.velocity, then.velocity[1:]))
    acceleration = np.concatenate((first.acceleration, then.acceleration[1:]))[:-1]
    assert np.abs(np.diff(position, axis=0)[:-1]).max() <= 50.0 * T * (1 + 1e-6)
    assert np.abs(np.diff(velocity, axis=0)[:-1]).max() <= 400.0 * T * (1 + 1e-6)
    assert np.abs(np.diff(acceleration, axis=0)[:-1]).max() <= 12000.0 * T * (1 + 1e-6)
