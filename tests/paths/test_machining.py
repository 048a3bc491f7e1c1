"""From a drawing to a cut part: SVG, DXF and text read, operations made of them, and cut in a height field."""

from __future__ import annotations

import json
from math import pi
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.interpolators.motion.segments import chain, line
from rds.machines import load_machine
from rds.nc.check import motion
from rds.nc.language.tool_library import ShapedTool, read_library
from rds.nc.machining.area import area_of, pocket_rings
from rds.nc.machining.job import read_job
from rds.nc.path_block import PathBlock
from rds.nc.paths.region import mended
from rds.nc.setup import Setup
from rds.nc.shapes.centre_lines import centre_lines
from rds.nc.shapes.curves import circle_curve, polyline_curve
from rds.nc.shapes.files import read_vector_drawing
from rds.nc.shapes.lettering import text_drawing
from rds.nc.stock.cut import Carving, Difference
from rds.nc.stock.stock import Stock

TOOLS = """\
[[tool]]
number = 1
diameter = 3.0
feed = 400
spindle = 8000
cutting_length = 6
reach = 12
holder_diameter = 20
[[tool]]
number = 2
shape = "drill"
diameter = 3.0
feed = 120
spindle = 3000
"""
SVG = """\
<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"
 width="60mm" height="40mm" viewBox="0 0 60 40">
<g inkscape:groupmode="layer" inkscape:label="outline"><rect x="5" y="5" width="50" height="30" rx="5"/></g>
<g inkscape:groupmode="layer" inkscape:label="pocket"><path d="m15 12h30v16H15z"/><circle cx="30" cy="20" r="4"/></g>
<g inkscape:groupmode="layer" inkscape:label="holes" transform="translate(1 0)"><circle cx="8" cy="9" r="1.5"/></g>
<text x="3" y="3">not a curve</text></svg>
"""
JOB = """\
drawing = "plate.svg"
tools = "tools.toml"
origin = "centre"
[[operation]]
do = "drill"
layer = "holes"
tool = 2
depth = 3
peck = 1
[[operation]]
do = "pocket"
layer = "pocket"
tool = 1
depth = 2
[[operation]]
do = "contour"
layer = "outline"
tool = 1
depth = 4
tabs = 3
"""
DXF = """\
0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n1\n0\nENDSEC\n0\nSECTION\n2\nBLOCKS\n0\nBLOCK\n2\nhole\n10\n0\n20\n0
0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n0.1\n0\nENDBLK\n0\nENDSEC\n0\nSECTION\n2\nENTITIES
0\nLINE\n8\nslot\n10\n0\n20\n0\n11\n1\n21\n0
0\nARC\n8\nslot\n10\n1\n20\n0.5\n40\n0.5\n50\n270\n51\n90
0\nLINE\n8\nslot\n10\n1\n20\n1\n11\n0\n21\n1
0\nARC\n8\nslot\n10\n0\n20\n0.5\n40\n0.5\n50\n90\n51\n270
0\nLWPOLYLINE\n8\ndisc\n70\n1\n10\n4\n20\n0\n42\n1\n10\n6\n20\n0\n42\n1
0\nINSERT\n8\nholes\n2\nhole\n10\n3\n20\n2\n41\n2\n42\n2
0\nMTEXT\n8\nnotes\n10\n0\n20\n0\n1\nhello\n0\nENDSEC\n0\nEOF
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("plate.svg", SVG), ("tools.toml", TOOLS), ("job.toml", JOB), ("part.dxf", DXF)):
        (tmp_path / name).write_text(text)
    return tmp_path


def carved(folder: Path, name: str = "job.toml", cell: float = 0.1) -> tuple[Carving, Stock]:
    """The program of a job, through the interpreter, cut in a block of 60 by 40 by 5 mm."""
    (folder / "part.ngc").write_text(read_job(folder / name).program())
    library = folder / "tools.toml"
    stock = Stock.block((-30, -20, -5), (30, 20, 0), cell)
    carving = Carving(stock, {tool.number: tool for tool in read_library(library)})
    carving.program(motion(folder / "part.ngc", load_machine("mini-cnc"), Setup(tools=library)))
    return carving, stock


def test_an_svg_takes_no_unit(folder: Path) -> None:
    with pytest.raises(InputError, match=r"plate\.svg.*says its own size; leave the unit out"):
        read_vector_drawing(str(folder / "plate.svg"), "in")


def test_an_svg_is_read_in_mm_upwards_with_its_layers_and_transforms(folder: Path) -> None:
    drawing = read_vector_drawing(str(folder / "plate.svg"))
    assert drawing.layers == ["outline", "pocket", "holes"]
    assert drawing.on("holes")[0].circle == pytest.approx((9.0, 31.0, 1.5))
    outline = area_of(drawing.on("outline"), "test")
    assert outline.area == pytest.approx(50 * 30 - (4 - pi) * 25, abs=0.05)
    assert any("text" in note for note in drawing.notes)
    with pytest.raises(InputError, match="did you mean 'holes'"):
        drawing.on("hole")


def test_a_dxf_joins_lines_and_arcs_and_follows_bulges_and_blocks(folder: Path) -> None:
    drawing = read_vector_drawing(str(folder / "part.dxf"))
    assert area_of(drawing.on("slot"), "test").area == pytest.approx(25.4**2 * (1 + pi / 4), rel=1e-4)
    assert area_of(drawing.on("disc"), "test").area == pytest.approx(25.4**2 * pi, rel=2e-4)
    assert drawing.on("holes")[0].circle == pytest.approx((3 * 25.4, 2 * 25.4, 0.2 * 25.4))
    (folder / "part.dxf").write_text(DXF.replace("$INSUNITS\n70\n1", "$INSUNITS\n70\n0"))
    with pytest.raises(InputError, match="does not say its unit"):
        read_vector_drawing(str(folder / "part.dxf"))


def test_a_plate_of_many_holes_has_its_area_without_going_through_it_for_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """256 holes in a plate: a pair of areas goes on with the next pair, so that each corner counts eight times."""
    from shapely import Polygon, get_num_coordinates
    from shapely.geometry.base import BaseGeometry

    met = 0

    def counted(one: BaseGeometry, other: BaseGeometry) -> BaseGeometry:
        nonlocal met
        met += get_num_coordinates(one) + get_num_coordinates(other)
        return difference(one, other)

    difference = BaseGeometry.symmetric_difference
    monkeypatch.setattr(BaseGeometry, "symmetric_difference", counted)
    plate = polyline_curve([[-1.0, -1.0], [33.0, -1.0], [33.0, 33.0], [-1.0, 33.0]], True, "")
    assert plate is not None
    holes = [circle_curve(2.0 * (k % 16), 2.0 * (k // 16), 0.5, "") for k in range(255)]
    area = area_of([plate, *holes], "test")
    assert area.area == pytest.approx(34.0**2 - 255 * Polygon(holes[0].points).area)
    assert met < 9 * get_num_coordinates(area)


def test_a_rational_spline_is_a_circle(folder: Path) -> None:
    r = 0.5**0.5
    corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    rows = ["0", "SPLINE", "8", "0", "70", "8", "71", "2"]
    rows += [word for knot in knots for word in ("40", str(knot))]
    rows += [word for k in range(9) for word in ("41", str(r if k % 2 else 1.0))]
    rows += [word for x, y in corners for word in ("10", str(x), "20", str(y))]
    (folder / "c.dxf").write_text("0\nSECTION\n2\nENTITIES\n" + "\n".join(rows) + "\n0\nENDSEC\n0\nEOF\n")
    points = read_vector_drawing(str(folder / "c.dxf"), "cm").curves[0].points
    assert np.hypot(*points.T) == pytest.approx(np.full(len(points), 10.0), abs=1e-9)


def test_text_has_its_height_and_names_letters_that_a_font_lacks() -> None:
    drawing = text_drawing("HO", 10.0)
    high = max(curve.points[:, 1].max() for curve in drawing.curves)
    assert high == pytest.approx(10.0, abs=0.3)
    assert len(drawing.curves) == 3  # H, and the two rings of O
    with pytest.raises(InputError, match="has no"):
        text_drawing("\U0001f980", 10.0)


def test_a_pocket_is_cleared_but_for_its_corners_and_its_island_stands() -> None:
    square = polyline_curve([(0, 0), (30, 0), (30, 20), (0, 20)], True, "")
    assert square is not None
    area = area_of([square, circle_curve(15, 10, 4, "")], "test")
    ways, _, lost = pocket_rings(area, 1.5, 1.2, True, "test")
    assert lost == pytest.approx((4 - pi) * 1.5**2, abs=0.02)
    stock = Stock.block((-2, -2, -3), (32, 22, 0), 0.1)
    for way in ways:
        points = np.column_stack((way, np.full(len(way), -1.0)))
        stock.cut(ShapedTool(1, 3.0), points, np.zeros(len(way)), np.zeros(len(way), bool), 1)
    cleared = (stock.heights < -0.5).sum() * 0.01
    assert cleared == pytest.approx(area.area - lost, rel=0.005)
    with pytest.raises(InputError, match="fits nowhere"):
        pocket_rings(area, 8.5, 4.0, True, "test")


def test_a_job_runs_from_the_drawing_to_the_cut_part(folder: Path) -> None:
    carving, stock = carved(folder)
    assert not carving.faults
    x0, _, y0, _ = stock.extent

    def height(x: float, y: float) -> float:
        return float(stock.heights[int((y - y0) / stock.cell), int((x - x0) / stock.cell)])

    assert height(10, 0) == pytest.approx(-2.0)  # the pocket
    assert height(0, 0) == 0.0  # its island
    assert height(-21, 11) == pytest.approx(-3.0, abs=0.1)  # the hole
    way = stock.heights[:, int((0 - x0) / stock.cell)]
    assert way.min() == pytest.approx(-4.0)
    tabs = np.unique(np.round(stock.heights, 4))
    assert -3.0 in tabs  # bridges 1 mm high
    assert set(carving.loads) == {1, 2}
    assert carving.loads[1].depth <= 1.5 + 1e-6  # half the diameter, as asked
    assert carving.loads[1].feed_per_tooth == pytest.approx(400 / 8000 / 2)


def test_what_must_not_touch_material_is_told_by_line(folder: Path) -> None:
    (folder / "bad.ngc").write_text(
        "G21 G90 G94 F400 S8000 M3\nT1 M6\nG43\nG0 X0 Y0 Z1\nG0 Z-1\nG1 X10\nG1 Z-6\nG0 Z5\nM2\n"
    )
    library = folder / "tools.toml"
    stock = Stock.block((-5, -5, -5), (15, 5, 0), 0.1)
    shallow = [*read_library(library)]
    tools = {1: ShapedTool(1, 3.0, cutting_length=2.0, reach=4.0, holder_diameter=8.0)}
    assert shallow[0].cutting_length == 6.0
    carving = Carving(stock, tools)
    carving.program(motion(folder / "bad.ngc", load_machine("mini-cnc"), Setup(tools=library)))
    assert {(fault.line, fault.kind) for fault in carving.faults} >= {(5, "rapid"), (7, "table"), (7, "holder")}
    rapid = next(fault for fault in carving.faults if fault.kind == "rapid")
    assert rapid.value == pytest.approx(pi * 1.5**2, rel=0.05)


def test_shapes_of_tools_leave_their_shape() -> None:
    for tool, below in (
        (ShapedTool(1, 6.0, "ball"), lambda r: 3 - (9 - r**2) ** 0.5),
        (ShapedTool(1, 6.0, "vee", angle=90.0), lambda r: r),
        (ShapedTool(1, 6.0, "bull", corner_radius=1.0), lambda r: 1 - (1 - max(r - 2, 0.0) ** 2) ** 0.5),
    ):
        for r in (0.0, 1.0, 2.5, 2.9):
            assert float(tool.height(np.array(r))) == pytest.approx(below(r), abs=1e-12)
        assert np.isinf(tool.height(np.array(3.1)))


def test_a_cut_is_measured_against_the_part() -> None:
    stock = Stock.block((0, 0, -5), (10, 10, 0), 0.1)
    part = stock.heights.copy()
    part[:50] = -1.0
    stock.heights[:50] = -1.2
    stock.heights[60:, :10] = 0.5
    found = Difference.of(stock, part, 0.01)
    assert found.gouged == pytest.approx(0.2 * 50)
    assert found.deepest == pytest.approx(0.2)
    assert found.left == pytest.approx(0.5 * 4)
    assert found.highest_at[1] > 6.0


def test_centre_lines_run_along_the_middle_of_a_stroke() -> None:
    bar = polyline_curve([(0, 0), (10, 0), (10, 1), (0, 1)], True, "")
    assert bar is not None
    lines = centre_lines([bar], 0.05, 0.03)
    middle = max(lines, key=len)
    assert abs(middle[:, 1] - 0.5).max() <= 0.55
    long = max(lines, key=lambda line: float(np.ptp(line[:, 0])))
    inner = long[(long[:, 0] > 1) & (long[:, 0] < 9)]
    assert np.ptp(long[:, 0]) > 8.5 and (len(inner) == 0 or abs(inner[:, 1] - 0.5).max() < 0.1)


def test_centre_lines_are_smooth_and_go_on_through_branchings() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    around = np.column_stack((np.cos(turn), np.sin(turn)))
    ring = [curve for r in (4.5, 5.5) if (curve := polyline_curve(r * around, True, "")) is not None]
    (line,) = centre_lines(ring, 0.05, 0.03)
    assert (line[0] == line[-1]).all()
    assert np.abs(np.hypot(*line.T) - 5.0).max() < 0.06
    ways = np.diff(line, axis=0)
    turns = np.angle(np.exp(1j * np.diff(np.unwrap(np.arctan2(ways[:, 1], ways[:, 0])))))
    assert np.abs(np.degrees(turns)).max() < 15.0  # the grid's steps turn by 45°
    corners = [(-5, -0.5), (-0.5, -0.5), (-0.5, -5), (0.5, -5), (0.5, -0.5), (5, -0.5)]
    cross = polyline_curve([*corners, *((-x, -y) for x, y in corners)], True, "")
    assert cross is not None
    strokes = [line for line in centre_lines([cross], 0.05, 0.03) if np.ptp(line, axis=0).max() > 1.0]
    assert len(strokes) == 2 and all(np.ptp(line, axis=0).max() > 8.5 for line in strokes)


@pytest.mark.parametrize("seed", range(5))
def test_what_a_photograph_leaves_never_hangs_together_at_a_corner(seed: int) -> None:
    cells = np.random.default_rng(seed).random((60, 60)) < 0.55
    a, b, c, d = (lambda m: (m[:-1, :-1], m[:-1, 1:], m[1:, :-1], m[1:, 1:]))(mended(cells))
    assert not ((a & d & ~b & ~c) | (b & c & ~a & ~d)).any()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('do = "drill"', 'do = "dril"'), "is no operation"),
        (("tabs = 3", "tab = 3"), "unknown key 'tab'"),
        (("tool = 2", "tool = 7"), "not in the library"),
        (('layer = "holes"', 'layer = "hole"'), "did you mean 'holes'"),
        (("depth = 2", "depth = 2\nstep_over = 0.9"), "at most 0.5"),
        (('tools = "tools.toml"', 'tools = "tools.toml"\nsafe = 0'), "below the clearance"),
        (('drawing = "plate.svg"\n', ""), "is of a drawing, and there is none"),
        (('drawing = "plate.svg"\n', 'unit = "in"\ntext = { text = "A" }\n'), "is of a drawing in a file"),
        (("peck = 1", "peck = 1\nat = [1.0, 2.0]"), "leave at out, or layer"),
        (("peck = 1", "peck = 1\ndwell = 0.5"), "does not dwell"),
        (('layer = "holes"\n', "grid = [-2, -1, 1.0, 1.0]\n"), "two whole numbers of holes, from 1"),
        (("tabs = 3", 'side = "on"\nstock_to_leave = 0.1'), "nothing is left beside"),
    ],
)
def test_faults_of_a_job_name_their_place(folder: Path, change: tuple[str, str], said: str) -> None:
    assert change[0] in JOB
    (folder / "job.toml").write_text(JOB.replace(*change))
    with pytest.raises(InputError, match=said) as caught:
        read_job(folder / "job.toml")
    assert "job.toml" in str(caught.value)


def test_a_drill_that_is_to_mill_is_told(folder: Path) -> None:
    (folder / "job.toml").write_text(JOB.replace('layer = "pocket"\ntool = 1', 'layer = "pocket"\ntool = 2'))
    cuts = read_job(folder / "job.toml").cuts
    assert [any("drill, which cuts along its axis only" in note for note in cut.notes) for cut in cuts] == [0, 1, 0]


def test_the_commands_list_layers_make_and_cut(folder: Path) -> None:
    run = CliRunner()
    found = json.loads(run.invoke(app, ["nc", "make", "job", str(folder / "plate.svg"), "--json"]).stdout)
    assert [layer["layer"] for layer in found["layers"]] == ["outline", "pocket", "holes"]
    for words in (["plate.svg", "--out", "part.ngc"], ["plate.svg", "--decimals", "3"], ["job.toml", "--unit", "mm"]):
        refused = run.invoke(app, ["nc", "make", "job", str(folder / words[0]), *words[1:]])
        assert refused.exit_code == 2 and f"{words[1]} is for" in refused.stderr
    program = folder / "part.ngc"
    made = run.invoke(app, ["nc", "make", "job", str(folder / "job.toml"), "-o", str(program), "--json"])
    assert len(json.loads(made.stdout)["operations"]) == 3
    words = ["nc", "cut", str(program), "--tools", str(folder / "tools.toml"), "--cell", "0.2", "--json"]
    first = run.invoke(app, [*words, "--save", str(folder / "cut.npz")])
    assert first.exit_code == 0, first.output
    assert (folder / "part-cut.png").exists()
    again = run.invoke(app, [*words, "--part", str(folder / "cut.npz")])
    assert json.loads(again.stdout)["part"]["highest_mm"] == 0.0


@pytest.mark.parametrize("depth, step_down", [(3.0, 1.0), (4.0, 0.8), (2.0, 2.0), (5.0, 0.5)])
def test_tabs_have_their_width_wherever_the_ramps_ended(tmp_path: Path, depth: float, step_down: float) -> None:
    (tmp_path / "tools.toml").write_text(TOOLS)
    (tmp_path / "plate.svg").write_text(SVG)
    (tmp_path / "job.toml").write_text(
        'drawing = "plate.svg"\ntools = "tools.toml"\n[[operation]]\ndo = "contour"\nlayer = "outline"\ntool = 1\n'
        f"depth = {depth}\nstep_down = {step_down}\ntabs = 7\ntab_width = 3.0\ntab_height = 1.3\n"
    )
    (piece,) = read_job(tmp_path / "job.toml").cuts[0].pieces
    roof = 1.3 - depth
    passes = len({round(segment.end[2], 9) for segment in piece if segment.end[2] < roof})
    over = [segment for segment in piece if abs(segment.start[2] - roof) + abs(segment.end[2] - roof) < 1e-9]
    length = sum(float(np.hypot(*np.subtract(segment.end[:2], segment.start[:2]))) for segment in over)
    assert length == pytest.approx(7 * passes * 6.0, rel=1e-3)  # of each tab with the tool, in each pass


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 and nothing more", b"heights"])
def test_a_file_that_no_cut_has_saved_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "part.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"part\.npz.*holds no heights that a cut has saved"):
        Stock.block((0, 0, 0), (1, 1, 1), 0.5).part(tmp_path / "part.npz")


def test_the_line_in_which_a_rotary_axis_turns_is_named() -> None:
    rows = chain(line([0.0] * 3, [5.0], 1.0, program_line=3), line([5.0], [5.0, 0, 0, 90.0], 1.0, program_line=8))
    carving = Carving(Stock.block((0, 0, -1), (1, 1, 0), 0.5), {1: ShapedTool(1, 3.0)})
    with pytest.raises(InputError, match="line 8: rotary axes move"):
        carving.program([PathBlock(rows, tool=1)])
    rows["end"], rows["rapid"] = [[5.0, 0, 0, 0, 0, 0]] * 2, [True, False]
    with pytest.raises(InputError, match="line 8: cuts with tool 2"):
        carving.program([PathBlock(rows, tool=2)])


def test_a_fault_is_told_once_for_a_line_with_its_largest_value() -> None:
    carving = Carving(Stock.block((0, 0, -1), (1, 1, 0), 0.5), {})
    for line_number, kind, value in ((3, "rapid", 1.0), (3, "table", 2.0), (3, "rapid", 4.0), (3, "rapid", 2.0)):
        carving._fault(line_number, kind, value)
    assert [(fault.line, fault.kind, fault.value) for fault in carving.faults] == [(3, "rapid", 4.0), (3, "table", 2.0)]


def test_holes_are_written_to_the_last_decimal(tmp_path: Path) -> None:
    (tmp_path / "tools.toml").write_text(TOOLS)
    (tmp_path / "job.toml").write_text(
        'tools = "tools.toml"\nsafe = 1234.5678\nblend = 0.00002\n[[operation]]\ndo = "drill"\ntool = 2\n'
        "depth = 2.34567\ndwell = 0.00005\nplunge = 1234567.0\nspindle = 1234567.0\n"
        "at = [123.4567, -1000.1234]\ngrid = [1, 2, 0.0, 0.0001]\n"
    )
    text = read_job(tmp_path / "job.toml").program()
    assert "G99 G82 P0.00005 X123.4567 Y-1000.1234 Z-2.3457 R0.5 F1234567\nX123.4567 Y-1000.1233\n" in text
    assert "G64 P0.00002\n" in text and "S1234567 M3\nG0 Z1234.5678\n" in text
