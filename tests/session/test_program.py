"""Part programs in a session: the text that is never lost, what a look finds, a run."""

from __future__ import annotations

import re
import shutil
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.core.types import Ending
from rds.machines import load_machine, machine_names
from rds.nc.active import Follower, modes_at
from rds.nc.validation import Validation
from rds.panels.interpolator.motion import MADE
from rds.panels.kit.notice import Notice
from rds.panels.program.check import CheckState
from rds.panels.program.mdi import FILE, Mdi
from rds.panels.program.offsets import Offsets
from rds.panels.program.path_view import PathView
from rds.panels.program.preview import _numbers
from rds.panels.program.state import Program
from rds.panels.program.text import ProgramText
from rds.panels.session import Session

PATIENCE = 60.0  # s, on a busy computer


def program(folder: Path, *lines: str) -> Program:
    made = Program(Session(folder))
    if lines:
        made.edit("\n".join((*lines, "")))
    return made


def looked(made: Program) -> CheckState:
    deadline = time.monotonic() + PATIENCE
    while made.looking:
        made.tick()
        assert time.monotonic() < deadline
        time.sleep(0.005)
    assert made.latest is not None
    return made.latest


def test_the_path_is_seen_first_in_a_plane_of_the_machines_axes() -> None:
    sides = {name: PathView(load_machine(name)).side for name in machine_names()}
    assert sides["lathe"] == sides["mrm-lathe"] == "ZX" and {*sides.values()} == {"XY", "ZX"}


# the text


@pytest.mark.parametrize("machine", machine_names())
def test_a_folder_without_programs_begins_with_one_that_the_machine_can_run(machine: str, tmp_path: Path) -> None:
    made = Program(Session(tmp_path, machine=machine))
    assert looked(made).validation.segments > 1 and looked(made).ok and made.text.is_new
    assert not (tmp_path / "part.ngc").exists()


def test_what_is_not_saved_is_there_in_the_next_session(tmp_path: Path) -> None:
    program(tmp_path, "(mine)", "M2")
    again = program(tmp_path)
    assert again.text.text == "(mine)\nM2\n" and again.text.changed
    again.save()
    assert (tmp_path / "part.ngc").read_text() == "(mine)\nM2\n"
    assert not again.text.draft.exists() and not again.text.changed


def test_each_program_keeps_its_draft_while_another_is_open(tmp_path: Path) -> None:
    made = program(tmp_path, "(first)", "M2")
    made.open("second.ngc")
    made.edit("(second)\nM2\n")
    made.open("part.ngc")
    assert made.text.text == "(first)\nM2\n"
    assert made.programs() == ["part.ngc", "second.ngc"]


def test_a_file_that_somebody_else_changed_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_text("M2\n")
    text = ProgramText(tmp_path, "part.ngc")
    text.edit("(mine)\nM2\n")
    path.write_text("(theirs)\nM2\n")
    with pytest.raises(InputError, match="changed by another program since it was opened"):
        text.save()
    assert path.read_text() == "(theirs)\nM2\n"
    text.discard()
    assert text.text == "(theirs)\nM2\n"


def test_what_was_found_of_another_text_is_not_said_of_one_whose_draft_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise InputError("cannot write: No space left on device", str(path))

    made = program(tmp_path, "G0 X1", "M2")
    assert looked(made).ok
    monkeypatch.setattr("rds.panels.program.text.write_whole", full)
    with pytest.raises(InputError, match="No space left"):
        made.edit("G0 X1000\nM2\n")
    assert "the check failed" in looked(made).sentence
    with pytest.raises(InputError, match="it cannot run yet"):
        made.run()
    monkeypatch.undo()
    made.look_again()
    assert "X" in looked(made).sentence and not looked(made).ok


def test_a_file_that_was_replaced_is_read_again_unless_something_is_unsaved(tmp_path: Path) -> None:
    path = tmp_path / "part.ngc"
    path.write_text("M2\n")
    made = program(tmp_path)
    assert not made.follow_disk()
    path.write_text("(longer)\nM2\n")
    assert made.follow_disk() and made.text.text == "(longer)\nM2\n"
    made.edit("(mine)\nM2\n")
    path.write_text("(longer still)\nM2\n")
    assert not made.follow_disk() and made.text.text == "(mine)\nM2\n"


