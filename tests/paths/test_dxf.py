"""DXF drawings as CAD programs write them: what counts, what is passed over and told, and where it lies."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.nc.shapes.curves import Drawing
from rds.nc.shapes.dxf import read_dxf
from rds.nc.shapes.files import read_vector_drawing

Read = Callable[..., Drawing]
HEADER = "0 SECTION 2 HEADER 9 $INSUNITS 70 4 0 ENDSEC"


def section(name: str, *entities: str) -> str:
    return f"0 SECTION 2 {name} {' '.join(entities)} 0 ENDSEC"


def written(path: Path, *sections: str, end: str = "\n") -> Path:
    """A file of groups, which stand here on one line: a code and its value, alternately."""
    path.write_bytes((end.join(" ".join((HEADER, *sections, "0 EOF")).split()) + end).encode())
    return path


@pytest.fixture
def drawn(tmp_path: Path) -> Read:
    def read(*entities: str, blocks: str = "", tables: str = "") -> Drawing:
        parts = [section("TABLES", tables), section("BLOCKS", blocks), section("ENTITIES", *entities)]
        return read_dxf(written(tmp_path / "part.dxf", *parts))

    return read


def extent(drawing: Drawing) -> list[float]:
    points = np.vstack([curve.points for curve in drawing.curves])
    return [*points.min(axis=0), *points.max(axis=0)]


@pytest.mark.parametrize("last", ["6.283185307179586", "6.283185307179587", "6.28318530717959", "6.283185"])
def test_a_whole_ellipse_is_whole_however_its_end_is_rounded(drawn: Read, last: str) -> None:
    drawing = drawn(f"0 ELLIPSE 8 a 10 5 20 0 11 4 21 0 40 0.5 41 0 42 {last}")
    assert drawing.curves[0].closed
    assert extent(drawing) == pytest.approx([1, -2, 9, 2], abs=1e-3)


def test_an_arc_of_a_whole_turn_is_a_circle(drawn: Read) -> None:
    drawing = drawn("0 ARC 8 a 10 0 20 0 40 3 50 0 51 360.00000000001")
    assert extent(drawing) == pytest.approx([-3, -3, 3, 3], abs=1e-2)


def test_an_insert_in_rows_and_columns_is_there_as_often(drawn: Read) -> None:
    hole = "0 BLOCK 2 Hole 10 0 20 0 0 CIRCLE 8 0 10 0 20 0 40 1 0 ENDBLK"
    array = "0 INSERT 8 a 2 HOLE 10 10 20 0 41 2 42 2 50 90 70 3 71 2 44 5 45 20"
    places = np.array([curve.circle for curve in drawn(array, blocks=hole).curves])
    expected = np.array([(10 - 20 * row, 5 * column, 2.0) for row in range(2) for column in range(3)])
    assert places == pytest.approx(expected)


def test_blocks_that_multiply_without_end_are_refused(drawn: Read) -> None:
    blocks = "".join(
        f" 0 BLOCK 2 b{k} 10 0 20 0 {f'0 INSERT 8 0 2 b{k + 1} ' * 10} 0 LINE 8 0 10 0 20 0 11 1 21 0 0 ENDBLK"
        for k in range(12)
    )
    with pytest.raises(InputError, match="more than 2000000 points"):
        drawn("0 INSERT 8 a 2 b0 70 30000 71 30000", blocks=blocks)


LINE = "0 LINE 8 a 10 0 20 0 11 1 21 1"


@pytest.mark.parametrize(
    ("entity", "told"),
    [
        ("0 LINE 8 a 67 1 10 0 20 0 11 210 21 297", "on sheets of paper"),
        ("0 LINE 8 a 60 1 10 0 20 0 11 9 21 9", "hidden objects"),
        ("0 POLYLINE 8 Off 66 1 0 VERTEX 8 Off 10 9 20 9 0 VERTEX 8 Off 10 5 20 9 0 SEQEND", "hidden layers"),
        ("0 LINE 8 OFF 10 0 20 0 11 9 21 9", "hidden layers"),
        ("0 CIRCLE 8 a 10 5 20 5 40 3 210 1 220 0 230 0", "do not lie in the plane XY"),
        ("0 POLYLINE 8 a 66 1 70 64 0 VERTEX 8 a 10 9 20 9 0 VERTEX 8 a 10 5 20 9 0 SEQEND", "meshes"),
    ],
)
def test_what_is_not_part_of_the_drawing_is_passed_over_and_told(drawn: Read, entity: str, told: str) -> None:
    drawing = drawn(entity, LINE, tables="0 LAYER 2 off 62 -7")
    assert extent(drawing) == pytest.approx([0, 0, 1, 1])
    assert told in " ".join(drawing.notes)


def test_the_control_points_of_a_smoothed_polyline_are_no_corners(drawn: Read) -> None:
    vertices = [(0, 0, 16), (5, 50, 16), (10, 0, 16), (0, 0, 8), (5, 10, 8), (10, 0, 8)]
    rows = " ".join(f"0 VERTEX 8 a 10 {x} 20 {y} 70 {flag}" for x, y, flag in vertices)
    assert extent(drawn(f"0 POLYLINE 8 a 66 1 70 4 {rows} 0 SEQEND")) == pytest.approx([0, 0, 10, 10])


def test_what_is_seen_from_below_has_its_x_mirrored_where_its_places_are_its_planes(
    drawn: Read,
) -> None:
    down = "210 0 220 0 230 -1"
    line = f"0 POLYLINE 8 line 66 1 {down} 0 VERTEX 8 line 10 1 20 0 0 VERTEX 8 line 10 2 20 3 0 SEQEND"
    drawing = drawn(line, f"0 POINT 8 point 10 4 20 5 {down}", f"0 CIRCLE 8 circle 10 4 20 5 40 1 {down}")
    assert extent(Drawing(drawing.on("line"), "")) == pytest.approx([-2, 0, -1, 3])
    assert drawing.on("point")[0].circle == pytest.approx((4, 5, 0))
    assert drawing.on("circle")[0].circle == pytest.approx((-4, 5, 1))


def test_curves_of_a_block_keep_within_the_chord_error_at_the_size_that_they_get(drawn: Read) -> None:
    block = "0 BLOCK 2 b 10 0 20 0 0 LWPOLYLINE 8 0 70 1 10 -1 20 0 42 1 10 1 20 0 42 1 0 ENDBLK"
    points = drawn("0 INSERT 8 a 2 b 10 0 20 0 41 50 42 50", blocks=block).curves[0].points
    middles = (points + np.roll(points, -1, axis=0)) / 2
    assert np.hypot(*middles.T) == pytest.approx(np.full(len(points), 50.0), abs=0.0021)
    assert np.ptp(np.unwrap(np.arctan2(points[:, 1], points[:, 0]))) == pytest.approx(2 * pi, abs=0.1)


def test_a_spline_of_fit_points_alone_is_a_smooth_curve_through_them_and_told(drawn: Read) -> None:
    fit = "11 0 21 0 11 5 21 5 11 10 21 0"
    drawing = drawn(f"0 SPLINE 8 a 70 8 71 3 74 3 {fit}")
    chord = 50**0.5
    u = np.linspace(0, 1, 1001)  # the natural cubic of three places, by hand
    half = np.column_stack((5 * u, 5 * u + 2.5 * (u - u**3)))
    points = drawing.curves[0].points
    rising = points[points[:, 0] <= 5]
    assert np.interp(rising[:, 0], *half.T) == pytest.approx(rising[:, 1], abs=1e-3)
    assert "through its fit points" in " ".join(drawing.notes)
    # where it states tangents, it begins and ends along them; where it is closed, it comes back without a corner
    points = drawn(f"0 SPLINE 8 a 70 8 71 3 74 3 12 0 22 {chord} 13 0 23 -1 {fit}").curves[0].points
    assert np.arctan2(*(points[1] - points[0])) == pytest.approx(0, abs=0.05)
    assert np.arctan2(*(points[-2] - points[-1])) == pytest.approx(0, abs=0.05)
    points = drawn(f"0 SPLINE 8 a 70 9 71 3 74 3 {fit}").curves[0].points
    first, last = points[1] - points[0], points[-1] - points[-2]
    assert np.dot(first, last) == pytest.approx(np.hypot(*first) * np.hypot(*last), rel=0.01)
    for again in ("11 0 21 0", "11 1e-17 21 0", "11 0 21 1e-12"):  # the end said again, rounded
        same = drawn(f"0 SPLINE 8 a 70 9 71 3 74 4 {fit} {again}").curves[0].points
        assert same == pytest.approx(points, abs=1e-9)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_and_what_stands_behind_the_end_do_not_matter(tmp_path: Path, end: str) -> None:
    path = written(tmp_path / "part.dxf", section("ENTITIES", LINE), end=end)
    path.write_bytes(path.read_bytes() + f"kept{end}by somebody{end}".encode())
    assert extent(read_dxf(path)) == pytest.approx([0, 0, 1, 1])


def test_layers_have_their_names_in_old_code_pages_too(tmp_path: Path) -> None:
    path = written(tmp_path / "part.dxf", section("ENTITIES", LINE.replace("8 a", "8 Außen")))
    text = path.read_text(encoding="utf-8").replace("$INSUNITS", "$DWGCODEPAGE\n3\nANSI_1252\n9\n$INSUNITS")
    path.write_bytes(text.encode("cp1252"))
    assert read_dxf(path).layers == ["Außen"]
    path.write_text(text.replace("Außen", "\\U+D800"))  # half of a character, which no terminal can show
    assert read_dxf(path).curves[0].layer == "?"
    path.write_text(text.replace("Außen", "Au\\U+00DFen"))
    assert read_dxf(path).layers == ["Außen"]


def test_a_separator_within_a_text_does_not_shift_the_groups(tmp_path: Path) -> None:
    path = written(tmp_path / "part.dxf", section("ENTITIES", "0 TEXT 8 a 1 here", LINE))
    path.write_text(path.read_text().replace("here", "one\x0btwo\x85three\u2028four"), encoding="utf-8")
    assert extent(read_dxf(path)) == pytest.approx([0, 0, 1, 1])


@pytest.mark.parametrize("groups", ["10 here 20 0", "10 nan 20 0"])
def test_a_place_that_is_no_number_is_told(drawn: Read, groups: str) -> None:
    for entity in (f"0 LWPOLYLINE 8 a 90 1 {groups}", f"0 SPLINE 8 a {groups}", f"0 POINT 8 a {groups}"):
        with pytest.raises(InputError, match=r"group 10 of a DXF entity is '(here|nan)', not a number"):
            drawn(entity)


def test_a_unit_that_parts_do_not_have_can_be_given(tmp_path: Path) -> None:
    path = written(tmp_path / "part.dxf", section("ENTITIES", LINE))
    path.write_text(path.read_text().replace("70\n4\n", "70\n9\n"))
    assert extent(read_dxf(path)) == pytest.approx([0, 0, 0.0254, 0.0254])
    path.write_text(path.read_text().replace("70\n9\n", "70\n20\n"))
    with pytest.raises(InputError, match="= 20 is no unit of drawings of parts; give its unit"):
        read_dxf(path)
    assert extent(read_dxf(path, "cm")) == pytest.approx([0, 0, 10, 10])


@pytest.mark.parametrize(
    ("entity", "why"),
    [
        ("0 ARC 8 a 10 0 20 0 40 1e20 50 0 51 90", "an arc of radius 1e.20 mm takes more than 2000000 chords"),
        ("0 LINE 8 a 10 0 20 x", "group 20 of a DXF entity is 'x', not a number"),
        (
            "0 SPLINE 8 a 71 3 11 0 21 0 11 1e160 21 1 11 2 21 1e300",
            "a spline goes through a place beyond 1e.12; save the drawing again",
        ),
    ],
)
def test_what_is_refused_is_told_with_the_file(tmp_path: Path, entity: str, why: str) -> None:
    path = written(tmp_path / "part.dxf", section("ENTITIES", entity))
    with pytest.raises(InputError, match=rf"part\.dxf: {why}"):
        read_vector_drawing(str(path))


def test_an_arc_that_is_as_good_as_straight_is_a_line(drawn: Read) -> None:
    assert len(drawn("0 LWPOLYLINE 8 a 70 0 10 0 20 0 42 1e-18 10 10 20 0").curves[0].points) == 2


SQUARE = (
    "0 LINE 8 a 10 0 20 0 11 8 21 0",
    "0 LINE 8 a 10 8 20 0 11 8 21 5",
    "0 LINE 8 a 10 8 20 5 11 0 21 5",
    "0 LINE 8 a 10 0 20 5 11 0 21 0",
)
POLYLINE = "0 LWPOLYLINE 8 a 70 1 10 8 20 5 10 8 20 0 10 0 20 0 10 0 20 5"
LYING = "0 ELLIPSE 8 a 10 0 20 0 11 3 21 0 40 0.5 41 0 42 6.283185307179586"


@pytest.mark.parametrize(
    ("more", "twice"),
    [
        (SQUARE[:1], 1),
        (("0 LINE 8 a 10 8 20 0 11 0 21 0", *SQUARE[1:2] * 2), 3),
        (SQUARE, 4),
        ((POLYLINE,), 1),
        ((SQUARE[0].replace("8 a", "8 b"), POLYLINE.replace("8 a", "8 b")), 0),
    ],
)
def test_what_is_drawn_twice_on_a_layer_counts_once_and_is_told(drawn: Read, more: tuple[str, ...], twice: int) -> None:
    drawing = drawn(*SQUARE, *more)
    (square,) = drawing.on("a")
    assert square.closed and len(square.points) == 4
    assert drawing.notes == ([f"passed over: {twice} × curves that are drawn already, on the same layer"] * bool(twice))


def test_a_circle_drawn_twice_is_a_pocket_and_one_hole(drawn: Read) -> None:
    circle = "0 CIRCLE 8 a 10 2 20 3 40 4"
    drawing = drawn(
        circle, circle, circle.replace("40 4", "40 4.001"), "0 POINT 8 a 10 2 20 3", "0 POINT 8 a 10 2 20 3"
    )
    circles = np.array([curve.circle for curve in drawing.curves])
    assert circles == pytest.approx(np.array([(2, 3, 4), (2, 3, 4.001), (2, 3, 0)]))


def test_an_ellipse_that_stands_on_the_plane_is_passed_over_and_told(drawn: Read) -> None:
    drawing = drawn(LYING, LYING + " 210 1 220 0 230 0", LYING + " 210 0 220 0.84147 230 0.54030")
    assert len(drawing.curves) == 1
    assert drawing.notes == ["passed over: 2 × objects that do not lie in the plane XY"]


@pytest.mark.parametrize(("in_force", "told"), [("71 1", 1), ("71 0", 0)])
def test_a_block_that_is_clipped_is_drawn_whole_and_that_is_told(tmp_path: Path, in_force: str, told: int) -> None:
    insert = "0 INSERT 5 A1 102 {ACAD_XDICTIONARY 360 %s 102 } 8 a 2 part 10 0 20 0"
    drawing = read_dxf(
        written(
            tmp_path / "part.dxf",
            section("BLOCKS", "0 BLOCK 2 part 10 0 20 0", *SQUARE, "0 ENDBLK"),
            section("ENTITIES", insert % "B0", insert.replace("10 0", "10 50") % "B9"),
            section(
                "OBJECTS",
                "0 DICTIONARY 5 B0 102 {ACAD_REACTORS 330 A1 102 } 330 A1 3 ACAD_FILTER 360 B1",
                "0 DICTIONARY 5 B1 330 B0 3 SPATIAL 360 B2",
                f"0 SPATIAL_FILTER 5 B2 330 B1 70 2 10 1 20 1 10 4 20 4 {in_force}",
                "0 DICTIONARY 5 B9 330 A1 3 ACAD_FIELD 360 BA",
            ),
        )
    )
    assert [len(curve.points) for curve in drawing.curves] == [4, 4]
    assert [note.startswith("passed over: 1 × a clip (XCLIP): its block is drawn whole") for note in drawing.notes] == (
        [True] * told
    )
