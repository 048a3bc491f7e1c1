"""What came of a program's run: where it is worst, by line; its path as measured; where its files are."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.panels.equipment.result_actions import ResultActions
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.panels.program.cut_html import cut_html
from rds.panels.program.run import ProgramWork
from rds.panels.program.stock import Cut, cut_of_run
from rds.results import html

_WORST = 3  # lines that have a button
_EMPTY = "<p>No result yet: press Run.</p>"


class ProgramResult:
    """`show(work)` when the loop is over, `show_cut()` when its cut is known, `saved(work)` when its files are there,
    `clear()` before the next run.
    """

    def __init__(self, shell: Any, go: Callable[[int], None]):
        """`go(line)` shows a line of the program."""
        self._shell, self._go = shell, go
        self.words, self.tables = Html(_EMPTY), Html()
        self.actions = ResultActions(shell)
        self.path, self.along, self.cut = FigureView(), FigureView(), FigureView()
        self.cut_words = Html()
        self.worst = widgets.HBox([])
        self.worst.add_class("rds-row")
        pictures = [self.path, self.along, self.cut_words, self.cut]
        self.widget = widgets.VBox([self.worst, self.words, *pictures, self.tables, self.actions.widget])

    def show(self, work: ProgramWork) -> None:
        """Sentences, the worst lines, and pictures."""
        from rds.nc.run.judge import worst_lines
        from rds.nc.run.pictures import along, path
        from rds.nc.run.report import program_report

        result, prepared = work.result, work.prepared
        if result is None or prepared is None or "program" not in result.meta:  # one that failed may not be judged
            return
        report = program_report(result, prepared)
        found = "".join(f"<p>{escape(sentence)}</p>" for sentence in report.findings)
        self.tables.value = "".join(
            html.table(each.columns, each.shown(), each.title, each.note)
            for each in (*report.tables[1:], report.tables[0])
        )
        self.words.value = html.verdict_line(result, "Timing") + found
        self.worst.children = [
            self._button(line, error) for line, error, _ in worst_lines(result, result["contour_error"], _WORST)
        ]
        self.actions.writing()
        session, ticker = self._shell.session, self._shell.ticker
        self.path.draw(session, ticker, lambda: path(result, prepared))
        self.along.draw(session, ticker, lambda: along(result, prepared))

    def show_cut(self, work: ProgramWork, planned: Cut | None) -> None:
        """The part that was cut against the intended one, where the program cuts what is `planned`."""
        result, prepared = work.result, work.prepared
        if planned is None or result is None or prepared is None or "program" not in result.meta:
            return
        cuts: list[Cut] = []

        def make() -> Any:
            from rds.nc.stock.pictures import picture

            made = cut_of_run(planned, result, prepared)
            if made is None:
                return None
            cuts.append(made)
            return picture(made.stock, f"{work.file.name} as measured", made.part)

        def say() -> None:
            self.cut_words.value = cut_html(cuts[0], measured=True) if cuts else ""

        self.cut.draw(self._shell.session, self._shell.ticker, make, then=say)

    def saved(self, work: ProgramWork) -> None:
        """Its tables are written; pictures and reports follow."""
        if work.result is not None:
            self.actions.follow(work.result, work, ("program.html", "result.csv"))

    def clear(self) -> None:
        """Nothing to show."""
        self.words.value, self.tables.value = _EMPTY, ""
        self.actions.clear()
        self.worst.children = []
        self.path.clear()
        self.along.clear()
        self.cut_words.value = ""
        self.cut.clear()

    def _button(self, line: int, error: float) -> widgets.Button:
        tip = "Contour error: how far off its path the tool was at most in this line; shows the line in the editor"
        button = widgets.Button(description=f"Line {line}: {error:.4f} mm off", tooltip=tip)
        button.on_click(lambda _: self._go(line))
        return button
