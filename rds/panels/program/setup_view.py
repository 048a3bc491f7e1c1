"""Touching off: where the work is on the machine, said by what the tool should read where it stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.nc.language.frame import SYSTEMS
from rds.panels.kit.button import button
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.program.offsets import FIRST, Offsets
from rds.panels.program.state import Program
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, Number
from rds.results import html

_WORDS = (
    "<p>Jog the tool to an edge, or hold a run there. The machine position is the last one that was measured here; "
    "type it where it is another. Then say what the tool should read: 0 at the work's zero, −3 at an edge that a "
    "tool of 6 mm touches from the left.</p>"
)


class SetupView:
    """`refresh()` when it is looked at; `at` is where the axes were measured last."""

    def __init__(self, program: Program, at: Callable[[], Mapping[str, float]]):
        self._program, self._at = program, at
        self.notice = Notice()
        axes = [name for name in "XYZ" if name in program.machine.axes]
        systems = {str(number): word for number, word in enumerate(SYSTEMS) if word}
        fields: list[Field] = [Choice("system", "Coordinate system", "which of them is set", "1", systems)]
        for axis in axes:
            low, high = program.machine.axes[axis].travel
            tip = "where the axis stands, in machine coordinates"
            fields.append(
                Number(f"at {axis}", f"{axis} machine", tip, None, "mm", low, high, optional=True, when_empty="?")
            )
            tip = "what it should read there in this system; empty: the origin of this axis stays"
            fields.append(
                Number(f"reads {axis}", f"{axis} should read", tip, None, "mm", optional=True, when_empty="stays")
            )
        self._axes, self._choices = axes, Choices(fields)
        self._views = [FieldView(self._choices, f"{which} {axis}") for axis in axes for which in ("at", "reads")]
        rows = [row(*pair) for pair in zip(self._views[::2], self._views[1::2], strict=True)]
        tip = "Write the origin into the parameter file; the program is checked anew with it"
        press = button("Touch off", tip, self._touch_off, self.notice)
        again = button("Take positions", "Fill in where the axes were measured last", self._take, self.notice)
        self._table = Html()
        group = widgets.VBox([FieldView(self._choices, "system"), *rows, row(again, press)])
        group.add_class("rds-group")
        file = FieldView(program.choices, "parameters", buttons=False)
        self.widget = widgets.VBox([Html(_WORDS), group, self.notice, file, self._table])
        self.refresh()
        program.choices.watch(lambda name: self.refresh() if name == "parameters" else None)

    def refresh(self) -> None:
        """Show the origins of the file that is chosen."""
        self._program.refresh()
        name = str(self._program.choices["parameters"])
        try:
            rows = Offsets(self._program.session.folder, name).table() if name else []
        except InputError as error:
            self.notice.say(str(error), "error")
            rows = []
        heads = ["system", "X [mm]", "Y [mm]", "Z [mm]"]
        none = "<p>No parameter file: every system has its origin at the machine's zero.</p>"
        self._table.value = html.table(heads, rows, f"Origins in {name}") if rows else none

    def _take(self) -> None:
        at = self._at()
        if not at:
            raise InputError("no position was measured here yet; run or hold a program, or type the positions")
        for axis in self._axes:
            self._choices.set(f"at {axis}", round(at[axis], 4) if axis in at else None)

    def _touch_off(self) -> None:
        check_mended(self._views)
        chosen = self._choices
        reads = {axis: chosen[f"reads {axis}"] for axis in self._axes if chosen[f"reads {axis}"] is not None}
        if not reads:
            raise InputError("say what an axis should read: 0 where the tool stands at the work's zero")
        machine = {axis: chosen[f"at {axis}"] for axis in self._axes if chosen[f"at {axis}"] is not None}
        name = str(self._program.choices["parameters"]) or FIRST
        system = int(chosen["system"])
        Offsets(self._program.session.folder, name).touch_off(system, machine, reads)
        self._program.refresh()
        if self._program.choices["parameters"] == name:
            self._program.look_again()
            self.refresh()
        else:
            self._program.choices.set("parameters", name)
        said = ", ".join(f"{axis} {value:g} mm" for axis, value in reads.items())
        self.notice.say(f"{SYSTEMS[system]} in {name}: the tool reads {said} there", "good")
