"""Drawings in a session: cells and pictures to outlines to part programs, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from waiting import wait_for

from rds.core.errors import InputError
from rds.panels.drawing.state import Drawing, _fields, traced
from rds.panels.program.state import program_choices
from rds.panels.session import Session
from rds.panels.session.fields import Field

PATIENCE = 60.0  # s
BLOCK = "\n".join(["." * 10] * 2 + ["..." + "#" * 4 + "..."] * 4 + ["." * 10] * 2)


def drawing(folder: Path, **values: Any) -> Drawing:
    made = Drawing(Session(folder))
    for name, value in values.items():
        made.choices.set(name, value)
    return drawing_of(made)


def chosen(folder: Path, **values: Any) -> dict[str, Any]:
    fields: list[Field] = list(_fields(folder))
    return {each.name: each.default for each in fields} | values


def test_the_first_drawing_has_an_outline(tmp_path: Path) -> None:
    made = drawing(tmp_path)
    assert made.latest is not None and not made.refusal
    assert made.latest.outline.deviation <= 0.5


def test_a_block_of_cells_has_the_outline_of_a_block(tmp_path: Path) -> None:
    made = drawing(tmp_path, cells=BLOCK, pixel=2.0, tolerance=0.0, depth=3.0, method="blob")
    assert made.latest is not None
    found = made.latest.summary
    # through the centres of 4 × 4 cells of 2 mm, about the middle of 10 × 8 cells
    assert [found["extent_mm"][axis] for axis in "XYZ"] == [
        pytest.approx(ends) for ends in ([-3, 3], [-3, 3], [-3, -3])
    ]
    assert found["length_mm"] == pytest.approx(24.0) and found["closed"]
    ring = np.array(made.latest.rings_in_cells()[0])
    assert ring.min(axis=0) == pytest.approx([3.5, 2.5]) and ring.max(axis=0) == pytest.approx([6.5, 5.5])


@pytest.mark.parametrize(
    ("cells", "says"),
    [
        ("....\n....\n....", "nothing|nowhere"),
        ("####.\n####.\n.....", "reaches the border"),
        (".........\n.##...##.\n.##...##.\n.........", "2 islands"),
        (".......\n.#####.\n.#...#.\n.#...#.\n.#####.\n.......", "hole"),
    ],
)
def test_what_has_no_outline_is_refused_with_the_reason(tmp_path: Path, cells: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        traced(chosen(tmp_path, cells=cells), tmp_path)


@settings(max_examples=25)
@given(st.floats(0.05, 2.0), st.integers(3, 8), st.integers(3, 8))
def test_the_cut_is_never_farther_off_than_the_smoothing_allows(
    tmp_path_factory: pytest.TempPathFactory, tolerance: float, wide: int, high: int
) -> None:
    cells = "\n".join(["." * (wide + 4)] * 2 + [".." + "#" * wide + ".."] * high + ["." * (wide + 4)] * 2)
    folder = tmp_path_factory.getbasetemp()
    made = traced(chosen(folder, cells=cells, tolerance=tolerance), folder)
    assert made.outline.deviation <= tolerance
    assert f"at most {made.outline.deviation:.3f} mm off" in made.sentence


def test_rows_and_columns_keep_what_was_drawn(tmp_path: Path) -> None:
    made = drawing(tmp_path, cells=BLOCK)
    assert (made.choices["rows"], made.choices["columns"]) == (8, 10)
    made.choices.set("cells", "\n".join(["." * 40] * 20))
    assert made.choices["cells"] == "\n".join(["." * 40] * 20)
    made.choices.set("cells", BLOCK)
    made.choices.set("columns", 14)
    made.choices.set("rows", 6)
    rows = made.choices["cells"].split("\n")
    assert len(rows) == 6 and all(len(row) == 14 for row in rows) and rows[2][:7] == "...####"


@pytest.mark.parametrize("cells", ["", "..\n.", "x", "." * 97, "\n".join(["."] * 97)])
def test_cells_that_are_none_are_refused(tmp_path: Path, cells: str) -> None:
    made = Drawing(Session(tmp_path))
    before = made.choices["cells"]
    if cells:
        with pytest.raises(InputError):
            made.choices.set("cells", cells)
        assert made.choices["cells"] == before
    else:
        with pytest.raises(InputError):
            traced(chosen(tmp_path, cells=cells), tmp_path)


def test_the_program_is_written_opened_and_valid(tmp_path: Path) -> None:
    from rds.machines import load_machine
    from rds.nc.check import check_program
    from rds.nc.setup import Setup

    made = drawing(tmp_path, cells=BLOCK)
    assert made.write() == "drawing.ngc"
    path = tmp_path / "drawing.ngc"
    assert program_choices(made.session)["file"] == "drawing.ngc"
    validation, _ = check_program(path, load_machine("mini-cnc"), Setup())
    assert validation.ok and validation.spindle == 3000.0
    made.choices.set("depth", 2.0)
    again = drawing_of(made)
    again.write()  # its own file is written again
    assert "Z-2" in path.read_text()


def drawing_of(made: Drawing) -> Drawing:
    def is_drawn() -> bool:
        if made.tracing:
            made.tick()
        return not made.tracing

    wait_for(is_drawn)
    return made


def test_a_program_of_somebody_else_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "drawing.ngc").write_text("M2\n")
    made = drawing(tmp_path, cells=BLOCK)
    with pytest.raises(InputError, match="choose another name"):
        made.write()
    assert (tmp_path / "drawing.ngc").read_text() == "M2\n"


def test_a_program_needs_a_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"write one like part\.ngc"):
        drawing(tmp_path).choices.set("program", "")


def test_a_picture_is_taken_into_the_folder_and_traced(tmp_path: Path) -> None:
    made = drawing(tmp_path)
    made.take_picture("C:\\x\\shape.txt", BLOCK.encode())
    assert made.choices["source"] == "picture" and made.choices["picture"] == "shape.txt"
    drawing_of(made)
    assert made.latest is not None and made.latest.outline.darkness.shape == (8, 10)
    with pytest.raises(InputError, match=r"another shape\.txt"):
        made.take_picture("shape.txt", b"other")


def test_a_picture_that_was_drawn_anew_is_traced_anew(tmp_path: Path) -> None:
    (tmp_path / "part.txt").write_text(BLOCK)
    made = drawing(tmp_path, source="picture", picture="part.txt")
    assert made.latest is not None
    before = made.latest.text
    (tmp_path / "part.txt").write_text(BLOCK.replace("####", "###."))
    with pytest.raises(InputError, match="not traced yet; wait a moment"):
        made.write()
    drawing_of(made).write()
    assert made.latest.text == (tmp_path / "drawing.ngc").read_text() != before


@pytest.mark.parametrize("name", ["x.exe", ".png", "../../x", "a\x00.png", ""])
def test_a_file_that_is_no_picture_stays_out(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="no picture"):
        drawing(tmp_path).take_picture(name, b"x")


def test_a_damaged_picture_is_a_refusal(tmp_path: Path) -> None:
    made = drawing(tmp_path)
    made.take_picture("bad.png", b"not a picture")
    drawing_of(made)
    assert "bad.png" in made.refusal and "no image" in made.refusal
    with pytest.raises(InputError):
        made.write()
