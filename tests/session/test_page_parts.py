"""Parts of the page without a browser: what goes wrong in them is said there, and stops nothing else."""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import ipywidgets as widgets
import numpy as np
import pytest

from rds.core.errors import ContractError, InputError
from rds.nc.setup import Setup
from rds.panels.equipment.build import Checked, Mark
from rds.panels.equipment.preview import preview
from rds.panels.equipment.result_actions import ResultActions
from rds.panels.equipment.state import Equipment
from rds.panels.equipment.view import EquipmentView
from rds.panels.kit.button import button, follow
from rds.panels.kit.notice import Notice
from rds.panels.kit.ticker import PATIENCE, Ticker
from rds.panels.kit.work_bar import WorkBar
from rds.panels.machine.modules_view import ModulesView
from rds.panels.machine.state import MachineState
from rds.panels.page.shell import Shell
from rds.panels.program.run import ProgramWork
from rds.panels.program.view import RESULT, ProgramView
from rds.panels.registry import PANELS
from rds.panels.session import Session
from rds.panels.session.formula import FOLDER
from rds.panels.session.task import Task


@pytest.mark.parametrize(
    ("error", "said"),
    [(InputError("give <b>more</b>"), "give &lt;b&gt;more&lt;/b&gt;"), (OSError(28, "No space left"), "Save failed")],
)
def test_whatever_a_button_meets_is_said_beside_it_and_as_text(error: Exception, said: str) -> None:
    def act() -> None:
        raise error

    notice = Notice()
    button("Save", "", act, notice).click()
    assert said in notice.value and "<b>more" not in notice.value


def test_an_emergency_stop_that_fails_in_any_way_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(tmp_path)
    shell = Shell(session)

    def fails() -> str:
        raise ValueError("the adapter is unplugged")

    monkeypatch.setattr(session, "emergency_stop", fails)
    shell.emergency_stop()
    said = [getattr(each, "value", "") for each in shell.widget.children]
    assert any("the adapter is unplugged; cut the power" in each for each in said)


def test_one_failure_of_a_part_of_the_page_does_not_end_it_and_many_are_said() -> None:
    told: list[str] = []
    calls: list[int] = []
    ticker = Ticker(told.append)

    def shaky() -> None:
        calls.append(1)
        if len(calls) == 1 or len(calls) > 3:
            raise OSError("the disk is away")

    ticker.add(shaky)
    for _ in range(3 + PATIENCE + 5):
        ticker.tick()
    assert len(calls) == 3 + PATIENCE and "the disk is away; reload the page" in told[0] and len(told) == 1


@pytest.mark.parametrize("name", PANELS.names())
def test_every_button_of_a_panel_says_what_fails_in_it(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shell = Shell(Session(tmp_path), name)

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Session, "work", full)
    monkeypatch.setattr("rds.core.atomic.write_whole", full)
    pressed = [each for each in _within(shell.panels[name]) if isinstance(each, widgets.Button)]
    for each in pressed:
        each.click()  # raises what its handler raises
    assert shell.session.machine_user is None
    assert pressed or name == "help"


def test_after_a_result_that_cannot_be_shown_the_next_program_can_be_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = ProgramView(Shell(Session(tmp_path)))

    def fails() -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(view, "_look", fails)
    view.work = view.operator.work = ProgramWork(
        view.shell.session, tmp_path / "part.ngc", "simulation", Setup(), "tracking", []
    )
    view.operator.enable()
    view.editor.locked = True
    assert view.operator.run_button.disabled
    with pytest.raises(OSError, match="No space"):
        view._ended()
    assert view.work is None and not view.editor.locked and not view.operator.run_button.disabled


