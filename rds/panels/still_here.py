"""Whether a browser still shows the page: for what must not go on when the last one has gone."""

from __future__ import annotations

import time
from functools import cache
from pathlib import Path
from typing import Any

import anywidget
import traitlets

GONE_AFTER = 90.0  # s without a word; a page in the background says one each minute


@cache
def _module() -> str:
    return (Path(__file__).parent / "static" / "still_here.js").read_text(encoding="utf-8")


class StillHere(anywidget.AnyWidget):
    """Invisible; `heard_at` is when a browser last said that it shows the page, s of time.monotonic()."""

    _esm = traitlets.Unicode().tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=_module())
        self.heard_at = time.monotonic()
        self.on_msg(self._said)

    @property
    def gone(self) -> bool:
        """Whether no browser shows the page any more."""
        return time.monotonic() - self.heard_at > GONE_AFTER

    def _said(self, _: Any, content: Any, __: Any) -> None:
        if content == {"kind": "here"}:
            self.heard_at = time.monotonic()
