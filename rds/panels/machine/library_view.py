"""By hand: a machine put together of modules of the library, judged and drawn as it grows, written as a file."""

from __future__ import annotations

from functools import partial
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.machines.by_hand import machine_of_modules, text_of_modules, verdict_of_modules
from rds.machines.library import library
from rds.panels.kit.button import button
from rds.panels.kit.field import FieldView
from rds.panels.kit.figure import FigureView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import columns, group, row
from rds.panels.kit.notice import Notice
from rds.panels.machine.configuration import NEXT_STEP, moved, write_machine_text
from rds.panels.machine.state import MachineState
from rds.panels.session.fields import Choice, Text

_FILE = Text("file", "Machine file", "A file of your folder, which every mode takes as its machine", "by-hand.toml")
_EMPTY = "no module stands here yet: begin with a cutting head, then what carries it, down to the work"


class LibraryView:
    """The order of modules from the tool to the work, with buttons that change it."""

    def __init__(self, shell: Any, state: MachineState):
        self.session, self.state = shell.session, state
        self._ticker, self._figure = shell.ticker, FigureView()
        self.notice = Notice()
        names = {name: f"{module.kind}: {name}, {module.title}" for name, module in library().items()}
        module = Choice("module", "Module", "Of the library", next(iter(names)), names)
        self.choices = shell.session.choices("by hand", [module, _FILE])
        self.order: list[str] = []
        self._place, self._found = widgets.VBox([]), Html()
        self._write = button("Write file", "Write the machine's file", self.write, self.notice, primary=True)
        side = [
            group(
                "The library",
                FieldView(self.choices, "module"),
                row(button("Mount", "Under the module that is mounted last", self.mount, self.notice)),
            ),
            group("The machine", FieldView(self.choices, "file"), row(self._write)),
        ]
        head = Html("<p>From the tool (1) to the work; each module is mounted on the one below it.</p>")
        self.widget = columns(side, [self.notice, head, self._place, self._found, self._figure])
        self._show()

    def mount(self) -> None:
        """Put the module that is chosen under the others."""
        self.order.append(self.choices["module"])
        self._show()

    def write(self) -> None:
        """Write the file."""
        file = self.choices["file"]
        path = write_machine_text(self.session.folder, file, lambda name: text_of_modules(self.order, name))
        self.state.offer(path)
        self.notice.say(
            f"wrote {path.name}: every mode takes it as its machine; its models and limits are chosen, within the "
            f"modules' speeds. {NEXT_STEP}",
            "good",
        )

    def _show(self) -> None:
        self._place.children = [self._row(place) for place in range(len(self.order))]
        verdict = verdict_of_modules(self.order) if self.order else None
        self._write.disabled = verdict is None or not verdict.ok
        if verdict is None:
            self.notice.say(_EMPTY)
        elif verdict.ok:
            self.notice.say("these modules make a machine", "good")
        else:
            self.notice.say("\n".join(fault.text for fault in verdict.faults), "error")
        marks = {True: "✔", False: "✘", None: "–"}
        lines = [
            f"<li>{marks[check.passed]} {escape(check.text)}</li>" for check in (verdict.checks if verdict else ())
        ]
        self._found.value = f"<ul class='rds-verdict'>{''.join(lines)}</ul>"
        try:
            machine = machine_of_modules(self.order)
            machine.kinematics  # noqa: B018 - raises for links that make no chain
        except InputError:
            self._figure.clear()
            return

        def draw() -> Any:
            from rds.machines.picture import picture

            return picture(machine)

        self._figure.draw(self.session, self._ticker, draw, "The links with their frames, and where the tip can be")

    def _row(self, place: int) -> widgets.HBox:
        up = button("▲", "Nearer to the tool", partial(self._move, place, -1), self.notice)
        down = button("▼", "Nearer to the work", partial(self._move, place, 1), self.notice)
        up.disabled, down.disabled = place == 0, place == len(self.order) - 1
        for each in (up, down):
            each.layout.min_width = each.layout.width = "44px"
        module = library()[self.order[place]]
        text = Html(f"<b>{place + 1}</b> &nbsp; {escape(module.kind)}: {escape(module.title or module.name)}")
        return row(up, down, text, button("Remove", "Take the module out", partial(self._remove, place), self.notice))

    def _move(self, place: int, by: int) -> None:
        numbers = moved(range(len(self.order)), place, by)
        self.order = [self.order[int(number)] for number in numbers]
        self._show()

    def _remove(self, place: int) -> None:
        del self.order[place]
        self._show()