def test_what_came_of_a_program_does_not_stand_beside_another_one(tmp_path: Path) -> None:
    for name, line in (("first.ngc", "X1"), ("same.ngc", "X1"), ("other.ngc", "X2")):
        (tmp_path / name).write_text(f"G21 G90\nG0 {line}\nM2\n")
    view = ProgramView(Shell(Session(tmp_path)))
    view.program.open("first.ngc")
    view._ran = view.program.text.text
    for name, stays in (("same.ngc", True), ("other.ngc", False)):
        view.notice.say("ended early: stopped in line 2")
        view.tabs.selected_index = RESULT
        view.program.open(name)
        assert (view.tabs.selected_index == RESULT, bool(view.notice.value)) == (stays, stays)


def test_a_run_whose_files_are_gone_is_not_sent_without_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.panels.equipment.result_actions.send_files", lambda *_: "sent")
    actions = ResultActions(Shell(Session(tmp_path)))
    actions.offer(object(), tmp_path / "runs" / "gone", ["report.html", "result.csv"])  # type: ignore[arg-type]
    next(each for each in _within(actions.widget) if getattr(each, "description", "") == "Send").click()
    assert "report.html, result.csv are gone from" in actions.notice.value


def test_simulated_modules_that_have_ended_can_be_started_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def scan(self: MachineState) -> Any:
        def none(task: Any) -> None:
            raise InputError("no module answers; start the simulated modules")

        return self.session.work("scan", none)

    shell = Shell(Session(tmp_path))
    monkeypatch.setattr(MachineState, "scan", scan)
    monkeypatch.setattr(MachineState, "serves", True)
    view = ModulesView(shell, MachineState(shell.session), lambda: None)
    start = next(each for each in _within(view.widget) if getattr(each, "description", "") == "Start modules")
    assert start.disabled
    monkeypatch.setattr(MachineState, "serves", False)  # their process was killed
    view.scan()
    while view.bar.busy:
        shell.ticker.tick()
    assert "start the simulated modules" in view.notice.value and not start.disabled


def test_who_was_told_to_wait_is_not_told_so_any_more_when_it_is_done(tmp_path: Path) -> None:
    shell, notice = Shell(Session(tmp_path)), Notice()
    bar, ends = WorkBar(shell.ticker), threading.Event()

    def begin() -> Task[bool]:
        return shell.session.work("check", lambda task: ends.wait(30.0))

    follow(bar, notice, begin, lambda _: None)
    follow(bar, notice, begin, lambda _: None)
    assert "wait until it is done" in notice.value
    ends.set()
    while bar.busy:
        shell.ticker.tick()
    assert notice.value == ""


