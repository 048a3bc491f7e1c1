"""A panel by the keyboard and by ear: what ipywidgets leaves to mouse and eye (static/keys.js)."""

from __future__ import annotations

import anywidget
import traitlets

from rds.panels.kit.static_files import static


class Keys(anywidget.AnyWidget):
    """Invisible; one on a page."""

    _esm = traitlets.Unicode().tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=static(__file__, "keys.js"))
