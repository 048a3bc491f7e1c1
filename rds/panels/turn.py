"""The buttons that turn a spindle either way for as long as the page is in sight: a small anywidget of our own."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import anywidget
import traitlets


@cache
def _module() -> str:
    return (Path(__file__).parent / "static" / "turn.js").read_text(encoding="utf-8")


class TurnButtons(anywidget.AnyWidget):
    """`on_word(kind, direction)` hears "turn" every 200 ms while the spindle shall turn, and "stop" once."""

    _esm = traitlets.Unicode().tag(sync=True)
    spindle = traitlets.Unicode("").tag(sync=True)
    disabled = traitlets.Bool(True).tag(sync=True)

    def __init__(self, on_word: Callable[[str, int], None], **options: Any):
        super().__init__(_esm=_module(), **options)
        self._on_word = on_word
        self.on_msg(self._told)

    def forget(self) -> None:
        """No button is pressed any more: the spindle was stopped by other means, or refused."""
        self.send({"kind": "forget"})

    def _told(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the two words moves nothing."""
        if not isinstance(content, dict):
            return
        kind, direction = content.get("kind"), content.get("direction", 0)
        if kind == "stop" or (kind == "turn" and direction in (-1, 1)):
            self._on_word(str(kind), int(direction))
        if kind == "turn":
            self.send({"kind": "heard"})
