"""The editor of code: CodeMirror in an anywidget, with faults shown below their lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import anywidget
import traitlets

from rds.panels.code.completions import Word
from rds.panels.equipment.build import Mark
from rds.panels.kit.static_files import codemirror, static


class CodeEditor(anywidget.AnyWidget):
    """`text` as it was a quarter of a second after the last key.

    `on_run()` is called at Ctrl-Enter, and `on_drop(name, content)` for a file that is dropped here.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    text = traitlets.Unicode("").tag(sync=True)
    file = traitlets.Unicode("").tag(sync=True)  # its name: another one begins another history of undo
    label = traitlets.Unicode("code").tag(sync=True)
    marks: Any = traitlets.List([]).tag(sync=True)
    words: Any = traitlets.List([]).tag(sync=True)

    def __init__(self, on_run: Callable[[], Any], on_drop: Callable[[str, bytes], Any], **options: Any):
        super().__init__(_esm=codemirror(__file__, "code.js"), _css=static(__file__, "code.css"), **options)
        self.add_class("rds-code-widget")
        self._on_run, self._on_drop = on_run, on_drop
        self.on_msg(self._asked)

    def show(self, name: str, text: str, words: Iterable[Word]) -> None:
        """Show this file."""
        with self.hold_sync():
            self.file, self.text, self.marks, self.words = name, text, [], list(words)

    def mark(self, marks: Iterable[Mark]) -> None:
        """Show these at their lines, and no others; those of the whole file stand above its first line."""
        self.marks = [{"line": each.line or 0, "text": each.text, "fault": each.fault} for each in marks]

    def go(self, line: int) -> None:
        """Go to a line."""
        self.send({"kind": "go", "line": line})

    def _asked(self, _: Any, content: Any, buffers: Any) -> None:
        """A run brings the text along: a change of `text` may still be on its way."""
        match content:
            case {"kind": "run", "text": str(text)}:
                self.text = text
                self._on_run()
            case {"kind": "drop", "name": str(name)} if buffers:
                self._on_drop(name, bytes(buffers[0]))
