"""What the program panel finds of a cut: tools with shapes, faults by line, the part; and the program line by line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rds.core.errors import InputError
from rds.nc.run.run import PartProgram
from rds.nc.setup import Setup
from rds.nc.stepping import Step
from rds.panels.program.cut_html import cut_html
from rds.panels.program.state import Program
from rds.panels.program.step_view import StepView
from rds.panels.program.stock import cut_of_run
from rds.panels.program.tool_file import LIBRARY_STARTER, ToolFile
from rds.panels.session import Session
from tests.session.test_program import looked

TOOLS = """
[[tool]]
number = 1
diameter = 6.0
cutting_length = 2.0
shank_diameter = 8.0
reach = 4.0
holder_diameter = 20.0
[[tool]]
number = 2
shape = "vee"
angle = 90.0
diameter = 8.0
length = 3.0
"""
LINES = (
    *("G21 G90 G94 F300", "T1 M6", "G43 S1000 M3", "G0 Z5", "G1 Z-5", "X6", "G0 X9", "Z5"),
    *("T2 M6", "G43 S1000 M3", "G0 Y20", "G1 Z-2", "X12", "G0 Z5", "M2", ""),
)


@pytest.fixture
def program(tmp_path: Path) -> Program:
    (tmp_path / "tools.toml").write_text(TOOLS)
    (tmp_path / "experiment.toml").write_text("[axis]\n")
    (tmp_path / "part.ngc").write_text("\n".join(LINES))
    return Program(Session(tmp_path))


def test_a_library_among_the_files_is_offered_and_its_faults_are_marked_by_line(program: Program) -> None:
    assert [*program.choices.fields["tools"].options] == ["", "tools.toml"]  # type: ignore[attr-defined]
    program.choices.set("tools", "tools.toml")
    found = looked(program)
    assert found.ok and found.cut is not None and not found.cut.assumed
    kinds = {(fault.line, fault.kind) for fault in found.cut.faults}
    assert {(5, "shank"), (5, "holder"), (6, "shank"), (7, "rapid")} <= kinds
    assert not any(line > 8 for line, _ in kinds)
    assert {mark.line for mark in found.marks if mark.kind == "warning"} == {line for line, _ in kinds}
    # the tip of the second tool is at -2 though its holder is 3 mm higher, and leaves a groove of 90 degrees
    heights, y0, cell = found.cut.stock.heights, found.cut.stock.y0, found.cut.stock.cell
    x = int((10.5 - found.cut.stock.x0) / cell)
    beside = heights[[int((20.0 - y0) / cell), int((21.0 - y0) / cell)], x]
    assert beside == pytest.approx([-2.0, -1.0], abs=1.5 * cell)
    assert "line 7: a rapid move goes through material" in cut_html(found.cut)


def test_a_run_is_held_against_the_part_as_programmed(program: Program) -> None:
    program.choices.set("tools", "tools.toml")
    planned = looked(program).cut
    assert planned is not None
    folder = program.session.folder
    part = PartProgram(folder / "part.ngc", "mini-cnc", setup=Setup(folder / "tools.toml"), mode="simulation")
    result = part.run()
    made = cut_of_run(planned, result, part.prepared)
    assert made is not None and made.part is planned.part
    off = made.difference
    assert 0.0 < off.left < 0.05 * (planned.top - planned.part).sum() * planned.stock.cell**2
    assert {(5, "shank"), (7, "rapid")} <= {(fault.line, fault.kind) for fault in made.faults}
    assert "against the part as programmed" in cut_html(made, measured=True)


def test_a_part_and_a_stock_are_those_that_are_chosen(program: Program, tmp_path: Path) -> None:
    for text in ("0 0 1", "0 0 0 inf 1 1"):
        with pytest.raises(InputError, match="not six numbers"):
            program.choices.set("stock", text)
    with pytest.raises(InputError, match="no volume"):
        program.choices.set("stock", "0 0 0 1 1 -1")
    program.choices.set("stock", "-10, -10, -6, 30, 30, 0")
    program.edit("G21 G90 G94\nG1 Z-1 F300\nX5\nM2\n")  # without a tool
    found = looked(program)
    assert found.cut is not None and found.cut.assumed == (0,)
    assert found.cut.stock.extent[:1] == (-10.0,) and found.cut.stock.floor == -6.0
    shown, heights = found.cut.shown()
    assert heights.shape == (shown["rows"], shown["columns"]) and shown["columns"] == 160
    np.savez(tmp_path / "other.npz", heights=np.zeros((3, 3)), place=np.zeros(4))
    program.refresh()
    program.choices.set("part", "other.npz")
    found = looked(program)
    assert found.ok and found.cut is None and "heights of other cells" in found.uncut


def test_a_library_is_edited_as_a_table_is(tmp_path: Path) -> None:
    table = ToolFile(tmp_path, "mine.toml")
    assert table.text == LIBRARY_STARTER and [tool.diameter for tool in table.tools()] == [6.0]
    table.text = table.text.replace('"flat"', '"square"')
    (mark,) = table.marks()
    assert mark.line == 5 and "square" in mark.text
    with pytest.raises(InputError, match="square"):
        table.save()


def test_a_program_is_stepped_line_by_line_and_to_the_cursor(program: Program) -> None:
    program.edit("G21 G90 G54\nG10 L2 P1 X10 Y5\no1 if [0]\nG0 X9\no1 endif\n#5 = 3\nG1 X1 F90\nG20\nX1\nM2\n")
    seen: list[Step | None] = []
    view = StepView(program, seen.append, lambda: 7)
    press = view.next_button.click
    press()
    assert seen[-1] is not None and seen[-1].line == 1 and "<code>G54</code>" in view._shown.value
    view._to_cursor()
    step = seen[-1]
    assert step is not None and step.line == 7 and step.position[0] == 1.0 and step.machine_position == (11.0, 0.0, 0.0)
    assert not any(each is not None and each.line == 4 for each in seen)  # passed over
    press()
    press()
    assert seen[-1] is not None and seen[-1].machine_position[0] == pytest.approx(35.4)
    press()
    press()
    assert "its last line has been executed" in view.notice.value
    program.edit("G1 X1\nM2\n")  # has no feed: a fault where it is executed
    press()
    assert "part.ngc:1" in view.notice.value
    press()
    assert "part.ngc:1" in view.notice.value  # and not that the program is over
    view.leave()
    assert seen[-1] is None
