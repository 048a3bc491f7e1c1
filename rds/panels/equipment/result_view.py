"""A result to read: metrics, plots, timing, the model's verdict, and what can be done with its files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ipywidgets as widgets

from rds.modes.experiment.report import STAGE_FIGURES
from rds.panels.equipment.live_view import changes_table
from rds.panels.equipment.result_actions import ResultActions, Saved
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.results import Result, html

if TYPE_CHECKING:
    from rds.nc.run.prepare import Prepared

_EMPTY = (
    "<p>No result yet. After a run, or when one of the earlier runs is opened, here are the errors in numbers, the "
    "response, the error and the voltage over time, and the files to save or send.</p>"
)
_NO_TIMING = (
    "<p>No result yet. After a run against the clock here is the verdict, met, missed or void, with its reason: how "
    "long each part of a sample took, and the samples that were late.</p>"
)
SENT = ("report.html", "result.csv")  # by e-mail; the report first


class ResultView:
    """`show(result, prepared)` when a loop is over, `follow_files(run)` when its run is; `saved(folder)` of others."""

    def __init__(self, shell: Any):
        self._shell, self._session = shell, shell.session
        self.result: Result | None = None
        self._timing_of: Result | None = None
        self.numbers = Html(_EMPTY)
        self.path, self.figure = FigureView(), FigureView()
        self.validation = Html()
        self.timing_figure = FigureView()
        self.timing_numbers = Html(_NO_TIMING)
        self.timing = widgets.VBox([self.timing_numbers, self.timing_figure])
        self.actions = ResultActions(shell)
        self.widget = widgets.VBox([self.numbers, self.path, self.figure, self.validation, self.actions.widget])

    def show(self, result: Result, prepared: Prepared | None = None) -> None:
        """Show it; `prepared` is the path that its axes followed together."""
        self.clear()
        self.result = result
        notes = html.notes_list(html.all_notes(result))
        if prepared is not None:
            from rds.nc.run.pictures import path

            self.path.draw(self._session, self._shell.ticker, lambda: path(result, prepared))
        self.numbers.value = (
            _contour(result) + _metrics({"": result}) + notes + changes_table(result.meta.get("changes") or [])
        )
        self.figure.draw(self._session, self._shell.ticker, result.plot)
        self.actions.writing()
        self._validate(result)

    def saved(self, folder: Path) -> None:
        """Its files are written."""
        if self.result is not None:
            self.actions.offer(self.result, folder, SENT)

    def follow_files(self, run: Saved) -> None:
        """Its tables are there; its pictures and reports are offered once they are, too."""
        if self.result is not None:
            self.actions.follow(self.result, run, SENT)

    def overlay(self, results: Sequence[Result], names: Sequence[str]) -> None:
        """Several results over each other."""
        from rds.results.plots_overlay import modes

        self.clear()
        self.numbers.value = _metrics(dict(zip(names, results, strict=True)))
        self.figure.draw(self._session, self._shell.ticker, lambda: modes(results, names))

    def clear(self) -> None:
        """Nothing to show."""
        self.result = self._timing_of = None
        self.numbers.value, self.timing_numbers.value = _EMPTY, _NO_TIMING
        self.validation.value = ""
        self.path.clear()
        self.figure.clear()
        self.timing_figure.clear()
        self.actions.clear()

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
        rows = [
            [words, *(summary[stage][key] for key in STAGE_FIGURES)]
            for stage, words in _STAGE_NAMES.items()
            if stage in summary
        ]
        late = f"{summary.get('late')} of {summary.get('samples')} samples late, {summary.get('discarded')} discarded"
        self.timing_numbers.value = (
            html.verdict_line(result, "Timing")
            + html.table(["part of a sample", "median [µs]", "99 % [µs]", "99.9 % [µs]", "longest [µs]"], rows)
            + f"<p>{escape(late)}</p>"
        )
        from rds.results.plots_timing import timing

        self.timing_figure.draw(self._session, self._shell.ticker, lambda: timing(result))

    def _validate(self, result: Result) -> None:
        if result.validation:
            from rds.identification.validate.report import fragment

            parts = [fragment(found, pictures=False) for found in result.validation.values()]
            self.validation.value = f"<h2 class=rds-part>Does the model hold?</h2>{''.join(parts)}"


_STAGE_NAMES = {
    "lateness": "lateness (of the system)",
    "io": "I/O (on the bus)",
    "interpolate": "interpolate (the path)",
    "compute": "compute (the controller)",
    "model": "model",
}


def timing_line(result: Result) -> tuple[str, str, str]:
    """The verdict on the timing in one line, its kind of notice, and what it rests on."""
    reason = str(result.meta.get("verdict_reason") or "")
    kind = {"met": "good", "missed": "error"}.get(str(result.verdict), "warning")
    return (
        f"timing {result.verdict}{f': {reason}' if reason else ''}",
        kind,
        str(result.meta.get("verdict_evidence") or ""),
    )


def _contour(result: Result) -> str:
    """How well the axes followed their path together, in sentences; nothing where there was none."""
    about = result.meta.get("program")
    if not about:
        return ""
    from rds.nc.run.report import findings

    return "".join(f"<p>{escape(sentence)}</p>" for sentence in findings(about))


def _metrics(results: Mapping[str, Result]) -> str:
    """The metrics as a table: a row per run and axis, a column per metric and unit.

    The name of a run, which says its axis, stands for both where it has but one.
    """
    cells: dict[tuple[str, str], dict[str, Any]] = {}
    for name, result in results.items():
        axes, metrics = html.metrics_rows(result)
        for title, *values in metrics:
            for axis, value in zip(axes[1:], values, strict=True):
                if value is not None:
                    cells.setdefault((name, axis), {})[title] = value
    columns = list(dict.fromkeys(title for row in cells.values() for title in row))
    alone = {name for name in results if sum(name == of for of, _ in cells) == 1}
    rows = [
        [name if name and name in alone else f"{name} {axis}".strip(), *(row.get(title) for title in columns)]
        for (name, axis), row in cells.items()
    ]
    return html.table(["", *columns], rows) if rows else ""
