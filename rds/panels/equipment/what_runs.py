"""What will run: the block diagram, the student's files with faults at their lines, and the experiment as a file."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.modes.experiment.experiment import Experiment
from rds.panels.equipment.build import Checked, Mark
from rds.panels.equipment.diagram import diagram
from rds.panels.equipment.equations import equations, equations_html
from rds.panels.equipment.state import Equipment
from rds.panels.kit.button import button
from rds.panels.kit.diagram import diagram_svg
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.ticker import Ticker
from rds.panels.session.as_file import as_python, as_toml, write_toml
from rds.panels.session.task import Task

_LONGEST = 400  # lines of a source that are shown


class WhatRuns:
    """`refresh()` when it is looked at; `show_checked(files)` after a build."""

    def __init__(self, equipment: Equipment, ticker: Ticker):
        self._equipment, self._ticker = equipment, ticker
        self._planning: Task[str] | None = None
        self._checked: dict[str, Checked] = {}
        self.drawing = Html()
        self.equations = Html()
        self.sources = Html()
        self.toml, self.python = Html(), Html()
        self.notice = Notice()
        self._name = widgets.Text(
            placeholder="experiment.toml", tooltip="a name that ends with .toml", continuous_update=False
        )
        save = button("Save the file", "Write it into the folder of your files", self._save, self.notice)
        text = widgets.Accordion(
            [widgets.VBox([self.toml, row(self._name, save), self.notice]), self.python],
            titles=("Show as file", "Show as Python"),
            selected_index=None,
        )
        text.add_class("rds-folded")
        self.widget = widgets.VBox([self.drawing, self.equations, self.sources, text])

    def refresh(self) -> None:
        """As it is chosen now."""
        try:
            table = self._equipment.table()
        except InputError as error:
            self.drawing.value = f'<p role="alert">✖ {escape(str(error))}</p>'
            self.toml.value = self.python.value = ""
        else:
            self.drawing.value = diagram_svg(diagram(table, self._equipment.machine, self._equipment.words()))
            self._work_out(table)
            self.toml.value = f"<pre>{escape(as_toml(table))}</pre>"
            self.python.value = f"<pre>{escape(as_python(table))}</pre>"
        self._show_sources()

    def _work_out(self, table: dict[str, Any]) -> None:
        """The equations, beside the page: their numbers may have to be tuned first. What is only looked at runs no
        code of the user's, who has it in sight below.
        """
        if self._equipment.files():
            self._planning, self.equations.value = None, ""
            return

        def work(task: Task[str]) -> str:
            return equations_html(equations(Experiment.from_table(table, self._equipment.session.folder).plan()))

        task = self._planning = self._equipment.session.work("equations", work)

        def look() -> None:
            if task.done:
                end()
                if self._planning is task:  # what cannot be loaded has none: a build says why
                    self.equations.value = task.result or ""

        end = self._ticker.add(look)

    def show_checked(self, files: Sequence[Checked]) -> None:
        """What a build found."""
        self._checked = {str(each.path): each for each in files}
        self.refresh()

    def _show_sources(self) -> None:
        try:
            files = self._equipment.files()
        except InputError:
            files = []
        parts = []
        for role, path in files:
            found = self._checked.get(str(path))
            parts.append(source_html(found if found is not None and found.role == role else _unchecked(role, path)))
        self.sources.value = "".join(parts)

    def _save(self) -> None:
        path = self._equipment.session.folder / self._name.value.strip()
        written = write_toml(self._equipment.table(), path)
        self.notice.say(f"saved as {written}; in a terminal: rds run {written.name}", "good")


def source_html(checked: Checked) -> str:
    """A file with its verdict, each fault marked at its line, and line numbers."""
    state = "✔ keeps its interface" if checked.ok else "✖ does not keep its interface"
    if checked.notes == _NOT_YET:
        state = "not built yet"
    general = "".join(_mark(mark) for mark in checked.marks if mark.line is None)
    at: dict[int, list[Mark]] = {}
    for mark in checked.marks:
        if mark.line is not None:
            at.setdefault(mark.line, []).append(mark)
    notes = "".join(f"<p>{escape(note)}</p>" for note in checked.notes)
    return (
        f"<h2 class=rds-part>{escape(checked.role.capitalize())}: {escape(checked.path.name)}, {state}</h2>{general}"
        f'<pre class="rds-source">{_lines(checked.text, at)}</pre>{notes}'
    )


def _lines(text: str, at: dict[int, list[Mark]]) -> str:
    shown = []
    for number, line in enumerate(text.splitlines()[:_LONGEST], start=1):
        marks = at.get(number, [])
        kind = ' class="rds-source-fault"' if marks else ""
        shown.append(f"<span{kind}>{number:4d}  {escape(line)}</span>\n" + "".join(map(_mark, marks)))
    return "".join(shown)


def _mark(mark: Mark) -> str:
    sign, kind = ("✖", "fault") if mark.fault else ("⚠", "warning")
    return f'<span class="rds-mark rds-mark-{kind}">{sign} {escape(mark.text)}</span>\n'


_NOT_YET = ("Build checks it.",)


def _unchecked(role: str, path: object) -> Checked:
    from pathlib import Path

    from rds.panels.equipment.build import LARGEST

    place = Path(str(path))
    try:
        with place.open("rb") as stream:
            text = stream.read(LARGEST).decode("utf-8", "replace")
    except OSError:
        return Checked(role, place, "", (Mark(None, f"there is no such file in {place.parent}"),))
    return Checked(role, place, text, notes=_NOT_YET)
