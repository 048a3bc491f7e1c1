"""Says when a browser has begun to show the page: a kernel that was made ready beforehand knows nothing newer.

And answers the word behind which a browser lets a click go, so that a click neither overtakes what was typed before it
nor, where it moves the machine, comes late (static/presence.js).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import anywidget
import traitlets

from rds.core.errors import InputError
from rds.panels.kit.static_files import static
from rds.panels.session.expired_orders import LATE, refusal

_MOST = 100  # answers of which it is remembered when they were given


class Presence(anywidget.AnyWidget):
    """Invisible; calls `here()` each time that a browser shows the page, and `late(sentence)` for what came too late.

    The age of a press is the sum of two stretches, each measured by one clock: from the press to the answer by the
    browser, which gives up a press that is LATE then; from the answer to the click by the kernel.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    patience = traitlets.Float(1e3 * LATE).tag(sync=True)  # ms

    def __init__(self, here: Callable[[], None], late: Callable[[str], None]):
        super().__init__(_esm=static(__file__, "presence.js"))
        self._here, self._late = here, late
        self._answered: dict[int, float] = {}  # number of the word -> when, s of time.monotonic()
        self._age = 0.0  # s, of the order that comes next
        self.on_msg(self._said)

    def in_time(self, what: str, moved: bool = False) -> None:
        """InputError if the order that is carried out now was pressed, or `moved`, too long ago."""
        age, self._age = self._age, 0.0
        if age > LATE:
            raise InputError(refusal(what, age, moved))

    def _said(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the four words does nothing."""
        if content == {"kind": "here"}:
            self._here()
            return
        if not isinstance(content, dict):
            return
        kind, number = content.get("kind"), content.get("number")
        if kind == "settle" and type(number) is int:
            self._answered[number] = time.monotonic()
            while len(self._answered) > _MOST:
                self._answered.pop(next(iter(self._answered)))
            self.send({"kind": "settled", "number": number})
            return
        age, what = content.get("age"), content.get("what")  # ms, the button
        if not isinstance(age, int | float) or not math.isfinite(age):
            return
        if kind == "go" and type(number) is int:
            self._age = 1e-3 * age + time.monotonic() - self._answered.pop(number, -math.inf)
        elif kind == "late" and isinstance(what, str):
            self._late(refusal(what[:60], 1e-3 * age, content.get("moved") is True))