def test_the_text_of_a_file_that_was_removed_stays(tmp_path: Path) -> None:
    made = program(tmp_path)
    made.edit("(mine)\nM2\n")
    made.save()
    made.text.path.unlink()
    assert made.follow_disk() and made.text.text == "(mine)\nM2\n" and made.text.is_new
    assert program(tmp_path).text.text == "(mine)\nM2\n"  # as a draft
    made.text.path.write_text("(theirs)\nM2\n")
    with pytest.raises(InputError, match="discard your changes to see the other's"):
        made.save()
    assert not made.text.is_new  # so that they can be discarded
    made.text.path.unlink()
    made.save()
    assert made.text.path.read_text() == "(mine)\nM2\n"


def test_a_copy_takes_no_name_that_is_there(tmp_path: Path) -> None:
    (tmp_path / "other.ngc").write_text("M2\n")
    made = program(tmp_path, "(mine)", "M2")
    with pytest.raises(InputError, match=r"there is a other\.ngc already"):
        made.save_as("other.ngc")
    made.save_as("new.ngc")
    assert made.text.name == "new.ngc" and (tmp_path / "new.ngc").read_text() == "(mine)\nM2\n"


@pytest.mark.parametrize(
    "name", ["../x.ngc", "/etc/x.ngc", "x", "x.py", ".x.ngc", "a\nb.ngc", "", "a\\b.ngc", "x" * 200]
)
def test_a_name_that_leads_elsewhere_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError):
        program(tmp_path).open(name)
    assert list(tmp_path.glob("*.ngc")) == []


