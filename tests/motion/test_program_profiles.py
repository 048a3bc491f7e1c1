"""The profiles that a program's motion can have besides the planned one: what each promises, as numbers."""

from __future__ import annotations

from math import ceil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.interpolators.motion import Limits, SampleBlock
from rds.interpolators.motion.certificate import Certificate
from rds.interpolators.motion.profiles import PROFILES, motion_of
from rds.interpolators.motion.segments import BLEND, EXACT_PATH, SEGMENT, arc, chain, line

from .chains import MACHINES, Event, PathBlock, chains, polygon

T = 1e-3
SLOW = 1e-2
EACH = sorted(PROFILES)


def sampled(
    profile: str, blocks: object, limits: Limits = MACHINES[0], period: float = T
) -> tuple[list[SampleBlock], np.ndarray, Certificate]:
    if "point" in profile:
        pytest.importorskip("ruckig")
    motion, certificate = motion_of(profile, blocks if isinstance(blocks, list) else [blocks], limits, period)
    found = list(motion)
    return found, np.concatenate([block.position for block in found]), certificate


@pytest.mark.parametrize("profile", EACH)
@settings(max_examples=25, deadline=None)
@given(segments=chains(most=6, low=-3.0), limits=st.sampled_from(MACHINES))
def test_each_profile_keeps_what_it_promises_on_any_path(profile: str, segments: np.ndarray, limits: Limits) -> None:
    if not len(segments):
        return
    blocks, position, certificate = sampled(profile, segments, limits, SLOW)
    assert certificate.ok, "\n".join(map(str, certificate.violations[:5]))
    assert (position[0] == segments["start"][0]).all() and (position[-1] == segments["end"][-1]).all()
    assert certificate.samples == len(position) == sum(map(len, blocks))
    distance = np.concatenate([block.distance for block in blocks])
    assert distance[-1] == pytest.approx(segments["length"].sum(), rel=1e-9, abs=1e-9)
    number = np.concatenate([block.segment for block in blocks])
    assert (np.diff(number) >= 0).all()
    line_of = np.concatenate([block.line for block in blocks])
    assert (line_of == segments["line"][number]).all()


@pytest.mark.parametrize("profile", ["trapezoid", "point-to-point"])
def test_at_rest_after_each_move_on_the_path(profile: str) -> None:
    path = chain(
        line((0, 0), (20, 0), 10.0, mode=BLEND),
        arc((20, 0), (20, 10), (20, 5), 10.0, mode=BLEND),
        line((20, 10), (0, 0), 10.0, rapid=True),
    )
    blocks, position, certificate = sampled(profile, path)
    assert certificate.worst["deviation", ""].value < 1e-9
    for end in ([20, 0], [20, 10], [0, 0]):
        k = int(np.argmax((position[:, :2] == end).all(axis=1)))
        assert (position[k, :2] == end).all()
        assert not np.concatenate([block.velocity for block in blocks])[k].any()


def test_the_trapezoid_of_a_line_is_that_of_the_thesis() -> None:
    """three-axis-mill, figure 9: 10 mm at 5 mm/s with 10 mm/s²: 0.5 s up, 1.5 s level, 0.5 s down."""
    limits = Limits.from_axes({"X": (13, 10 / 0.999, 1e4)})
    blocks, position, certificate = sampled("trapezoid", line((0,), (10,), 5.0), limits)
    speed = np.concatenate([block.velocity[:, 0] for block in blocks])
    assert len(position) == 2501
    assert speed[250] == pytest.approx(2.5) and speed[1250] == pytest.approx(5.0) and speed[2250] == pytest.approx(2.5)
    assert position[500, 0] == pytest.approx(1.25) and position[2000, 0] == pytest.approx(8.75)
    assert "Not promised: jerk (" in certificate.sentence()


def test_point_to_point_is_the_fastest_along_a_line() -> None:
    """d/v + v/a + a/j, the seven phases, in the time of one sample more at most."""
    _, position, certificate = sampled("point-to-point", line((0, 0), (40, 0), np.inf, rapid=True))
    v, a, j = (0.999 * value for value in (13.0, 200.0, 1e4))
    assert len(position) - 1 == ceil((40 / v + v / a + a / j) / T - 1e-6)
    assert certificate.worst["jerk", "X"].share == pytest.approx(0.999, abs=1e-3)


def test_blended_holds_the_velocity_through_corners_and_stops_where_an_axis_turns_back() -> None:
    corner = polygon([(0, 0), (10, 0), (20, 5), (15, 10)], 5.0, mode=BLEND)
    blocks, position, _ = sampled("blended", corner)
    speed = np.linalg.norm(np.concatenate([block.velocity for block in blocks]), axis=1)

    def at(point: tuple[float, float]) -> float:
        return float(speed[int(np.argmin(np.abs(position[:, :2] - point).sum(axis=1)))])

    assert at((10, 0)) == pytest.approx(5.0, rel=0.01)
    assert at((20, 5)) == pytest.approx(0.0, abs=0.1)  # X turns back: off for all axes
    exact = polygon([(0, 0), (10, 0), (20, 5)], 5.0, mode=EXACT_PATH)
    blocks, position, _ = sampled("blended", exact)
    speed = np.linalg.norm(np.concatenate([block.velocity for block in blocks]), axis=1)
    assert at((10, 0)) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("profile", EACH)
def test_dwells_and_stops_are_met_at_rest_and_take_their_time(profile: str) -> None:
    path = polygon([(0, 0), (10, 0), (20, 0), (30, 0)], 10.0, mode=BLEND)
    events = [Event(-1, "dwell", 0.1), Event(0, "dwell", 0.25), Event(1, "stop")]
    blocks, position, certificate = sampled(
        profile, [PathBlock(path[:2], events[:3]), PathBlock(path[2:], [Event(0, "end")])]
    )
    assert certificate.ok
    met = {event.kind + str(event.value): sample for block in blocks for sample, event in block.events}
    assert list(met) == ["dwell0.1", "dwell0.25", "stop0.0", "end0.0"]
    assert (position[:101, 0] == 0.0).all() and position[104, 0] > 0.0
    begin = met["dwell0.25"]
    assert (position[begin : begin + 251, 0] == 10.0).all() and position[begin + 255, 0] > 10.0
    assert position[met["stop0.0"], 0] == 20.0 and met["end0.0"] == len(position) - 1


@pytest.mark.parametrize("profile", EACH)
def test_a_path_of_blocks_is_that_of_one(profile: str) -> None:
    path = polygon([(0, 0), (5, 0), (5, 5), (0, 5), (0, 0)], 8.0, mode=EXACT_PATH)
    whole = sampled(profile, path)[1]
    parts = sampled(profile, [path[k : k + 1] for k in range(4)])[1]
    assert (whole == parts).all()
    nothing, certificate = motion_of(profile, [np.empty(0, SEGMENT)], MACHINES[0], T)
    assert list(nothing) == [] and certificate.ok


def test_profiles_refuse_what_cannot_be() -> None:
    with pytest.raises(InputError, match="profile 'fast' is not one of planned, trapezoid, blended, point-to-point"):
        motion_of("fast", [], MACHINES[0], T)
    for profile in ("trapezoid", "blended"):
        with pytest.raises(InputError, match="line 8: this move wants axis B"):
            sampled(profile, line((0,) * 6, (0, 0, 0, 0, 1), 1.0, program_line=8))
