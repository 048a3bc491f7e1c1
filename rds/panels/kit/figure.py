"""A matplotlib figure to read: zoom, pan and save through ipympl, or a picture where that is not installed.

It is as wide as its place on the page, and not wider than it was made for. When the place changes, it is drawn anew:
letters keep their size.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from html import escape
from typing import Any

import anywidget
import ipywidgets as widgets
import traitlets

from rds.core.errors import RdsError
from rds.panels.kit.html import Html
from rds.panels.kit.static_files import static
from rds.panels.kit.ticker import Ticker
from rds.panels.session.session import Session
from rds.panels.texts import translate_picture

DPI = 94  # on the page: letters that can be read on a projector
WIDTH = 7.6  # inches: as wide as what is beside the settings on a screen of 1280, or of 1024
NARROWEST = 3.0  # inches: below, labels leave no room for curves


class FigureView(widgets.VBox):
    """Empty until `show(figure)`; the figure before is closed."""

    children: Any  # ipywidgets has no types

    def __init__(self) -> None:
        super().__init__([])
        self.add_class("rds-figure")
        self._width = WIDTH  # inches of DPI pixels, until the page says how wide its place is
        self._made_for = WIDTH  # inches, of the figure
        self._room: _Room | None = None
        self._name = ""  # of the figure, which is read out in place of its canvas
        self.figure: Any = None
        self._waiting: Any = None
        self._drawing: Html | None = None  # what is said meanwhile
        self._shown: list[widgets.Widget] = []  # closed when something else is: a kernel keeps every open widget

    def show(self, figure: Any, session: Session, caption: str = "") -> None:
        """Show a matplotlib figure that belongs to no pyplot; `caption` is read out in its place.

        Its texts are in the language of the session's page.
        """
        self.clear()
        translate_picture(figure, session.language)
        figure.set_dpi(DPI)
        self._made_for = figure.get_figwidth()
        figure.set_figwidth(min(self._width, self._made_for))
        self.figure = figure
        self._name = _name(figure)
        words = [Html(f"<p>{caption}</p>")] if caption else []
        self._put(_canvas(figure), *words)

    def draw(
        self,
        session: Session,
        ticker: Ticker,
        make: Callable[[], Any],
        caption: str = "",
        then: Callable[[], None] = lambda: None,
    ) -> None:
        """Show the figure that `make()` gives, which is called beside the page: drawing takes seconds. None: no figure.

        `then()` is called once it is there.
        """
        self.clear()
        if self._drawing is None:
            self._drawing = Html()
            self._drawing.add_class("rds-drawing")
            self.children = self._standing()
        self._drawing.value = '<p role="status">drawing …</p>'
        task = self._waiting = session.work("a plot", lambda task: make())

        def look() -> None:
            if not task.done:
                return
            end()
            if self._waiting is not task:  # something else is wanted by now
                return
            if task.error is not None:
                if not isinstance(task.error, RdsError):
                    logging.getLogger(__name__).error("a plot could not be drawn", exc_info=task.error)
                self.clear()
                self._put(Html(f'<p role="alert">✖ no plot: {escape(str(task.error))}</p>'))
                return
            if task.result is None:
                self.clear()
            else:
                self.show(task.result, session, caption)
            then()

        end = ticker.add(look)

    def clear(self) -> None:
        """Nothing to show."""
        self._waiting = self.figure = None
        if self._drawing is not None:
            self._drawing.value = ""
        self.children = self._standing()
        for widget in self._shown:
            toolbar = getattr(widget, "toolbar", None)  # an ipympl canvas has one
            for part in (
                getattr(widget, "style", None),
                getattr(toolbar, "layout", None),
                toolbar,
                widget.layout,
                widget,
            ):
                if part is not None:
                    part.close()
        self._shown = []

    def _put(self, *shown: widgets.DOMWidget) -> None:
        # in a box of its own, because a closed canvas does not leave a page by itself
        box = widgets.VBox(shown)
        self._shown = [*shown, box]
        self._room = self._room or _Room(self._fit)
        self._room.name = self._name
        if self._drawing is not None:
            self._drawing.value = ""
        self.children = [*self._standing(), box]

    def _standing(self) -> list[widgets.DOMWidget]:
        """What stays on the page: of a widget that is shown once more, ipywidgets keeps what was there before."""
        return [each for each in (self._drawing, self._room) if each is not None]

    def _fit(self, pixels: float) -> None:
        """The place is so wide."""
        self._width = max(pixels / DPI, NARROWEST)
        width = min(self._width, self._made_for)
        if self.figure is None or round(width * DPI) == round(self.figure.get_figwidth() * DPI):
            return
        if (resize := getattr(self.figure.canvas, "handle_resize", None)) is not None:  # as a drag of its corner does
            resize({"width": round(width * DPI), "height": round(self.figure.get_figheight() * DPI)})
        else:
            self.figure.set_figwidth(width)
            self._shown[0].value = self.figure.png()


class _Room(anywidget.AnyWidget):
    """Invisible; calls `told(pixels)` with the width of its place, each time that it is another one.

    The canvas beside it is called `name`.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    name = traitlets.Unicode("").tag(sync=True)

    def __init__(self, told: Callable[[float], None]):
        super().__init__(_esm=static(__file__, "room.js"))
        self._told = told
        self.on_msg(self._said)

    def _said(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than a width does nothing."""
        width = content.get("width") if isinstance(content, dict) and content.get("kind") == "width" else None
        if isinstance(width, int | float) and not isinstance(width, bool) and math.isfinite(width):
            self._told(float(width))


def _name(figure: Any) -> str:
    """What a figure shows, by its title and those of its axes, or what they are of."""
    titles = [figure.get_suptitle(), *(axes.get_title() or axes.get_ylabel() for axes in figure.axes)]
    return ", ".join(dict.fromkeys(filter(None, titles)))


def _canvas(figure: Any) -> widgets.DOMWidget:
    try:
        from ipympl.backend_nbagg import Canvas, FigureManager
    except ImportError:
        return widgets.Image(value=figure.png(), format="png")
    canvas = Canvas(figure)
    FigureManager(canvas, 0)
    canvas.header_visible = False
    canvas.footer_visible = True
    canvas.toolbar_visible = True
    canvas.toolbar_position = "top"
    canvas.resizable = False
    canvas.draw_idle()
    return canvas
