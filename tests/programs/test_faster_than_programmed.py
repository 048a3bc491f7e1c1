"""A feed override above 100 % on rows that an interpolator makes: only where those that are made leave room for it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers, lists, sampled_from, tuples

import rds
from rds.core.types import LineSegment
from rds.interpolators.acceleration import make_acceleration
from rds.interpolators.interpolator import library_interpolator
from rds.machines import load_machine
from rds.modes.loop.interpolated import Interpolated
from rds.nc.run.path_method import Method, program_of

CIRCLE = [{"kind": "arc", "end": [0.0, 0.0], "centre": [5.0, 0.0]}]
CORNER = [{"kind": "line", "end": [10.0, 0.0]}, {"kind": "line", "end": [10.0, 10.0]}]
T = 0.002


def follow(changes: list[tuple[float, str, float]], **words: Any) -> rds.Result:
    filter_ = {"name": "s-shape", "time": 0.2}
    reference = {"kind": "path", "start": [0.0, 0.0], "feed": 450, "acceleration": filter_} | words
    experiment = rds.Experiment(axis=["X", "Y"], controller="tracking", reference=reference, sample_period=T)
    return experiment.run(changes=changes)


def test_a_circle_is_passed_faster_within_the_limits() -> None:
    plain, fast = follow([], segment=CIRCLE), follow([(0.0, "override", 1.5)], segment=CIRCLE)
    assert fast["program_override"].max() == pytest.approx(1.5, abs=1e-12)
    assert len(plain) / 1.5 < len(fast) < len(plain) / 1.3
    assert (fast["X_reference"][-1], fast["Y_reference"][-1]) == (plain["X_reference"][-1], plain["Y_reference"][-1])
    assert fast["path_error"].max() < plain["path_error"].max() + 1e-5
    for shares in fast.meta["program"]["limit_shares"].values():
        assert shares["velocity"] <= 1.0 and shares["acceleration"] <= 1.0
    assert plain["program_buffer"].max() == 3.0 < fast["program_buffer"].max()


def test_the_speed_of_an_axis_bounds_it() -> None:
    """7.5 mm/s along X, which moves at 13 mm/s at most: 173 %, and at the corner what the filter leaves room for."""
    result = follow([(0.0, "override", 2.0)], segment=CORNER)
    assert result["program_override"].max() == pytest.approx(1.73, abs=1e-12)
    shares = result.meta["program"]["limit_shares"]
    assert all(share[kind] <= 1.0 for share in shares.values() for kind in ("velocity", "acceleration"))
    assert shares["X"]["velocity"] > 0.99


def test_a_corner_that_bends_too_much_is_passed_at_the_programmed_feed() -> None:
    result = follow([(0.0, "override", 2.0)], segment=CORNER, acceleration=None)
    at = int(np.argmax(result["program_segment"] == 2))
    assert result["program_override"][at - 1 : at + 2] == pytest.approx(1.0, abs=1e-12)
    assert result["program_override"].max() == pytest.approx(1.73, abs=1e-12)
    assert result["program_override"][-1] == pytest.approx(1.0, abs=1e-12)  # its end, where it stops at once


def test_pulses_leave_no_room() -> None:
    result = follow([(0.0, "override", 2.0)], segment=CIRCLE, acceleration=None, interpolator="reference-pulse")
    assert result["program_override"].max() == 1.0


@given(
    changes=lists(
        tuples(
            integers(1, 500),
            sampled_from([("override", 1.3), ("override", 2.0), ("override", 0.4), ("hold", 1.0), ("hold", 0.0)]),
        ),
        min_size=1,
        max_size=6,
    ),
    feed=floats(3.0, 9.0),
)
@settings(max_examples=25)
def test_whatever_is_wanted_the_limits_are_kept(changes: list[tuple[int, Any]], feed: float) -> None:
    machine = load_machine("mini-cnc")
    path = [LineSegment((0.0, 0.0), (8.0, 6.0), feed), LineSegment((8.0, 6.0), (8.0, 7.0), feed)]
    method = Method(library_interpolator("constant-velocity"), make_acceleration("s-shape", time=0.2))
    made = program_of("path", path, [1, 2], {}, (), method, machine, ["X", "Y"], T)
    follower, wanted, at, way = Interpolated(made, T), {"override": 1.0, "hold": 0.0}, dict(changes), [[0.0, 0.0]]
    for k in range(20_000):
        if k in at:
            wanted[at[k][0]] = at[k][1]
        if k > 500:
            wanted["hold"] = 0.0
        follower.advance(0.0 if wanted["hold"] else wanted["override"], follower.last)
        way.append(list(follower.position))
        if follower.place >= follower.last:
            break
    assert way[-1] == pytest.approx([8.0, 7.0], abs=1e-9)
    speed = np.diff(way, axis=0) / T
    velocity, acceleration, _ = np.asarray(made.limits)
    assert (np.abs(speed).max(axis=0) <= velocity * 1.001).all()
    assert (np.abs(np.diff(speed, axis=0)).max(axis=0) / T <= acceleration).all()
