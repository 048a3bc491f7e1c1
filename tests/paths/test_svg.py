"""SVG drawings as drawing programs write them: sizes, clones, style sheets, and what is passed over and told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.nc.shapes import curves
from rds.nc.shapes.curves import Drawing
from rds.nc.shapes.files import read_vector_drawing
from rds.nc.shapes.svg import read_svg

Read = Callable[..., Drawing]
SIZE = 'width="100mm" height="100mm" viewBox="0 0 100 100"'
BOX = '<rect x="10" y="20" width="30" height="40"/>'


@pytest.fixture
def drawn(tmp_path: Path) -> Read:
    def read(inner: str, size: str = SIZE) -> Drawing:
        path = tmp_path / "part.svg"
        head = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
        path.write_text(f"<svg {head} {size}>{inner}</svg>")
        return read_svg(path)

    return read


def extent(drawing: Drawing) -> list[float]:
    """Least x and y, greatest x and y, mm, with Y upwards."""
    points = np.vstack([curve.points for curve in drawing.curves])
    return [*points.min(axis=0), *points.max(axis=0)]


@pytest.mark.parametrize(
    ("aspect", "expected"),
    [
        ("", [60, 40, 90, 80]),  # in the middle of the wide page, and not stretched
        ("xMinYMid meet", [10, 40, 40, 80]),
        ("xMaxYMax", [110, 40, 140, 80]),
        ("none", [20, 40, 80, 80]),
        ("xMidYMin slice", [20, -20, 80, 60]),
        ("xMidYMax slice", [20, 80, 80, 160]),
    ],
)
def test_a_page_of_another_shape_than_its_view_box_does_not_stretch(
    drawn: Read, aspect: str, expected: list[float]
) -> None:
    size = 'width="200mm" height="100mm" viewBox="0 0 100 100"'
    size += f' preserveAspectRatio="{aspect}"' if aspect else ""
    assert extent(drawn(BOX, size)) == pytest.approx(expected)


def test_a_drawing_within_the_drawing_lies_where_it_is_put(drawn: Read) -> None:
    assert extent(drawn(f'<svg x="50" y="10">{BOX}</svg>')) == pytest.approx([60, 30, 90, 70])
    inner = f'<svg x="50" y="10" width="50%" height="50" viewBox="0 0 100 100">{BOX}</svg>'
    assert extent(drawn(inner)) == pytest.approx([55, 60, 70, 80])


def test_per_cent_are_of_the_view_box(drawn: Read) -> None:
    size = 'width="200mm" height="100mm" viewBox="0 0 200 100"'
    assert extent(drawn('<rect x="10%" y="10%" width="50%" height="50%"/>', size)) == pytest.approx([20, 40, 120, 90])
    assert drawn('<circle cx="50%" cy="50%" r="10%"/>').curves[0].circle == pytest.approx((50, 50, 10))


def test_a_background_of_a_page_without_a_size_is_passed_over(drawn: Read) -> None:
    drawing = drawn('<rect width="100%" height="100%"/><circle cx="20" cy="20" r="10"/>', "")
    assert len(drawing.curves) == 1
    assert drawing.notes == ["passed over: 1 × a background as large as the page, of which the file gives no size"]


@pytest.mark.parametrize(
    ("radii", "narrow"),
    [
        ('rx="10" ry="0"', 60),  # either is 0: no rounding
        ('ry="10"', 40),
        ('rx="10" ry="-1"', 40),  # a negative one is as if it was not given
        ('rx="auto" ry="10"', 40),
    ],
)
def test_the_corners_of_a_rectangle_are_as_round_as_they_should_be(drawn: Read, radii: str, narrow: float) -> None:
    points = drawn(f'<rect x="10" y="10" width="60" height="60" {radii}/>').curves[0].points
    top = points[abs(points[:, 1] - 90) < 1e-9]
    assert np.ptp(top[:, 0]) == pytest.approx(narrow)


def test_an_ellipse_with_one_radius_is_a_circle(drawn: Read) -> None:
    assert drawn('<ellipse cx="50" cy="50" rx="20"/>').curves[0].circle == pytest.approx((50, 50, 20))


@pytest.mark.parametrize("href", ["href", "xlink:href"])
def test_clones_are_drawn_where_they_are_put(drawn: Read, href: str) -> None:
    drawing = drawn(f'<defs><g id="a">{BOX}</g></defs><use {href}="#a" x="40" y="10" transform="scale(0.5)"/>')
    assert extent(drawing) == pytest.approx([25, 65, 40, 85])
    symbol = f'<symbol id="s" viewBox="0 0 100 100">{BOX}</symbol><use {href}="#s" x="50" width="50" height="50"/>'
    assert extent(drawn(symbol)) == pytest.approx([55, 70, 70, 90])


def test_clones_that_multiply_without_end_are_refused(drawn: Read) -> None:
    groups = "".join(f'<g id="g{k}">' + f'<use href="#g{k + 1}"/>' * 20 + "</g>" for k in range(8))
    many = " ".join(f"{k},{k % 7}" for k in range(1000))
    with pytest.raises(InputError, match="more than 2000000 points, clones included"):
        drawn(f'<defs>{groups}<g id="g8"><polyline points="{many}"/></g></defs><use href="#g0"/>')


def test_a_clone_of_itself_ends(drawn: Read) -> None:
    drawing = drawn(
        f'{BOX}<g id="a"><use href="#b"/><use href="#b"/></g><g id="b"><use href="#a"/><use href="#a"/></g>'
    )
    assert extent(drawing) == pytest.approx([10, 40, 40, 80])
    assert "or of itself" in drawing.notes[0]


@pytest.mark.parametrize(
    "other",
    [
        '<g visibility="hidden"><path d="M0 0H99"/></g>',
        '<path style="visibility: collapse" d="M0 0H99"/>',
        '<style>.st0{display:none;} .st1{fill:red}</style><g class="st1 st0"><path d="M0 0H99"/></g>',
        '<style>/* a layer */ #Layer_2, #Layer_3 { display : none }</style><g id="Layer_2"><path d="M0 0H99"/></g>',
        '<path style="display:none !important" d="M0 0H99"/>',
        '<style>@media screen { .a {display:none} }</style><path class="a" d="M0 0H99"/>',
    ],
)
def test_what_is_hidden_is_passed_over_and_told(drawn: Read, other: str) -> None:
    drawing = drawn(BOX + other)
    assert extent(drawing) == pytest.approx([10, 40, 40, 80])
    assert drawing.notes == ["passed over: 1 × hidden objects"]


@pytest.mark.parametrize(
    ("inner", "is_drawn"),
    [
        ('<path fill="none" d="M0 0H99"/>', False),
        ('<g fill="none"><path d="M0 0H99"/></g>', False),
        ('<path style="fill:none;stroke:none" d="M0 0H99"/>', False),
        ("<style>.a{fill:none}</style><path class='a' d='M0 0H99'/>", False),
        ('<path d="M0 0H99"/>', True),
        ('<g stroke="red"><path fill="none" d="M0 0H99"/></g>', True),
        ('<g fill="none"><path style="stroke:#000" d="M0 0H99"/></g>', True),
        ("<style>g > path{stroke:red}</style><g><path fill='none' d='M0 0H99'/></g>", True),
    ],
)
def test_what_has_neither_fill_nor_stroke_is_passed_over_and_told(drawn: Read, inner: str, is_drawn: bool) -> None:
    drawing = drawn(BOX + inner)
    assert extent(drawing) == pytest.approx([0, 40, 99, 100] if is_drawn else [10, 40, 40, 80])
    assert [("which nobody sees" in note) for note in drawing.notes] == ([] if is_drawn else [True])


def test_a_style_sheet_without_end_is_read_in_a_moment(drawn: Read) -> None:
    """It once took the square of its length: hours for these."""
    drawing = drawn(f"<style>{'/*' * 500_000}</style><style>{'a' * 1_000_000}</style>{BOX}")
    assert extent(drawing) == pytest.approx([10, 40, 40, 80])


def test_what_is_visible_in_a_hidden_group_is_drawn(drawn: Read) -> None:
    inner = f'<g visibility="hidden"><path d="M0 0H99"/><g visibility="visible">{BOX}</g></g>'
    assert extent(drawn(inner)) == pytest.approx([10, 40, 40, 80])


@pytest.mark.parametrize(
    ("attribute", "told"),
    [
        ('clip-path="url(#c)"', "a clip or mask: its object is drawn whole"),
        ('style="mask:url(#c)"', "a clip or mask: its object is drawn whole"),
        ('marker-end="url(#arrow)" marker-start="url(#arrow)"', "1 × markers, such as arrowheads"),
        ('stroke="red" style="stroke-dasharray: 3,1"', "the dashes of a stroke, which is cut as one line"),
        ('transform="rotate(90)" transform-origin="50 50"', "a transformation by CSS"),
        ('style="transform: rotate(90deg)"', "a transformation by CSS"),
    ],
)
def test_what_is_not_done_to_an_object_is_told(drawn: Read, attribute: str, told: str) -> None:
    notes = drawn(f"<g {attribute}>{BOX}</g>").notes
    assert len(notes) == 1 and told in notes[0]


@pytest.mark.parametrize(
    ("sheet", "told"),
    [
        ("#a { transform: scale(2) }", "a transformation by CSS"),
        ("#a { clip-path: url(#c) }", "a clip or mask: its object is drawn whole"),
        (".cut .edge { mask: url(#c) }", "the style sheet's rule for '.cut .edge' that hides, shows, clips"),
        ("path.cut, g path, .cut.old { display: none }", "the style sheet's rule for '.cut.old' that hides"),
    ],
)
def test_what_a_style_sheet_does_and_is_not_done_is_told(drawn: Read, sheet: str, told: str) -> None:
    notes = drawn(f'<style>{sheet} path[id] {{ fill: red }}</style><g id="a">{BOX}</g>').notes
    assert len(notes) == sheet.count(",") + 1 and told in notes[-1]


@pytest.mark.parametrize(
    "inner",
    [
        '<circle r="1e300"/>',
        '<path d="M0 0 A 1e20 1e20 0 0 1 5 5"/>',
        '<path d="M0 0 A 99999999999 5 0 0 1 10 10"/>',  # as chords these would be 8 million
        '<path d="M0 0L1e999 5"/>',
        '<polyline transform="skewX(1)" points="1e308 1e400 1 2"/>',  # no numbers, once they are moved
    ],
)
def test_numbers_too_large_for_a_drawing_are_refused(tmp_path: Path, inner: str) -> None:
    path = tmp_path / "part.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {SIZE}>{inner}</svg>')
    with pytest.raises(InputError, match=r"part\.svg: .*correct it"):
        read_vector_drawing(str(path))


@pytest.mark.parametrize("coding", ["shift-jis", "gbk", "euc-jp", "no-such-coding", "hex", "idna"])
def test_codings_that_the_reader_of_xml_does_not_know_are_refused(tmp_path: Path, coding: str) -> None:
    path = tmp_path / "a.svg"
    path.write_text(
        f'<?xml version="1.0" encoding="{coding}"?><svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"/>'
    )
    with pytest.raises(InputError, match="save it as plain SVG in UTF-8"):
        read_svg(path)


@pytest.mark.parametrize("coding", ["utf-8", "utf-16"])
def test_entities_are_refused_in_every_coding(tmp_path: Path, coding: str) -> None:
    text = '<!DOCTYPE svg [<!ENTITY a "b">]><svg xmlns="http://www.w3.org/2000/svg"><desc>&a;</desc></svg>'
    (tmp_path / "a.svg").write_text(text, encoding=coding)
    with pytest.raises(InputError, match="defines entities"):
        read_svg(tmp_path / "a.svg")


def test_flowed_text_of_inkscape_is_told(drawn: Read) -> None:
    flowed = f"<flowRoot><flowRegion>{BOX}</flowRegion><flowPara>Part 7</flowPara></flowRoot>"
    drawing = drawn(BOX + flowed)
    assert len(drawing.curves) == len(drawing.notes) == 1 and "1 × text (Path > Object" in drawing.notes[0]


def test_lines_drawn_twice_are_cut_once_and_that_is_told(drawn: Read) -> None:
    spokes = '<path d="M0 0L5 0M0 0L0 5"/><g transform="scale(2)"><path d="M2.5 0H0"/></g><line y2="5" stroke="red"/>'
    drawing = drawn(spokes)
    length = sum(np.hypot(*np.diff(curve.points, axis=0).T).sum() for curve in drawing.curves)
    assert length == pytest.approx(10.0)
    assert drawing.notes == ["passed over: 2 × curves that are drawn already, on the same layer"]


def test_curves_around_one_centre_are_not_all_held_against_each_other(
    drawn: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that 2000 squares are read within a second, and not within minutes."""
    asked = []
    same = curves._same
    monkeypatch.setattr(curves, "_same", lambda one, other: asked.append(one) or same(one, other))
    squares = [f'<rect x="{50 - k / 9}" y="{50 - k / 9}" width="{k / 4.5}" height="{k / 4.5}"/>' for k in range(1, 301)]
    drawing = drawn("".join((*squares, squares[7])))
    assert len(drawing.curves) == 300 and 1 <= len(asked) <= 10


