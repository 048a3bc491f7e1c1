"""A program begun at one of its lines, and one that waits after each of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rds import open_result
from rds.cli.main import app
from rds.core.errors import InputError
from rds.core.shared_quantities import TIED_FEED
from rds.modes.loop.execution import State
from rds.modes.loop.program import STEP
from rds.nc.run.run import PartProgram

PROGRAM = "G21 G90 G94\nM3 S1000\nG0 Z5\nG1 Z-1 F300\nG1 X10\nY10\n(a remark)\nX0\nG0 Z8\nM2\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "part.ngc"
    path.write_text(PROGRAM)
    return path


def test_a_run_from_a_line_goes_up_across_and_down_and_cuts_the_rest(file: Path) -> None:
    whole, part = PartProgram(file), PartProgram(file, begin=7)
    rest = whole.prepared.path[whole.prepared.path["line"] >= 8]
    path = part.prepared.path
    ends = [[0, 0, 5], [10, 10, 5], [10, 10, -1]]  # up to the highest point of the lines before, not of those after
    assert path["end"][:3, :3].tolist() == ends
    assert path["rapid"][:3].tolist() == [True, True, False] and path["rate"][2] == 5.0  # down by feed, mm/s
    assert np.array_equal(path[3:], rest)
    assert [(each.kind, each.value) for each in part.prepared.program.happenings[:1]] == [("spindle", 1000.0)]
    result = part.run()
    assert set(result["program_line"]) == {2.0, 8.0, 9.0} and result["X_measured"][-1] == pytest.approx(0.0, abs=0.1)


def test_the_command_takes_both_and_what_holds_before_holds(file: Path, tmp_path: Path) -> None:
    file.write_text(PROGRAM.replace("M3 S1000", "M3 S1000 M49"))
    command = ["nc", "run", str(file), "--begin", "7", "--steps", "--override", "50", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0 and "It was begun at line 7: of the lines before, tool" in done.output
    result = open_result(tmp_path / "out")
    assert set(result["program_line"]) == {2.0, 8.0, 9.0}
    assert State.STOP in result["program_state"]
    assert set(result["program_override"][result["program_line"] == 8.0]) == {0.0, 1.0}  # M49: no override


def test_a_thread_of_two_lines_is_one_step_and_the_way_to_its_middle_can_be_held(file: Path) -> None:
    file.write_text("G21 G90\nM3 S600\nG0 Z5\nG33 Z-2 K1\nG33 X8 Z-3 K1\nG0 Z5\nM2\n")
    program = PartProgram(file, steps=True)
    happenings = program.prepared.program.happenings
    assert [each.line for each in happenings if (each.kind, each.value) == ("stop", STEP)] == [3, 4, 5]
    result = program.run()
    assert State.STOP in result["program_state"][result["program_line"] == 5]
    assert State.STOP not in result["program_state"][result["program_line"] == 4]
    part = PartProgram(file, begin=5).prepared  # up, across (nowhere) and down, before the feed is the spindle's
    begins = next(each.sample for each in part.program.happenings if each.kind == "override")
    assert part.program.position[begins].tolist() == part.path["start"][part.path["line"] == 5][-1, :3].tolist()
    assert part.program.position[begins, 2] == -2.0


def test_a_line_after_the_last_move_and_an_interpolator_are_refused(file: Path) -> None:
    with pytest.raises(InputError, match="nothing moves from line 10 on; the last line that moves is 9"):
        PartProgram(file, begin=10)
    with pytest.raises(InputError, match="go with planned motion"):
        PartProgram(file, steps=True, interpolator="constant-velocity")


def test_single_step_rests_after_each_line_that_moves(file: Path) -> None:
    program = PartProgram(file, steps=True).prepared.program
    stops = [each for each in program.happenings if each.value == STEP]
    assert [each.line for each in stops] == [3, 4, 5, 6, 8]  # the last move is followed by the end
    for each in stops:
        assert not program.velocity[each.sample].any()
    assert [each.sample for each in program.happenings] == sorted(each.sample for each in program.happenings)


def test_a_run_from_within_a_thread_may_be_held_on_the_way_there(file: Path) -> None:
    """Only the thread is tied to its spindle: the way to it, a rapid move across, once was, and no hold ended it."""
    file.write_text("G21 G90 G94\nM3 S100\nG0 X5 Z5\nG33 Z2 K1\nG33 Z-1 K1\nG0 Z8\nM2\n")
    prepared = PartProgram(file, begin=5).prepared
    assert prepared.path["line"].tolist() == [5, 5, 5, 5, 6]
    tied = next(each for each in prepared.program.happenings if each.kind == "override")
    assert tied.value == TIED_FEED
    assert prepared.program.position[tied.sample][:3].tolist() == pytest.approx([5.0, 0.0, 2.0])
