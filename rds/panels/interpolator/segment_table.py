"""A table of segments: a row for each line or arc, with what is refused under it."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.core.geometry import PLANES
from rds.panels.interpolator.fields import read_point
from rds.panels.kit.html import Html
from rds.panels.session.choices import Choices

_FEED_TIP = "feed rate of this segment, in the unit on the left; empty: that of the path"


class SegmentTable(widgets.VBox):
    """The rows of `choices[name]`, kept equal to it as long as all of them will do."""

    def __init__(self, choices: Choices, name: str):
        super().__init__()
        self.add_class("rds-group")
        self._choices, self._name = choices, name
        self._taken = choices[name]
        self._rows = [_Row(self, row) for row in self._taken]
        self._add = widgets.Button(description="Add a line", tooltip="A straight move from where the path ends")
        self._add.on_click(lambda _: self.add("line"))
        self._add_arc = widgets.Button(description="Add an arc", tooltip="An arc from where the path ends")
        self._add_arc.on_click(lambda _: self.add("arc"))
        self._refusal = Html("")
        self._refusal.add_class("rds-refusal")
        self._show()
        choices.watch(self._follow)

    @property
    def refused(self) -> list[str]:
        """Which rows will not do, in words."""
        return ["the table of segments"] if self._refusal.value else []

    def add(self, kind: str) -> None:
        """One more row, 10 mm further along X."""
        end = list(self._choices[self._name][-1]["end"]) if self._choices[self._name] else [0.0, 0.0]
        far = [end[0] + 10.0, *end[1:]]
        arc = {"centre": [end[0] + 5.0, *end[1:]]} if kind == "arc" else {}
        self._rows.append(_Row(self, {"kind": kind, "end": far} | arc))
        self._show()
        self.changed()

    def remove(self, row: _Row) -> None:
        """Take a row away."""
        self._rows.remove(row)
        self._show()
        self.changed()

    def changed(self) -> None:
        """Take what stands in the rows, or say why it will not do."""
        made = []
        try:
            for number, row in enumerate(self._rows, start=1):
                made.append(row.read(number))
            self._taken = made
            self._choices.set(self._name, made)
            self._refusal.value = ""
        except InputError as error:
            self._refusal.value = f'<span role="alert">✖ {escape(str(error))}</span>'

    def _follow(self, name: str) -> None:
        """Show rows that were set elsewhere."""
        if name == self._name and self._choices[name] != self._taken:
            self._taken = self._choices[name]
            self._rows = [_Row(self, row) for row in self._taken]
            self._refusal.value = ""
            self._show()

    def _show(self) -> None:
        for number, row in enumerate(self._rows, start=1):
            row.label.value = f"{number}"
        buttons = widgets.HBox([self._add, self._add_arc])
        buttons.add_class("rds-row")
        told = "Segments: each begins where the one before ends (positions in mm: X, Y or X, Y, Z)"
        head = Html(f"<h2 class=rds-part>{told}</h2>")
        self.children = [head, *self._rows, self._refusal, buttons]


class _Row(widgets.HBox):
    """One line or arc."""

    def __init__(self, owner: SegmentTable, row: dict[str, Any]):
        self.label = widgets.Label(tooltip="")
        self.kind = widgets.Dropdown(
            options=[("Line", "line"), ("Arc", "arc")], value=row["kind"], tooltip="line or arc"
        )
        self.end = _text("to", row["end"], "end, mm: X, Y or X, Y, Z")
        self.centre = _text("around", row.get("centre", row["end"]), "centre of the arc, mm")
        turn = "clockwise" if row.get("clockwise") else "counter-clockwise"
        self.turn = widgets.Dropdown(options=["counter-clockwise", "clockwise"], value=turn, tooltip="way of the arc")
        self.plane = widgets.Dropdown(options=list(PLANES), value=row.get("plane", "XY"), tooltip="plane of the arc")
        feed = "" if row.get("feed") is None else f"{row['feed']:.12g}"
        self.feed = widgets.Text(feed, placeholder="feed", tooltip=_FEED_TIP, continuous_update=False)
        away = widgets.Button(description="✕", tooltip="Remove this segment")
        away.on_click(lambda _: owner.remove(self))
        for control, width in ((self.label, 14), (self.kind, 76), (self.turn, 172), (self.plane, 58), (self.feed, 58)):
            control.layout.width = f"{width}px"
        away.layout.min_width = away.layout.width = "34px"
        self.end.layout.width, self.centre.layout.width = "100px", "122px"
        super().__init__([self.label, self.kind, self.end, self.centre, self.turn, self.plane, self.feed, away])
        self.add_class("rds-row")
        for control in (self.kind, self.end, self.centre, self.turn, self.plane, self.feed):
            control.observe(lambda _: self._changed(owner), "value")
        self._arrange()

    def read(self, number: int) -> dict[str, Any]:
        """The row; InputError for a position or a feed rate that is none."""
        try:
            row: dict[str, Any] = {"kind": self.kind.value, "end": read_point(self.end.value)}
            if row["kind"] == "arc":
                row |= {"centre": read_point(self.centre.value), "clockwise": self.turn.value == "clockwise"}
                row["plane"] = self.plane.value
            if self.feed.value.strip():
                row["feed"] = float(self.feed.value.replace(",", "."))
        except InputError as error:
            raise InputError(f"segment {number}: {error}") from error
        except ValueError as error:
            raise InputError(f"segment {number}: feed rate {self.feed.value!r:.40} must be a number above 0") from error
        return row

    def _changed(self, owner: SegmentTable) -> None:
        self._arrange()
        owner.changed()

    def _arrange(self) -> None:
        for control in (self.centre, self.turn, self.plane):
            control.layout.display = "" if self.kind.value == "arc" else "none"


def _text(label: str, values: list[float], tip: str) -> widgets.Text:
    made = widgets.Text(
        ", ".join(f"{value:.12g}" for value in values), description=label, tooltip=tip, continuous_update=False
    )
    made.style.description_width = "initial"
    return made
