"""The tool table of the program panel: chosen, edited with its fault at the word, saved, or begun anew."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.core.errors import InputError
from rds.nc.language.errors import ProgramError
from rds.nc.language.tools import Tool
from rds.panels.kit.button import attempt, button
from rds.panels.kit.field import FieldView
from rds.panels.kit.html import Html
from rds.panels.kit.layout import row
from rds.panels.kit.notice import Notice
from rds.panels.program.editor import Editor
from rds.panels.program.state import Program
from rds.panels.program.tool_file import ToolFile
from rds.results import html

_NONE = "<p>No tool table is chosen: T M6, G43 and G41 need one. Choose one above, or begin a new one.</p>"


class ToolView:
    """`refresh()` when it is looked at; `chosen()` when another table is."""

    def __init__(self, program: Program):
        self._program = program
        self._file: ToolFile | None = None
        self._kept: dict[str, ToolFile] = {}  # those that were left without being saved
        self.notice = Notice()
        self.table = Html()
        self.editor = Editor(lambda: attempt("saving", self._save, self.notice), label="tool table", height=170)
        self.editor.observe(lambda change: self._typed(change["new"]), "text")
        tip = "Look for tool tables in the folder, and read this one anew; what is not saved of it is given up"
        again = button("Look again", tip, self._again, self.notice)
        self.state = Html()
        choose = row(FieldView(program.choices, "tools", buttons=False), again)
        choose.layout.align_items = "flex-end"
        tip = "A name for a new tool table: .toml for tools with shapes, .tbl as LinuxCNC has them"
        self._name = widgets.Text(placeholder="tools.toml", tooltip=tip)
        self._name.layout.width = "140px"
        begin = button("New table", "Begin a table under the name beside this", self._begin, self.notice)
        self.save_button = button(
            "Save table", "Write the table (Ctrl-S); a program is checked anew with it", self._save, self.notice
        )
        self._shown = (self.editor, row(self.save_button, self.state))
        self._edit = widgets.VBox([])  # nothing of it is on the page before a table is open
        self.widget = widgets.VBox([choose, row(self._name, begin), self._edit, self.notice, self.table])
        self.chosen()

    def refresh(self) -> None:
        """Look for tables that have come or gone, and for what somebody else wrote into the one that is chosen."""
        self._program.refresh()
        if self._file is None or not self._file.changed:
            self.chosen()

    def _again(self) -> None:
        self._file = None
        self._kept.pop(str(self._program.choices["tools"]), None)
        self.refresh()

    def chosen(self) -> None:
        """Show the table that is chosen: as it is on the disk, or as it was left without being saved."""
        self.notice.clear()
        if self._file is not None and self._file.changed:
            self._kept[self._file.name] = self._file
        name = str(self._program.choices["tools"])
        try:
            kept = self._kept.pop(name, None)
            self._open(kept or (ToolFile(self._program.session.folder, name) if name else None))
        except InputError as error:
            self._open(None)
            self.notice.say(str(error), "error")

    def _open(self, file: ToolFile | None) -> None:
        self._file = file
        self._edit.children = () if file is None else self._shown
        self.editor.text = "" if file is None else file.text
        self._look()

    def _begin(self) -> None:
        """Another table, which is there once it is saved."""
        file = ToolFile(self._program.session.folder, self._name.value.strip())
        if file.path.exists():
            raise InputError(f"{file.name} is there already; choose it above, or take another name")
        self._open(file)
        self.notice.say(f"{file.name} is new: change it, then Save table")

    def _typed(self, text: str) -> None:
        if self._file is not None:
            self._file.text = text
            self._look()

    def _look(self) -> None:
        file = self._file
        changed = file is not None and file.changed
        self.save_button.disabled = not changed
        self.state.value = f'<span role="status">{"● not saved" if changed else "✔ saved"}</span>'
        self.editor.mark(file.marks() if file is not None else [])
        if file is None:
            self.table.value = _NONE
            return
        try:
            self.table.value = _tools(file.tools(), file.name)
        except (ProgramError, InputError):
            self.table.value = ""  # the editor says what is wrong, and where

    def _save(self) -> None:
        file = self._file
        if file is None or not file.changed:
            return
        file.save()
        self._program.refresh()
        if self._program.choices["tools"] == file.name:
            self._program.look_again()
        else:
            self._program.choices.set("tools", file.name)
        self.notice.say(f"saved as {file.name}", "good")
        self._look()


def _tools(tools: list[Tool], name: str) -> str:
    rows: list[list[Any]] = [
        [f"T{tool.number}", tool.pocket, f"{tool.diameter:g}", f"{tool.offset[2]:g}", tool.comment] for tool in tools
    ]
    return html.table(["tool", "pocket", "diameter [mm]", "length Z [mm]", "comment"], rows, f"Tools of {name}")
