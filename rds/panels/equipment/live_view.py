"""A run while it goes on: the strip with a mark at each change, and the machine in motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import ipywidgets as widgets
import numpy as np

from rds.machines import Machine
from rds.panels.equipment.parameters import Parameters
from rds.panels.equipment.run import EquipmentRun
from rds.panels.equipment.strip import StripChart, end_marks
from rds.panels.equipment.taken_up import TakenUpRun
from rds.panels.kit.html import Html
from rds.panels.scene.scene import MachineScene
from rds.panels.session.live_values import LiveValues
from rds.results import Result, html


class LiveView:
    """`follow(run)`, then `look()` ten times a second until `ended()`."""

    def __init__(self, machine: Machine, parameters: Parameters, preview: Callable[[], str]):
        """In `parameters` the values of a run can be changed while it goes on; `preview()` is HTML before a run."""
        self._preview = preview
        self._parameters = parameters
        self._run: EquipmentRun | TakenUpRun | None = None
        self._traces: list[tuple[str, str]] = []
        self._is_live = False  # whether the run's values can be changed now
        self._said = 0
        self._ghost: tuple[Result | None, str] = (None, "")
        self.strip = StripChart()
        self.strip.layout.display = "none"
        self.hint = Html(preview())
        self.scene = MachineScene(machine)
        self._changes = Html()
        beside = widgets.Box([self.strip, self.scene])
        beside.add_class("rds-live")
        self.widget = widgets.VBox([self.hint, beside, self._changes])

    def follow(self, run: EquipmentRun | TakenUpRun) -> None:
        """Show this run from its beginning."""
        self._run, self._traces, self._said = run, [], 0
        self.hint.value = "<p>The loop is being started; the first samples come in a moment.</p>"
        self._changes.value = ""
        self.strip.layout.display = "none"
        self._is_live = False
        self._parameters.lock()

    def chosen(self) -> None:
        """Something else is chosen: before a run, that is what will be there."""
        if self._run is None and not self._traces:
            self.hint.value = self._preview()

    def look(self) -> None:
        """What has come since."""
        run = self._run
        if run is None:
            return
        if not self._traces and (traces := run.traces()):
            self._traces = traces
            self.hint.value = ""
            self.strip.layout.display = ""
            self.strip.begin(traces)
            self._stand_behind()
            self.scene.begin(traces, run.real_time, self.strip.stream)
        if self._traces and len(rows := run.new_rows()):
            self.scene.show(self.strip.add(rows))
        if run.real_time and not self._is_live and run.live_values:
            self._is_live = True
            self._parameters.show_live(LiveValues(run), isinstance(run, EquipmentRun))
        self._list_changes(run)

    def show_ghost(self, result: Result | None, name: str) -> None:
        """Let an earlier run stand behind the strip, until another one does, or None."""
        self._ghost = result, name
        self._stand_behind()

    def _stand_behind(self) -> None:
        result, name = self._ghost
        rows = ghost_rows(result, self._traces) if result is not None and self._traces else np.empty((0, 1))
        self.strip.stand_behind(rows, name)

    def ended(self) -> None:
        """The run is over; its strip stays, to be scrubbed through."""
        run, self._run = self._run, None
        self._is_live = False
        self._parameters.rest()
        if run is not None:
            self._list_changes(run)
            self._mark_end(run)
            if not self._traces:
                self.hint.value = self._preview()

    def _list_changes(self, run: EquipmentRun | TakenUpRun) -> None:
        changes = run.changes
        if len(changes) != self._said:
            self._said = len(changes)
            self.strip.events = [{"time": time, "text": f"{name} {new:g}"} for time, name, _, new in changes]
            self._changes.value = changes_table(changes)

    def _mark_end(self, run: EquipmentRun | TakenUpRun) -> None:
        """Where a run ended early, and why; a fault in red."""
        if run.result is not None:
            self.strip.events = [*self.strip.events, *end_marks(run.result)]


def ghost_rows(result: Result, traces: Sequence[tuple[str, str]]) -> np.ndarray:
    """What a result has of these traces: rows of time and one value each, nan for what it does not have."""
    columns = [result["time"]]
    for name, unit in traces:
        axis = name.removesuffix("_error")
        reference, measured = f"{axis}_reference", f"{axis}_measured"
        if name in result and result.units.get(name, "") == unit:
            columns.append(result[name])
        elif name != axis and reference in result and measured in result and result.units[measured] == unit:
            columns.append(result[reference] - result[measured])
        else:
            columns.append(np.full(len(result), np.nan))
    return np.column_stack(columns)


def changes_table(changes: Any) -> str:
    """The changes of live values as a table, with the times at which the loop took them."""
    rows = [[f"{time:.3f}", name, old, new] for time, name, old, new in changes]
    return html.table(["at [s]", "value", "was", "became"], rows, "Changed while it ran") if rows else ""
