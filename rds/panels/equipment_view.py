"""What equipment model and equipment control share: settings on the left; run, live strip and results on the right."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.kit.field import FieldView
from rds.panels.kit.figure import FigureView
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.strip import StripChart
from rds.results import Result
from rds.session.equipment import USER, Equipment
from rds.session.equipment_run import EquipmentRun

_FILES = {"shape_file": "shape", "model_file": "model", "controller_file": "controller"}  # shown for what is the user's


class EquipmentView:
    """The widgets over one `Equipment`."""

    def __init__(self, shell: Any, equipment: Equipment, drive: str):
        self.shell, self.equipment = shell, equipment
        self.run: EquipmentRun | None = None
        self._fields = {name: FieldView(equipment.choices, name) for name in equipment.choices.fields}
        self._settings = widgets.VBox([])
        self._settings.add_class("rds-side")
        self.run_button = widgets.Button(description="Run", button_style="primary", tooltip="Run with these settings")
        self.run_button.on_click(lambda _: self.start())
        self.bar = WorkBar(shell.ticker)
        self.notice = Notice()
        self.strip = StripChart()
        self.strip.layout.display = "none"
        self.table = widgets.HTML()
        self.figure = FigureView()
        row = widgets.HBox([self.run_button, self.bar])
        row.add_class("rds-row")
        main = widgets.VBox([row, self.notice, self.strip, self.table, self.figure])
        main.add_class("rds-main")
        self.widget = widgets.HBox([self._settings, main])
        self.widget.add_class("rds-columns")
        self._traces: list[tuple[str, str]] = []
        self._end: Any = None
        equipment.choices.watch(lambda name: self._arrange())
        self._arrange()

    def start(self) -> None:
        """What the run button does."""
        if self.bar.busy:
            return
        if refused := [view.field.label for view in self._shown() if view.refused]:
            self.notice.say(f"first mend what is refused on the left: {', '.join(refused)}", "error")
            return
        try:
            self.run = EquipmentRun(self.equipment.session, self.equipment.table())
            self.run.start()
        except RdsError as error:
            self.notice.say(str(error), "error")
            return
        self.notice.clear()
        self.table.value = ""
        self.figure.clear()
        self.run_button.disabled = True
        self._traces = []
        self.bar.follow(self.run, self._ended)
        self._end = self.shell.ticker.add(self._look)

    def _look(self) -> None:
        """Ten times a second while it runs."""
        run = self.run
        if run is None:
            return
        if not self._traces and (traces := run.traces()):
            self._traces = traces
            self.strip.layout.display = ""
            self.strip.begin(traces)
        if self._traces and len(rows := run.new_rows()):
            self.strip.add(rows)

    def _ended(self) -> None:
        self._look()
        if self._end is not None:
            self._end()
        self.run_button.disabled = False
        run = self.run
        assert run is not None
        if run.error is not None:
            self.notice.say(str(run.error), "error")
        if run.result is not None:
            self._show(run.result)

    def _show(self, result: Result) -> None:
        from rds.results import html

        reason = result.meta.get("verdict_reason")
        if result.meta.get("ending") != "done":
            self.notice.say(f"ended early ({result.meta['ending']}): {result.meta.get('ending_reason')}", "warning")
        elif result.verdict:
            kind = {"met": "good", "missed": "error"}.get(result.verdict, "warning")
            self.notice.say(f"timing {result.verdict}: {reason}", kind)
        else:
            self.notice.say(f"done: {len(result)} samples", "good")
        columns, rows = html.metrics_rows(result)
        folder = self.run.folder if self.run else ""
        self.table.value = html.table(columns, rows) + f"<p>saved in {escape(str(folder))}</p>"
        self.figure.show(result.plot())

    def _shown(self) -> list[FieldView]:
        chosen = self.equipment.choices
        names = [name for name in chosen.fields if name not in _FILES or chosen[_FILES[name]] == USER]
        if chosen["shape"] == USER:
            names = [name for name in names if name not in ("amplitude", "frequency", "offset")]
        return [self._view(name) for name in names]

    def _view(self, name: str) -> FieldView:
        if name not in self._fields:
            self._fields[name] = FieldView(self.equipment.choices, name)
        return self._fields[name]

    def _arrange(self) -> None:
        """Show the fields that matter for what is chosen."""
        for name in [name for name in self._fields if name not in self.equipment.choices]:
            self._fields.pop(name).close()
        self._settings.children = self._shown()
