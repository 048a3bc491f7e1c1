"""Grading, for instructors: a batch's progress, its results, and gradebooks."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.kit.field import FieldView
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.session.grading_desk import GradingDesk, rows
from rds.session.task import Task

NAME = "grading"
TITLE = "Grading"
SUMMARY = "For instructors: grade a folder of submissions, see the class, export a gradebook"
HELP = "grading"


_FIRST = (
    '<div class="rds-hint"><p>For instructors. To grade a class:</p><ol>'
    "<li>Name the folder of the assignment, and the folder or zip with what was handed in.</li>"
    "<li><i>Check assignment</i>: its solution gets full marks, an empty file none.</li>"
    "<li>Name a new folder for the grades, then <i>Grade</i>. Stop when you like: <i>Go on</i> grades the rest.</li>"
    "<li><i>Export</i> writes the gradebook of your platform.</li></ol>"
    "<p>Help at the top says how an assignment is written. Students try their own file with "
    "<code>rds grade self</code>.</p></div>"
)


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return GradingView(shell).widget


class GradingView:
    """Settings on the left, the class on the right."""

    def __init__(self, shell: Any):
        self.shell, self.desk = shell, GradingDesk(shell.session)
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        self.table = widgets.HTML(_FIRST)
        self._said = widgets.HTML()
        self._run = self._button("Grade", "Grade all submissions, or go on with those that are left", self.grade, True)
        batch = self._group(
            "Batch",
            ["assignment", "submissions", "out", "jobs", "scheduler"],
            [
                self._button("Check assignment", "Its solution gets full marks, an empty one none", self.check),
                self._run,
            ],
        )
        export = self._group(
            "Export",
            ["to", "gradebook"],
            [self._button("Export", "Write the gradebook into the folder of the grades", self.export)],
        )
        side = widgets.VBox([batch, export])
        side.add_class("rds-side")
        main = widgets.VBox([self.bar, self.notice, self._said, self.table])
        main.add_class("rds-main")
        self.widget = widgets.HBox([side, main])
        self.widget.add_class("rds-columns")
        self.desk.choices.watch(lambda name: self._name_button())
        self._name_button()
        if self.desk.started():
            self.show()
        if (task := self.desk.going_on()) is not None:
            self._follow(task, self._graded)
            self.notice.say("a batch that was begun earlier goes on; Stop ends it after what is being graded")

    def check(self) -> None:
        """Try the assignment itself."""
        self._begin(self.desk.check, lambda said: self._show_said(said))

    def grade(self) -> None:
        """Begin or go on."""
        self._begin(self.desk.grade, self._graded)

    def _graded(self, count: int) -> None:
        self.notice.say(f"{count} submissions are graded", "good")
        self.show()

    def show(self) -> None:
        """The class as it stands."""
        from rds.results import html

        try:
            finished = self.desk.finished()
        except RdsError as error:
            self.notice.say(str(error), "error")
            return
        left = len(finished.not_graded)
        page = finished.folder / "index.html"
        about = f"<h3>{escape(finished.title)}: {len(finished.grades)} graded, {left} left</h3>"
        links = f"<p>feedback pages: {escape(str(finished.folder / 'students'))}; the class: {escape(str(page))}</p>"
        self.table.value = about + html.table(["student", "status", "score", "why"], rows(finished.grades)) + links
        self._name_button()

    def export(self) -> None:
        """Write the chosen gradebook."""
        try:
            written = self.desk.export(self.desk.choices["to"])
        except RdsError as error:
            self.notice.say(str(error), "error")
            return
        left = "".join(f"\nleft out: {student}: {reason}" for student, reason in written.left_out.items())
        notes = "".join(f"\n{note}" for note in written.notes)
        said = f"{written.students} students: {written.place}{notes}{left}"
        self.notice.say(said, "warning" if written.left_out else "good")

    def _begin(self, start: Callable[[], Task[Any]], show: Callable[[Any], None]) -> None:
        if self.bar.busy:
            return
        try:
            task = start()
        except RdsError as error:
            self.notice.say(str(error), "error")
            return
        self.notice.clear()
        self._said.value = ""
        self._follow(task, show)

    def _follow(self, task: Task[Any], show: Callable[[Any], None]) -> None:
        def ended() -> None:
            if task.stopped:
                self.notice.say("stopped", "warning")
            elif task.error is not None:
                self.notice.say(str(task.error), "error")
            elif task.stopping:
                self.show()
                self.notice.say("stopped; what is graded is kept, and Go on grades the rest", "warning")
            else:
                show(task.result)

        self.bar.follow(task, ended)

    def _show_said(self, text: str) -> None:
        self._said.value = f"<pre>{escape(text)}</pre>"

    def _name_button(self) -> None:
        self._run.description = "Go on" if self.desk.started() else "Grade"

    def _button(self, text: str, tip: str, act: Callable[[], None], primary: bool = False) -> widgets.Button:
        button = widgets.Button(description=text, tooltip=tip, button_style="primary" if primary else "")
        button.on_click(lambda _: act())
        return button

    def _group(self, title: str, names: list[str], buttons: list[Any]) -> widgets.VBox:
        row = widgets.HBox(buttons)
        row.add_class("rds-row")
        fields = [FieldView(self.desk.choices, name) for name in names]
        group = widgets.VBox([widgets.HTML(f"<h3>{title}</h3>"), *fields, row])
        group.add_class("rds-group")
        return group
