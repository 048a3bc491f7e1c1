"""Interpolator: a path through the library's methods or one's own; motion, path, errors beside what was promised."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any, TypeVar

import ipywidgets as widgets
import numpy as np

from rds.core.errors import InputError
from rds.interpolators.result import Interpolation
from rds.machines import load_machine
from rds.panels.code.state import Code
from rds.panels.code.view import CodeView
from rds.panels.equipment.build import Checked
from rds.panels.equipment.what_runs import source_html
from rds.panels.interpolator.diagram import diagram
from rds.panels.interpolator.fields import USER
from rds.panels.interpolator.segment_table import SegmentTable
from rds.panels.interpolator.state import Interpolating
from rds.panels.kit.button import button, follow, runs
from rds.panels.kit.diagram import diagram_svg
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.scene.scene import MachineScene
from rds.panels.session.task import Task
from rds.results.html import notes_list, table

T = TypeVar("T")

NAME = "interpolator"
TITLE = "Interpolator"
SUMMARY = "Turn lines, arcs or a part program into motion, by a method of the library or your own"
HELP = "interpolation"
_GROUPS = (
    ("kind", "given", "segment", "start", "end", "centre", "direction", "plane", "bundled", "program"),
    ("feed", "feed_unit", "period"),
    ("line_method", "line_file", "line.", "arc_method", "arc_file", "arc."),
    ("acceleration", "acceleration_time", "exact_stop"),
)
_SEEN = 0.01  # s between two samples that are drawn in motion
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
        self.numbers, self.source = Html(_FIRST), Html()
        self.done: Interpolation | None = None
        self._views: dict[str, FieldView] = {}
        self._side = widgets.VBox([])
        self._side.add_class("rds-side")
        self.segments = SegmentTable(interpolating.choices, "rows")
        say = self.notice
        tip = "Work out the motion along the path"
        self.run_button = runs(button("Interpolate", tip, self.start, say, primary=True))
        tip = "In a process of its own; faults show at their lines"
        self.check_button = button("Check my file", tip, self.check, say)
        tip = "Interpolate with this file (Ctrl+Enter in the editor)"
        self.file_button = button("Run this file", tip, lambda: self._code().press(), say, primary=True)
        self.bar.locks = [self.run_button, self.check_button, self.file_button]
        tip = "Write an interpolator of your own: an editor with a file that works to begin with"
        self.code_button = widgets.ToggleButton(description="Code", tooltip=tip)
        self.code_button.layout.width = "auto"
        self.code_button.observe(lambda change: self._show_code(change["new"]), "value")
        self.model_button = widgets.ToggleButton(
            description="View model", tooltip="What interpolates, as a block diagram, as it is chosen now"
        )
        self.model_button.layout.width = "auto"
        self.model_button.observe(lambda change: self._show_model(), "value")
        self.model = Html()
        self._code_place = widgets.VBox([])
        self._code_view: CodeView | None = None
        self.picture = widgets.ToggleButtons(
            options=[("Motion", "motion")], tooltips=["which picture is shown"], tooltip=""
        )
        self.picture.observe(lambda change: self._draw(), "value")
        self._save_views: dict[str, FieldView] = {}
        self._save_row = self._saving()
        self.scene = _scene(self.shell.session.machine)
        moving = widgets.Box([] if self.scene is None else [self.scene])
        moving.add_class("rds-live")
        self.results = widgets.VBox([self.picture, self.figure, self._save_row, moving])
        self.results.layout.display = "none"
        main = widgets.VBox(
            [
                row(self.run_button, self.check_button, self.model_button, self.code_button),
                self.bar,
                self.notice,
                self._code_place,
                self.segments,
                self.model,
                self.source,
                self.numbers,
                self.results,
            ]
        )
        main.add_class("rds-main")
        self.widget = widgets.HBox([main, self._side])  # Tab comes to the button before the settings
        self.widget.add_class("rds-columns")
        interpolating.choices.watch(lambda name: self._arrange())
        self._arrange()

    def _saving(self) -> widgets.HBox:
        actions = []
        for name, text, tip, press in (
            ("file", "Save", "The samples of all axes, as a table", self.save),
            ("send_to", "Send", "Send the table by e-mail; it is saved first", self.send),
        ):
            self._save_views[name] = FieldView(self.work.choices, name)
            action = widgets.HBox([self._save_views[name], button(text, tip, press, self.notice)])
            action.add_class("rds-action")
            actions.append(action)
        return row(*actions)

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
        self._show_model()

    def _show_model(self) -> None:
        """The block diagram of what is chosen, where it is looked at."""
        if not self.model_button.value:
            self.model.value = ""
            return
        try:
            self.model.value = diagram_svg(diagram(self.work))
        except InputError as error:
            self.model.value = f'<p role="alert">✖ {escape(str(error))}</p>'

    def _code(self) -> CodeView:
        if self._code_view is None:
            work = self.work
            code = Code(work.session, "interpolator", work.builds, lambda: float(work.choices["period"]))
            self._code_view = CodeView(self.shell, {"interpolator": code}, self._run_file, self.file_button)
        return self._code_view

    def _show_code(self, on: bool) -> None:
        self._code_place.children = [self._code().widget] if on else []
        if on:
            for role in self.work.roles:
                if self.work.choices[f"{role}_method"] == USER:
                    self._code().open("interpolator", str(self.work.choices[f"{role}_file"]).strip())
            self._code().refresh()

    def _run_file(self, _: str, name: str) -> None:
        for role in self.work.roles:
            self.work.choices.set(f"{role}_method", USER)
            self.work.choices.set(f"{role}_file", name)
        self.start()
        self._code().refresh()

    def _view(self, name: str) -> FieldView:
        if name not in self._views:
            self._views[name] = FieldView(self.work.choices, name, buttons=False if name == "feed_unit" else None)
        return self._views[name]

    def start(self) -> None:
        """What the first button does."""
        self._follow(self.work.run, self._show, "stopped; nothing was made")

    def check(self) -> None:
        """What the second button does."""

        def checked(files: list[Checked]) -> None:
            self.source.value = "".join(map(source_html, files))
            bad = [each for each in files if not each.ok]
            self.notice.say("\n".join(each.sentence for each in bad or files), "error" if bad else "good")

        self._follow(self.work.check, checked, "stopped; nothing was checked")

    def save(self) -> None:
        """What the save button does."""
        if self.done is not None:
            check_mended([self._save_views["file"]])
            self.notice.say(f"saved as {self.work.save(self.done)}", "good")

    def send(self) -> None:
        """What the send button does."""
        done = self.done
        if done is not None:
            check_mended(self._save_views.values())  # it is saved first
            follow(
                self.bar, self.notice, lambda: self.work.send(done), lambda sentence: self.notice.say(sentence, "good")
            )

    def _follow(self, begin: Callable[[], Task[T]], show: Callable[[T], None], stopped: str) -> None:
        refused = [view.field.label for name, view in self._views.items() if name in self.work.shown and view.refused]
        if self.work.choices["given"] == "several":
            refused += self.segments.refused
        if refused:
            raise InputError(f"first mend what is refused: {', '.join(refused)}")
        follow(self.bar, self.notice, begin, show, stopped, self._show_faults)

    def _show_faults(self) -> None:
        bad = [each for each in self.work.builds.latest() if not each.ok]
        self.source.value = "".join(map(source_html, bad))

    def _show(self, done: Interpolation) -> None:
        from rds.interpolators.plots import names_of
        from rds.interpolators.summary import summary

        self.done = done
        self.source.value = ""
        title, rows = summary(done)
        half = -(-len(rows) // 2)
        both = "".join(table(["quantity", "", "unit"], part) for part in (rows[:half], rows[half:]))
        self.numbers.value = (
            f'<h2 class=rds-part>{title}</h2><div class="rds-side-by-side rds-compact">{both}</div>'
            f"{notes_list(self.work.notes)}"
        )
        if done.within:
            self.notice.say(f"done: {done.samples} samples, {done.duration:.4g} s", "good")
        else:
            self.notice.say("done, but further from the path than one BLU: see the numbers", "warning")
        self.results.layout.display = ""
        self._move(done)
        options = [(_PICTURES[name], name) for name in names_of(done)]
        kept = self.picture.value if self.picture.value in names_of(done) else "motion"
        with self.picture.hold_trait_notifications():
            self.picture.options = options
            self.picture.value = kept
        self._draw()

    def _move(self, done: Interpolation) -> None:
        """The machine goes along the samples; its trail is coloured by their distance from the programmed path."""
        if self.scene is None:
            return
        apart = done.T if done.T >= _SEEN else _SEEN + done.T  # s; the stream leaves out what comes faster
        drawn = np.linspace(0, done.samples, 1 + max(int(done.duration / apart + 1e-9), 1)).round().astype(int)
        rows = np.column_stack([done.time, done.position, done.path_error])[drawn]
        self.scene.begin([*((f"{axis}_reference", "mm") for axis in done.axes), ("contour_error", "mm")], live=False)
        self.scene.add(rows)

    def _draw(self) -> None:
        from rds.interpolators.plots import picture

        done, name = self.done, self.picture.value
        if done is not None and name is not None:
            self.figure.draw(self.shell.session, self.shell.ticker, lambda: picture(done, name))


def _scene(machine: str) -> MachineScene | None:
    """The machine of the page; none where its file will not do, which interpolating does not need."""
    try:
        return MachineScene(load_machine(machine))
    except InputError:
        return None


_FIRST = "<p>Choose a path on the left, then press Interpolate: motion, path and errors follow.</p>"
