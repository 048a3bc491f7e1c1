"""The widgets over one `Drawing`: settings on the left; cells or picture with the outline on the right."""

from __future__ import annotations

from typing import Any

import anywidget
import ipywidgets as widgets
import traitlets

from rds.panels.drawing.state import CELLS, PICTURES, Drawing
from rds.panels.kit.button import attempt, button
from rds.panels.kit.field import FieldView, check_mended
from rds.panels.kit.figure import FigureView
from rds.panels.kit.file_import import FileImport
from rds.panels.kit.layout import fields_group, row
from rds.panels.kit.notice import Notice
from rds.panels.kit.static_files import static

_OUTLINE = ["pixel", "columns", "rows", "picture", "level", "specks", "invert", "holes", "method", "tolerance", "arcs"]
_CUT = ["feed", "depth", "passes", "safe", "spindle", "x", "y"]
_OF_CELLS, _OF_PICTURES = ("columns", "rows"), ("picture", "level", "invert")


class DrawingView:
    """Everything of the drawing panel."""

    def __init__(self, shell: Any):
        self.shell = shell
        self.drawing = Drawing(shell.session)
        choices = self.drawing.choices
        self.cells = Cells(str(choices["cells"]))
        self.cells.observe(self._drawn, "text")
        self.figure = FigureView()
        self.verdict = Notice()
        self.verdict.add_class("rds-verdict")
        self.verdict.say("tracing …")
        self.notice = Notice()
        tip = "Copy a picture into your folder"
        self.upload = FileImport("Take a picture", tip, self._take, self.notice, accept=",".join(PICTURES))
        self._views = {name: FieldView(choices, name) for name in ["source", "program", *_OUTLINE, *_CUT]}
        self._place = widgets.VBox([])
        self._outline_box, cut = fields_group([]), fields_group([self._views[name] for name in _CUT])
        folded = widgets.Accordion([cut], titles=("Cut: feed, depth, place",), selected_index=None)
        folded.add_class("rds-folded")
        side = widgets.VBox([fields_group([self._views["source"]]), self._outline_box, folded])
        side.add_class("rds-side")
        tip = "Write the part program and open it in the program panel"
        top = row(self._views["program"], button("Make the program", tip, self.make, self.notice, primary=True))
        top.layout.align_items = "flex-end"
        main = widgets.VBox([top, self.notice, self.verdict, self._place])
        main.add_class("rds-main")
        self.widget = widgets.HBox([side, main])
        self.widget.add_class("rds-columns")
        choices.watch(self._chosen)
        self._arrange()
        shell.ticker.add(self._tick)

    def make(self) -> None:
        """What the button does."""
        check_mended(self._views.values())
        self.notice.clear()
        name = self.drawing.write()
        self.notice.say(f"written as {name}, and open in the program panel", "good")
        self.shell.open("program")

    def _drawn(self, change: Any) -> None:
        attempt("the drawing", lambda: self.drawing.choices.set("cells", change["new"]), self.notice)

    def _take(self, name: str, content: bytes) -> None:
        self.drawing.take_picture(name, content)
        self.notice.say(f"{name} is in your folder", "good")

    def _chosen(self, name: str) -> None:
        self.notice.clear()  # it was about what was chosen before
        if name == "cells" and self.cells.text != self.drawing.choices["cells"]:
            self.cells.text = str(self.drawing.choices["cells"])
        elif name == "source":
            self._arrange()

    def _arrange(self) -> None:
        """Show what is of use for cells, or for a picture."""
        of_cells = self.drawing.choices["source"] == CELLS
        hidden = _OF_PICTURES if of_cells else _OF_CELLS
        shown: list[widgets.Widget] = [self._views[name] for name in _OUTLINE if name not in hidden]
        self._outline_box.children = shown if of_cells else [self.upload, *shown]
        self._place.children = [self.cells if of_cells else self.figure]
        if not of_cells:
            self.drawing.refresh()

    def _tick(self) -> None:
        if not self.drawing.tick():
            return
        drawing = self.drawing
        found = drawing.latest
        if found is None or drawing.refusal:
            waits = drawing.choices["source"] != CELLS and not drawing.choices["picture"]  # nothing is wrong yet
            self.verdict.say(drawing.refusal, "note" if waits else "error")
            self.cells.outline([])
            self.figure.clear()
            return
        self.verdict.say(found.sentence, "good")
        if drawing.choices["source"] == CELLS:
            self.cells.outline(found.rings_in_cells())
        else:
            from rds.nc.paths.pictures import picture

            made, outline = found, found.outline
            self.figure.draw(
                self.shell.session, self.shell.ticker, lambda: picture(made.outline.segments, drawing=outline)
            )


class Cells(anywidget.AnyWidget):
    """A grid of cells that are filled with the mouse or the keyboard; the outline that is cut lies over it.

    `text`: rows of # (filled) and . (empty), the first on top. `rings`: outlines as (column, row), in cells.
    """

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
