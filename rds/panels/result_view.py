"""A result to read: metrics, plots, timing, the model's verdict; saved elsewhere, or sent by e-mail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.kit.field import FieldView
from rds.panels.kit.figure import FigureView
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.live_view import changes_table
from rds.results import Result, html
from rds.session.email import check_address, mail_server, send_files
from rds.session.fields import Text
from rds.session.save_as import save_as

_EMPTY = "<p>No result yet: run something, or open one of the earlier runs.</p>"
_STAGES = ("p50", "p99", "p999", "max")


class ResultView:
    """`show(result, folder)` when a run is over, `saved(folder)` when its files are there."""

    def __init__(self, shell: Any):
        self._shell, self._session = shell, shell.session
        self.result: Result | None = None
        self._folder: Path | None = None
        self._timing_of: Result | None = None
        self.numbers = widgets.HTML(_EMPTY)
        self.figure = FigureView()
        self.validation = widgets.HTML()
        self.where = widgets.HTML()
        self.timing_figure = FigureView()
        self.timing_numbers = widgets.HTML(_EMPTY)
        self.timing = widgets.VBox([self.timing_numbers, self.timing_figure])
        self.bar = WorkBar(shell.ticker)
        self.notice = Notice()
        self.actions = self._actions()
        self.widget = widgets.VBox([self.numbers, self.figure, self.validation, self.where, self.actions])

    def show(self, result: Result, folder: Path) -> None:
        """Show it; `folder` is where its files are, or will be."""
        self.clear()
        self.result, self._folder = result, folder
        notes = html.notes_list(html.all_notes(result))
        self.numbers.value = _metrics({"": result}) + notes + changes_table(result.meta.get("changes") or [])
        self.figure.draw(self._session, self._shell.ticker, result.plot)
        self.where.value = "<p>its files are being written …</p>"
        self._validate(result)

    def saved(self, folder: Path) -> None:
        """Its files are written."""
        self.where.value = f"<p>Saved with its report in <code>{escape(str(folder))}</code></p>"
        self.actions.layout.display = ""

    def overlay(self, results: Sequence[Result], names: Sequence[str]) -> None:
        """Several results over each other."""
        from rds.results.plots_overlay import modes

        self.clear()
        self.numbers.value = _metrics(dict(zip(names, results, strict=True)))
        self.figure.draw(self._session, self._shell.ticker, lambda: modes(results, names))

    def clear(self) -> None:
        """Nothing to show."""
        self.result = self._folder = self._timing_of = None
        self.numbers.value = self.timing_numbers.value = _EMPTY
        self.validation.value = self.where.value = ""
        self.figure.clear()
        self.timing_figure.clear()
        self.notice.clear()
        self.actions.layout.display = "none"

    def draw_timing(self) -> None:
        """The verdict with its reason, percentiles, lateness histogram and late samples; drawn when looked at."""
        result = self.result
        if result is None or self._timing_of is result:
            return
        self._timing_of = result
        summary = result.meta.get("timing") or {}
        if not summary:
            self.timing_numbers.value = "<p>A simulation runs in virtual time: there is no timing to judge.</p>"
            return
        rows = [[stage, *(summary[stage][key] for key in _STAGES)] for stage in _STAGE_NAMES if stage in summary]
        late = f"{summary.get('late')} of {summary.get('samples')} samples late, {summary.get('discarded')} discarded"
        self.timing_numbers.value = (
            html.verdict_line(result, "Timing")
            + html.table(["stage", "median [µs]", "99 % [µs]", "99.9 % [µs]", "longest [µs]"], rows)
            + f"<p>{escape(late)}</p>"
        )
        from rds.results.plots_timing import timing

        self.timing_figure.draw(self._session, self._shell.ticker, lambda: timing(result))

    def _validate(self, result: Result) -> None:
        if result.validation:
            from rds.validation.report import fragment

            parts = [fragment(found, pictures=False) for found in result.validation.values()]
            self.validation.value = f"<h3>Does the model hold?</h3>{''.join(parts)}"

    def _actions(self) -> widgets.Widget:
        choices = self._session.choices(
            "results",
            [
                Text("save_as", "Save as", "a name that ends with .csv, .mat or .parquet", "", "first.csv"),
                Text("send_to", "E-mail to", "addresses, separated by commas", "", "me@example.edu", refuse=_refuse),
            ],
        )
        save = widgets.Button(description="Save", tooltip="Save the result's table under this name, with its units")
        save.on_click(lambda _: self._save(str(choices["save_as"])))
        send = widgets.Button(description="Send", tooltip="Send the report and the table (CSV) by e-mail")
        send.on_click(lambda _: self._send(str(choices["send_to"])))
        rows = []
        for name, button in (("save_as", save), ("send_to", send)):
            row = widgets.HBox([FieldView(choices, name), button])
            row.add_class("rds-action")
            rows.append(row)
        box = widgets.HBox(rows)
        box.add_class("rds-row")
        actions = widgets.VBox([box, self.bar, self.notice])
        actions.layout.display = "none"
        return actions

    def _save(self, name: str) -> None:
        if self.result is None or self.bar.busy:
            return
        result, folder = self.result, self._session.folder
        task = self._session.work("save", lambda task: f"saved as {save_as(result, folder, name)}")
        self.bar.follow(task, lambda: self._said(task))

    def _send(self, to: str) -> None:
        if self.result is None or self._folder is None or self.bar.busy:
            return
        files = [path for name in ("report.html", "result.csv") if (path := self._folder / name).is_file()]
        subject, folder = f"RDS: {self._folder.name}", self._session.folder
        text = f"Results of {self._folder.name}, sent from RDS.\n"
        task = self._session.work("send", lambda task: send_files(mail_server(folder), to, subject, text, files))
        task.note = "sending"
        self.bar.follow(task, lambda: self._said(task))

    def _said(self, task: Any) -> None:
        if task.error is None:
            self.notice.say(task.result, "good")
        else:
            self.notice.say(str(task.error), "error")
            if not isinstance(task.error, RdsError):
                raise task.error


_STAGE_NAMES = ("lateness", "io", "compute", "model")


def _metrics(results: Mapping[str, Result]) -> str:
    """The metrics as a table: a row per run and axis, a column per metric and unit."""
    cells: dict[tuple[str, str], dict[str, Any]] = {}
    for name, result in results.items():
        axes, metrics = html.metrics_rows(result)
        for title, *values in metrics:
            for axis, value in zip(axes[1:], values, strict=True):
                if value is not None:
                    cells.setdefault((name, axis), {})[title] = value
    columns = list(dict.fromkeys(title for row in cells.values() for title in row))
    rows = [[f"{name} {axis}".strip(), *(row.get(title) for title in columns)] for (name, axis), row in cells.items()]
    return html.table(["", *columns], rows) if rows else ""


def _refuse(text: str) -> None:
    for each in text.split(","):
        check_address(each)
