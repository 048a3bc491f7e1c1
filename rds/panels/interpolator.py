"""Interpolator: a path through the library's methods or one's own; motion, path, errors beside what was promised."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.interpolators.result import Interpolation
from rds.panels.kit.field import FieldView
from rds.panels.kit.figure import FigureView
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.segment_table import SegmentTable
from rds.panels.what_runs import source_html
from rds.results.html import notes_list, table
from rds.session.interpolator import Interpolating

NAME = "interpolator"
TITLE = "Interpolator"
SUMMARY = "Turn lines, arcs or a part program into motion, by a method of the library or your own"
HELP = "interpolation"
_GROUPS = (
    ("kind", "given", "segment", "start", "end", "centre", "direction", "plane", "program"),
    ("feed", "feed_unit", "period"),
    ("line_method", "line_file", "line.", "arc_method", "arc_file", "arc."),
    ("acceleration", "acceleration_time", "exact_stop"),
)
_PICTURES = {
    "motion": "Motion",
    "path": "Path",
    "magnified": "Errors magnified",
    "errors": "Errors over time",
    "steps": "Steps of the arc",
    "generation-error": "Pulses",
}


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return InterpolatorView(shell, Interpolating(shell.session)).widget


class InterpolatorView:
    """The widgets over an `Interpolating`."""

    def __init__(self, shell: Any, interpolating: Interpolating):
        self.shell, self.work = shell, interpolating
        self.notice, self.bar, self.figure = Notice(), WorkBar(shell.ticker), FigureView()
        self.numbers, self.source = widgets.HTML(_FIRST), widgets.HTML()
        self.done: Interpolation | None = None
        self._views: dict[str, FieldView] = {}
        self._side = widgets.VBox([])
        self._side.add_class("rds-side")
        self.segments = SegmentTable(interpolating.choices, "rows")
        self.run_button = _button("Interpolate", "Work out the motion along the path", self.start, "primary")
        self.check_button = _button("Check my file", "In a process of its own; faults show at their lines", self.check)
        self.picture = widgets.ToggleButtons(options=[("Motion", "motion")], tooltips=["which picture is shown"])
        self.picture.observe(lambda change: self._draw(), "value")
        self._save_row = self._saving()
        row = widgets.HBox([self.run_button, self.check_button])
        row.add_class("rds-row")
        self.results = widgets.VBox([self.picture, self.figure, self._save_row])
        self.results.layout.display = "none"
        main = widgets.VBox(
            [row, self.bar, self.notice, self.segments, self.source, self.numbers, self.results]
        )  # fmt: skip
        main.add_class("rds-main")
        self.widget = widgets.HBox([self._side, main])
        self.widget.add_class("rds-columns")
        interpolating.choices.watch(lambda name: self._arrange())
        self._arrange()

    def _saving(self) -> widgets.HBox:
        row = widgets.HBox(
            [FieldView(self.work.choices, "file"), _button("Save", "The samples of all axes, as a table", self.save)]
        )
        row.add_class("rds-row")
        return row

    def _arrange(self) -> None:
        """Show the fields that matter for what is chosen."""
        shown = self.work.shown
        for name in [name for name in self._views if name not in self.work.choices]:
            self._views.pop(name).close()
        groups = []
        for names in _GROUPS:
            of_group = [each for name in names for each in shown if each == name or (name[-1] == "." and name in each)]
            if not of_group:
                continue
            group = widgets.Box([self._view(name) for name in of_group])
            group.add_class("rds-group")
            group.add_class("rds-fields")
            groups.append(group)
        self._side.children = groups
        self.segments.layout.display = "" if "rows" in shown else "none"
        self.check_button.layout.display = "" if {"line_file", "arc_file"} & set(shown) else "none"

    def _view(self, name: str) -> FieldView:
        if name not in self._views:
            self._views[name] = FieldView(self.work.choices, name, buttons=False if name == "feed_unit" else None)
        return self._views[name]

    def start(self) -> None:
        """What the first button does."""

        def begin() -> None:
            task = self.work.run()

            def ended() -> None:
                if task.stopped:
                    self.notice.say("stopped; nothing was made", "warning")
                elif task.error is not None or task.result is None:
                    self._failed(task.error)
                else:
                    self.source.value = ""
                    self._show(task.result)

            self._follow(task, ended)

        self._try(begin)

    def check(self) -> None:
        """What the second button does."""

        def begin() -> None:
            task = self.work.check()

            def ended() -> None:
                if task.stopped:
                    self.notice.say("stopped; nothing was checked", "warning")
                    return
                if task.error is not None or task.result is None:
                    self._failed(task.error)
                    return
                self.source.value = "".join(map(source_html, task.result))
                bad = [each for each in task.result if not each.ok]
                said = "\n".join(each.sentence for each in bad or task.result)
                self.notice.say(said, "error" if bad else "good")

            self._follow(task, ended)

        self._try(begin)

    def save(self) -> None:
        """What the save button does."""
        if self.done is None:
            return
        try:
            path = self.work.save(self.done)
        except RdsError as error:
            self.notice.say(str(error), "error")
        else:
            self.notice.say(f"saved as {path}", "good")

    def _try(self, begin: Callable[[], None]) -> None:
        if self.bar.busy:
            return
        refused = [view.field.label for name, view in self._views.items() if name in self.work.shown and view.refused]
        if self.work.choices["given"] == "several":
            refused += self.segments.refused
        if refused:
            self.notice.say(f"first mend what is refused: {', '.join(refused)}", "error")
            return
        self.notice.clear()
        try:
            begin()
        except RdsError as error:
            self.notice.say(str(error), "error")

    def _follow(self, task: Any, ended: Callable[[], None]) -> None:
        self.run_button.disabled = self.check_button.disabled = True

        def over() -> None:
            self.run_button.disabled = self.check_button.disabled = False
            ended()

        self.bar.follow(task, over)

    def _failed(self, error: BaseException | None) -> None:
        self.notice.say(str(error), "error")
        bad = [each for each in self.work.builds.latest() if not each.ok]
        self.source.value = "".join(map(source_html, bad))

    def _show(self, done: Interpolation) -> None:
        from rds.interpolators.plots import names_of
        from rds.interpolators.summary import summary

        self.done = done
        title, rows = summary(done)
        half = -(-len(rows) // 2)
        both = "".join(table(["quantity", "", "unit"], part) for part in (rows[:half], rows[half:]))
        self.numbers.value = (
            f'<h3>{title}</h3><div class="rds-side-by-side rds-compact">{both}</div>{notes_list(self.work.notes)}'
        )
        if done.within:
            self.notice.say(f"done: {done.samples} samples, {done.duration:.4g} s", "good")
        else:
            self.notice.say("done, but further from the path than one BLU: see the numbers", "warning")
        self.results.layout.display = ""
        options = [(_PICTURES[name], name) for name in names_of(done)]
        kept = self.picture.value if self.picture.value in names_of(done) else "motion"
        with self.picture.hold_trait_notifications():
            self.picture.options = options
            self.picture.value = kept
        self._draw()

    def _draw(self) -> None:
        from rds.interpolators.plots import picture

        done, name = self.done, self.picture.value
        if done is not None and name is not None:
            self.figure.draw(self.shell.session, self.shell.ticker, lambda: picture(done, name))


_FIRST = "<p>Choose a path on the left, then press Interpolate: motion, path and errors follow.</p>"


def _button(text: str, tip: str, act: Callable[[], None], style: str = "") -> widgets.Button:
    button = widgets.Button(description=text, tooltip=tip, button_style=style)
    button.on_click(lambda _: act())
    return button
