"""Drawings traced: the blob of three-axis-mill, contours, what is refused, and smoothing."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation, binary_fill_holes, label

from rds.core.errors import InputError
from rds.core.types import ArcSegment
from rds.nc.paths import outline, part_program
from rds.nc.paths.boundary import boundary_cells
from rds.nc.paths.deviation import hausdorff
from rds.nc.paths.drawing import parse_text_drawing
from rds.nc.paths.measure import is_closed, pieces, signed_area, trace
from rds.nc.paths.outlines import Outline
from rds.nc.paths.region import single_region, without_specks
from rds.nc.paths.smoothing import smoothed
from tests.paths.programs import agreed, assert_cuts

FEED = 5.0

# 日, "sun": the sample part of three-axis-mill's figure 5, drawn in pixels
SUN = parse_text_drawing(
    """\
..............
..##########..
..##########..
..##......##..
..##......##..
..##########..
..##########..
..##......##..
..##......##..
..##########..
..##########..
..............
"""
)
# a shape with an inside corner: the tool goes right along the foot and turns down (figure 38)
STEP = parse_text_drawing(
    """\
........
.######.
.######.
...####.
...####.
........
"""
)


def cells_of(text: str) -> np.ndarray:
    return parse_text_drawing(text.replace(" ", "").replace("/", "\n"))


def test_the_blob_goes_counter_clockwise_and_cuts_inside_corners() -> None:
    path = [tuple(cell) for cell in boundary_cells(STEP).tolist()]
    assert path[0] == (1, 1)  # found by scanning the field row by row
    assert path[1:4] == [(2, 1), (2, 2), (3, 3)]  # down, right; then down over the corner, from "right" to "down"
    assert (2, 3) not in path  # "these points are actually interior to the figure"
    made = outline(STEP, 2.0, FEED, method="blob")
    assert signed_area(made.rings[0][:-1]) > 0
    assert made.segments[0].start == (3.0, 9.0, 0.0)  # centre of the first cell: row 1 of 6, column 1, 2 mm each
    assert is_closed(made.segments)


def test_the_blob_of_the_sun_symbol_is_its_frame() -> None:
    """Drawn as a shape or as an outline that closes, it is the same: the outline of the outer frame."""
    frame = [(2.5, 1.5), (11.5, 1.5), (11.5, 10.5), (2.5, 10.5)]
    made = outline(SUN, 1.0, FEED, method="blob", holes="fill")
    assert {tuple(point) for point in made.rings[0].tolist()} == set(frame)
    drawn = np.zeros_like(SUN)
    drawn[1:11, 2:12] = True
    drawn[2:10, 3:11] = False  # a line one pixel wide that closes
    assert np.array_equal(outline(drawn, 1.0, FEED, method="blob", holes="fill").rings[0], made.rings[0])
    with pytest.raises(InputError, match=r"has 2 holes, the first at row 4, column 5; fill them"):
        outline(SUN, 1.0, FEED, method="blob")
    with pytest.raises(InputError, match="a blob has one outline, without its holes"):
        outline(SUN, 1.0, FEED, method="blob", holes="cut")


@st.composite
def shapes(draw: st.DrawFn) -> np.ndarray:
    """Unions of rectangles."""
    cells = np.zeros((24, 30), dtype=bool)
    for _ in range(draw(st.integers(1, 7))):
        row, column = draw(st.integers(1, 18)), draw(st.integers(1, 24))
        cells[row : min(row + draw(st.integers(2, 9)), 23), column : min(column + draw(st.integers(2, 9)), 29)] = True
    return cells


@st.composite
def noise(draw: st.DrawFn) -> np.ndarray:
    cells = np.zeros((8, 9), dtype=bool)
    bits = draw(st.lists(st.booleans(), min_size=42, max_size=42))
    cells[1:-1, 1:-1] = np.reshape(bits, (6, 7))
    return cells


@settings(max_examples=200)
@given(shapes() | noise())
def test_a_blob_is_every_cell_at_the_border_once_or_the_drawing_is_refused(cells: np.ndarray) -> None:
    try:
        region = single_region(cells, "fill")
    except InputError:
        return
    path = boundary_cells(region)
    outside = ~binary_fill_holes(region)
    at_border = region & binary_dilation(outside)  # over an edge: cells in inside corners are not
    assert len({tuple(cell) for cell in path.tolist()}) == len(path)
    assert sorted(map(tuple, path.tolist())) == sorted(map(tuple, np.argwhere(at_border).tolist()))
    steps = np.abs(np.diff(np.vstack([path, path[:1]]), axis=0))
    assert steps.max() == 1 and np.all(steps.sum(axis=1) > 0)
    assert signed_area(np.column_stack([path[:, 1], -path[:, 0]]).astype(float)) > 0
    assert shapely.Polygon(path).is_valid


@settings(max_examples=200)
@given(shapes() | noise(), st.sampled_from(["refuse", "fill", "cut"]))
def test_what_is_accepted_has_one_outline_and_what_is_refused_has_not(cells: np.ndarray, holes: str) -> None:
    filled = binary_fill_holes(cells)
    try:
        region = single_region(cells, holes)  # type: ignore[arg-type]
    except InputError as error:
        said = str(error)
        islands = label(cells, np.ones((3, 3)))[1]
        assert ("nothing filled" in said) == (not cells.any())
        assert ("islands" in said) == (islands > 1)
        assert ("hole" in said) <= bool((filled & ~cells).any())
        return
    assert np.array_equal(region, filled if holes == "fill" else cells)
    assert label(region)[1] == 1
    made = outline(cells, 1.0, FEED, holes=holes)  # type: ignore[arg-type]
    assert len(made.rings) == 1 + (label(region == 0)[1] - 1)
    shape = shapely.Polygon(made.rings[0], made.rings[1:])
    assert shape.is_valid
    assert signed_area(made.rings[0][:-1]) > 0 and all(signed_area(ring[:-1]) < 0 for ring in made.rings[1:])
    centres = np.argwhere(np.ones_like(region))
    points = shapely.points(centres[:, 1] + 0.5, region.shape[0] - 0.5 - centres[:, 0])
    assert np.array_equal(shapely.contains(shape, points), region.ravel())


@pytest.mark.parametrize(
    "drawing, holes, words",
    [
        ("..../..../....", "refuse", "nowhere as dark as level 0.5"),
        ("##/##", "refuse", "nowhere lighter than level 0.5"),
        ("...../##.../##.../.....", "refuse", "reaches the border of the drawing at row 2, column 1"),
        ("......../.##..##./.##..##./........", "refuse", "2 islands (4 pixels at row 2, column 2, 4 pixels at row 2"),
        ("......../.######./.#....#./.#.##.#./.#.##.#./.#....#./.######./........", "fill", "2 islands"),
        ("......./.#####./.##.##./.#####./.......", "refuse", "has 1 hole, the first at row 3, column 4"),
        ("....../.##.../.##.../...##./...##./......", "refuse", "at a corner only at row 3, column 3"),
        ("......./.#####./.......", "refuse", "is one pixel wide at row 2, column 3"),
        (".../.#./...", "refuse", "is one pixel wide at row 2, column 2"),
        ("..../.##./....", "refuse", "is one pixel wide"),
        ("......./.####../.#...../.####../.......", "fill", "a line, or an outline that does not close"),
        ("......./.##..../.#####./.##..../.......", "refuse", "is one pixel wide at row 3, column 4"),
        ("......./.#####./.#...#./.#...#./.#####./.......", "cut", "is one pixel wide"),
    ],
)
def test_what_has_no_one_closed_outline_is_refused_with_a_reason(drawing: str, holes: str, words: str) -> None:
    with pytest.raises(InputError) as refusal:
        outline(cells_of(drawing), 1.0, FEED, holes=holes, name="it")  # type: ignore[arg-type]
    assert words in str(refusal.value), str(refusal.value)


def test_specks_are_left_out_on_request() -> None:
    cells = np.zeros((20, 20), dtype=bool)
    cells[4:16, 4:16] = True
    dusty = cells.copy()
    dusty[1, 1] = dusty[2, 17] = dusty[2, 18] = True
    dusty[8, 8] = False
    cleaned, count = without_specks(dusty, 2)
    assert np.array_equal(cleaned, cells) and count == 3
    made = outline(dusty, 1.0, FEED, specks=2)
    assert made.specks == 3
    assert np.array_equal(made.rings[0], outline(cells, 1.0, FEED).rings[0])
    with pytest.raises(InputError, match="3 islands"):
        outline(dusty, 1.0, FEED, specks=0)
    with pytest.raises(InputError, match="specks = -1"):
        outline(dusty, 1.0, FEED, specks=-1)


def test_an_outline_is_where_it_was_placed_and_as_deep() -> None:
    made = outline(STEP, 0.5, FEED, at=(100, -50), depth=3, passes=3)
    assert made.bounds == (100, 104, -50, -47)
    left, bottom, right, top = shapely.Polygon(made.rings[0]).bounds
    assert (left, bottom, right, top) == (100.5, -49.5, 103.5, -47.5)  # the edges of the cells
    assert list(dict.fromkeys(s.end[2] for s in made.segments)) == [-1, -2, -3]
    assert len(pieces(made.segments)) == 1 and is_closed(made.segments)
    program = part_program(made.segments, "step", safe_height=2)
    assert_cuts(program, made.segments)
    agreed(program)


def disc(radius: float, size: int = 60) -> np.ndarray:
    """The darkness of a disc: how much of each pixel it covers (8 × 8 samples)."""
    at = (np.arange(size * 8) + 0.5) / 8 - size / 2
    fine = np.hypot(at[:, None], at[None, :]) < radius
    return fine.reshape(size, 8, size, 8).mean(axis=(1, 3))


def test_a_grey_disc_is_traced_to_a_tenth_of_a_pixel() -> None:
    made = outline(disc(20.3), 1.0, FEED)
    radii = np.hypot(*(made.rings[0] - 30).T)
    assert abs(radii - 20.3).max() < 0.1
    arcs = outline(disc(20.3), 1.0, FEED, tolerance=0.2, arcs=True)
    assert len(arcs.segments) <= 12 and any(isinstance(segment, ArcSegment) for segment in arcs.segments)
    assert abs(np.hypot(*(trace(arcs.segments, 1e-4)[:, :2] - 30).T) - 20.3).max() < 0.2 + 0.1


def measured(made: Outline) -> float:
    return hausdorff(made.traced, made.rings)


@settings(max_examples=40)
@given(shapes(), st.floats(0.02, 1.5), st.booleans(), st.sampled_from(["contour", "blob"]), st.floats(0.01, 10))
def test_smoothing_keeps_within_its_tolerance(
    cells: np.ndarray, tolerance: float, arcs: bool, method: str, pixel: float
) -> None:
    try:
        made = outline(cells, pixel, FEED, holes="fill", tolerance=tolerance * pixel, arcs=arcs, method=method)  # type: ignore[arg-type]
    except InputError as error:
        said = str(error)
        assert "islands" in said or "corner" in said or "one pixel wide" in said, said
        return
    assert measured(made) <= made.deviation + 1e-5 <= tolerance * pixel + 1e-5
    assert shapely.Polygon(made.rings[0]).is_valid and signed_area(made.rings[0][:-1]) > 0
    assert is_closed(made.segments) and len(pieces(made.segments)) == 1
    part_program(made.segments)


def test_smoothing_takes_the_stairs_out_of_a_slope() -> None:
    rows, columns = np.mgrid[:60, :120]
    wedge = (rows > 5) & (rows < 55) & (columns > 5) & (columns < 20 + 1.5 * rows)
    raw = outline(wedge, 1.0, FEED)
    smooth = outline(wedge, 1.0, FEED, tolerance=0.7)
    assert len(smooth.segments) < len(raw.segments) / 4
    assert 0 < smooth.deviation <= 0.7

    def turning(ring: np.ndarray) -> float:
        steps = np.diff(np.vstack([ring, ring[1:2]]), axis=0)
        angles = np.arctan2(steps[:, 1], steps[:, 0])
        return float(np.abs(np.angle(np.exp(1j * np.diff(angles)))).sum())

    assert turning(smooth.rings[0]) < 1.15 * 2 * np.pi < turning(raw.rings[0]) / 3
    _, deviation = smoothed(raw.traced, 0.7)
    assert deviation == smooth.deviation  # the same again


@pytest.mark.parametrize(
    "options, words",
    [
        ({"pixel": 0}, "pixel = 0 must be more than 0"),
        ({"pixel": 5e5}, "leaves the space"),
        ({"method": "edge"}, "trace = 'edge' must be one of: contour, blob"),
        ({"holes": "keep"}, "holes = 'keep' must be one of: refuse, cut, fill"),
        ({"level": 0.0}, "level = 0.0 must be more than 0"),
        ({"level": 1.5}, "nowhere as dark as level 1.5"),
        ({"tolerance": -1}, "tolerance = -1 must be at least 0"),
        ({"arcs": True}, "arcs need a tolerance to fit them with; give one (half a pixel is 0.5 mm)"),
        ({"passes": 0, "depth": 1}, "passes = 0 must be a whole number from 1"),
        ({"passes": 2}, "2 passes need a depth to divide"),
        ({"at": (1,)}, "at = (1,) must be x, y in mm"),
    ],
)
def test_what_makes_no_outline_is_refused(options: dict, words: str) -> None:
    with pytest.raises(InputError) as refusal:
        made = outline(STEP, **({"pixel": 1.0, "feed_rate": FEED} | options))
        part_program(made.segments)
    assert words in str(refusal.value), str(refusal.value)


@pytest.mark.parametrize("bad", [np.zeros(5), np.zeros((0, 3)), np.ones((3, 3), dtype=int), np.full((3, 3), np.nan)])
def test_what_is_no_drawing_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"give rows × columns|darkness must be from 0"):
        outline(bad, 1.0, FEED)
