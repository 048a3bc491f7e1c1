"""A path of segments: chained, sampled, measured, saved and drawn; a user's method through the same door."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import ContractError, InputError
from rds.core.types import ArcSegment, LineSegment
from rds.interpolators.acceleration import make_acceleration
from rds.interpolators.deviation import distances
from rds.interpolators.interpolator import find_interpolator, library_interpolator
from rds.interpolators.path import interpolate
from rds.interpolators.plots import pictures
from rds.interpolators.segment_rows import segments_of
from rds.results import open_result

T = 0.01
KEYHOLE = [
    LineSegment((0.0, 0.0), (30.0, 40.0), 10.0),
    ArcSegment((30.0, 40.0), (30.0, 40.0), (30.0, 30.0), 10.0),
    LineSegment((30.0, 40.0), (0.0, 0.0), 20.0),
]


def test_segments_follow_each_other_without_a_gap() -> None:
    done = interpolate(KEYHOLE, T)
    assert done.samples == 500 + 629 + 250 and done.duration == pytest.approx(13.79)
    assert np.bincount(done.segment).tolist() == [501, 629, 250]
    assert np.linalg.norm(np.diff(done.position, axis=0), axis=1).max() <= 0.2 + 1e-9
    assert done.path_error.max() < 1e-9 and tuple(done.position[500]) == (30.0, 40.0)
    assert not done.velocity[0].any()
    assert done.programmed_length == pytest.approx(100 + 20 * np.pi)


def test_lines_and_arcs_by_different_methods() -> None:
    done = interpolate(KEYHOLE, T, arcs=library_interpolator("tustin"))
    assert done.methods == ("constant-velocity", "tustin")
    assert [each is not None for each in done.steps] == [False, True, False]
    assert 0.001 < done.path_error.max() <= 0.01 and done.within


def test_distance_to_arcs_ends_at_their_ends() -> None:
    quarter = ArcSegment((10.0, 0.0, 0.0), (0.0, 10.0, 5.0), (0.0, 0.0, 0.0), 1.0)
    points = np.array([(10.0, -1.0, 0.0), (-1.0, 10.0, 5.0), (11.0, 0.0, 0.0), (0.0, 0.0, -3.0), (7.0, 7.0, 2.5)])
    assert distances(quarter, points)[:3] == pytest.approx([1.0, 1.0, 1.0])
    assert distances(quarter, points)[4] == pytest.approx(10.0 - np.hypot(7, 7))
    circle = ArcSegment((10.0, 0.0, 0.0), (10.0, 0.0, 5.0), (0.0, 0.0, 0.0), 1.0)
    assert distances(circle, np.array([(10.0, 0.0, 5.0), (10.0, 0.0, 0.0)])).max() < 1e-9


def test_the_table_reopens_as_it_was_saved(tmp_path: Path) -> None:
    done = interpolate(KEYHOLE, T, library_interpolator("reference-pulse"), acceleration=make_acceleration("linear"))
    done.save(tmp_path / "keyhole.csv")
    again = open_result(tmp_path / "keyhole.csv")
    assert np.array_equal(again["X_reference"], done.position[:, 0])
    assert np.array_equal(again["Y_reference_velocity"], done.velocity[:, 1])
    assert done.pulses is not None and np.array_equal(again["Y_pulses"][1:], done.pulses[:, 1])
    assert again.units["X_pulses"] == "BLU" and again.units["path_error"] == "mm"
    assert again.meta["interpolation"]["method"] == "reference-pulse"
    # decoded from the table, the pulses lead along the path (dcs-thesis, section 6.6)
    decoded = np.cumsum(again["X_pulses"]) * 0.01
    assert np.abs(decoded - done.theory[:, 0]).max() <= 0.005 + 1e-9


@pytest.mark.parametrize("method", ["reference-pulse", "improved-tustin"])
def test_pictures(method: str) -> None:
    drawn = pictures(interpolate(KEYHOLE, T, library_interpolator(method)))
    own = {"reference-pulse": "generation-error", "improved-tustin": "steps"}[method]
    assert set(drawn) == {"motion", "path", "magnified", "errors", own}
    assert all(picture.png().startswith(b"\x89PNG") for picture in drawn.values())
    assert [axes.get_ylabel() for axes in drawn["motion"].axes] == [
        "position [mm]",
        "velocity [mm/s]",
        "acceleration [mm/s²]",
    ]


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ([], "no segment"),
        ([LineSegment((0.0,), (0.0,), 1.0)], "has no length"),
        ([KEYHOLE[0], KEYHOLE[0]], r"segment 2 starts at \(0.0, 0.0\) and the one before ends at \(30.0, 40.0\)"),
    ],
)
def test_refusals(path: list, said: str) -> None:
    with pytest.raises(InputError, match=said):
        interpolate(path, T)


@pytest.mark.parametrize(
    ("rests", "said"),
    [({3: 1.0}, "no segment 3 .*to 2"), ({-2: 1.0}, "no segment -2"), ({0: -1.0}, "from 0"), ({0: np.nan}, "finite")],
)
def test_rests_that_there_are_not(rests: dict[int, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        interpolate(KEYHOLE, T, rests=rests)


def test_lines_and_arcs_have_one_basic_length_unit() -> None:
    fine, coarse = (library_interpolator("reference-pulse", blu=blu) for blu in (0.002, 0.01))
    with pytest.raises(InputError, match=r"a BLU each, 0\.002 and 0\.01 mm; give both the same"):
        interpolate(KEYHOLE, T, lines=fine, arcs=coarse)
    assert interpolate(KEYHOLE[:1], T, lines=fine, arcs=coarse).blu == 0.002


@pytest.mark.parametrize("end", [[10**400, 0.0], [float("nan"), 0.0], [float("inf"), 0.0]])
def test_a_row_whose_end_is_no_place_is_refused(end: list[float]) -> None:
    with pytest.raises(InputError, match=r"segment 1: end = .* must be one to six positions"):
        segments_of((0.0, 0.0), [{"kind": "line", "end": end}], 1.0, "mm/s")


@pytest.mark.parametrize(("feed", "period"), [(0.0, T), (1.0, 0.0)])
def test_rows_of_what_cannot_be_are_refused_as_a_path_is(feed: float, period: float) -> None:
    with pytest.raises(InputError, match="above 0"):
        library_interpolator().rows(LineSegment((0.0,), (1.0,), feed), period)


def test_axes_are_named() -> None:
    line = [LineSegment((0.0, 0.0), (1.0, 1.0), 1.0)]
    assert interpolate(line, T, axes=("Y", "Z")).axes == ("Y", "Z")
    with pytest.raises(InputError, match="2 axes move, and there are 1 names"):
        interpolate(line, T, axes=("Y",))


GOOD = """
import numpy as np
params = {"samples": 10}

