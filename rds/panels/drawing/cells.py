"""A grid of cells that are filled with the mouse or the keyboard; the outline that is cut lies over it."""

from __future__ import annotations

from typing import Any

import anywidget
import traitlets

from rds.panels.kit.static_files import static


class Cells(anywidget.AnyWidget):
    """`text`: rows of # (filled) and . (empty), the first on top. `rings`: outlines as (column, row), in cells."""

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    text = traitlets.Unicode(".").tag(sync=True)
    rings: Any = traitlets.List([]).tag(sync=True)

    def __init__(self, text: str):
        super().__init__(_esm=static(__file__, "cells.js"), _css=static(__file__, "cells.css"), text=text)

    def outline(self, rings: list[list[list[float]]]) -> None:
        """Show these, which are of the cells as they are."""
        self.rings = rings
        self.send({"kind": "outlined"})
