"""Data: logged data described, a model fitted to them, and validated on others."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.panels.data.state import DataState
from rds.panels.kit.button import button, follow
from rds.panels.kit.field import FieldView
from rds.panels.kit.field_names import in_fields
from rds.panels.kit.figure import FigureView
from rds.panels.kit.file_import import FileImport
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.session.task import Task

NAME = "data"
TITLE = "Data"
SUMMARY = "Describe logged data, fit a model to them, and validate it on others"
HELP = "data"

_FIRST = (
    '<div class="rds-hint"><p>From logged data to a model that can be trusted:</p><ol>'
    "<li><b>Data</b>: choose a log of an axis (its voltage and its position over time), or a folder under "
    "<code>runs/</code>; <i>Describe</i> says what it holds, and what is doubtful.</li>"
    "<li><b>Fit</b>: <i>Fit</i> estimates the parameters of the structure that you choose.</li>"
    "<li><b>Validate</b>: try the model on other data than it was fitted to.</li></ol>"
    "<p>No log yet? Run a <i>System test</i> in Equipment model: its run is one.</p></div>"
)
_IMPORT = "Copy a file of up to 250 MB into the folder; or put it there yourself"
_SIGNS = {"fault": "✖", "warning": "⚠", "note": "ℹ"}


def build(shell: Any) -> widgets.Widget:
    """The panel."""
    return DataView(shell).widget


class DataView:
    """Three steps from left to right: data, fit, validation."""

    def __init__(self, shell: Any):
        self.shell, self.state = shell, DataState(shell.session)
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        self.text, self.figure = Html(_FIRST), FigureView()
        self.text.add_class("rds-scroll")
        self._known = widgets.Dropdown(
            options=[("files of the folder …", "")], tooltip="What the folder holds", layout={"width": "auto"}
        )
        self._known.observe(self._picked, "value")
        self._upload = FileImport("Import a file", _IMPORT, self._imported, self.notice)
        self._map = widgets.Textarea(rows=10, tooltip="", layout=widgets.Layout(width="calc(100% - 4px)"))
        self._map_says = Html("")
        self._map_box = widgets.VBox(
            [
                self._map_says,
                self._map,
                button("Save map", "Write it beside the data, and describe again", self._keep_map, self.notice),
            ]
        )
        self._offer_map("")
        side = [self._data_step(), self._fit_step(), self._validation_step()]
        self.widget = columns(side, [self.bar, self.notice, self._map_box, self.text, self.figure])
        self._refresh()

    def _data_step(self) -> widgets.Widget:
        tip = "Columns, sample period, and what is doubtful"
        press = button("Describe", tip, self.describe, self.notice, primary=True)
        return group("1 Data", self._known, self._upload, self._field("file"), self._field("map"), row(press))

    def _fit_step(self) -> widgets.Widget:
        own = self._field("structure_file")
        self.state.choices.watch(lambda name: self._show_own(own))
        self._show_own(own)
        fields = [self._field("structure"), own, self._field("options"), self._field("method"), self._field("model")]
        say = self.notice
        buttons = row(
            button("Fit", "Estimate the parameters", self.fit, say, primary=True),
            button("Save model", "Write the model file, which every mode takes", self.save_model, say),
            button("Use it", "Equipment control with this model", self.use_model, say),
        )
        return group("2 Fit", *fields, buttons)

    def _validation_step(self) -> widgets.Widget:
        tip = "How far the model can be trusted on other data"
        press = button("Validate", tip, self.validate, self.notice, primary=True)
        return group("3 Validate", self._field("validation_file"), row(press))

    def describe(self) -> None:
        """What the file holds."""
        self._begin(self.state.describe, self._show_description)
        self._offer_map(self.state.map_text())  # which may be why nothing is described

    def fit(self) -> None:
        """Estimate."""
        self._begin(self.state.fit, self._show_estimate)

    def validate(self) -> None:
        """Judge the model on other data."""
        self._begin(self.state.validate, self._show_validation)

    def save_model(self) -> None:
        """Write the model file."""
        self.notice.say(f"wrote {self.state.write_model()}", "good")
        self._refresh()

    def use_model(self) -> None:
        """Go to equipment control with the model file chosen there."""
        self.state.model_to_use()
        self.shell.open("equipment-control")
        choices = self.shell.session.choices("equipment control", ())
        choices.set("model", "user")
        choices.set("model_file", self.state.choices["model"])

    def _begin(self, start: Callable[[], Task[Any]], show: Callable[[Any], None]) -> None:
        def begin() -> Task[Any]:
            task = start()
            self._offer_map("")
            return task

        follow(self.bar, self.notice, begin, show)

    def _show_description(self, found: Any) -> None:
        from rds.identification.logs.describe_plot import overview
        from rds.results import html
        from rds.results.units import heading

        rows = [[heading(c.name, c.unit), c.low, c.high, c.step, c.values, c.missing] for c in found.columns]
        parts = [html.table(["column", "lowest", "highest", "step", "values", "missing"], rows)]
        parts += [
            f"<p><b>{escape(log.name)}</b>: {len(log)} samples, {log.time[-1] - log.time[0]:.6g} s, "
            f"every {log.sample_period:.6g} s</p>"
            for log in found.logs
        ]
        parts += [
            f"<p><b>{_SIGNS[str(each.gravity)]} {escape(str(each.gravity))}</b>: {escape(in_fields(each.what))}</p>"
            for each in found.findings
        ]
        self.text.value = "".join(parts)
        if found.usable:
            self.notice.say(f"{found.path.name} can be fitted; columns: {found.map or 'as they are'}", "good")
        else:
            self.notice.say(f"{found.path.name} cannot be used as it is: see below", "error")
        if found.draft:
            self._offer_map(found.draft, drafted=True)
        if found.logs:
            self.figure.show(overview(found.logs), self.shell.session)
        else:
            self.figure.clear()

    def _show_estimate(self, estimate: Any) -> None:
        from rds.identification.fit.fit_report import fragment, free_run_picture
        from rds.identification.structures.structures import for_logs, structure

        self.text.value = in_fields(fragment(estimate))
        kind = "warning" if estimate.warnings or estimate.unidentifiable else "good"
        count = len(estimate.warnings)
        said = "fitted" if kind == "good" else f"fitted, with {count} warning{'s' * (count != 1)}: read them first"
        self.notice.say(said, kind)
        if self.state.fitted:
            made = for_logs(structure(estimate.structure, estimate.options), self.state.fitted)
            self.figure.show(free_run_picture(estimate, self.state.fitted[0], made), self.shell.session)

    def _show_validation(self, validation: Any) -> None:
        from rds.identification.validate.plots import overlay
        from rds.identification.validate.report import fragment

        self.text.value = in_fields(fragment(validation, pictures=False))
        self.notice.say(validation.verdict.sentence, "good" if validation.verdict.ok else "warning")
        self.figure.show(overlay(next(iter(validation.assessments.values()))), self.shell.session)

    def _offer_map(self, text: str, drafted: bool = False) -> None:
        """Let a map be corrected; none, where `text` is empty."""
        self._map.value = text
        self._map_says.value = (
            "What its columns mean is not clear. Correct this map, and save it:"
            if drafted
            else "What its columns mean, by the map beside it. Where it is wrong, correct and save it:"
        )
        self._map_box.layout.display = "" if text else "none"

    def _keep_map(self) -> None:
        self.state.keep_map(self._map.value)
        self.describe()

    def _picked(self, change: Any) -> None:
        if change["new"]:
            self.state.choices.set("file", change["new"])

    def _imported(self, name: str, content: bytes) -> None:
        from rds.core.atomic import write_whole

        path = self.shell.session.folder / _plain(name)
        if path.exists():
            raise InputError(f"{path.name} is there already; rename one of them")
        write_whole(path, content)
        self.state.choices.set("file", path.name)
        self.notice.say(f"{path.name} is in your folder", "good")
        self._refresh()

    def _refresh(self) -> None:
        self._known.options = [("files of the folder …", ""), *((name, name) for name in self.state.files())]

    def _show_own(self, own: widgets.Widget) -> None:
        own.layout.display = "" if self.state.choices["structure"] == "user" else "none"

    def _field(self, name: str) -> FieldView:
        return FieldView(self.state.choices, name)


def _plain(name: str) -> str:
    """The last part of a file name that a browser sent, without what a file system might obey."""
    return "".join(c for c in name.replace("\\", "/").rpartition("/")[2] if c.isprintable()).lstrip(".") or "imported"
