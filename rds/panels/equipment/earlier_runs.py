"""The runs of this folder: reopened, laid over each other; those that were cut short, and those that go on."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.kit.button import button, follow
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.session.kept_runs import KeptRun, State
from rds.panels.session.task import Task
from rds.results import Result

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
            options=[], rows=12, tooltip="Hold Ctrl or Shift to choose several", layout={"width": "auto"}
        )
        self.bar, self.notice = WorkBar(shell.ticker), Notice()
        tip = "Open the run that is chosen; several are laid over"
        self.open_button = button("Open", tip, self.open, self.notice, primary=True)
        again = button("Look again", "Look for runs that other pages have made meanwhile", self.refresh, self.notice)
        hint = widgets.HTML(
            "<p>Choose a run to reopen it, or several (Ctrl or Shift) to lay them over each other. "
            f"The latest {_SHOWN} are listed; <code>rds compare</code> takes any.</p>"
        )
        self.widget = widgets.VBox([hint, self.list, row(self.open_button, again, self.bar), self.notice])

    def refresh(self) -> None:
        """As they lie in the folder now."""
        chosen = {self._runs[i].name for i in self.list.value}
        self._runs = self._session.runs(_SHOWN)
        self.list.options = [(_label(run), i) for i, run in enumerate(self._runs)]
        self.list.value = tuple(i for i, run in enumerate(self._runs) if run.name in chosen)

    def open(self) -> None:
        """What the open button does."""
        chosen = [self._runs[i] for i in self.list.value]
        if not chosen:
            raise InputError("choose a run in the list first")
        if len(chosen) > MOST:
            raise InputError(f"{len(chosen)} runs are too many for one picture; choose at most {MOST}")
        if early := [run for run in chosen if run.state in (State.GOES_ON, State.SAVED_NOW)]:
            raise InputError(f"{early[0].name} {early[0].state}; open it when that is over (Look again)")
        names, short = [run.name for run in chosen], _short(chosen)

        def work(task: Task[list[Result]]) -> list[Result]:
            results = []
            for number, run in enumerate(chosen):
                task.advance(number, len(chosen), f"opening {run.name}")
                results.append(run.open())
            return results

        def show(results: list[Result]) -> None:
            self._opened(results, names, short)

        follow(self.bar, self.notice, lambda: self._session.work("opening", work), show)


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
