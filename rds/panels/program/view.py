"""The widgets over one `Program`: editor on the left; preview, run, result and settings on the right."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ipywidgets as widgets
import numpy as np

from rds.core.errors import InputError
from rds.nc.run.run import Status
from rds.nc.stepping import Step
from rds.panels.equipment.result_view import timing_line
from rds.panels.equipment.strip import StripChart, end_marks
from rds.panels.interpolator.motion import MADE, OWN
from rds.panels.kit.button import WAIT, attempt, is_free, say_error
from rds.panels.kit.field import FieldView, check_mended, field_group
from rds.panels.kit.html import Html
from rds.panels.kit.notice import Notice
from rds.panels.program.check import CheckState
from rds.panels.program.editor import Editor
from rds.panels.program.files import ProgramFiles
from rds.panels.program.mdi import Mdi
from rds.panels.program.nodes_view import NodesView
from rds.panels.program.operator import Operator
from rds.panels.program.preview import Preview
from rds.panels.program.result import ProgramResult
from rds.panels.program.run import ProgramWork
from rds.panels.program.setup_view import SetupView
from rds.panels.program.state import OPTIONS, Program
from rds.panels.program.status import at_the_end, status_html
from rds.panels.program.step_view import StepView
from rds.panels.program.stock import drawn
from rds.panels.program.tool_view import ToolView
from rds.panels.program.words import words
from rds.panels.scene.scene import MachineScene
from rds.results import Result

TABS = ("Preview", "Machine", "Result", "Steps", "Touch off", "MDI", "Nodes", "Settings, tools")
_BEGINS = "the run begins"  # until there are samples
PREVIEW, MACHINE, RESULT, STEP, SETUP, MDI, NODES, SETTINGS = range(len(TABS))


class ProgramView:
    """Everything of the program panel."""

    def __init__(self, shell: Any):
        self.shell = shell
        self.program = Program(shell.session)
        self.notice = Notice()
        self.work: ProgramWork | None = None
        self._traced = self._shown = False
        self._uncut: ProgramWork | None = None  # a run that is over, until it is known what its program cuts
        self._ran: str | None = None  # the text whose run, or result, is shown
        self.editor = Editor(lambda: self.files.save(), words=list(words()))
        self.editor.text = self.program.text.text
        self.editor.observe(self._typed, "text")
        self.files = ProgramFiles(self.program, self.notice, self._opened)
        self.operator = Operator(shell, self.program.choices, self.notice, self.start, self.start_from_cursor)
        self.preview = Preview(self.program)
        self.status = Html()
        self.strip = StripChart(height=170)
        self.strip.layout.display = "none"
        self.scene = MachineScene(self.program.machine)
        self._latest: Status | None = None  # of the run that goes on, or of the last one
        self._at: dict[str, float] = {}  # where the axes were measured last
        self.setup = SetupView(self.program, lambda: self._at)
        self.mdi = Mdi(shell, self.program, self._begin, self.notice)
        self.nodes = NodesView(shell, self.program)
        self.result = ProgramResult(shell, self.editor.go)
        self.steps = StepView(self.program, self._stepped, lambda: self.editor.caret)
        self.tools = ToolView(self.program)
        self.program.choices.watch(self._chosen)
        self.widget = self._arranged()
        self._show_status()
        if self.program.trouble:
            self.notice.say(f"{self.program.trouble}; a new program is open instead", "warning")
        shell.ticker.add(self._tick)

    def _arranged(self) -> widgets.Widget:
        choices = self.program.choices
        self._motion = {name: FieldView(choices, name) for name in ("interpolator", *OWN, *MADE)}
        motion = widgets.VBox([*self._motion.values()])
        motion.add_class("rds-group")
        self._show_motion()
        settings = field_group(choices, ["controller", "coupled", "optional_stop", *OPTIONS])
        block = field_group(choices, ["stock", "part"])
        more = widgets.VBox([motion, settings, self.tools.widget, block])
        run = widgets.VBox([self.scene, self.strip])
        run.add_class("rds-live")
        pages = [self.preview.widget, run, self.result.widget, self.steps.widget, self.setup.widget]
        pages += [self.mdi.widget, self.nodes.widget, more]
        self.tabs = widgets.Tab(pages, titles=TABS)
        self.tabs.add_class("rds-tabs")
        self.tabs.observe(self._turned, "selected_index")
        left, right = widgets.VBox([self.editor]), widgets.VBox([self.status, self.nodes.bar, self.tabs])
        left.add_class("rds-program-left")
        right.add_class("rds-main")
        columns = self._columns = widgets.HBox([left, right])
        columns.add_class("rds-columns")
        self.files.widget.add_class("rds-program-files")
        view = widgets.VBox([self.operator.widget, self.files.widget, self.notice, columns])
        view.add_class("rds-program")
        return view

    # the text

    def _typed(self, change: Any) -> None:
        attempt("the text", lambda: self.program.edit(change["new"]), self.notice)
        self.files.refresh()

    def _opened(self) -> None:
        """Another text is open."""
        self.editor.marks = []
        self.editor.text = self.program.text.text
        self.files.refresh()

    def _chosen(self, name: str) -> None:
        if name == "file":
            if self.work is None and self._ran not in (None, self.program.text.text):
                self._ran = None  # what came of it names lines of another text
                self.notice.clear()
                self.result.clear()
                self.tabs.selected_index = PREVIEW
            if self.editor.text != self.program.text.text:
                self._opened()
            self.files.refresh()
        elif name == "tools":
            self.tools.chosen()
        elif name in self._motion:
            self._show_motion()

    def _show_motion(self) -> None:
        """Only the fields of the motion that say something now."""
        idle = self.program.idle()
        for name, view in self._motion.items():
            view.layout.display = "none" if name in idle else ""

    def _turned(self, change: Any) -> None:
        # pictures are wider than what else stands beside the text
        wide = change["new"] in (RESULT, NODES)
        (self._columns.add_class if wide else self._columns.remove_class)("rds-program-wide")
        if change["new"] == SETTINGS:
            self.tools.refresh()
        elif change["new"] == SETUP:
            self.setup.refresh()

    def _stepped(self, step: Step | None) -> None:
        """The line that was executed last is lit in the text, and the tool on the path."""
        if self.work is not None:
            return  # what runs is shown
        own = step is not None and Path(step.file).name in (self.program.text.name, self.program.text.draft.name)
        self.editor.running = step.line if step is not None and own else 0
        if step is not None:
            self.preview.place(step.machine_position)

    def _lay_stock(self, look: CheckState) -> None:
        """The stock that the program cuts, the part that it is meant to become, and the tools."""
        if look.cut is None:
            self.scene.lay({}, np.empty(0), {})
        else:
            self.scene.lay(*look.cut.shown(), drawn(look.cut.tools))

    # ten times a second

    def _tick(self) -> None:
        if self.work is None and self.program.follow_disk():
            self._opened()
        found = self.program.tick()
        if found is not None:
            self._found(found)
        if self.work is not None:
            self._look()

    def _found(self, look: CheckState) -> None:
        self.editor.mark(look.marks)
        self.preview.show(look)
        if not self.program.looking:  # else the cut is still to come
            self._lay_stock(look)
            self._show_cut()

    def _show_cut(self) -> None:
        """Of the run that is over: it may have begun, and ended, before it was known what its program cuts."""
        if (work := self._uncut) is None or self.program.looking:
            return
        self._uncut = None
        look = self.program.latest
        if look is not None and work.file == self.program.text.path and self.program.text.text == self._ran:
            self.result.show_cut(work, look.cut)

    # running

    def start(self, begin: int = 0) -> None:
        """What the run button does; from line `begin` on."""
        if not is_free(self.operator.bar, self.notice):
            return
        self.notice.clear()
        check_mended(self._motion.values())
        try:
            work = self.program.run(begin)
        finally:
            self.files.refresh()
        self._begin(work)

    def start_from_cursor(self) -> None:
        """Run from the line that the cursor is in."""
        self.start(self.editor.caret)

    def _begin(self, work: ProgramWork) -> None:
        if self.work is not None:
            raise InputError("wait until the run is over, or stop it first")
        self.notice.clear()
        if work.file == self.program.text.path and self.program.latest is not None and not self.program.looking:
            work.cut = self.program.latest.cut
        work.start()
        self.work = self.operator.work = work
        self.mdi.button.disabled = True
        self._latest = None
        self._ran = self.program.text.text
        self._traced = self._shown = False
        self._uncut = None
        self.editor.locked = True
        self.result.clear()
        self.notice.say(_BEGINS)
        if self.tabs.selected_index not in (PREVIEW, MACHINE, MDI):
            self.tabs.selected_index = PREVIEW
        self.operator.enable()
        self.operator.bar.follow(work, lambda: attempt("showing the run", self._ended, self.notice))

    def _look(self) -> None:
        work = self.work
        assert work is not None
        self.operator.enable()
        self._show_status()
        if not self._traced and (traces := work.traces()):
            self._traced = True
            self.strip.layout.display = ""
            self._wide = 1 + len(traces)
            self.strip.begin(traces)
            self.scene.begin([traces[-1], *work.moved()], work.real_time)
        if self._traced and len(rows := work.new_rows()):
            self.strip.add(rows[:, : self._wide])
            self.scene.add(np.delete(rows, np.s_[1 : self._wide - 1], axis=1))  # time, contour error, the motion
        if work.status() is not None:
            self.notice.take_back(_BEGINS)
        if work.result is not None and not self._shown:
            self._show(work)

    def _show_status(self) -> None:
        status = self.work.status() if self.work is not None else None
        if status is None and self.work is not None:
            return  # between start and first sample, and after the last one
        self._display(status)
        if status is not None:
            self._latest = status
            self._at = {name: at for name, at in status.measured.items() if name in "XYZ"}
            assert self.work is not None
            self.editor.running = status.line if self.work.file == self.program.text.path else 0
            self.preview.place([status.measured.get(name, 0.0) for name in "XYZ"])

    def _display(self, status: Status | None) -> None:
        modes = self.program.latest.modes if self.program.latest is not None else {}
        shown = status_html(status, modes, self.program.machine, float(self.program.choices["override"]))
        if shown != self.status.value:
            self.status.value = shown

    def _show(self, work: ProgramWork) -> None:
        """The loop is over; its files are still being written."""
        self._shown = True
        self.editor.running = 0
        result = work.result
        assert result is not None
        self.strip.events = end_marks(result)
        self._say_end(result)
        self.result.show(work)
        self._uncut = work
        self._show_cut()
        if self.tabs.selected_index == PREVIEW:  # whoever looks at something else is left there
            self.tabs.selected_index = RESULT

    def _say_end(self, result: Result) -> None:
        ending = result.meta.get("ending")
        if ending not in (None, "done"):
            self.notice.say(f"ended early: {result.meta.get('ending_reason')}", "warning")
        elif result.verdict:
            said, kind, why = timing_line(result)
            self.notice.say(f"done; {said}", kind, why)
        else:
            self.notice.say(f"done: {len(result)} samples", "good")

    def _ended(self) -> None:
        work = self.work
        assert work is not None
        try:
            self._look()
        finally:  # whatever its result does to the page, the next one can be run
            self.work = self.operator.work = None
            self.mdi.button.disabled = False
            self.operator.enable()
            self.editor.locked, self.editor.running = False, 0
        if self._latest is not None and work.result is not None:  # where it ended stays in sight
            self._latest = at_the_end(self._latest, work.result)
            self._at = {name: at for name, at in self._latest.measured.items() if name in "XYZ"}
            self._display(self._latest)
        if self.notice.take_back(WAIT) and work.result is not None:
            self._say_end(work.result)
        if work.stopped_early:
            self.notice.say("stopped before it began; nothing was recorded", "warning")
        elif work.error is not None:
            say_error("the run", work.error, self.notice)
        self.result.saved(work)
        self.mdi.ended(work)
        self.files.refresh()
