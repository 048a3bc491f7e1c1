"""The editor of part programs, over CodeMirror: marks at words, what these mean, and the line that runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import anywidget
import traitlets

from rds.panels.kit.codemirror import module
from rds.panels.program.check import Mark

_STATIC = Path(__file__).parent / "static"


@cache
def _style() -> str:
    return (_STATIC / "editor.css").read_text(encoding="utf-8")


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
        super().__init__(_esm=module(_STATIC / "editor.js"), _css=_style(), **options)
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
