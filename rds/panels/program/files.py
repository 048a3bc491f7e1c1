"""The files of the program panel: which program is open; saved, copied, discarded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ipywidgets as widgets

from rds.panels.kit.button import attempt, button
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.program.state import Program


class ProgramFiles:
    """A row over the editor. `opened()` is called when another text is to be shown."""

    def __init__(self, program: Program, notice: Notice, opened: Callable[[], None]):
        self._program, self._notice, self._opened = program, notice, opened
        self._loading = False
        self.list = widgets.Dropdown(
            options=[(program.text.name, program.text.name)], description="Program", tooltip="The program that is open"
        )
        self.list.observe(self._chosen, "value")
        self.name = widgets.Text(placeholder="name.ngc", tooltip="A name for a copy, which is open from then on")
        self.name.layout.width = "120px"
        self.name.add_class("rds-program-name")
        self.state = Html()
        self.save_button = button("Save", "Write the file (Ctrl-S in the editor); Run saves, too", self.save, notice)
        self.discard_button = button("Discard changes", "Go back to the file as it was saved", self._discard, notice)
        self.widget = row(
            self.list,
            self.save_button,
            self.discard_button,
            self.name,
            button("Save as", "Save under the name beside this, which is open from then on", self._save_as, notice),
            self.state,
        )
        self.refresh()

    def refresh(self) -> None:
        """As things are now."""
        program = self._program
        here = program.text.name
        names = tuple((name, name) for name in program.programs())
        names += tuple((f"{name} (comes with rds)", name) for name in program.bundled())
        self._loading = True
        try:
            if self.list.options != names:
                self.list.options = names
            self.list.value = here
        finally:
            self._loading = False
        changed = program.text.changed
        self.save_button.disabled = not changed
        self.discard_button.disabled = not changed or program.text.is_new
        state = "new, not saved yet" if program.text.is_new else "not saved" if changed else "saved"
        self.state.value = f'<span role="status">{"●" if changed else "✔"} {state}</span>'

    def save(self) -> None:
        """What the save button does."""
        self._try(self._program.save)

    def _save_as(self) -> None:
        self._try(lambda: self._program.save_as(self.name.value))

    def _discard(self) -> None:
        self._try(self._program.discard)
        self._opened()

    def _chosen(self, change: Any) -> None:
        if not self._loading and change["new"]:
            self._try(lambda: self._program.open(str(change["new"])))

    def _try(self, act: Callable[[], None]) -> None:
        self._notice.clear()
        attempt("the program", act, self._notice)
        self.refresh()
