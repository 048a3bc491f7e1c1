"""Design: the poles of the tracking controller, dragged on the s-plane; gains, margins and responses follow."""

from __future__ import annotations

from math import isfinite
from typing import Any

import ipywidgets as widgets
import numpy as np

from rds.core.errors import InputError, RdsError
from rds.identification.robustness.tracking_design import LoopDraws, TrackingDesign
from rds.panels.design.charts import charts, details, key_numbers
from rds.panels.design.splane import Curves, SPlane
from rds.panels.design.state import Design
from rds.panels.equipment.build import Checked
from rds.panels.kit.button import button, follow, is_free, watch
from rds.panels.kit.field import FieldView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.session.task import Task

NAME = "design"
TITLE = "Design"
SUMMARY = "Place the poles of a tracking controller by dragging them, and write it as a file of your own"
HELP = "design"
QUIET = 3  # ticks without a change before the cloud is drawn again
_GROUPS = (
    ("source", "axis", "model_file", "sample_period"),
    ("kind", "real", "imaginary", "first", "second", "observer"),
    ("step", "delay", "spread_tau", "spread_K"),
)
_LABELS = {"pair": "pair of poles", "first": "first pole", "second": "second pole", "observer": "observer pole"}


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return DesignView(shell, Design(shell.session)).widget


