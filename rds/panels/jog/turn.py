"""The buttons that turn a spindle either way for as long as the page is in sight: a small anywidget of our own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from rds.panels.jog.answers import Answers
from rds.panels.kit.static_files import static

_FRESH = 1.0  # s: as long as static/turn.js waits for an answer


class TurnButtons(anywidget.AnyWidget):
    """`on_word(kind, direction)` hears "turn" every 200 ms while the spindle shall turn, and "stop" once.

    The first "turn" is an order, which static/presence.js lets go in time; those behind it name an answer that they
    have had: what was under way while nothing went through moves nothing.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    spindle = traitlets.Unicode("").tag(sync=True)
    disabled = traitlets.Bool(True).tag(sync=True)

    def __init__(self, on_word: Callable[[str, int], None], **options: Any):
        super().__init__(_esm=static(__file__, "turn.js"), **options)
        self._on_word = on_word
        self._answers = Answers(_FRESH)
        self.on_msg(self._told)

    def forget(self) -> None:
        """No button is pressed any more: the spindle was stopped by other means, or refused."""
        self.send({"kind": "forget"})

    def _told(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the two words moves nothing."""
        if not isinstance(content, dict):
            return
        kind, direction = content.get("kind"), content.get("direction", 0)
        number = content.get("answer")
        moves = kind == "turn" and (number is None or self._answers.fresh(number))
        if kind == "stop" or (moves and direction in (-1, 1)):
            self._on_word(str(kind), int(direction))
        if kind == "turn":
            self.send(self._answers.give())