@pytest.mark.parametrize("d", ["M0 0L5 5TZ", "M0 0L5 5 l", "M0 0 Q9 9 5 0 T z M8 8 l1 1", "M", "M0 0LL5 5"])
def test_a_command_of_a_path_without_its_numbers_is_refused(drawn: Read, d: str) -> None:
    with pytest.raises(InputError, match=r"path command [TlML] has no numbers"):
        drawn(f'<path d="{d}"/>')


@pytest.mark.parametrize(
    "attribute",
    [
        'style="stroke-dasharray:none;marker:none;clip-path:none"',
        'stroke="red" stroke-dasharray="0 0"',
        'stroke-dasharray="3"',
    ],
)
def test_what_does_nothing_to_an_object_is_not_told(drawn: Read, attribute: str) -> None:
    assert drawn(f"<g {attribute}>{BOX}</g>").notes == []


@pytest.mark.parametrize(
    ("inner", "told"),
    [
        ('<svg x="5" y="5" width="20" height="20"><circle cx="10" cy="10" r="10"/></svg>', 0),
        ('<svg x="5" y="5" width="20" height="20"><circle cx="10" cy="10" r="11"/></svg>', 1),
        ('<svg x="5" y="5" width="20" height="20" overflow="visible"><circle cx="10" cy="10" r="11"/></svg>', 0),
        ('<symbol id="s" viewBox="-5 -5 10 10"><circle r="6"/></symbol><use href="#s" width="50" height="50"/>', 1),
        ('<symbol id="s" viewBox="-5 -5 10 10"><circle r="5"/></symbol><use href="#s" width="50" height="50"/>', 0),
    ],
)
def test_what_reaches_out_of_a_drawing_within_the_drawing_is_drawn_and_told(drawn: Read, inner: str, told: int) -> None:
    drawing = drawn(inner)
    assert len(drawing.curves) == 1 and drawing.curves[0].circle
    assert [note for note in drawing.notes if "the border of a drawing within the drawing" in note] == drawing.notes
    assert len(drawing.notes) == told


