"""Configuration: modules put into their order from the tool to the work, checked, and written as a machine file."""

from __future__ import annotations

from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.machines.assembly import assembled, first_order, judged, order_of
from rds.machines.library import library
from rds.machines.machine import Machine
from rds.panels.kit.button import button
from rds.panels.kit.field import FieldView
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.machine.configuration import NEXT_STEP, directions, moved, write_machine
from rds.panels.machine.state import MachineState
from rds.panels.session.fields import Choice, Text
from rds.results import html

_BOARDLESS = {
    name: f"{module.kind}: {name}, {module.title}"
    for name, module in library().items()
    if module.kind in ("accessory", "frame", "table")
}
_PART = Choice("part", "Without a board", "What the bus cannot tell of", next(iter(_BOARDLESS)), _BOARDLESS)
_FILE = Text("file", "Machine file", "A file of your folder, which every mode takes as its machine", "my-machine.toml")


class ConfigurationView:
    """The order, with buttons that change it."""

    def __init__(self, shell: Any, state: MachineState):
        self.session, self.state = shell.session, state
        self._ticker, self._figure = shell.ticker, FigureView()
        self.notice = Notice()
        self.choices = shell.session.choices("configuration", [_PART, _FILE])
        self.order: list[int | str] = []
        self._place, self._found = widgets.VBox([]), Html()
        self._write = button("Write machine", "Write the machine's file", self.write, self.notice, primary=True)
        side = [group("The machine", FieldView(self.choices, "file"), row(self._write))]
        head = Html("<p>Number the modules as they are mounted: 1 holds the tool, the last one the work.</p>")
        self._parts = row(
            FieldView(self.choices, "part"),
            button("Add", "Put it into the order", self.add, self.notice),
        )
        self.widget = columns(side, [self.notice, head, self._place, self._parts, self._found, self._figure])
        self.refresh()

    def refresh(self) -> None:
        """Other modules are known."""
        if {each for each in self.order if isinstance(each, int)} != set(self.state.data):
            self.order = order_of(self.state.machine, self.state.data) or first_order(self.state.data)
        self._show()

    def write(self) -> None:
        """Write the file."""
        path = write_machine(self.session.folder, self.choices["file"], self.order, self.state.data)
        self.state.offer(path)
        self.notice.say(
            f"wrote {path.name}: every mode takes it as its machine; its head says where models and limits are from, "
            f"which no module knows. {NEXT_STEP}",
            "good",
        )

    def _show(self) -> None:
        self._place.children = [self._row(place, number) for place, number in enumerate(self.order, start=1)]
        self._parts.layout.display = None if self.order else "none"
        verdict = judged(self.order, self.state.data)
        self._write.disabled = not verdict.ok
        if not verdict.ok:
            kind = "warning" if not self.order else "error"
            self.notice.say("\n".join(fault.text for fault in verdict.faults), kind)
            self._found.value = ""
            self._figure.clear()
            return
        self.notice.say("this order makes a machine that can move as its modules say", "good")
        rows = [
            [name, kind, *map(float, direction.round(6) + 0.0)]
            for name, (kind, direction) in directions(self.order, self.state.data).items()
        ]
        note = "Unit vectors, in the tool's directions, with all axes at zero."
        self._found.value = html.table(["module", "does", "x", "y", "z"], rows, "What moves how", note)
        machine = assembled("machine", self.order, self.state.data)
        self._figure.draw(self.session, self._ticker, lambda: _picture(machine), "The links with their frames")

    def _row(self, place: int, number: int | str) -> widgets.HBox:
        up = button("▲", "Nearer to the tool", lambda: self._move(number, -1), self.notice)
        down = button("▼", "Nearer to the work", lambda: self._move(number, 1), self.notice)
        up.disabled, down.disabled = place == 1, place == len(self.order)
        for each in (up, down):
            each.layout.min_width = each.layout.width = "44px"
        text = Html(f"<b>{place}</b> &nbsp; {escape(self._name(number))}")
        if isinstance(number, int):
            return row(up, down, text)
        return row(
            up, down, text, button("Remove", "Take it out of the order", lambda: self._remove(number), self.notice)
        )

    def _name(self, number: int | str) -> str:
        if isinstance(number, str):
            return f"{library()[number].kind} {library()[number].title} ({number})"
        data = self.state.data[number]
        return f"{data['axis']}: {data['kind']} {data['type_text']} (module {number})"

    def add(self) -> None:
        """Put what has no board into the order: an accessory behind the tool, anything else at the work's end."""
        part = self.choices["part"]
        if part in self.order:
            raise InputError(f"{part} stands in the order already; move it with ▲ and ▼")
        self.order.insert(1 if library()[part].kind == "accessory" else len(self.order), part)
        self._show()

    def _remove(self, part: str) -> None:
        self.order.remove(part)
        self._show()

    def _move(self, number: int | str, by: int) -> None:
        self.order = moved(self.order, number, by)
        self._show()


def _picture(machine: Machine) -> Any:
    from rds.machines.picture import picture

    return picture(machine)
