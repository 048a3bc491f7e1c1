"""Two buttons that act for as long as they are held: a small anywidget of our own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from rds.panels.jog.answers import Answers
from rds.panels.kit.static_files import static

_FRESH = 0.5  # s: as long as static/hold.js waits for an answer


class HoldButtons(anywidget.AnyWidget):
    """`on_word(kind, direction)` hears "hold" every 50 ms while a button is held, "release", and "step" for a press.

    The first word of a press only asks for the answer that those behind it name: what was under way while nothing
    went through moves nothing.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    axis = traitlets.Unicode("").tag(sync=True)
    by_step = traitlets.Bool(False).tag(sync=True)
    disabled = traitlets.Bool(True).tag(sync=True)

    def __init__(self, on_word: Callable[[str, int], None], **options: Any):
        super().__init__(_esm=static(__file__, "hold.js"), **options)
        self._on_word = on_word
        self._answers = Answers(_FRESH)
        self.on_msg(self._told)

    def _told(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the three words moves nothing."""
        if not isinstance(content, dict):
            return
        kind, direction = content.get("kind"), content.get("direction", 0)
        moves = kind == "step" or (kind == "hold" and self._answers.fresh(content.get("answer")))
        if kind == "release" or (moves and direction in (-1, 1)):
            self._on_word(str(kind), int(direction))
        if kind == "hold":
            self.send(self._answers.give())
