"""The program by the nodes' own methods: which of them, a button, and the report of what came of it."""

from __future__ import annotations

from functools import partial
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.panels.equipment.result_actions import report_link
from rds.panels.kit.button import attempt, is_free, run_order, say_error
from rds.panels.kit.field import FieldView
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.program.nodes import ByNodes, NodesRun
from rds.panels.program.nodes_run import CarriedOut
from rds.panels.program.state import Program
from rds.results import html

_WORDS = (
    "<p>Here no loop of this computer leads the axes: the nodes carry the program out by themselves, in the mode that "
    "is chosen above. The methods that are chosen run one after the other, and are compared. Stop tells the nodes to "
    "stop, and so does a page that no browser shows any more.</p>"
)
_NONE = (
    "<p>No node of this machine carries programs out by itself: methods A, B and C need axes with stepper motors on a "
    "serial line, or models with tau and K; moves needs modules with numbers below 15.</p>"
)


class NodesView:
    """`widget` is a page of the panel; `bar` stays in sight, whatever page is."""

    def __init__(self, shell: Any, program: Program):
        self._shell = shell
        self.by_nodes = ByNodes(program)
        self.notice = Notice()
        self.bar = WorkBar(shell.ticker)
        self.bar.stop_button.tooltip = "Tell the nodes to stop, and end the run; nothing of it is kept"
        self._results = widgets.VBox([])
        self._run: NodesRun | None = None  # the last one
        if not self.by_nodes.methods:
            self.widget = widgets.VBox([Html(_NONE)])
            return
        tip = "Save the program, and let the nodes carry it out by the methods chosen"
        self.button = run_order(shell, tip, self._start, self.notice, program.choices, "Run by the nodes")
        self.button.remove_class("rds-run")  # Ctrl+Enter is the loop's
        self.bar.locks = [self.button]
        choices = self.by_nodes.choices
        group = widgets.VBox([FieldView(choices, name) for name in (*self.by_nodes.methods, "motion")])
        group.add_class("rds-group")
        self.widget = widgets.VBox([Html(_WORDS), group, row(self.button), self.notice, self._results])
        shell.ticker.add(self._look)

    def _look(self) -> None:
        """What moves with nobody there to stop it is stopped: in another page it can only be by an emergency stop."""
        run = self._run
        if run is None or run.done or run.stopping:
            return
        if run.notes:
            self.notice.say("\n".join(run.notes))
        if run.real_time and self._shell.still_here.gone:
            run.stop()

    def _start(self) -> None:
        if not is_free(self.bar, self.notice):
            return
        self.notice.clear()
        run = self.by_nodes.run()
        run.start()
        self._run = run
        self._clear()
        self.bar.follow(run, lambda: attempt("showing the run", partial(self._ended, run), self.notice))

    def _ended(self, run: NodesRun) -> None:
        if run.stopped:
            self.notice.say("stopped; the nodes were told to stop, and nothing of it is kept", "warning")
        elif run.error is not None:
            say_error("the run by the nodes", run.error, self.notice)
        elif run.result is not None:
            self._show(run.result, run)

    def _show(self, made: CarriedOut, run: NodesRun) -> None:
        report = made.report()
        self.notice.say("done; its report is below", "good")
        found = "".join(f"<p>{escape(sentence)}</p>" for sentence in report.findings)
        link = f"<p>Saved with its report in <code>{escape(str(run.folder))}</code> · {report_link(made.files[0])}</p>"
        tables = "".join(html.table(each.columns, each.shown(), each.title, each.note) for each in report.tables)
        pictures = []
        for draw in report.figures.values():
            picture = FigureView()
            picture.draw(self._shell.session, self._shell.ticker, draw)
            pictures.append(picture)
        self._results.children = [Html(found), *pictures, Html(tables), Html(link)]

    def _clear(self) -> None:
        for each in self._results.children:
            if isinstance(each, FigureView):
                each.clear()
        self._results.children = []
