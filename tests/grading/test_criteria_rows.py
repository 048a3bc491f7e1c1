"""Criteria of interpolators against geometry."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rds.core.types import ArcSegment, LineSegment, Segment
from rds.grading.cases import CaseRun
from rds.grading.criteria import KINDS
from rds.grading.criteria.measuring import NotMeasured
from rds.results import Result

T = 0.01
LINE = LineSegment((0.0, 0.0), (3.0, 4.0), 10.0)
ARC = ArcSegment((10.0, 0.0), (0.0, 10.0), (0.0, 0.0), 10.0)


def rows_of(segment: Segment, positions: np.ndarray, velocities: np.ndarray | None = None) -> CaseRun:
    whole = np.vstack([segment.start, positions])
    columns = {"time": np.arange(len(whole)) * T, "X_reference": whole[:, 0], "Y_reference": whole[:, 1]}
    rows = None
    if velocities is not None:
        rows = np.stack([positions, velocities, np.zeros_like(positions)], axis=1)
    meta = {"axes": ["X", "Y"], "sample_period": T}
    return CaseRun("case", 0, Result(columns, {}, meta), facts={"segment": segment}, rows=rows)


def measured(kind: str, run: Any) -> float:
    return float(KINDS.module(kind).measure(run, {}))


def straight(n: int, reach: float = 1.0) -> np.ndarray:
    return np.outer(np.arange(1, n + 1) / n, np.array([3.0, 4.0])) * reach


def test_a_line_at_its_feed() -> None:
    run = rows_of(LINE, straight(50))
    assert measured("end-point-error", run) < 1e-12
    assert measured("path-error", run) < 1e-12
    assert measured("feed-error", run) < 1e-9
    assert measured("largest-velocity", run) == pytest.approx(8.0, rel=1e-9)  # of Y: 10 mm/s, 4 of 5
    assert measured("largest-acceleration", run) == pytest.approx(8.0 / T, rel=1e-9)  # from rest in one sample


def test_a_line_that_is_too_fast_and_ends_too_early() -> None:
    run = rows_of(LINE, straight(25, 0.9))
    assert measured("end-point-error", run) == pytest.approx(0.5, rel=1e-12)
    assert measured("feed-error", run) == pytest.approx(80.0, rel=1e-9)


def test_a_feed_rate_is_not_kept_by_rows_that_do_not_move() -> None:
    with pytest.raises(NotMeasured, match="nothing moves"):
        measured("feed-error", rows_of(LINE, np.zeros((5, 2))))


def test_beside_the_line_is_off_the_path() -> None:
    assert measured("path-error", rows_of(LINE, straight(50) + 0.1 * np.array([-0.8, 0.6]))) == pytest.approx(0.1)


@pytest.mark.parametrize("n", [20, 100])
def test_the_chord_error_of_an_arc_is_its_sagitta(n: int) -> None:
    angle = 0.5 * np.pi * np.arange(1, n + 1) / n
    run = rows_of(ARC, 10.0 * np.column_stack([np.cos(angle), np.sin(angle)]))
    assert measured("chord-error", run) == pytest.approx(10.0 * (1.0 - np.cos(0.25 * np.pi / n)), rel=1e-6)
    assert measured("path-error", run) < 1e-12


def around(turns: float) -> np.ndarray:
    angle = 2.0 * np.pi * turns * np.arange(1, 101) / 100
    return 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("is_clockwise", [False, True])
def test_a_full_circle_is_gone_round_once_and_the_right_way(is_clockwise: bool) -> None:
    circle = ArcSegment((10.0, 0.0), (10.0, 0.0), (0.0, 0.0), 10.0, is_clockwise)
    right = -1.0 if is_clockwise else 1.0
    assert measured("path-error", rows_of(circle, around(right))) < 1e-12
    there_and_back = np.vstack([around(0.1 * right), around(0.1 * right)[::-1], circle.end])
    for samples in (around(-right), around(2.0 * right), there_and_back, np.array([circle.end])):
        with pytest.raises(NotMeasured, match="about the centre"):
            measured("path-error", rows_of(circle, samples))


def test_rows_whose_velocities_are_not_those_of_their_positions() -> None:
    honest = np.tile([6.0, 8.0], (50, 1))
    assert measured("row-consistency", rows_of(LINE, straight(50), honest)) < 1e-9
    wrong = honest.copy()
    wrong[20] += [1.0, 0.0]
    assert measured("row-consistency", rows_of(LINE, straight(50), wrong)) == pytest.approx(0.5, rel=1e-9)


def test_a_move_lasts_from_the_start_to_the_last_row() -> None:
    assert measured("duration", rows_of(LINE, straight(50))) == pytest.approx(0.5, rel=1e-12)  # 5 mm at 10 mm/s
    assert measured("duration", rows_of(LINE, straight(51))) == pytest.approx(0.51, rel=1e-12)
