"""Grading, for instructors: a batch's progress, its results, and gradebooks."""

from __future__ import annotations

from html import escape
from itertools import chain
from typing import TYPE_CHECKING, Any

import ipywidgets as widgets

from rds.grading.review.entries import Kind
from rds.panels.grading.review import USES
from rds.panels.grading.state import GradingState, rows
from rds.panels.kit.button import attempt, button, follow, runs, watch
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar

if TYPE_CHECKING:
    from rds.grading.batch.finished import Finished

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
        self.shell, self.state = shell, GradingState(shell.session)
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        self.table = Html(_FIRST)
        self._said = Html()
        say = self.notice
        tip = "Grade all submissions, or go on with those that are left"
        self._run = runs(button("Grade", tip, self.grade, say, primary=True))
        check = button("Check assignment", "Its solution gets full marks, an empty one none", self.check, say)
        export = button("Export", "Write the gradebook into the folder of the grades", self.export, say)
        words = button("Keep", "An entry of the audit trail; grades, pages and gradebooks follow", self.review, say)
        tip = "Of this batch and other attempts each student's best grade, into the new folder"
        best = button("Best of attempts", tip, self.best, say)
        tip = "What this batch kept, by the assignment as it is now, into the new folder; lists who changes and why"
        again = button("Grade again", tip, self.regrade, say)
        kind, by = self._fields("kind", "by")
        self._words = {name: self._fields(name)[0] for name in dict.fromkeys(chain(*USES.values()))}
        self._batch = self._fields("assignment", "submissions", "out", "class_list", "jobs", "scheduler")
        side = [
            group("Batch", *self._batch, row(check, self._run)),
            group("Review", kind, *self._words.values(), by, row(words)),
            group("Attempts, and a mended assignment", *self._fields("attempts", "new"), row(best, again)),
            group("Export", *self._fields("to", "gradebook"), row(export)),
        ]
        self.widget = columns(side, [self.bar, self.notice, self._said, self.table])
        self.state.choices.watch(self._changed)
        self._name_button()
        self._show_words()
        if self.state.started():
            attempt("the class as it stands", self.show, self.notice)
        if (task := self.state.going_on()) is not None:
            watch(self.bar, self.notice, task, self._graded)
            self.notice.say("a batch that was begun earlier goes on; Stop ends it after what is being graded")

    def check(self) -> None:
        """Try the assignment itself."""
        self._said.value = ""
        follow(self.bar, self.notice, self.state.check, self._show_said)

    def grade(self) -> None:
        """Begin or go on."""
        check_mended(self._batch)
        self._said.value = ""
        follow(self.bar, self.notice, self.state.grade, self._graded)

    def _graded(self, count: int) -> None:
        if left := self.show():
            self.notice.say(f"{count} submissions are graded and kept, {left} are left: Go on grades them", "warning")
        else:
            self.notice.say(f"{count} submissions are graded", "good")

    def show(self) -> int:
        """The class as it stands; how many are not graded yet."""
        from rds.results import html

        finished = self.state.finished()
        left = len(finished.not_graded)
        page = finished.folder / "index.html"
        about = f"<h2 class=rds-part>{escape(finished.title)}: {len(finished.grades)} graded, {left} left</h2>"
        links = f"<p>feedback pages: {escape(str(finished.folder / 'students'))}; the class: {escape(str(page))}</p>"
        grades = html.table(["student", "status", "score", "why"], rows(finished.grades))
        self.table.value = about + grades + links + _said_of(finished)
        self._name_button()
        return left

    def review(self) -> None:
        """Keep what a grader says, and show the class with it."""
        check_mended(self._words.values())
        said = self.state.review()
        self.show()
        self.notice.say(said, "good")

    def best(self) -> None:
        """Make a batch of each student's best grade, and show it."""
        follow(self.bar, self.notice, self.state.best, self._made)

    def regrade(self) -> None:
        """Grade again by a mended assignment, and show who changes."""
        follow(self.bar, self.notice, self.state.regrade, lambda count: self._regraded())

    def _made(self, said: str) -> None:
        self.state.choices.set("out", self.state.choices["new"])
        self.show()
        self.notice.say(said, "good")

    def _regraded(self) -> None:
        from rds.results import html

        changes, left = self.state.regraded()
        if left:
            self.notice.say(f"{left} are left: Grade again grades them", "warning")
            return
        told = [[each.student, f"{each.before:g}", f"{each.now:g}", "; ".join(each.why)] for each in changes]
        self._made(f"{len(changes)} students change; the grades are those of the new folder now")
        if told:
            self.table.value = html.table(["student", "before", "now", "why"], told, "Changes") + self.table.value

    def export(self) -> None:
        """Write the chosen gradebook."""
        written = self.state.export(self.state.choices["to"])
        left = "".join(f"\nleft out: {student}: {reason}" for student, reason in written.left_out.items())
        notes = "".join(f"\n{note}" for note in written.notes)
        said = f"{written.students} students: {written.place}{notes}{left}"
        self.notice.say(said, "warning" if written.left_out else "good")

    def _show_said(self, text: str) -> None:
        self._said.value = f"<pre>{escape(text)}</pre>"

    def _changed(self, name: str) -> None:
        self._name_button()
        if name == "out" and self.state.started():
            attempt("the class as it stands", self.show, self.notice)
        if name == "kind":
            self._show_words()

    def _show_words(self) -> None:
        """The fields that what is to be said has."""
        uses = USES[Kind(self.state.choices["kind"])]
        for name, view in self._words.items():
            view.layout.display = "" if name in uses else "none"

    def _name_button(self) -> None:
        self._run.description = "Go on" if self.state.started() else "Grade"

    def _fields(self, *names: str) -> list[FieldView]:
        return [FieldView(self.state.choices, name) for name in names]


def _said_of(finished: Finished) -> str:
    """What waits for a grader, and what was said, as tables; empty where there is neither."""
    from rds.grading.review.tables import LOG, WAITING, log, waiting
    from rds.results import html

    tables = (("Waits for a grader", WAITING, waiting(finished)), ("Audit trail", LOG, log(finished)))
    return "".join(html.table(columns, found, title) for title, columns, found in tables if found)
