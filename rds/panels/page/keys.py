"""A panel by the keyboard and by ear: what ipywidgets leaves to mouse and eye (static/keys.js)."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import anywidget
import traitlets


@cache
def _module() -> str:
    return (Path(__file__).parent / "static" / "keys.js").read_text(encoding="utf-8")


class Keys(anywidget.AnyWidget):
    """Invisible; one on a page."""

    _esm = traitlets.Unicode().tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=_module())
