"""Canned cycles and the other words of courses: what they do, besides being call for call those of rs274."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.nc.language.canon import ARC, FEED, RATE, TRAVERSE, Call, MotionBlock
from rds.nc.language.dialect import Dialect
from rds.nc.language.errors import ProgramError
from rds.nc.language.interpreter import interpret
from rds.nc.spline import CURVE_ERROR, curve
from rds.nc.toolpath import toolpath

Moves = list[tuple[int, tuple[float, float, float]]]


def moves(text: str, **options: Any) -> Moves:
    """Kind and end (X, Y, Z) of each straight move."""
    found: Moves = []
    for item in interpret(text, options=Dialect(**options)):
        if isinstance(item, MotionBlock):
            assert ARC not in item.rows["kind"]
            for row in item.rows[item.rows["kind"] != RATE]:
                x, y, z = row["values"][:3].tolist()
                found.append((int(row["kind"]), (x, y, z)))
    return found


def ends(text: str, **options: Any) -> list[tuple[float, float, float]]:
    return [end for _, end in moves(text, **options)]


AXES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
heights = st.integers(-50, 50).map(lambda value: value / 4)


@given(
    plane=st.sampled_from([17, 18, 19]),
    holes=st.lists(st.tuples(heights, heights), min_size=1, max_size=5),
    start=heights,
    retract=heights,
    depth=st.integers(0, 80).map(lambda value: value / 4),
    peck=st.integers(1, 20).map(lambda value: value / 4),
    code=st.sampled_from([73, 81, 82, 83, 85, 89]),
    high=st.booleans(),
)
def test_each_hole_is_drilled_to_its_depth_and_left_at_the_right_height(
    plane: int,
    holes: list[tuple[float, float]],
    start: float,
    retract: float,
    depth: float,
    peck: float,
    code: int,
    high: bool,
) -> None:
    """Cutting only along the third axis above the holes, never deeper than the bottom, no rapid into uncut material."""
    first, second, third = AXES[plane]
    letters = "XYZ"
    bottom = retract - depth
    begin = f"G{plane} G{98 if high else 99} F100\nG0 {letters[third]}{start}\n"
    words = f"G{code} {letters[third]}{bottom} R{retract} Q{peck} P0.1"
    if code not in (73, 83):
        words = words.replace(f" Q{peck}", "")
    if code not in (82, 89):
        words = words.replace(" P0.1", "")
    lines = [f"{letters[first]}{a} {letters[second]}{b}" for a, b in holes]
    found = moves(f"{begin}{words} {lines[0]}\n" + "\n".join(lines[1:]) + "\nG80\nM2")
    clear = max(start, retract) if high else retract
    cut: dict[tuple[float, float], float] = {}
    before = found[0][1]
    for kind, end in found[1:]:
        place = end[first], end[second]
        if kind == FEED:
            assert (before[first], before[second]) == place
            cut[place] = min(cut.get(place, math.inf), end[third])
        elif (before[first], before[second]) == place:
            assert end[third] >= min(retract, cut.get(place, retract))  # rapids stay in what is cut, or above R
        else:
            assert before[third] == end[third] >= retract  # across only above R
        before = end
    assert cut == dict.fromkeys(holes, bottom)
    assert before == tuple(np.array(before)) and before[third] == clear


def test_pecks_take_q_each_and_g91_repeats_along_a_line() -> None:
    found = ends("F100\nG0 Z5\nG99 G91 G83 X2 Z-3 R-4 Q1 L2\nM2")
    assert [z for _, _, z in found[:8]] == [5, 5, 1, 0, 1, 0.254, -1, 1]
    assert found[-1] == (4, 0, 1) and (2, 0, -2) in found and (4, 0, -2) in found


def test_a_polar_pattern_of_holes_is_on_its_circle() -> None:
    found = moves("F100\nG0 Z2\nG0 @10 ^0\nG91 G81 ^60 Z-1 R-1 L6\nG80\nM2")
    holes = {(round(x, 9), round(y, 9)) for kind, (x, y, _) in found if kind == FEED}
    assert len(holes) == 6 and all(math.hypot(*hole) == pytest.approx(10) for hole in holes)


def test_g52_shifts_the_origin_and_g52_x0_y0_brings_it_back() -> None:
    offsets = [item.args[:2] for item in interpret("G52 X1 Y2\nG52 X0 Y0\nM2") if _named(item, "SET_G92_OFFSET")]
    assert offsets[1:] == [(1, 2), (0, 0)]


def _named(item: MotionBlock | Call, name: str) -> bool:
    return isinstance(item, Call) and item.name == name


def test_diameters_are_halved_between_g7_and_g8_and_in_the_fast_lane_too() -> None:
    text = "F100\nG7\n" + "".join(f"G1 X{2 * k} Z{k}\n" for k in range(200)) + "G8\nG1 X7\nM2"
    found = ends(text)
    assert [x for x, _, _ in found] == [*range(200), 7]


def test_m98_runs_a_program_by_its_number_and_m99_returns() -> None:
    text = "O1000 (main)\n#1=1\nM98 P200 L3\nG0 Y9\nM30\nO200\n#1=[#1+1]\nG0 X#1\nM99\n"
    assert ends(text) == [(2, 0, 0), (3, 0, 0), (4, 0, 0), (4, 9, 0)]
    assert ends("G0 X1\nM99\nG0 X2\n") == [(1, 0, 0)]  # of the main program, its end


def test_modes_saved_by_m73_are_back_when_the_subroutine_returns() -> None:
    text = "G21 F120\no1 sub\nM73\nG91 G20 F3\nG1 X1\no1 endsub\no1 call\nG1 X30\nM2"
    found = list(interpret(text))
    rows = np.concatenate([item.rows for item in found if isinstance(item, MotionBlock)])
    assert rows[rows["kind"] == FEED]["values"][:, 0].tolist() == [1, 30]
    assert rows[rows["kind"] == RATE]["values"][:, 0].tolist() == [120, 3, 120, 0]


def test_a_probe_stops_at_the_surface_and_the_program_can_ask_where() -> None:
    probing = "G0 Z10\nG38.2 Z-5 F50\nG0 X#5063 Y#5070\nM2"
    assert ends(probing, probe_surface=2.5)[-1] == (2.5, 1, 2.5)
    assert ends("G10 L2 P1 Z1\n" + probing, probe_surface=2.5)[-1] == (1.5, 1, 1.5)  # in the program's coordinates
    with pytest.raises(ProgramError, match=r"does not touch the surface, .+ Z -8 of the machine; .+ G38.3"):
        ends(probing, probe_surface=-8.0)
    assert ends(probing.replace("38.2", "38.3"), probe_surface=-8.0)[-1] == (-5, 0, -5)


def segments(text: str) -> np.ndarray:
    return np.concatenate([block.segments for block in toolpath(interpret(text))])


def test_a_thread_moves_by_its_pitch_for_each_turn() -> None:
    cut = segments("S600 M3\nG0 X10\nG33 Z-20 K1.5\nG0 X12\nM2")
    assert cut["rate"][1] == pytest.approx(15.0)  # mm/s: 10 turns a second
    assert not cut["rapid"][1] and cut["rapid"][2]


def test_g76_cuts_to_its_depth_in_smaller_and_smaller_passes() -> None:
    found = moves("S600 M3\nG0 X20 Z5\nG76 P1.5 Z-20 I-2 J0.3 K0.92 R2 H1\nM2")
    depths = [18 - end[0] for kind, end in found if kind == FEED]
    assert depths == sorted(depths) and depths[-2:] == pytest.approx([0.92, 0.92])
    steps = np.diff([0, *depths[:-2]])
    assert (np.diff(steps) < 1e-12).all() and found[-1] == (TRAVERSE, (20, 0, -20))


def test_a_spline_is_followed_within_its_error() -> None:
    points = np.array([(0, 0, 1), (0, 30, 1), (40, -30, 1), (40, 0, 1.0)])
    places = curve(points, 4, CURVE_ERROR)
    t = np.linspace(0, 1, 20001)[:, None]
    exact = sum(math.comb(3, k) * t**k * (1 - t) ** (3 - k) * points[k, :2] for k in range(4))
    nearest = np.searchsorted(places[:, 0], exact[:, 0]).clip(1, len(places) - 1)
    a, b = places[nearest - 1], places[nearest]
    along = (b - a) / np.hypot(*(b - a).T)[:, None]
    off = np.abs(along[:, 0] * (exact - a)[:, 1] - along[:, 1] * (exact - a)[:, 0])
    assert off.max() <= CURVE_ERROR * 1.01
    cut = segments("G21 F100\nG5 X40 Y0 I0 J30 P0 Q-30\nM2")
    assert cut["end"][-1][:2] == pytest.approx([40, 0])


def test_a_spline_of_many_points_is_followed_within_its_error() -> None:
    """Each span but those at the ends is the one before it, moved by 20 mm: what holds for one holds for all."""
    points = np.array([(10.0 * k, 10.0 * (k % 2), 1.0) for k in range(150)])
    places = curve(points, 4, CURVE_ERROR)
    few = curve(points[:20], 4, CURVE_ERROR)
    assert len(places) / 147 == pytest.approx(len(few) / 17, rel=0.1)
    middle = places[len(places) // 2 :][:64]
    assert np.hypot(*np.diff(middle, axis=0).T).max() < 0.5  # of a curve with radii of some 5 mm


def test_a_nurbs_with_weights_is_a_circle() -> None:
    half = math.sqrt(0.5)
    places = curve(np.array([(1, 0, 1), (1, 1, half), (0, 1, 1.0)]), 3, 1e-6)
    assert np.abs(np.hypot(*places.T) - 1).max() < 1e-9
