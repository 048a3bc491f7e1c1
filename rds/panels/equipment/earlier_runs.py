"""The runs of this folder: reopened, laid over each other; those that were cut short, and those that go on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.code.versions import changes
from rds.panels.code.view import changes_html
from rds.panels.equipment.runs_widget import RunsWidget
from rds.panels.kit.button import attempt, button, follow
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.session.kept_runs import KeptRun, State
from rds.panels.session.run_table import RunRow, RunTable, code_of, differences
from rds.panels.session.session import RUNS
from rds.panels.session.task import Task
from rds.results import Result, html

MOST = 6  # that one picture can show
_SHOWN = 200


class EarlierRuns:
    """The table. `opened(results, folders, short names)` is called with what was chosen, `ghost(result, name)` with a
    run that is to stand behind the live strip; none for no run.
    """

    def __init__(
        self,
        shell: Any,
        opened: Callable[[list[Result], list[str], list[str]], None],
        ghost: Callable[[Result | None, str], None],
    ):
        self._session, self._opened, self._ghost = shell.session, opened, ghost
        self._runs: dict[str, KeptRun] = {}
        self._rows: dict[str, RunRow] = {}
        self._kept = RunTable(self._session.folder / RUNS)
        self.bar, self.notice = WorkBar(shell.ticker), Notice()
        self.table = RunsWidget(self._open_one, self._star, self._note)
        tip = "Open the run that is ticked; several are laid over"
        self.open_button = button("Open", tip, self.open, self.notice, primary=True)
        tip = "What was chosen differently in the two runs that are ticked, and what came of it"
        differ = button("What differs", tip, self.differ, self.notice)
        tip = "Let the run that is ticked stand behind the strip, to compare the next one with; none ticked: no ghost"
        behind = button("As ghost", tip, self.show_ghost, self.notice)
        again = button("Look again", "Look for runs that other pages have made meanwhile", self.refresh, self.notice)
        self.difference = Html()
        self.widget = widgets.VBox(
            [row(self.open_button, differ, behind, again, self.bar), self.notice, self.difference, self.table]
        )

    def refresh(self) -> None:
        """As they lie in the folder now."""
        runs = self._session.runs(_SHOWN)
        self._runs = {run.name: run for run in runs}
        rows = self._kept.rows(runs)
        self._rows = {row.name: row for row in rows}
        self.table.show(rows)

    def differ(self) -> None:
        """What the button that compares does."""
        chosen = sorted(self._ticked(), key=lambda run: run.when)
        if len(chosen) != 2:
            raise InputError(f"tick two runs to compare; {len(chosen)} {'is' if len(chosen) == 1 else 'are'} ticked")
        a, b = (self._rows[run.name] for run in chosen)
        self.notice.clear()
        self.difference.value = difference_html(a, b, _short(chosen))

    def show_ghost(self) -> None:
        """What the ghost button does."""
        chosen = self._ticked()
        if len(chosen) > 1:
            raise InputError(f"one run can be the ghost; {len(chosen)} are ticked")
        if not chosen:
            self._ghost(None, "")
            self.notice.say("no run stands behind the strip any more")
            return
        name = _short(chosen)[0]

        def show(results: list[Result]) -> None:
            self._ghost(results[0], name)
            self.notice.say(f"{name} stands behind the live strip, dotted", "good")

        self._load(chosen, show)

    def _ticked(self) -> list[KeptRun]:
        return [run for name, run in self._runs.items() if name in self.table.ticked]

    def _open_one(self, name: str) -> None:
        self.table.ticked = [name]
        attempt("open", self.open, self.notice)

    def _star(self, name: str, on: bool) -> None:
        attempt("star", lambda: self._kept.set_star(name, on), self.notice)
        self.refresh()

    def _note(self, name: str, text: str) -> None:
        attempt("note", lambda: self._kept.set_note(name, text), self.notice)
        self.refresh()

    def open(self) -> None:
        """What the open button does."""
        chosen = self._ticked()
        if not chosen:
            raise InputError("tick a run in the table first")
        if len(chosen) > MOST:
            raise InputError(f"{len(chosen)} runs are too many for one picture; tick at most {MOST}")
        names, short = [run.name for run in chosen], _short(chosen)
        self._load(chosen, lambda results: self._opened(results, names, short))

    def _load(self, chosen: list[KeptRun], show: Callable[[list[Result]], None]) -> None:
        if early := [run for run in chosen if run.state in (State.GOES_ON, State.SAVED_NOW)]:
            raise InputError(f"{early[0].name} {early[0].state}; open it when that is over (Look again)")

        def work(task: Task[list[Result]]) -> list[Result]:
            results = []
            for number, run in enumerate(chosen):
                task.advance(number, len(chosen), f"opening {run.name}")
                results.append(run.open())
            return results

        follow(self.bar, self.notice, lambda: self._session.work("opening", work), show)


def _short(runs: list[KeptRun]) -> list[str]:
    """Names for a legend: time of day, axes and mode; with the end of the folder's name where that is not enough."""
    names = []
    for run in runs:
        parts = run.name.split("-")
        clock = parts[1] if len(parts) > 3 and parts[1].isdigit() and len(parts[1]) == 6 else ""
        names.append(f"{clock[:2]}:{clock[2:4]}:{clock[4:]} {' '.join(parts[2:-1])}" if clock else run.name)
    return names if len(set(names)) == len(names) else [run.name for run in runs]


def difference_html(a: RunRow, b: RunRow, names: Sequence[str]) -> str:
    """What was chosen differently in two runs, what came of it, and the lines of code that are new and gone."""
    rows = [["RMS error", a.rms, b.rms], ["fit", a.fit, b.fit], ["timing", a.verdict, b.verdict]]
    rows = [each for each in rows if each[1] or each[2]]
    rows += [list(each) for each in differences(a.facts, b.facts)]
    shown = html.table(["", *names], rows, "What differs", mixed=True)
    before, after = code_of(a), code_of(b)
    for key in before.keys() & after.keys():
        if before[key] != after[key]:
            shown += f"<h2 class=rds-part>{key.capitalize()}</h2>{changes_html(changes(before[key], after[key]))}"
    return shown