def test_a_press_of_run_while_a_run_goes_on_is_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A browser shows the button as free until it has heard that it is not."""
    monkeypatch.setattr("rds.panels.equipment.run.made_beside", lambda *_: {})
    (tmp_path / "part.ngc").write_text("G21 G90 G94\nG1 X1 F600\nM2\n")
    shell = Shell(Session(tmp_path))
    equipment, program = EquipmentView(shell, Equipment(shell.session, "control")), ProgramView(shell)
    equipment.equipment.choices.set("duration", 0.01)
    program.program.open("part.ngc")
    for view, bar in ((equipment, equipment.bar), (program, program.operator.bar)):
        view.start()
        view.start()
        assert "wait until it is done" in view.notice.value
        while bar.busy:
            shell.ticker.tick()
        assert "done: " in view.notice.value  # what came of the run stands in its place
    assert len(shell.session.runs()) == 2


def test_what_a_run_found_in_a_file_is_said_until_it_is_mended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shell = Shell(Session(tmp_path))
    view = EquipmentView(shell, Equipment(shell.session, "control"))
    code = view.edit()
    bad = Checked("controller", code.code.file.path, code.code.file.text, (Mark(1, "x is wrong"),))
    monkeypatch.setattr(view.equipment.builds, "latest", lambda: [bad])
    view.run = SimpleNamespace(stopped_early=False, share=None, error=ContractError("line 1: x is wrong"), result=None)
    view._ended()
    assert "line 1: x is wrong" in view.notice.value
    code._found(bad)
    assert "line 1: x is wrong" in view.notice.value
    code._found(replace(bad, marks=()))
    assert view.notice.value == ""


def test_the_lanes_before_a_run_have_the_signal_that_is_chosen(tmp_path: Path) -> None:
    control, model = (Equipment(Session(tmp_path), kind) for kind in ("control", "model"))
    (points,) = re.findall(r'polyline points="([^"]+)"', preview(control))
    pairs = np.array([pair.split(",") for pair in points.split()], dtype=float)
    cycles = 10.0 * 0.2  # final time and frequency of the first reference
    assert pairs[:, 1] == pytest.approx(-0.9 * np.sin(2.0 * np.pi * cycles * pairs[:, 0]), abs=2e-3)
    assert re.findall(r"<span>(.*?)</span>", preview(control)) == [
        "position [mm]",
        "as chosen, 10 s",
        "error [mm]",
        "voltage [V]",
    ]
    assert re.findall(r"<span>(.*?)</span>", preview(model)) == ["position [mm]", "voltage [V]", "as chosen, 8 s"]
    control.choices.set("shape", "user")  # the file is not named yet, and is not run for this
    assert "polyline" not in preview(control)
    control.choices.set("shape_file", "3*sin(t)")
    assert "polyline" not in preview(control) and not (tmp_path / FOLDER).exists()


def test_a_bar_says_what_goes_on_after_the_stop(tmp_path: Path) -> None:
    """It said that a program was stopping for as long as the files of the stopped one were written."""
    bar = WorkBar(Shell(Session(tmp_path)).ticker)
    work = SimpleNamespace(share=0.5, seconds_left=9.0, done=False, note="running", stop=lambda: None)
    bar.follow(work, lambda: None)
    bar.stop_button.click()
    bar._look()
    assert bar._text.value == "stopping"
    work.note = "saving tables"
    bar._look()
    assert bar._text.value == "saving tables"  # of what was stopped half of the way


def _within(widget: Any) -> Iterator[Any]:
    yield widget
    for child in getattr(widget, "children", ()):
        yield from _within(child)


def test_a_picture_drawn_again_leaves_no_widget_behind(tmp_path: Path) -> None:
    """A kernel keeps every widget that is not closed, and all that hangs on it."""
    from ipywidgets.widgets.widget import _instances
    from matplotlib.figure import Figure

    from rds.panels.kit.figure import FigureView

    view, session = FigureView(), Session(tmp_path)
    open_after = []
    for _ in range(4):
        view.show(Figure(), session, caption="the error in µm")
        open_after.append(len(_instances))
    assert len(set(open_after)) == 1
    view.clear()
    assert [type(each).__name__ for each in view.children] == ["_Room"]  # which nobody sees
    assert len(_instances) < open_after[-1]


@pytest.mark.parametrize("is_canvas", [True, False], ids=["ipympl", "picture"])
def test_a_figure_is_as_wide_as_its_place_and_not_wider_than_it_was_made_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_canvas: bool
) -> None:
    from rds.core.figure import Picture
    from rds.panels.kit.figure import DPI, FigureView

    if not is_canvas:
        monkeypatch.setitem(sys.modules, "ipympl.backend_nbagg", None)
    view = FigureView()
    view.show(Picture(4.0, 10.0), Session(tmp_path))
    (room, _) = view.children
    for pixels, wanted in ((340, 340 / DPI), (5000, 10.0), (60, 3.0), ("wide", 3.0), (500, 500 / DPI)):
        room._said(room, {"kind": "width", "width": pixels}, [])
        assert view.figure.get_figwidth() == pytest.approx(wanted, abs=0.5 / DPI)
        assert view.figure.get_figheight() == pytest.approx(4.0, abs=0.5 / DPI)
    view.show(Picture(4.0, 10.0), Session(tmp_path))  # the next one is drawn so at once
    assert view.figure.get_figwidth() == pytest.approx(500 / DPI)