class DesignView:
    """The widgets over a `Design`."""

    def __init__(self, shell: Any, design: Design):
        self.shell, self.design = shell, design
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        self.plane = SPlane(self._moved)
        self.curves = Curves(columns=3, height=200)
        self.numbers, self.details = Html(), Html()
        self._views: dict[str, FieldView] = {}
        self._side = widgets.VBox([])
        self._side.add_class("rds-side")
        self._made: TrackingDesign | None = None  # what is shown
        self._cloud: LoopDraws | None = None
        self._drawing: Task[LoopDraws] | None = None
        self._clouded: TrackingDesign | None = None  # what it is drawn for
        self._stale, self._undrawn, self._quiet = True, True, 0
        self._complains = False  # whether the notice is about the poles
        self._buttons = self._make_buttons()
        self.plane.layout.flex = "1 1 430px"
        self.numbers.layout.flex = "0 0 auto"
        top = widgets.HBox([self.plane, self.numbers])
        top.add_class("rds-splane-row")
        main = widgets.VBox([self.notice, self.bar, top, self.curves, self.details])
        main.add_class("rds-main")
        self.widget = widgets.HBox([self._side, main])
        self.widget.add_class("rds-columns")
        design.watch(self._chosen)
        shell.ticker.add(self._tick)
        self._arrange()
        self._refresh()

    def _make_buttons(self) -> widgets.VBox:
        say = self.notice
        tip = "A controller of your own, to read and change"
        self.write_button = button("Write the file", tip, self._write, say, primary=True)
        self.replace_button = button(
            "Replace it", "Write over the file that is there", lambda: self._write(replace=True), say
        )
        self.replace_button.button_style = "warning"
        self.replace_button.layout.display = "none"
        self.try_button = button("Try it", "Go to Equipment control with this file open", self._try, say)
        self.picture_button = button(
            "Save a picture", "Poles and curves as a PNG file beside the controller's file", self._save_picture, say
        )
        press = row(self.write_button, self.replace_button, self.try_button, self.picture_button)
        group = widgets.VBox([FieldView(self.design.choices, "file"), press])
        group.add_class("rds-group")
        return group

    def _arrange(self) -> None:
        """Show the fields that matter for what is chosen."""
        shown = self.design.shown
        groups = []
        for names in _GROUPS:
            group = widgets.Box([self._view(name) for name in names if name in shown])
            group.add_class("rds-group")
            group.add_class("rds-fields")
            groups.append(group)
        self._side.children = [groups[0], groups[1], self._buttons, groups[2]]

    def _view(self, name: str) -> FieldView:
        if name not in self._views:
            self._views[name] = FieldView(self.design.choices, name)
        return self._views[name]

    def _chosen(self, name: str) -> None:
        if name in ("source", "kind"):
            self._arrange()
        if name == "file":
            self.replace_button.layout.display = "none"
            return
        self._stale = True  # shown at the next tick, when all that changes together has changed

    # what follows from the poles

    def _moved(self, name: str, place: complex, done: bool) -> None:
        """A pole is being dragged, or (`done`) was let go."""
        try:
            made = self.design.move(name, place) if done else self.design.preview(name, place)
        except RdsError as error:
            self.plane.refused = str(error)
            self._complain(f"not there: {error}{'; the pole stays where it was' if done else ''}")
        else:
            self.plane.refused = ""
            self._be_content()
            self._show(made)
        if done:
            self._place()
            self.plane.refused = ""
            self.plane.settled()

    def _refresh(self) -> None:
        """Everything by what is chosen."""
        self._stale = False
        self._place()
        try:
            made = self.design.now()
            self.plane.limit = _points(self.design.limit())
        except RdsError as error:
            self._made = self._cloud = None
            self._complain(str(error))
            self.numbers.value = self.details.value = ""
            self.curves.charts, self.plane.limit, self.plane.cloud = [], [], []
        else:
            self._be_content()
            self._show(made)
        for each in (self.write_button, self.try_button, self.picture_button):
            each.disabled = self._made is None

    def _complain(self, sentence: str) -> None:
        self.notice.say(sentence, "error")
        self._complains = True

    def _be_content(self) -> None:
        if self._complains:
            self.notice.clear()
        self._complains = False

    def _show(self, made: TrackingDesign) -> None:
        self._made, self._cloud, self._undrawn, self._quiet = made, None, True, 0
        self.plane.cloud = []
        self._show_numbers()

    def _show_numbers(self) -> None:
        if self._made is not None:
            self.numbers.value = key_numbers(self._made, self.design.choices["step"], self._cloud)
            self.details.value = details(self._made, self._cloud)

    def _place(self) -> None:
        first, second = self.design.poles
        places = {"pair": first} if first.imag or self.design.choices["kind"] == "pair" else {}
        places = places or {"first": first, "second": second}
        places["observer"] = complex(self.design.choices["observer"])
        self.plane.poles = [
            {"name": name, "label": _LABELS[name], "re": place.real, "im": place.imag} for name, place in places.items()
        ]

    def _tick(self) -> None:
        """Ten times a second: curves at most so often, and the cloud once the poles are at rest."""
        if self._stale:
            self._refresh()
        if self._made is None:
            return
        if self._undrawn:
            self._undrawn, self._quiet = False, 0
            self.curves.charts = charts(self._made, self.design.choices["step"])
            return
        self._quiet += 1
        if self._drawing is not None:
            self._look_at_cloud()
        elif self._quiet >= QUIET and self._cloud is None:
            self._clouded = self._made
            self._drawing = self.design.cloud(self._made)

    def _look_at_cloud(self) -> None:
        """Take the cloud when it is there, if it is still that of the design that is shown."""
        task = self._drawing
        assert task is not None
        if not task.done:
            return
        self._drawing = None
        if self._clouded is not self._made:
            return
        if task.result is None:
            self._quiet = -(10**9)  # it would fail again
            self._complain(f"no cloud: {task.error}")
            return
        self._cloud = task.result
        self.plane.cloud = _points(_parts(task.result.poles))
        self._show_numbers()

    # the file

    def _write(self, replace: bool = False) -> None:
        if not is_free(self.bar, self.notice) or not self._fit_to_write():
            return
        name = self.design.choices["file"]
        self._complains = False
        try:
            path = self.design.write(name, replace=replace)
        except RdsError as error:
            self.notice.say(str(error), "error")
            there = (self.design.session.folder / name.strip()).is_file()
            self.replace_button.layout.display = "" if there else "none"
            return
        self.replace_button.layout.display = "none"

        def checked(found: Checked) -> None:
            if found.ok:
                self.notice.say(f"wrote {path.name}; {found.sentence}; Try it opens it beside Run", "good")
            else:
                self.notice.say(found.sentence, "error")

        watch(self.bar, self.notice, self.design.check(path), checked, f"wrote {path.name}, which is not checked")

    def _try(self) -> None:
        path = self.design.file(self.design.choices["file"])
        if not path.is_file():
            raise InputError(f"there is no {path.name} yet: write the file first")
        self.design.try_it(path)
        self.shell.open("equipment-control")
        if self.shell.on_code is not None:
            self.shell.on_code()

    def _save_picture(self) -> None:
        made, cloud, size = self._made, self._cloud, self.design.choices["step"]
        if made is None:
            return
        self._complains = False

        def work(task: Task[str]) -> str:
            from rds.panels.design.picture import design_picture

            task.note = "drawing"
            return self.design.keep_picture(design_picture(made, size, cloud).png()).name

        self.design.file(self.design.choices["file"])  # a name that will not do is said before the drawing
        follow(self.bar, self.notice, lambda: self.shell.session.work("picture", work), self._pictured)

    def _pictured(self, name: str) -> None:
        self.notice.say(f"wrote {name}", "good")

    def _fit_to_write(self) -> bool:
        refused = [view.field.label for name, view in self._views.items() if name in self.design.shown and view.refused]
        if refused:
            self.notice.say(f"first mend what is refused on the left: {', '.join(refused)}", "error")
        return not refused


def _points(values: np.ndarray) -> list[list[float]]:
    return [[float(f"{x:.5g}"), float(f"{y:.5g}")] for x, y in values.tolist() if isfinite(x) and isfinite(y)]


def _parts(poles: np.ndarray) -> np.ndarray:
    flat = poles.ravel()
    return np.column_stack([flat.real, flat.imag])
