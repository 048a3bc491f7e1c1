"""Says when a browser has begun to show the page: a kernel that was made ready beforehand knows nothing newer.

And answers the word behind which a browser lets a click go (static/presence.js).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import anywidget
import traitlets


@cache
def _module() -> str:
    return (Path(__file__).parent / "static" / "presence.js").read_text(encoding="utf-8")


class Presence(anywidget.AnyWidget):
    """Invisible; calls `here()` each time that a browser shows the page."""

    _esm = traitlets.Unicode().tag(sync=True)

    def __init__(self, here: Callable[[], None]):
        super().__init__(_esm=_module())
        self._here = here
        self.on_msg(self._said)

    def _said(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the two words does nothing."""
        if content == {"kind": "here"}:
            self._here()
        elif isinstance(content, dict) and content.get("kind") == "settle" and type(content.get("number")) is int:
            self.send({"kind": "settled", "number": content["number"]})
