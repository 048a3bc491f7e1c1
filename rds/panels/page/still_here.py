"""Whether a browser still shows the page: for what must not go on when the last one has gone."""

from __future__ import annotations

import time
from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import static

IN_SIGHT = 20.0  # s without a word of a page that was in sight, which says one every five
IN_BACKGROUND = 90.0  # s without a word of a page in the background, which browsers let say one each minute


class StillHere(anywidget.AnyWidget):
    """Invisible; `until` is how long a browser shows the page by what it said last, s of time.monotonic()."""

    _esm = traitlets.Unicode().tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=static(__file__, "still_here.js"))
        self.until = time.monotonic() + IN_SIGHT
        self.on_msg(self._said)

    @property
    def gone(self) -> bool:
        """Whether no browser shows the page any more."""
        return time.monotonic() > self.until

    def _said(self, _: Any, content: Any, __: Any) -> None:
        """Another browser may show the same page: the one that stays longest counts."""
        if content == {"kind": "in sight"}:
            self.until = max(self.until, time.monotonic() + IN_SIGHT)
        elif content == {"kind": "in background"}:
            self.until = max(self.until, time.monotonic() + IN_BACKGROUND)
