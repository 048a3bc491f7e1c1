"""The table of runs on the page: rows that can be ticked, starred, noted and sorted (static/runs.js)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import static
from rds.panels.session.run_table import RunRow


class RunsWidget(anywidget.AnyWidget):
    """`ticked` are the names of those that are chosen; `on_open(name)`, `on_star(name, on)` and `on_note(name, text)`
    are called for what is pressed in a row.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    rows: Any = traitlets.List([]).tag(sync=True)
    ticked: Any = traitlets.List([]).tag(sync=True)

    def __init__(
        self,
        on_open: Callable[[str], Any],
        on_star: Callable[[str, bool], Any],
        on_note: Callable[[str, str], Any],
    ):
        super().__init__(_esm=static(__file__, "runs.js"))
        self._on_open, self._on_star, self._on_note = on_open, on_star, on_note
        self.on_msg(self._asked)

    def show(self, rows: Iterable[RunRow]) -> None:
        """Show these; what was ticked stays so, where it is still there."""
        shown = [row.to_json() for row in rows]
        names = {each["name"] for each in shown}
        with self.hold_sync():
            self.rows = shown
            self.ticked = [name for name in self.ticked if name in names]

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """A word of the page; a run that is not in the table is none of it."""
        names = {each["name"] for each in self.rows}
        match content:
            case {"kind": "open", "name": str(name)} if name in names:
                self._on_open(name)
            case {"kind": "star", "name": str(name), "on": bool(on)} if name in names:
                self._on_star(name, on)
            case {"kind": "note", "name": str(name), "text": str(text)} if name in names:
                self._on_note(name, text)
