"""The editor of part programs, over CodeMirror: marks at words, what these mean, and the line that runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import codemirror, static
from rds.panels.program.check import Mark


class Editor(anywidget.AnyWidget):
    """`text` as it was a quarter of a second ago; `on_save()` is called at Ctrl-S."""

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    text = traitlets.Unicode("").tag(sync=True)
    label = traitlets.Unicode("part program").tag(sync=True)
    marks: Any = traitlets.List([]).tag(sync=True)
    running = traitlets.Int(0).tag(sync=True)  # the line that runs; 0: none
    caret = traitlets.Int(1).tag(sync=True)  # the line that the cursor is in
    locked = traitlets.Bool(False).tag(sync=True)
    height = traitlets.Int(380).tag(sync=True)  # px
    words: Any = traitlets.List([]).tag(sync=True)  # what is offered, and said of a word under the mouse

    def __init__(self, on_save: Callable[[], None], **options: Any):
        super().__init__(_esm=codemirror(__file__, "editor.js"), _css=static(__file__, "editor.css"), **options)
        self.add_class("rds-editor-widget")
        self._on_save = on_save
        self.on_msg(self._asked)

    def mark(self, marks: Iterable[Mark]) -> None:
        """Show these, and no others."""
        self.marks = [mark.to_json() for mark in marks]

    def go(self, line: int) -> None:
        """Go to a line, and select it."""
        self.send({"kind": "go", "line": line})

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """A save brings the text along: a change of `text` may still be on its way."""
        if isinstance(content, dict) and content.get("kind") == "save" and isinstance(content.get("text"), str):
            self.text = content["text"]
            self._on_save()
