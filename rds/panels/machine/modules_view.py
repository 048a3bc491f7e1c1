"""Modules: the simulated ones started and stopped, the bus scanned, what was found and what it says of itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rds.panels.kit.button import button, follow
from rds.panels.kit.field import FieldView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.kit.work_bar import WorkBar
from rds.panels.machine.state import MachineState
from rds.results import html

_NEXT = "no modules are known yet: start the simulated ones, or switch yours on, and press Scan"


class ModulesView:
    """`found()` is called when other modules are known."""

    def __init__(self, shell: Any, state: MachineState, found: Callable[[], None]):
        self.state, self._found = state, found
        self.notice, self.bar = Notice(), WorkBar(shell.ticker)
        self.table = Html()
        self.table.add_class("rds-scroll")
        say = self.notice
        self._start = button("Start modules", "Run the simulated modules until they are stopped", self.start, say)
        self._end = button("Stop modules", "End the simulated modules that this page runs", self.end, say)
        side = [
            group(
                "Simulated modules",
                FieldView(state.choices, "machine"),
                FieldView(state.choices, "dialect", buttons=False),
                row(self._start, self._end),
            ),
            group(
                "The bus",
                row(
                    button(
                        "Scan", "Look who is on the bus, and ask for their data; nothing moves", self.scan, say, True
                    )
                ),
            ),
        ]
        self.widget = columns(side, [self.bar, self.notice, self.table])
        self._show([])

    def start(self) -> None:
        """Start the simulated modules, then scan."""
        follow(self.bar, self.notice, self.state.start, lambda _: self._scan_next(), failed=self._enable)

    def _scan_next(self) -> None:
        self._enable()
        self.scan()

    def end(self) -> None:
        """End them."""
        self.state.end()
        self.notice.say("the simulated modules are stopped", "note")
        self._show([])

    def scan(self) -> None:
        """Who is there."""
        # the simulated modules may be found to have ended
        follow(self.bar, self.notice, self.state.scan, self._scanned, failed=self._enable)

    def _scanned(self, rows: list[dict[str, Any]]) -> None:
        self._show(rows)
        described = len(self.state.data)
        text = f"{len(rows)} module{'s' * (len(rows) != 1)} on the bus"
        if described:
            text += f"; {described} say what they are: go on with Configuration or Controllers"
        else:
            text += "; modules of this dialect do not say what they are (distributed ones, oacs, do)"
        self.notice.say(text, "good")

    def _show(self, rows: list[dict[str, Any]]) -> None:
        self._enable()
        if rows:
            names = ["id", "type", "dialect", "version", "state"]
            shown = html.table(
                ["number", "type", "dialect", "version", "state"], [[each[name] for name in names] for each in rows]
            )
            self.table.value = shown + self._data() + self._matrices()
        else:
            self.table.value = f"<p>{_NEXT}</p>"
        self._found()

    def _data(self) -> str:
        data = list(self.state.data.values())
        if not data:
            return ""
        lines: list[list[Any]] = []
        for title, key in (
            ("unit", "unit"),
            ("travel, from", "lowest"),
            ("travel, to", "highest"),
            ("accuracy, ±", "accuracy"),
            ("repeatability, ±", "repeatability"),
            ("counts per unit", "counts_per_unit"),
            ("speed clockwise, unit/min (tool: unit)", "clockwise_speed"),
            ("speed counter-clockwise, unit/min (tool: unit)", "counterclockwise_speed"),
            ("supply [V]", "supply"),
            ("controller", "controller"),
            ("Kp [duty/count]", "Kp"),
            ("Ki [duty/(count s)]", "Ki"),
            ("Kd [duty s/count]", "Kd"),
        ):
            lines.append([title, *(each["tuning"].get(key, each.get(key)) for each in data)])
        heads = ["", *(f"{each['axis']} (module {each['number']})" for each in data)]
        return html.table(heads, lines, "What they say of themselves")

    def _matrices(self) -> str:
        found = []
        for each in self.state.data.values():
            moves = f"moves along or about {each['joint']}" if each["joint"] else "is not moved"
            title = f"{each['axis']} (module {each['number']}): transformation matrix; {moves}"
            found.append(html.table(["x", "y", "z", "shift [mm]"], [list(line) for line in each["matrix"]], title))
        return f"<details><summary>Transformation matrices</summary>{''.join(found)}</details>" if found else ""

    def _enable(self) -> None:
        self._start.disabled, self._end.disabled = self.state.serves, not self.state.serves