@given(st.text(max_size=200))
def test_any_text_is_looked_at_without_an_error(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    from rds.machines import load_machine
    from rds.nc.setup import Setup
    from rds.panels.program.check import look
    from rds.panels.session.task import Task

    source = tmp_path_factory.getbasetemp() / "any.ngc"
    source.write_bytes(text.encode("utf-8", "replace"))
    task: Task[CheckState] = Task("look", lambda task: look(task, source, "any.ngc", load_machine("mini-cnc"), Setup()))
    task.start().wait(PATIENCE)
    assert task.error is None and task.result is not None
    assert task.result.ok or task.result.marks or task.result.trouble


# what a look finds


def test_faults_and_warnings_are_at_their_words(tmp_path: Path) -> None:
    found = looked(program(tmp_path, "G21 G90", "G1 X10 Q5 F300", "G1 X20 W2", "M2"))
    marks = [(mark.line, mark.column, mark.length, mark.kind) for mark in found.marks]
    assert (2, 8, 2, "error") in marks
    assert not found.ok and found.sentence.startswith("2 faults; line 2: Q5")
    warned = looked(program(tmp_path, "G21 G90", "M3", "G1 X10 F300", "M2"))
    assert [(mark.line, mark.kind) for mark in warned.marks] == [(2, "warning")]
    assert warned.ok


def test_what_leaves_the_travel_is_a_fault_and_in_the_trace(tmp_path: Path) -> None:
    found = looked(program(tmp_path, "G21 G90", "G1 X80 F300", "M2"))
    assert [(mark.line, mark.column) for mark in found.marks] == [(2, 4)]
    assert "5 mm beyond its travel" in found.marks[0].text
    assert found.trace.high[0] == 80.0


def test_the_reach_has_the_units_and_the_tolerance_of_the_validator(tmp_path: Path) -> None:
    made = Program(Session(tmp_path, "xyzac"))
    most = {axis: made.machine.axes[axis].travel[1] for axis in "XA"}
    reach = Validation("", "xyzac", low={"X": 0.0, "A": 0.0}, high={"X": most["X"] + 1e-9, "A": most["A"] + 1e-3})
    shown = _numbers(CheckState((), reach), made)
    assert re.findall(r"<tr><td>(.*?)</td>.*?<td>. (\w+)</td></tr>", shown) == [
        ("X [mm]", "inside"),
        ("A [deg]", "beyond"),
    ]


def test_a_cycle_time_that_can_be_reckoned_by_hand(tmp_path: Path) -> None:
    found = looked(program(tmp_path, "G21 G90", "G1 X10 F600", "G4 P0.5", "M2"))
    assert found.cycle is not None
    # 10 mm at 10 mm/s: 1 s, and v/a + a/j = 0.05 + 0.02 s for both ramps together; the dwell
    assert found.cycle.total == pytest.approx(1.57, abs=0.01)
    assert found.cycle.certificate.ok


def test_a_wrong_tool_table_is_said_and_nothing_breaks(tmp_path: Path) -> None:
    (tmp_path / "t.tbl").write_text("T1 P1 nonsense\n")
    made = program(tmp_path, "M2")
    made.choices.set("tools", "t.tbl")
    found = looked(made)
    assert not found.ok and "nonsense" in found.sentence


def test_blocks_behind_a_slash_are_left_out_on_demand(tmp_path: Path) -> None:
    made = program(tmp_path, "G21 G90", "/G1 X200 F300", "G1 X1 F300", "M2")
    assert not looked(made).ok
    made.choices.set("block_delete", True)
    assert looked(made).ok


def test_a_program_too_long_for_one_run_is_said_without_planning_it(tmp_path: Path) -> None:
    made = program(tmp_path, "G21 G90", *["G1 X60 F1", "X-60"] * 200, "M2")
    found = looked(made)
    assert not found.ok and "takes at least" in found.sentence and found.trace.high[0] == 60.0


def test_faults_and_path_are_there_before_the_time_is_planned(tmp_path: Path) -> None:
    made = program(tmp_path, "G21 G90", *["G1 X60 F60", "X-60"] * 2, "M2")
    found = []
    deadline = time.monotonic() + PATIENCE
    while made.looking and time.monotonic() < deadline:
        if (each := made.tick()) is not None:
            found.append(each)
        time.sleep(0.002)
    unplanned = [look.cycle is None for look in found]
    assert unplanned in ([True, False], [True, False, False]), "planned, it is found once more with what it cuts"
    assert all(look.ok and look.trace.high[0] == 60.0 for look in found)


def test_a_loop_that_never_ends_is_given_up_when_the_text_changes(tmp_path: Path) -> None:
    made = program(tmp_path, "#1 = 0", "o1 while [1]", "#1 = [#1 + 1]", "o1 endwhile", "M2")
    made.tick()
    made.edit("G21 G90\nG1 X1 F300\nM2\n")
    assert looked(made).ok


# modes


def test_modes_line_by_line(tmp_path: Path) -> None:
    path = tmp_path / "m.ngc"
    path.write_text("G21 G90 G17\nG10 L2 P2 X10 Y20 Z3\nG55\nG1 X1 F100\nS500 M3 G91 G18\nG61\nG0 Z1\nG20\nM2\n")
    follower = Follower(path)
    list(follower.run())
    follower.close()
    at = {line: modes_at(follower.modes, line) for line in range(1, 9)}
    assert all(at.values())
    one, four, five, six, eight = (at[line] for line in (1, 4, 5, 6, 8))
    assert one is not None and four is not None and five is not None and six is not None and eight is not None
    assert {"G17", "G90", "G21", "G54", "G64", "M5"} <= set(one.words)
    assert {"G1", "G55"} <= set(four.words) and four.feed == 100.0
    assert {"G91", "G18", "M3"} <= set(five.words) and five.speed == 500.0
    assert "G61" in six.words and "G64" not in six.words
    assert four.work({"X": 11.0, "Y": 20.0, "Z": 4.0}) == pytest.approx({"X": 1.0, "Y": 0.0, "Z": 1.0})
    assert eight.work({"X": 10.0}) == pytest.approx({"X": 0.0, "Y": -20.0, "Z": -3.0})  # mm, also in G20


@given(
    st.tuples(*[st.floats(-50, 50)] * 3),
    st.tuples(*[st.floats(-50, 50)] * 3),
    st.floats(-180, 180),
    st.tuples(*[st.floats(-20, 20)] * 3),
)
def test_work_coordinates_undo_the_way_to_the_machine(
    origin: tuple[float, ...], g92: tuple[float, ...], rotation: float, point: tuple[float, ...]
) -> None:
    import numpy as np

    from rds.nc.active import Modes
    from rds.nc.language.frame import Frame

    frame = Frame()
    frame.set_origin(1, origin)
    frame.set_g92(g92)
    frame.set_tool_length((1.0, 2.0, 3.0))
    frame.rotation = rotation
    machine = frame.to_machine(np.array([[*point, 0.0, 0.0, 0.0]]))[0]
    modes = Modes((), 0, 0.0, 0.0, origin, g92, (1.0, 2.0, 3.0), rotation)
    found = modes.work(dict(zip("XYZ", machine.tolist(), strict=False)))
    assert tuple(found.values()) == pytest.approx(point, abs=1e-6)


# a run


def test_a_run_saves_the_program_and_has_its_results_in_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved: list[Path] = []  # pictures take seconds, and are not this test's subject
    monkeypatch.setattr("rds.panels.equipment.run.made_beside", lambda save, result, prepared, to: saved.append(to))
    made = program(tmp_path, "G21 G90", "G1 X2 F600", "M2")
    assert looked(made).ok
    work = made.run().start()
    assert work.wait(PATIENCE) and work.error is None
    assert (tmp_path / "part.ngc").read_text() == "G21 G90\nG1 X2 F600\nM2\n"
    assert saved == [work.folder] and work.folder.parent == tmp_path / "runs"
    assert [name for name, _ in work.traces()] == ["X_error", "Y_error", "Z_error", "contour_error"]
    assert work.result is not None
    rows = work.new_rows()
    kept = work.result["contour_error"]
    assert rows[:, len(work.traces())] == pytest.approx(kept[:: round(0.01 / work.result.sample_period)])
    assert len(work.new_rows()) == 0


def test_an_interpolator_makes_the_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.panels.equipment.run.made_beside", lambda save, result, prepared, folder: None)
    made = program(tmp_path, "G21 G90", "G1 X6 F600", "G2 X0 Y0 I-3 J0", "M2")
    assert looked(made).ok and set(MADE) <= made.idle()
    made.choices.set("interpolator", "tustin")
    assert made.idle() == {"interpolator_file", "arc_interpolator_file"}
    made.choices.set("override", 110.0)
    work = made.run().start()
    assert work.wait(PATIENCE) and work.error is None and work.result is not None
    assert work.result.meta["program"]["interpolator"] == "tustin"
    assert work.result.meta["program"]["acceleration"]["name"] == "s-shape"
    kept = work.result["contour_error"][:: round(0.01 / work.result.sample_period)]
    assert work.new_rows()[:, len(work.traces())] == pytest.approx(kept)  # the contour error is the last trace
    assert work.result["program_override"].max() == pytest.approx(1.1)
    made.choices.set("override", 100.0)
    made.choices.set("interpolator", "user")
    assert "interpolator_file" not in made.idle()
    with pytest.raises(InputError, match="interpolator's file is not there"):
        made.run()
    (tmp_path / "mine.py").write_text("def interpolate(segment, T, params):\n    yield from ()\n    return 3\n")
    made.choices.set("interpolator_file", "mine.py")
    work = made.run().start()
    assert work.wait(PATIENCE) and isinstance(work.error, InputError) and "mine.py" in str(work.error)
    made.choices.set("arc_interpolator_file", "arcs.py")
    with pytest.raises(InputError, match="interpolator's file is not there"):
        made.run()
    for name in ("mine.py", "arcs.py"):  # one for lines, and one for arcs
        shutil.copy(Path(__file__).parents[2] / "examples" / "my_interpolator.py", tmp_path / name)
    work = made.run().start()
    assert work.wait(PATIENCE) and work.error is None and work.result is not None
    assert work.result.meta["program"]["interpolator"] == "mine.py, arcs by arcs.py"


def test_one_controller_for_all_axes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.panels.equipment.run.made_beside", lambda save, result, prepared, folder: None)
    made = program(tmp_path, "G21 G90", "G1 X1 F600", "M2")
    assert looked(made).ok
    made.choices.set("coupled", True)
    with pytest.raises(InputError, match="tracking is for single axes"):
        made.run()
    (tmp_path / "all.py").write_text("def control(t, r, y, state, params):\n    return 20 * (r.position - y), state\n")
    made.choices.set("controller", "all.py")
    work = made.run().start()
    assert work.wait(PATIENCE) and work.error is None and work.result is not None
    assert work.result["X_measured"][-1] == pytest.approx(1.0, abs=0.2)
    assert work.result.meta["controller"]["X"]["name"] == work.result.meta["controller"]["Y"]["name"] == "all.py"


def test_what_cannot_run_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    made = program(tmp_path, "G21 G90", "G1 X200 F600", "M2")
    looked(made)
    with pytest.raises(InputError, match="cannot run yet: 1 fault; line 2"):
        made.run()
    assert not (tmp_path / "part.ngc").exists()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("override", 0.0, "never moves"),
        ("controller", "nonsense", "nonsense"),
        ("controller", "no.py", "no file no.py"),
    ],
)
def test_a_choice_that_will_not_do_is_refused_with_the_reason(
    tmp_path: Path, name: str, value: object, says: str
) -> None:
    made = program(tmp_path, "G21 G90", "G1 X1 F600", "M2")
    made.choices.set(name, value)
    with pytest.raises(InputError, match=says):
        made.run()


