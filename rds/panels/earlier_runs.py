"""The runs of this folder: reopened, laid over each other; those that were cut short, and those that go on."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.results import Result
from rds.session.kept_runs import KeptRun, State
from rds.session.task import Task

MOST = 6  # that one picture can show
_SHOWN = 200
_STATES = {
    State.WHOLE: "",
    State.GOES_ON: ", goes on",
    State.SAVED_NOW: ", is being saved",
    State.CUT_SHORT: ", cut short: its record can be opened",
}


class EarlierRuns:
    """The list. `opened(results, folders, short names)` is called with what was chosen."""

    def __init__(self, shell: Any, opened: Callable[[list[Result], list[str], list[str]], None]):
        self._session, self._opened = shell.session, opened
        self._runs: list[KeptRun] = []
        self.list = widgets.SelectMultiple(
            options=[], rows=12, tooltip="Hold Ctrl or Shift to choose several", layout={"width": "100%"}
        )
        self.open_button = widgets.Button(
            description="Open", button_style="primary", tooltip="Open the run that is chosen; several are laid over"
        )
        self.open_button.on_click(lambda _: self.open())
        again = widgets.Button(description="Look again", tooltip="Look for runs that other pages have made meanwhile")
        again.on_click(lambda _: self.refresh())
        self.bar = WorkBar(shell.ticker)
        self.notice = Notice()
        row = widgets.HBox([self.open_button, again, self.bar])
        row.add_class("rds-row")
        hint = widgets.HTML("<p>Choose a run to reopen it, or several (Ctrl or Shift) to lay them over each other.</p>")
        self.widget = widgets.VBox([hint, self.list, row, self.notice])

    def refresh(self) -> None:
        """As they lie in the folder now."""
        chosen = {self._runs[i].name for i in self.list.value}
        self._runs = self._session.runs()[:_SHOWN]
        self.list.options = [(_label(run), i) for i, run in enumerate(self._runs)]
        self.list.value = tuple(i for i, run in enumerate(self._runs) if run.name in chosen)

    def open(self) -> None:
        """What the open button does."""
        chosen = [self._runs[i] for i in self.list.value]
        if self.bar.busy:
            return
        if not chosen:
            self.notice.say("choose a run in the list first", "error")
            return
        if len(chosen) > MOST:
            self.notice.say(f"{len(chosen)} runs are too many for one picture; choose at most {MOST}", "error")
            return
        if early := [run for run in chosen if run.state in (State.GOES_ON, State.SAVED_NOW)]:
            self.notice.say(f"{early[0].name} {early[0].state}; open it when that is over (Look again)", "error")
            return
        self.notice.clear()

        def work(task: Task[list[Result]]) -> list[Result]:
            results = []
            for number, run in enumerate(chosen):
                task.advance(number, len(chosen), f"opening {run.name}")
                results.append(run.open())
            return results

        task = self._session.work("open", work)
        self.bar.follow(task, lambda: self._over(task, [run.name for run in chosen], _short(chosen)))

    def _over(self, task: Task[list[Result]], names: list[str], short: list[str]) -> None:
        if task.error is not None or task.result is None:
            if not task.stopped:
                self.notice.say(str(task.error), "error")
            return
        try:
            self._opened(task.result, names, short)
        except InputError as error:
            self.notice.say(str(error), "error")


def _short(runs: list[KeptRun]) -> list[str]:
    """Names for a legend: time of day, axes and mode; with the end of the folder's name where that is not enough."""
    names = []
    for run in runs:
        parts = run.name.split("-")
        clock = parts[1] if len(parts) > 3 and parts[1].isdigit() and len(parts[1]) == 6 else ""
        names.append(f"{clock[:2]}:{clock[2:4]}:{clock[4:]} {' '.join(parts[2:-1])}" if clock else run.name)
    return names if len(set(names)) == len(names) else [run.name for run in runs]


def _label(run: KeptRun) -> str:
    when = time.strftime("%d %b %H:%M:%S", time.localtime(run.when))
    return f"{when}  {run.name.partition('-')[2].partition('-')[2]}{_STATES[run.state]}"
