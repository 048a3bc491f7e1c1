"""Answers to the words of a button that is held: a word that replies to none of late was under way for too long."""

from __future__ import annotations

import time
from typing import Any

_KEPT = 50  # answers of which it is remembered when they were given


class Answers:
    """Each word of a held button names the last answer that its page has heard; the first ones name none.

    When a connection, or a kernel, stands still and comes back, all words that were under way come at once. None of
    them may move anything: nobody knows whether the button is held still.
    """

    def __init__(self, lasts: float):
        self._lasts = lasts  # s for which words may name an answer
        self._given: dict[int, float] = {}  # number -> when, s of time.monotonic()
        self._number = 0

    def fresh(self, number: Any) -> bool:
        """Whether this answer was given of late."""
        given = self._given.get(number) if type(number) is int else None
        return given is not None and time.monotonic() - given <= self._lasts

    def give(self) -> dict[str, Any]:
        """The next answer, to be sent to the page."""
        self._number += 1
        self._given[self._number] = time.monotonic()
        self._given.pop(self._number - _KEPT, None)
        return {"kind": "heard", "number": self._number}