def test_nothing_is_operated_when_nothing_runs(tmp_path: Path) -> None:
    work = program(tmp_path, "G21 G90", "G1 X1 F600", "M2").run()
    assert not work.operable and not work.held and work.status() is None
    for act in (work.hold, work.resume, work.home, lambda: work.override(1.0)):
        with pytest.raises(InputError, match="no program runs now"):
            act()


# bundled programs, and the options of the dialect


def test_a_bundled_program_opens_as_a_new_one(tmp_path: Path) -> None:
    made = program(tmp_path)
    assert "square.ngc" in made.bundled() and "oacs-p001.ngc" not in made.bundled()
    made.open("square.ngc")
    assert made.text.is_new and made.text.changed and "a square of 40 mm" in made.text.text
    assert looked(made).ok
    made.save()
    assert (tmp_path / "square.ngc").is_file() and "square.ngc" not in made.bundled()
    made.edit("M2\n")
    made.save()
    assert program(tmp_path).text.text == "M2\n"  # the folder's own file comes first
    assert "oacs-p001.ngc" in Program(Session(tmp_path / "other", "mrmt-oacs")).bundled()


def test_a_printed_program_needs_its_options(tmp_path: Path) -> None:
    made = program(tmp_path, "O001", "N020 G1 X7 Y2", "N040 M5")
    assert not looked(made).ok
    for name in ("program_numbers", "default_feed", "open_end"):
        made.choices.set(name, True)
    found = looked(made)
    assert found.ok, found.sentence
    assert [mark.kind for mark in found.marks] == ["warning", "warning"]
    assert "660 mm/min, is assumed" in found.marks[0].text and found.marks[0].line == 2


def test_a_typed_line_that_was_stopped_is_not_gone_on_from(tmp_path: Path) -> None:
    mdi = Mdi(SimpleNamespace(), program(tmp_path), lambda work: None, Notice())
    for ending, kept in ((Ending.STOPPED, []), (Ending.DONE, ["G0 X10"])):
        mdi._text.value = "G0 X10"
        mdi._go()
        mdi.ended(SimpleNamespace(file=tmp_path / FILE, error=None, result=SimpleNamespace(meta={"ending": ending})))
        assert mdi._lines == kept


@pytest.mark.parametrize(
    ("numbers", "says"),
    [("5220\t1\n5230\t90\n", "G54 is turned by 90°"), ("5210\t1\n5212\t7\n5220\t1\n", "shifts all systems by G92")],
)
def test_what_is_turned_or_shifted_is_not_touched_off(numbers: str, says: str, tmp_path: Path) -> None:
    """The program went elsewhere then than where the tool stood."""
    (tmp_path / "o.var").write_text(numbers)
    with pytest.raises(InputError, match=says):
        Offsets(tmp_path, "o.var").touch_off(1, {"X": 30.0, "Y": 20.0}, {"X": 10.0, "Y": 0.0})
    assert (tmp_path / "o.var").read_text() == numbers
