"""What equipment model and equipment control share: settings on the left; run, live strip and results on the right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.core.types import Ending
from rds.panels.code.state import Code
from rds.panels.code.view import CodeView
from rds.panels.equipment.build import Checked
from rds.panels.equipment.earlier_runs import EarlierRuns
from rds.panels.equipment.fields import USER
from rds.panels.equipment.live_view import LiveView
from rds.panels.equipment.preview import preview
from rds.panels.equipment.result_view import ResultView, timing_line
from rds.panels.equipment.run import EquipmentRun
from rds.panels.equipment.settings import EquipmentSettings
from rds.panels.equipment.state import Equipment
from rds.panels.equipment.taken_up import TakenUpRun, is_driven_by
from rds.panels.equipment.what_runs import WhatRuns
from rds.panels.kit.button import WAIT, attempt, button, follow, is_free, run_order, say_error
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.session.session import RUNS
from rds.results import Result, html

TABS = ("Live", "Code", "Results", "Timing", "What runs", "Earlier runs")
_BEGINS = "the run begins"  # until there are samples
_STOPPED = "stopped; nothing was checked or loaded"
LIVE, CODE, RESULTS, TIMING, WHAT, EARLIER = range(len(TABS))


class EquipmentView:
    """The widgets over one `Equipment`."""

    def __init__(self, shell: Any, equipment: Equipment):
        self.shell, self.equipment = shell, equipment
        self.run: EquipmentRun | TakenUpRun | None = None
        self.settings = EquipmentSettings(equipment)
        self.bar = WorkBar(shell.ticker)
        self.notice = Notice()
        self.live = LiveView(equipment.machine, self.settings.parameters, lambda: preview(equipment))
        self.results = ResultView(shell)
        self.what = WhatRuns(equipment, shell.ticker)
        self.earlier = EarlierRuns(shell, self._reopened, self.live.show_ghost)
        say = self.notice
        built = "Check your files in a process of their own; faults show at their lines"
        viewed = "What will run, as a block diagram; your files; the experiment's file"
        loaded = "Make everything ready and look for the machine, without running"
        tip = "Run with these settings; files are checked first"
        self.run_button = run_order(shell, tip, self.start, say, equipment.choices)
        self.bar.locks = [
            self.run_button,
            button("Build", built, self.build, say),
            button("View model", viewed, self.view, say),
            button("Load", loaded, self.load, say),
        ]
        self.code: CodeView | None = None  # once somebody looks at it
        self._code_place = widgets.VBox([])
        self.tabs = widgets.Tab(
            [
                self.live.widget,
                self._code_place,
                self.results.widget,
                self.results.timing,
                self.what.widget,
                self.earlier.widget,
            ],
            titles=TABS,
        )
        self.tabs.add_class("rds-tabs")
        self.tabs.observe(self._turned, "selected_index")
        main = widgets.VBox([row(*self.bar.locks), self.bar, self.notice, self.tabs])
        main.add_class("rds-main")
        self.widget = widgets.HBox([main, self.settings.widget])  # Tab comes to Run before the settings
        self.widget.add_class("rds-columns")
        equipment.choices.watch(self._chosen)
        self._stale: set[int] = set()  # tabs that show what is chosen, and not yet what is chosen now
        if equipment.kind == "control":
            shell.on_code = self.edit
        shell.ticker.add(self._tick)
        self._shown: Result | None = None
        self._end_look: Callable[[], None] = lambda: None
        self.take_up()

    def start(self) -> None:
        """What the run button does."""
        if not is_free(self.bar, self.notice):
            return
        self._refuse()
        self.notice.clear()
        choices = self.equipment.choices
        role = self.code.role if self.code is not None else ""
        if role in choices and choices[role] == USER and not str(choices[f"{role}_file"]).strip():
            assert self.code is not None
            self.code.press()  # the file that has been opened for it, and has no name beside it yet
            return
        run = self.equipment.run()
        try:
            run.start()
        except InputError:
            if not self.take_up():  # the machine is in use by a run that can be followed
                raise
            return
        self._follow(run)

    def take_up(self) -> bool:
        """Follow the run that was begun elsewhere and goes on; false where there is none for this panel."""
        session = self.equipment.session
        if self.bar.busy or session.machine_user is not None:
            return False
        for kept in session.runs_that_go_on():
            if is_driven_by(kept) == self.equipment.kind:
                self._follow(TakenUpRun(kept))
                self.notice.say(f"{kept.name} goes on, which was begun elsewhere: Stop ends it safely")
                return True
        return False

    def _follow(self, run: EquipmentRun | TakenUpRun) -> None:
        self.run, self._shown = run, None
        self.notice.say(_BEGINS)
        self.tabs.selected_index = LIVE
        self.results.clear()
        self.live.follow(run)
        self._end_look = self.shell.ticker.add(self._look)
        self.bar.follow(run, lambda: attempt("showing the run", self._ended, self.notice))

    def edit(self) -> CodeView:
        """Show the code, of the file that is chosen."""
        if self.code is None:
            equipment, choices = self.equipment, self.equipment.choices
            roles = ("controller", "model") if equipment.kind == "control" else ("model",)
            codes = {
                role: Code(
                    equipment.session,
                    role,
                    equipment.builds,
                    lambda: float(choices["sample_period"]),
                    lambda: equipment.checked_axes,
                )
                for role in roles
            }
            tip = "Run with this file, and the settings on the left (Ctrl+Enter in the editor)"
            press = run_order(self.shell, tip, lambda: self.edit().press(), self.notice, choices, "Run this file")
            self.bar.locks = [*self.bar.locks, press]
            press.disabled = self.bar.busy
            self.code = CodeView(self.shell, codes, self._run_file, press)
            self._code_place.children = [self.code.widget]
        self._show_chosen_file()
        self.code.refresh()
        if self.tabs.selected_index != CODE:
            self.tabs.selected_index = CODE
        return self.code

    def _run_file(self, role: str, name: str) -> None:
        """Choose a file, and run."""
        if self.bar.busy:
            raise InputError("wait until the run is over, or stop it first")
        self.equipment.choices.set(role, USER)
        self.equipment.choices.set(f"{role}_file", name)
        self.start()

    def _show_chosen_file(self) -> None:
        """The code is that of the file that is chosen on the left."""
        choices = self.equipment.choices
        for role in ("model", "controller"):
            if self.code is not None and role in choices and choices[role] == USER:
                self.code.open(role, str(choices[f"{role}_file"]).strip())

    def build(self) -> None:
        """What the build button does."""
        self._refuse()
        if self.equipment.files():
            follow(self.bar, self.notice, self.equipment.build, self._built, _STOPPED)
        else:
            self.notice.say("nothing of yours is chosen: what will run is the library's own, and is built", "good")

    def load(self) -> None:
        """What the load button does."""
        self._refuse()
        follow(self.bar, self.notice, self.equipment.load, self._loaded, _STOPPED)

    def view(self) -> None:
        """What the view button does."""
        self.tabs.selected_index = WHAT

    def _refuse(self) -> None:
        if refused := self.settings.refused:
            raise InputError(f"first mend what is refused on the left: {', '.join(refused)}")

    def _built(self, files: list[Checked]) -> None:
        self.what.show_checked(files)
        bad = [each for each in files if not each.ok]
        self.notice.say("\n".join(each.sentence for each in bad or files), "error" if bad else "good")
        self.tabs.selected_index = WHAT

    def _loaded(self, said: str) -> None:
        self.notice.say(said, "warning" if "; but" in said else "good")

    def _look(self) -> None:
        """Ten times a second while it runs."""
        run = self.run
        assert run is not None
        self.live.look()
        if run.share:  # the bar beside it says how far it is
            self.notice.take_back(_BEGINS)
        if run.result is not None and self._shown is None:
            self._show(run.result)

    def _ended(self) -> None:
        try:
            self._look()
        finally:
            self._end_look()
            self.live.ended()
        run = self.run
        assert run is not None
        if self.notice.take_back(WAIT) and self._shown is not None:
            self.notice.say(*_verdict(self._shown))
        if run.stopped_early:
            self.notice.say("stopped before it began; nothing was recorded", "warning")
        elif run.error is not None:
            say_error("the run", run.error, self.notice)
            if run.result is None:  # its file may be at fault
                checked = self.equipment.builds.latest()
                self.what.show_checked(checked)
                if self.code is not None and self.code.shows(checked):
                    self.tabs.selected_index = CODE
                    self.code.show_checked(checked)
                    said = str(run.error)
                    self.code.on_good = lambda: self.notice.take_back(said)
        if run.result is not None:
            self.results.follow_files(run)
        if self.tabs.selected_index == EARLIER:  # else it is brought up to date once it is looked at
            self.earlier.refresh()

    def _show(self, result: Result) -> None:
        """The loop is over; its tables are there, pictures and reports still to come."""
        self._shown = result
        self.results.show(result, self.run.prepared if self.run is not None else None)
        self.notice.say(*_verdict(result))
        if self.tabs.selected_index == LIVE:  # whoever looks at something else is left there
            self.tabs.selected_index = RESULTS

    def _reopened(self, results: list[Result], names: list[str], short: list[str]) -> None:
        if len(results) == 1:
            self.results.show(results[0])
            self.results.saved(self.equipment.session.folder / RUNS / names[0])
            said, *how = _verdict(results[0])
            self.notice.say(f"{names[0]}: {said}", *how)
        else:
            self.results.overlay(results, short)
            self.notice.say(f"{len(results)} runs over each other")
        self.tabs.selected_index = RESULTS

    def _chosen(self, name: str) -> None:
        self._stale = {LIVE, WHAT}
        choices = self.equipment.choices
        if name in ("controller", "model") and choices[name] == USER and not str(choices[f"{name}_file"]).strip():
            self.edit().turn(name)  # nobody need know how such a file is written

    def _tick(self) -> None:
        """What runs is shown as it is chosen now, while one looks at it."""
        if (tab := self.tabs.selected_index) in self._stale:
            self._stale.discard(tab)
            (self.what.refresh if tab == WHAT else self.live.chosen)()

    def _turned(self, change: Any) -> None:
        """Tabs that cost something are filled when they are looked at."""
        if change["new"] == TIMING:
            self.results.draw_timing()
        elif change["new"] == CODE:
            self.edit()
        elif change["new"] == WHAT:
            self.what.refresh()
        elif change["new"] == EARLIER:
            self.earlier.refresh()


def _verdict(result: Result) -> tuple[str, str, str]:
    """What to say of a result in one line, how, and what *why?* opens."""
    if result.meta.get("ending") not in (None, Ending.DONE):
        return f"ended early: {html.ending(result)}", "warning", ""
    if result.verdict:
        return timing_line(result)
    return f"done: {len(result)} samples", "good", ""
