"""Files of points, and arcs fitted to points."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.core.geometry import radius, sweep
from rds.core.types import ArcSegment, LineSegment
from rds.nc.paths import part_program, path_of_points, read_points
from rds.nc.paths.arc_fit import fit
from rds.nc.paths.deviation import hausdorff
from rds.nc.paths.measure import is_closed, pieces, total_length, trace
from tests.paths.programs import agreed, assert_cuts

FEED = 5.0
# 日, "sun", the character that three-axis-mill reads from a file of points (figures 24 to 28): the frame, the bar
SUN = "x [mm], y [mm]\n0,0\n30,0\n30,40\n0,40\n0,0\n\n0,20\n30,20\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "points.csv"


def read(file: Path, text: str | bytes, unit: str | None = None):
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_points(file, unit)


@pytest.mark.parametrize(
    "text",
    [
        "x [mm], y [mm], z [mm]\n1,2,3\n4,5,6\n",
        "x (mm);y (mm);z (mm)\n1;2;3\n4;5;6",
        "x_mm y_mm z_mm\n1 2 3\n4 5 6\n",
        "\ufeffX\tY\tZ\r\n# units: mm\r\n1\t2\t3\r\n4 5 6 # the end\r\n",
        "# unit = mm\n1 2 3\n# between\n4, 5, 6\n\n\n",
        "z [cm], x [cm], y [cm]\n0.3, .1, 2e-1\n0.6, 0.4, +0.5\n",
        '"x [um]","y [um]","z [um]"\n1000,2000,3000\n4000,5000,6000\n',
        "x [\N{MICRO SIGN}m] y [\N{GREEK SMALL LETTER MU}m] z\n1000 2000 3000\n4000 5000 6000\n",
        "# units: in\n0.03937007874015748,0.07874015748031496,0.11811023622047244\n"
        "0.15748031496062992,0.19685039370078740,0.23622047244094488\n",
    ],
)
def test_points_are_read_in_their_unit(file: Path, text: str) -> None:
    points = read(file, text)
    assert points.has_z
    assert np.allclose(points.pieces, [[[1, 2, 3], [4, 5, 6]]], rtol=1e-14)


def test_the_sun_symbol_is_cut_from_a_file_of_points(file: Path) -> None:
    points = read(file, SUN)
    path, deviation = path_of_points(points, FEED, depth=2)
    assert [len(piece) for piece in pieces(path)] == [4, 1] and deviation == 0
    assert is_closed(pieces(path)[0])
    assert total_length(path) == 170
    assert {point[2] for segment in path for point in (segment.start, segment.end)} == {-2}
    program = part_program(path, "sun", safe_height=5)
    assert_cuts(program, path)
    agreed(program)


def test_points_of_an_array_are_one_piece() -> None:
    points = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    pieces_of_it = path_of_points([points], FEED)
    assert path_of_points(points, FEED) == pieces_of_it == path_of_points(points.tolist(), FEED)
    assert len(path_of_points([points, points[:2] + 9.0], FEED)[0]) == 3
    wrong: list[Any] = ["x.csv", None, [1.0, 2.0], np.zeros((3, 4))]
    for each in wrong:
        with pytest.raises(InputError, match="points"):
            path_of_points(each, FEED)


def test_repeated_points_are_left_out_and_counted(file: Path) -> None:
    points = read(file, "x [mm] y [mm]\n0 0\n0 0\n1 0\n1 0\n1 0\n1 1\n")
    assert points.repeated == 3 and len(points.pieces[0]) == 3
    closed, _ = path_of_points(points, FEED, closed=True)
    assert len(closed) == 3 and is_closed(closed)


@pytest.mark.parametrize(
    "text, unit, place, words",
    [
        ("1,2\n3,4\n", None, ":1", "no unit is given; begin with a header such as 'x [mm], y [mm]'"),
        ("x [mm], y [mm]\n1,2\n3\n", None, ":3", "1 number in '3' instead of 2 (x, y)"),
        ("x [mm], y [mm]\n1,2\n3,4,5\n", None, ":3", "3 numbers in '3,4,5' instead of 2 (x, y)"),
        ("x [mm], y [mm]\n1,2\n3,\n", None, ":3", "y = '' is not a number"),
        ("x [mm], y [mm]\n1,2\n3,four\n", None, ":3", "y = 'four' is not a number"),
        ("x [mm]; y [mm]\n1,5;2,5\n", None, ":2", "x = '1,5' is not a number; write decimals with a point"),
        ("1,5 2,5\n3,5 4,5\n", "mm", ":1", "'1,5 2,5' has decimal commas; write decimals with a point"),
        ("x [mm], y [mm]\n1,2\nnan,4\n", None, ":3", "x = 'nan' is not a number"),
        ("x [mm], y [mm]\n1,2\n1_0,4\n", None, ":3", "x = '1_0' is not a number"),
        ("x [mm], y [mm]\n1,2\n1e999,4\n", None, ":3", "beyond 1e+06 mm; is the unit 'mm' right?"),
        ("x [m], y [m]\n1,2\n1001,4\n", None, ":3", "beyond 1e+06 mm; is the unit 'm' right?"),
        ("x [mm], y [in]\n1,2\n3,4\n", None, ":1", "unit 'in', where 'mm' is given already"),
        ("x [mm], y [mm]\n1,2\n3,4\n", "in", ":1", "unit 'mm', where 'in' is given already"),
        ("x [furlong], y\n1,2\n3,4\n", None, ":1", "unit 'furlong' is not known; known units: mm"),
        ("1,2\n3,4\n", "ft", "", "unit 'ft' is not known"),
        ("x [mm], a [deg]\n1,2\n3,4\n", None, ":1", "column 'a' is none of x, y, z"),
        ("x [mm], x [mm]\n1,2\n3,4\n", None, ":1", "column 'x' is there twice"),
        ("x [mm], z [mm]\n1,2\n3,4\n", None, ":1", "does not name both x and y"),
        ("hello, world!\n1,2\n", None, ":1", "'hello, world!' is no point and no header"),
        ("x [mm], y [mm]\n1,2\n\n3,4\n5,6\n", None, ":2", "a single point makes no path"),
        ("x [mm], y [mm]\n1,2\nx [mm], y [mm]\n3,4\n", None, ":3", "'x [mm]' is not a number"),
        ("x [mm], y [mm]\n", None, "", "has no points"),
        ("", None, "", "has no points"),
        ("1\n", "mm", ":1", "1 number in '1'; a point has 2 (x, y) or 3 (x, y, z)"),
        (b"\xff\xfe\x00", None, "", "is not text in UTF-8"),
        ("1" * 5000, "mm", ":1", "more than 1000 characters"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_by_line(
    file: Path, text: str | bytes, unit: str | None, place: str, words: str
) -> None:
    with pytest.raises(InputError) as refusal:
        read(file, text, unit)
    assert words in str(refusal.value)
    if unit != "ft":
        assert str(refusal.value).startswith(f"{file}{place}: ")


@given(st.binary(max_size=200) | st.text("xyz[]m,; \n#.-+e019", max_size=80).map(str.encode))
def test_no_file_of_points_crashes_the_reader(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    file = tmp_path_factory.getbasetemp() / "any.csv"
    try:
        points = read(file, content, "mm")
    except InputError as error:
        assert str(file) in str(error)
    else:
        assert all(np.all(np.isfinite(piece)) and piece.shape[1] == 3 for piece in points.pieces)


def test_missing_files_and_contradictions_are_refused(file: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_points(file)
    points = read(file, "x [mm] y [mm] z [mm]\n1 2 3\n4 5 6\n")
    with pytest.raises(InputError, match="leave the depth out, or the column z"):
        path_of_points(points, FEED, depth=1)
    with pytest.raises(InputError, match="tolerance = 0 must be more than 0"):
        path_of_points(points, FEED, tolerance=0)


def on_circle(r: float, first: float, last: float, count: int) -> np.ndarray:
    angles = np.linspace(first, last, count)
    return np.column_stack([r * np.cos(angles), r * np.sin(angles), np.zeros(count)])


def test_points_of_a_slot_become_two_lines_and_four_quarter_turns() -> None:
    right = on_circle(5, -np.pi / 2, np.pi / 2, 200) + np.array([20, 0, 0])
    left = on_circle(5, np.pi / 2, 3 * np.pi / 2, 200)
    path, deviation = fit(np.vstack([right, left, right[:1]]), 0.001, FEED)
    assert deviation <= 0.001
    arcs = [segment for segment in path if isinstance(segment, ArcSegment)]
    assert len(path) <= 6 and len(arcs) >= 2
    assert all(radius(segment) == pytest.approx(5, abs=0.01) and not segment.clockwise for segment in arcs[:2])
    assert sum(np.degrees(sweep(segment)) for segment in arcs) == pytest.approx(360, abs=3)
    assert_cuts(part_program(path), path)


def test_the_corners_of_a_square_are_not_taken_for_a_circle() -> None:
    corners = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [0, 0, 0]], dtype=float)
    path, deviation = fit(corners, 0.5, FEED)
    assert [segment.end for segment in path] == [tuple(corner) for corner in corners[1:]] and deviation == 0


def test_a_rising_path_has_no_flat_arcs() -> None:
    helix = on_circle(10, 0, 3, 100) + np.linspace(0, 5, 100)[:, None] * np.array([0, 0, 1])
    path, deviation = fit(helix, 0.01, FEED)
    assert all(isinstance(segment, LineSegment) for segment in path) and deviation <= 0.01
    assert len(path) < 99


@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=40, unique=True),
    st.floats(0.001, 5),
    st.integers(1, 20),
)
def test_fitted_paths_keep_within_the_tolerance(corners: list, tolerance: float, between: int) -> None:
    xy = np.array(corners)
    dense = np.vstack([np.linspace(a, b, between, endpoint=False) for a, b in pairwise(xy)] + [xy[-1:]])
    points = np.column_stack([dense, np.zeros(len(dense))])
    path, stated = fit(points, tolerance, FEED)
    assert stated <= tolerance
    assert len(pieces(path)) == 1
    assert path[0].start == tuple(points[0]) and path[-1].end == tuple(points[-1])
    assert hausdorff([dense], [trace(path, 1e-4)[:, :2]]) <= stated + 2e-4
    part_program(path)  # no arc off its circle
