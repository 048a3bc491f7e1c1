"""Every planned sample keeps the limits of each axis and the path; and what the modes promise, as numbers."""

from __future__ import annotations

from math import ceil, hypot, inf, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError, RdsError
from rds.interpolators.motion import Limits, plan, predicted_time
from rds.interpolators.motion.certificate import Certificate, certified
from rds.interpolators.motion.least_time import LeastTime
from rds.interpolators.motion.segments import BLEND, EXACT_PATH, EXACT_STOP, SEGMENT, arc, chain, line, point_at

from .chains import MACHINES, Event, PathBlock, chains, planned, polygon

T = 1e-3
SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)]


def periods(segments: np.ndarray, limits: Limits) -> float:
    """A sample period at which this chain does not take too many samples to test."""
    rate = np.where(segments["rapid"], inf, segments["rate"])
    slowest = np.minimum(rate, 0.3 * limits.velocity[limits.present].min())
    return 1e-3 if (segments["length"] / slowest).sum() < 30.0 else 1e-2


@settings(max_examples=75, deadline=None)
@given(segments=chains(), limits=st.sampled_from(MACHINES))
def test_every_sample_keeps_every_limit(segments: np.ndarray, limits: Limits) -> None:
    if not len(segments):
        return
    motion, certificate, _ = planned(segments, limits, periods(segments, limits))
    assert certificate.ok, "\n".join(map(str, certificate.violations[:5]))
    assert (motion.position[0] == segments["start"][0]).all()
    assert (motion.position[-1] == segments["end"][-1]).all()
    assert not motion.velocity[-1].any()
    assert (np.diff(motion.segment) >= 0).all() and (np.diff(motion.distance) > -1e-9).all()
    assert motion.distance[-1] == pytest.approx(segments["length"].sum(), rel=1e-9, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(segments=chains(modes=(EXACT_PATH, EXACT_STOP)))
def test_an_exact_path_is_kept_by_each_sample(segments: np.ndarray) -> None:
    if len(segments):
        _, certificate, _ = planned(segments, T=1e-2)
        assert certificate.worst["deviation", ""].value < 1e-6  # mm


@settings(max_examples=25, deadline=None)
@given(segments=chains(most=40, low=-2.0, modes=(BLEND,)), parts=st.integers(1, 20))
def test_it_does_not_matter_how_the_path_is_portioned_out(segments: np.ndarray, parts: int) -> None:
    if not len(segments):
        return
    whole, _, _ = planned(segments, T=1e-2)
    portions, _, _ = planned([segments[k : k + parts] for k in range(0, len(segments), parts)], T=1e-2)
    for name in ("position", "velocity", "acceleration", "line", "distance"):
        assert (getattr(whole, name) == getattr(portions, name)).all()


def wave(count: int, step: float, **words: float) -> np.ndarray:
    """A dense polyline of `count` lines, along a sine of 4 mm."""
    x = step * np.arange(count + 1)
    points = np.column_stack((x, 4.0 * np.sin(x / 5.0), *np.zeros((4, count + 1))))
    path = np.zeros(count, SEGMENT)
    path["start"], path["end"], path["plane"] = points[:-1], points[1:], -1
    path["length"] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    path["rate"], path["tolerance"], path["line"] = 10.0, 0.02, np.arange(count) + 1
    path["mode"] = BLEND
    for name, value in words.items():
        path[name] = value
    return path


def test_a_long_path_is_planned_in_windows_portion_by_portion() -> None:
    """8000 lines without a stop: windows of 1024 pieces, whose ends must not show."""
    path = wave(8000, 0.02)
    whole, certificate, _ = planned(path)
    portions, _, _ = planned([path[k : k + 700] for k in range(0, len(path), 700)])
    assert (whole.position == portions.position).all()
    assert certificate.ok
    speed = np.linalg.norm(whole.velocity, axis=1)
    middle = speed[500:-500]
    assert middle.min() > 4.0  # it neither stops nor crawls


def test_dense_polylines_do_not_crawl() -> None:
    for step, least in ((0.5, 9.0), (0.1, 8.5), (0.02, 5.0)):
        path = wave(int(60 / step), step)
        motion, certificate, _ = planned(path)
        assert certificate.ok
        assert path["length"].sum() / (len(motion) * T) > least  # mm/s on average, of 10


def test_a_motion_that_breaks_its_limits_is_refused_by_line() -> None:
    motion, certificate, _ = planned(polygon(SQUARE, 10.0))
    certificate.require("part.ngc")
    assert f"all {len(motion)} planned samples keep" in certificate.sentence()
    slower = Certificate(Limits.from_axes({"X": (13, 200, 1e4), "Y": (9, 200, 1e4)}))
    for _block in certified([motion], slower):
        pass
    assert slower.sentence().startswith(
        f"The planned motion breaks its limits in {slower.count} places; first: line 2:"
    )
    with pytest.raises(RdsError, match=r"part.ngc: line 2: velocity of Y is .* at most 9 is allowed"):
        slower.require("part.ngc")


@pytest.mark.parametrize("rate", [1e-5, 1e-7])
def test_feeds_whose_ramps_are_shorter_than_rounding_are_planned(rate: float) -> None:
    motion, certificate, _ = planned(line((0, 0, 0), (1e-2, 0, 0), rate), T=1e-5 / rate)
    assert certificate.ok
    assert len(motion) == pytest.approx(1000, abs=25)


def test_a_jerk_that_never_gets_anywhere_is_refused() -> None:
    with pytest.raises(InputError, match="raise the jerk"):
        planned(line((0, 0, 0), (1, 0, 0), 1.0), Limits.from_axes({"X": (13, 200, 1e-9)}))


def test_lines_that_are_nearly_one_are_taken_as_one_with_q() -> None:
    dense = wave(6000, 0.01)
    joined = wave(6000, 0.01, collinear=0.01)
    slow, _, _ = planned(dense)
    fast, certificate, _ = planned(joined)
    assert certificate.ok  # within P
    assert certificate.worst["deviation", ""].value > 0.001
    assert len(fast) < 0.8 * len(slow)


@pytest.mark.parametrize("seed", range(6))
def test_joining_and_blending_together_stay_within_p(seed: int) -> None:
    """G64 P without Q: lines are joined within the same tolerance, but the two don't add up."""
    chance = np.random.default_rng(seed)
    lengths = 0.5 * 10.0 ** chance.uniform(-1.0, 1.0, 100)
    turns = np.cumsum(chance.choice([0.05, 0.3, 1.0], 100) * chance.normal(size=100))
    points = np.cumsum(lengths[:, None] * np.column_stack((np.cos(turns), np.sin(turns))), axis=0)
    path = polygon(points, 10.0, mode=BLEND, tolerance=0.5, collinear=0.5)
    motion, certificate, _ = planned(path)
    assert certificate.ok
    a, way = path["start"][:, :2], (path["end"] - path["start"])[:, :2]
    p = motion.position[:, None, :2]
    share = np.clip(((p - a) * way).sum(axis=2) / (way**2).sum(axis=1), 0.0, 1.0)
    off = np.linalg.norm(p - a - share[..., None] * way, axis=2).min(axis=1)
    assert 0.1 < off.max() <= 0.5 + 1e-6


def test_a_straight_move_takes_the_time_of_the_seven_phases() -> None:
    """d/v + v/a + a/j, to the margin kept for rounding and one sample."""
    motion, _, _ = planned(line((0, 0, 0), (40, 0, 0), 100.0))
    v, a, j = (0.999 * value for value in (13.0, 200.0, 1e4))
    assert len(motion) - 1 == ceil((40 / v + v / a + a / j) / T)


def test_rapids_go_at_the_speed_of_the_slowest_axis_along_a_straight_line() -> None:
    motion, certificate, _ = planned(line((0, 0, 0), (10, 20, 30), inf, rapid=True))
    assert certificate.worst["velocity", "Z"].share == pytest.approx(0.999, abs=1e-9)
    assert np.abs(motion.position[:, :2] - motion.position[:, 2:3] * [1 / 3, 2 / 3]).max() < 1e-12


def test_exact_stop_rests_on_every_corner() -> None:
    motion, _, _ = planned(polygon(SQUARE, 10.0, mode=EXACT_STOP))
    for corner in SQUARE:
        at = (motion.position[:, :2] == corner).all(axis=1)
        assert at.any() and not motion.velocity[at].any()


def test_exact_path_slows_down_for_a_turn_and_passes_a_small_one() -> None:
    def slowest(degrees: float) -> float:
        turn = np.radians(degrees)
        end = (10 + 10 * np.cos(turn), 10 * np.sin(turn))
        motion, certificate, _ = planned(polygon([(0, 0), (10, 0), end], 10.0))
        assert certificate.ok
        speed = np.linalg.norm(motion.velocity, axis=1)
        middle = np.searchsorted(motion.distance, 10.0)
        return float(speed[middle - 5 : middle + 5].min())

    assert slowest(90) < 1e-3
    assert slowest(0.1) == pytest.approx(0.3 * 0.999 * 1e4 * T**2 / np.radians(0.1), rel=0.02)  # turn share of the jerk
    assert slowest(0.01) == pytest.approx(10.0, rel=1e-6)


def test_curvature_that_jumps_is_passed_as_fast_as_the_jerk_allows() -> None:
    """From a line into an arc of 2 mm: v² / R jumps, which third differences see as 3/4 v² / (R T)."""
    path = chain(line((0, 0), (10, 0), 13.0), arc((10, 0), (10, 4), (10, 2), 13.0))
    motion, certificate, _ = planned(path)
    assert certificate.ok
    middle = np.searchsorted(motion.distance, 10.0)
    expected = np.sqrt(0.3 * 0.999 * 1e4 * T / (0.75 / 2.0))
    assert np.linalg.norm(motion.velocity[middle]) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("tolerance", [0.01, 0.1, 0.5])
def test_blending_uses_its_tolerance_and_keeps_it(tolerance: float) -> None:
    motion, certificate, _ = planned(polygon(SQUARE, 10.0, mode=BLEND, tolerance=tolerance))
    assert certificate.ok
    away = certificate.worst["deviation", ""].value
    assert 0.6 * tolerance < away <= tolerance
    assert np.linalg.norm(motion.velocity, axis=1)[200:-200].min() > 1.0  # no stop at a corner


def test_a_wider_tolerance_is_faster_and_none_given_means_the_default() -> None:
    times = [len(planned(polygon(SQUARE, 13.0, mode=BLEND, tolerance=t))[0]) for t in (0.01, 0.05, 0.2, inf)]
    assert times[0] > times[1] > times[2]
    assert times[3] == times[1]
    assert times[1] < len(planned(polygon(SQUARE, 13.0, mode=EXACT_PATH))[0])


def test_where_the_path_turns_back_it_is_stopped_at_even_when_blending() -> None:
    motion, certificate, _ = planned(polygon([(0, 0), (5, 0), (0, 0.1)], 10.0, mode=BLEND, tolerance=0.5))
    assert certificate.ok and motion.position[:, 0].max() == 5.0


def test_the_speed_along_the_path_is_the_programmed_rate() -> None:
    path = chain(line((0, 0), (20, 0), 5.0, mode=BLEND), arc((20, 0), (20, 20), (20, 10), 3.0, mode=BLEND))
    motion, _, _ = planned(path)
    speed = np.linalg.norm(motion.velocity[:, :3], axis=1)
    assert speed.max() == pytest.approx(5.0, rel=1e-9)
    assert np.median(speed[motion.segment == 1]) == pytest.approx(3.0, rel=1e-9)


@settings(max_examples=60, deadline=None)
@given(segments=chains(modes=(BLEND,), low=-3.0))
def test_blends_are_no_faster_than_the_faster_of_the_moves_that_they_blend(segments: np.ndarray) -> None:
    """In mm/s; a chain with rapids has no programmed rate to compare with."""
    if not len(segments) or segments["rapid"].any():
        return
    motion, _, _ = planned(segments, MACHINES[2], periods(segments, MACHINES[2]))
    linear = (segments["start"] != segments["end"])[:, :3].any(axis=1) | (segments["plane"] >= 0)
    rate = np.where(linear, segments["rate"], 0.0)
    near = np.clip(motion.segment[:, None] + [-1, 0, 1], 0, len(rate) - 1)
    speed = np.linalg.norm(motion.velocity[:, :3], axis=1)
    assert (speed <= rate[near].max(axis=1) * (1.0 + 1e-9)).all()


def test_a_blend_of_an_arc_would_be_faster_than_its_ends_and_is_not() -> None:
    """At the corner of a line and an arc the quintic's derivative by q is more than 1."""
    path = chain(
        line((0, 0), (4, 0), 5.0, mode=BLEND, tolerance=0.5),
        arc((4, 0), (4, 2), (4, 1), 5.0, mode=BLEND, tolerance=0.5),
    )
    motion, _, _ = planned(path, MACHINES[2])
    assert 4.999 < np.linalg.norm(motion.velocity[:, :3], axis=1).max() <= 5.0 * (1.0 + 1e-12)


@pytest.mark.parametrize("off", [0.0007, 0.0283, -0.0283])
def test_an_arc_that_ends_off_its_circle_drifts_there_at_most_at_the_programmed_rate(off: float) -> None:
    """The circle of the start's radius, plus a share of the difference that grows with the angle: mm, mm/s."""
    path = arc((10, 0), (0, 10 + off), (0, 0), 5.0)
    motion, certificate, _ = planned(path)
    assert certificate.ok and certificate.worst["deviation", ""].value < 1e-9
    share = motion.distance / path["length"][0]
    circle = 10.0 * np.column_stack((np.cos(share * pi / 2), np.sin(share * pi / 2)))
    assert np.abs(motion.position[:, :2] - circle - share[:, None] * [0.0, off]).max() < 1e-9
    spiral = 10.0 + off * share  # LinuxCNC's: the radius grows with the angle
    assert np.abs(np.hypot(*motion.position[:, :2].T) - spiral).max() < 0.3 * abs(off)
    assert np.linalg.norm(motion.velocity, axis=1).max() <= 5.0 * (1.0 + 1e-12)


def test_rotary_moves_go_by_degrees() -> None:
    motion, certificate, _ = planned(line((0, 0, 0, 0), (0, 0, 0, 90), 20.0))
    assert certificate.ok and motion.velocity[:, 3].max() == pytest.approx(20.0)
    assert motion.distance[-1] == 90.0
    with_x, _, _ = planned(line((0, 0, 0, 0), (10, 0, 0, 90), 5.0))
    assert with_x.velocity[:, 3].max() == pytest.approx(0.999 * 30.0)  # A cannot follow 45°/s
    assert with_x.velocity[:, 0].max() == pytest.approx(0.999 * 30.0 / 9.0)


def test_many_short_ways_and_none_at_all() -> None:
    """Ways of 0.1 nm add up, and end exactly."""
    points = [(1e-7 * k, 0.0) for k in range(2001)]
    motion, certificate, _ = planned(polygon([*points, (1.0, 0.0)], 10.0))
    assert certificate.ok and (motion.position[-1, :2] == [1.0, 0.0]).all()
    still, _, _ = planned(line((1, 1), (1, 1), 10.0))
    assert (still.position[:, :2] == 1.0).all()
    assert list(plan([np.empty(0, SEGMENT)], MACHINES[0], T)) == []


def test_the_motion_rests_for_dwells_and_stops() -> None:
    path = polygon([(0, 0), (10, 0), (20, 0), (30, 0)], 10.0, mode=BLEND)
    kinds = (
        Event(-1, "spindle", 500.0),
        Event(0, "dwell", 0.25),
        Event(0, "coolant"),
        Event(1, "stop"),
        Event(2, "end"),
    )
    motion, certificate, happened = planned([PathBlock(path, list(kinds))])
    assert certificate.ok
    assert [event.kind for _, event in happened] == ["spindle", "dwell", "coolant", "stop", "end"]
    at = {event.kind: sample for sample, event in happened}
    assert at["spindle"] == 0 and at["end"] == len(motion) - 1
    assert (motion.position[at["dwell"] : at["dwell"] + 251, 0] == 10.0).all()
    assert motion.position[at["dwell"] + 255, 0] > 10.0
    assert motion.position[at["stop"], 0] == 20.0 and not motion.velocity[at["stop"]].any()


def test_an_event_that_comes_after_its_block_still_stops_the_motion() -> None:
    path = polygon([(0, 0), (10, 0), (20, 0)], 10.0, mode=BLEND)
    blocks = [PathBlock(path[:1], []), PathBlock(path[1:], [Event(-1, "dwell", 0.1)])]
    together = [PathBlock(path, [Event(0, "dwell", 0.1)])]
    assert (planned(blocks)[0].position == planned(together)[0].position).all()


def test_a_passing_event_is_where_it_is_passed() -> None:
    path = polygon([(0, 0), (10, 0), (20, 0)], 10.0, mode=BLEND)
    motion, _, ((sample, event),) = planned([PathBlock(path, [Event(0, "coolant")])])
    assert event.kind == "coolant" and motion.velocity[sample, 0] == pytest.approx(10.0)
    assert motion.position[sample - 1, 0] < 10.0 <= motion.position[sample, 0]


def test_the_predicted_time_is_that_of_the_samples() -> None:
    blocks = list(plan([polygon(SQUARE, 10.0)], MACHINES[0], T))
    assert predicted_time(blocks) == sum(map(len, blocks)) * T


def test_helices_and_arcs_follow_their_programmed_path() -> None:
    helix = arc((5, 0, 0), (5, 0, 6), (0, 0, 0), 8.0, turns=2)
    assert helix["length"][0] == pytest.approx(hypot(2 * pi * 5 * 3, 6))
    motion, certificate, _ = planned(helix)
    assert certificate.ok
    expected = np.array([point_at(helix[0], d) for d in motion.distance])
    assert np.abs(motion.position - expected).max() < 1e-9


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (lambda: line((0, 0), (1, 0), 0.0, program_line=7), "line 7: this move has the rate 0"),
        (lambda: line((0,) * 6, (0, 0, 0, 0, 1), 1.0, program_line=8), "line 8: this move wants axis B"),
        (lambda: line((0, 0), (np.nan, 0), 1.0, program_line=9), "line 9: a position of this move is not finite"),
        (
            lambda: chain(line((0, 0), (1, 0), 1.0), line((1.1, 0), (2, 0), 1.0, program_line=5)),
            "line 5: this move does not start where",
        ),
    ],
)
def test_segments_that_cannot_be_are_refused_by_line(path: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        list(plan([path()], MACHINES[0], T))  # type: ignore[operator]
    with pytest.raises(InputError, match="sample period"):
        list(plan([], MACHINES[0], 0.0))


def _passed(points: list[tuple[float, float]], feed: float, tolerance: float, mode: int = BLEND) -> tuple[float, float]:
    """Time (s) of a way through points at P `tolerance`, or stopping at each, and how far off the path it is (mm)."""
    limits = Limits(np.r_[[130.0] * 3, [0.0] * 3], np.r_[[400.0] * 3, [0.0] * 3], np.r_[[12000.0] * 3, [0.0] * 3])
    certificate = Certificate(limits)
    blocks = list(certified(plan([polygon(points, feed, mode=mode, tolerance=tolerance)], limits, T), certificate))
    assert certificate.ok, certificate.violations
    speed = np.linalg.norm(np.concatenate([block.velocity for block in blocks]), axis=1)
    middle = speed[len(speed) // 2 - 100 : len(speed) // 2 + 100].min() if len(speed) > 200 else 0.0
    return (float(middle), certificate.worst["deviation", ""].value) if mode == BLEND else (certificate.time, 0.0)


def test_a_right_angle_is_passed_at_the_jerk_limited_optimum() -> None:
    """Within a path tolerance P and a jerk j each axis changes its speed v in 2 √(v/j), and is vτ/6 off: 7.25 mm/s."""
    optimum = (6 * 0.05 * 12000**0.5) ** (2 / 3) / 2**0.5
    speed, away = _passed([(0, 0), (20, 0), (20, 20)], 40.0, 0.05)
    assert 0.98 * optimum < speed <= optimum
    assert 0.95 * 0.05 < away <= 0.05


@pytest.mark.parametrize(("turn", "saves"), [(90.0, 0.015), (130.0, 0.02)])
def test_the_way_through_a_corner_is_sped_up_within_its_blend(turn: float, saves: float) -> None:
    """It takes less than at the highest even speed √(a d / |t₁ − t₀|) over the blend, from one S-curve to the other."""
    F, a, j, P = 10.0, 200.0, 10000.0, 0.02
    limits = Limits(np.r_[[13.0] * 3, [0.0] * 3], np.r_[[a] * 3, [0.0] * 3], np.r_[[j] * 3, [0.0] * 3])
    here, there = np.array([2 * 0.5**0.5, 2 * 0.5**0.5]), np.radians(45.0 + turn) + np.array([0.0, -pi / 2])
    path = [(0.0, 0.0), tuple(here), tuple(here + 2.0 * np.cos(there))]
    certificate = Certificate(limits)
    blocks = list(certified(plan([polygon(path, F, mode=BLEND, tolerance=P)], limits, T), certificate))
    assert certificate.ok, certificate.violations
    half = 6 * 0.999 * P / np.sin(np.radians(turn))
    change = np.abs(np.cos(there) - 0.5**0.5).max()
    even = (a * half / change) ** 0.5
    along = [1 / 0.5**0.5, 1 / np.abs(np.cos(there)).max()]  # of acceleration and jerk, that a line has
    ramps = [[((F - v) / (a * k) + a / j, 0.5 * (F + v)) for v in (0.0, even)] for k in along]
    took = sum(2.0 / F + sum(t * (1.0 - v / F) for t, v in ramp) for ramp in ramps)
    took += 2.0 * half * (1.0 / even - 1.0 / F)
    assert sum(map(len, blocks)) * T < took - saves


def test_the_tolerance_is_measured_to_the_path_at_a_sharp_turn() -> None:
    _, away = _passed([(0, 0), (20, 0), (10, 10)], 2.0, 0.05)
    assert 0.9 * 0.05 < away <= 0.05


@pytest.mark.parametrize("feed", [1.5, 30.0])
@pytest.mark.parametrize("seed", range(4))
def test_no_plan_is_slower_than_stopping_at_every_move(seed: int, feed: float) -> None:
    rng = np.random.default_rng(seed)
    turn = np.cumsum(rng.uniform(-2.5, 2.5, 20))
    steps = 10 ** rng.uniform(-1, 1) * rng.uniform(0.1, 1.0, 20)
    points = [tuple(p) for p in np.cumsum(np.column_stack((np.cos(turn), np.sin(turn))) * steps[:, None], axis=0)]
    limits = Limits(np.r_[[130.0] * 3, [0.0] * 3], np.r_[[400.0] * 3, [0.0] * 3], np.r_[[12000.0] * 3, [0.0] * 3])
    times = [
        sum(map(len, plan([polygon(points, feed, mode=mode, tolerance=0.01)], limits, T)))
        for mode in (BLEND, EXACT_STOP)
    ]
    assert times[0] <= times[1] + 1


@settings(max_examples=60)
@given(
    data=st.data(),
    axes=st.lists(st.floats(0.0, 2.0), min_size=9, max_size=9),
    feed=st.floats(2.0, 20.0),
    tolerance=st.floats(-3.0, -1.7),
)
def test_nor_where_the_axes_differ_a_hundredfold(
    data: st.DataObject, axes: list[float], feed: float, tolerance: float
) -> None:
    """And what it is compared with, the least time along its path, is that of the motion that was taken."""
    steps = data.draw(st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 3), min_size=2, max_size=12))
    size = data.draw(st.sampled_from([0.05, 1.0, 10.0]))
    points = [tuple(p) for p in np.cumsum([(0.0, 0.0, 0.0), *steps], axis=0) * size]
    rows = 10.0 ** np.add(np.reshape(axes, (3, 3)), [[0.0], [1.0], [3.0]])
    limits = Limits(*(np.r_[row, [0.0] * 3] for row in rows))
    times = []
    for mode in (BLEND, EXACT_STOP):
        least = LeastTime(limits, T)
        path = polygon(points, feed, mode=mode, tolerance=10.0**tolerance)
        times.append(predicted_time(plan([path], limits, T, least_time=least)))
        assert least.seconds <= times[-1]
    assert times[0] <= times[1] + 0.5 * T


@pytest.mark.parametrize("ramp", [0.033, 0.2])  # s to the full acceleration
@pytest.mark.parametrize("way", [0.003, 0.02, 0.1, 0.5, 3.0, 30.0])
def test_a_short_move_takes_the_least_time_within_two_per_cent(way: float, ramp: float) -> None:
    """Against the closed form of the time-optimal move within v, a and j, which `ruckig` computes too."""
    v, a, j = 40.0, 12000.0 * ramp, 12000.0
    limits = Limits(np.r_[[v] * 3, [0.0] * 3], np.r_[[a] * 3, [0.0] * 3], np.r_[[j] * 3, [0.0] * 3])
    took = sum(map(len, plan([line((0, 0), (way, 0), v)], limits, T))) * T
    if v < a * a / j and way >= 2 * v * (v / j) ** 0.5:
        best = way / v + 2 * (v / j) ** 0.5
    elif v >= a * a / j and way >= v * v / a + v * a / j:
        best = way / v + v / a + a / j
    elif way >= 2 * a**3 / j**2:
        best = a / j + ((a / j) ** 2 + 4 * way / a) ** 0.5
    else:
        best = 4 * (way / (2 * j)) ** (1 / 3)
    assert took <= 1.02 * best + 2 * T
