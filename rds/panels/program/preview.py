"""What a look at a program found: verdict, cycle time, reach against the travel, tools; its path from all sides."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.nc.validate import TOLERANCE
from rds.panels.kit.html import Html
from rds.panels.kit.notice import Notice
from rds.panels.program.check import CheckState
from rds.panels.program.cut_html import cut_html
from rds.panels.program.path_view import PathView
from rds.panels.program.state import Program
from rds.results import html


class Preview:
    """`show(look)` when something was found, `place(position)` while it runs."""

    def __init__(self, program: Program):
        self._program = program
        self._look: CheckState | None = None
        self._space: Any = None  # made when somebody wants to see it
        self.path = PathView(program.machine)
        self.verdict = Notice()
        self.verdict.add_class("rds-verdict")
        self.verdict.say("checking …")
        self.numbers = Html()
        self.in_space = widgets.ToggleButton(
            description="In space (3-D)", tooltip="The path in three dimensions, to be turned with the mouse"
        )
        self.in_space.layout.width = "auto"
        self.in_space.observe(lambda change: self._toggle(change["new"]), "value")
        self._place = widgets.VBox([self.path])
        row = widgets.HBox([self.in_space])
        row.add_class("rds-row")
        self.widget = widgets.VBox([self.verdict, row, self._place, self.numbers])

    def show(self, look: CheckState) -> None:
        """What was found."""
        self._look = look
        self.verdict.say(look.sentence, "good" if look.ok else "error")
        self.path.show(look.trace, look.sentence)
        if self._space is not None and self.in_space.value:
            self._space.show(look.trace)
        self.numbers.value = _numbers(look, self._program) + cut_html(look.cut, look.uncut)

    def place(self, position: Sequence[float]) -> None:
        """The tool is there: X, Y, Z in machine coordinates, mm."""
        self.path.place(position)
        if self._space is not None and self.in_space.value:
            self._space.place(position)

    def _toggle(self, on: bool) -> None:
        if on and self._space is None:
            from rds.panels.program.space import SpaceView

            self._space = SpaceView(self._program.machine)
        if on and self._look is not None:
            self._space.show(self._look.trace)
        self._place.children = [self._space.widget if on else self.path]


def _numbers(look: CheckState, program: Program) -> str:
    parts = []
    if look.cycle is not None:
        shares = [(f"T{tool}" if tool else "no tool", share) for tool, share in look.cycle.by_tool.items()]
        if len(shares) > 1:
            shares.append(("all", look.cycle.whole))
        rows = [[tool, *(f"{value:.2f}" for value in share.seconds)] for tool, share in shares]
        heads = ["tool", "cutting [s]", "rapid [s]", "dwell [s]", "total [s]"]
        parts.append(html.table(heads, rows, "Cycle time at 100 % (M0, M1 and tool changes take none)"))
        parts.append(f"<p>{escape(look.cycle.certificate.sentence())}</p>")
    if look.validation is not None and look.validation.low:
        rows = []
        for axis, low in look.validation.low.items():
            high, of = look.validation.high[axis], program.machine.axes.get(axis)
            least, most = of.travel if of is not None else (0.0, 0.0)
            inside = of is not None and least - TOLERANCE <= low and high <= most + TOLERANCE
            place, verdict = f"{axis} [{of.unit if of is not None else 'mm'}]", "✔ inside" if inside else "✖ beyond"
            rows.append([place, f"{low:.3f}", f"{high:.3f}", f"{least:g} to {most:g}", verdict])
        heads = ["axis", "least", "greatest", "travel", ""]
        parts.append(html.table(heads, rows, "Reach, machine coordinates"))
    return "".join(parts)