def interpolate(segment, T, params):
    for k in range(1, params["samples"] + 1):
        share = k / params["samples"]
        yield np.array(segment.start) * (1 - share) + np.array(segment.end) * share, [0, 0], [0, 0]
"""
BAD = {
    "rows": "    yield segment.start\n",
    "(position, velocity, acceleration), 2 finite numbers": "    yield [1, 2], [float('nan'), 0], [0, 0]\n",
    "and no end": "    while True:\n        yield segment.start, segment.start, segment.start\n",
    "ZeroDivisionError": "    yield segment.start, 1 / 0, 0\n",
}


def test_a_user_s_interpolator(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(GOOD)
    assert interpolate(KEYHOLE[:1], T, find_interpolator(str(file))).samples == 10
    mine = find_interpolator(str(file), {"samples": 4})
    smoothed = interpolate(KEYHOLE[:1], T, mine, acceleration=make_acceleration("linear", time=0.03))
    assert smoothed.samples == 6 and tuple(smoothed.position[-1]) == (30.0, 40.0)
    with pytest.raises(InputError, match="unknown parameter 'rows'"):
        find_interpolator(str(file), {"rows": 4})


@pytest.mark.parametrize(("said", "body"), BAD.items(), ids=lambda text: text[:12])
def test_a_user_s_interpolator_that_breaks_its_interface(tmp_path: Path, said: str, body: str) -> None:
    file = tmp_path / "mine.py"
    file.write_text("def interpolate(segment, T, params):\n" + body)
    with pytest.raises(ContractError) as refusal:
        interpolate(KEYHOLE[:1], T, find_interpolator(str(file)))
    text = str(refusal.value)
    assert "rds check mine.py" in text and (said in text or said == "rows"), text


def test_names_and_options_that_there_are_not() -> None:
    with pytest.raises(InputError, match=r"no interpolator 'cubic'; known interpolators: constant-velocity, linear"):
        find_interpolator("cubic")
    with pytest.raises(InputError, match="no such file"):
        find_interpolator("no_such_file.py")
    with pytest.raises(InputError, match="did you mean 'blu'"):
        library_interpolator("euler", blue=0.1)
    with pytest.raises(InputError, match=r"steps = 2\.5 must be a whole number"):
        library_interpolator("euler", steps=2.5)


def test_keyhole_is_a_chain() -> None:
    assert all(a.end == b.start for a, b in pairwise(KEYHOLE))


def test_a_circle_that_is_gone_round_within_a_sample_is_told_by_its_feed() -> None:
    tiny = ArcSegment((0.0, 0.0), (0.0, 0.0), (0.02, 0.0), 200.0)  # 0.126 mm, and 0.2 mm in a sample
    with pytest.raises(InputError, match=r"an arc of 0\.125664 mm takes 0\.63 sample periods .* lower the feed rate"):
        interpolate([tiny], 0.001)