def test_one_alternative_of_a_switch_is_drawn(drawn: Read) -> None:
    german, any_language = '<circle r="3" systemLanguage="de"/>', '<circle r="4"/><circle r="5"/>'
    drawing = drawn(f'<switch><!-- --><foreignObject requiredExtensions="x"/>{german}{any_language}</switch>')
    assert [curve.circle[2] for curve in drawing.curves if curve.circle] == pytest.approx([4.0])
    assert drawing.notes == ["passed over: 1 × foreign content", "passed over: 2 × other alternatives of a <switch>"]


@pytest.mark.parametrize(
    ("size", "inner", "why"),
    [
        ("", '<rect width="50%" height="5"/>', "'50%' is of a size that the drawing does not say; give it a viewBox"),
        ("", '<svg viewBox="0 0 9 9"><circle r="3"/></svg>', "has a drawing within it without a size"),
        ('width="-200" height="100" viewBox="0 0 200 100"', '<circle r="3"/>', "give it width and height above 0"),
    ],
)
def test_a_size_that_is_not_said_is_refused(drawn: Read, size: str, inner: str, why: str) -> None:
    with pytest.raises(InputError, match=why):
        drawn(inner, size)


def test_what_is_too_deep_in_groups_is_told(drawn: Read) -> None:
    drawing = drawn(BOX + "<g>" * 120 + BOX + "</g>" * 120)
    assert len(drawing.curves) == 1
    assert drawing.notes == ["passed over: 1 × objects in more than 100 groups within one another (ungroup them)"]
