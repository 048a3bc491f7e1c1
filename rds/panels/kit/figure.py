"""A matplotlib figure to read: zoom, pan and save through ipympl, or a picture where that is not installed."""

from __future__ import annotations

import logging
from collections.abc import Callable
from html import escape
from typing import Any

import ipywidgets as widgets

from rds.core.errors import RdsError
from rds.panels.kit.ticker import Ticker
from rds.panels.session.session import Session
from rds.panels.texts import translate_picture

DPI = 94  # on the page: letters that can be read on a projector
WIDTH = 7.6  # inches: as wide as what is beside the settings on a screen of 1280, or of 1024


class FigureView(widgets.VBox):
    """Empty until `show(figure)`; the figure before is closed."""

    children: Any  # ipywidgets has no types

    def __init__(self, width: float = WIDTH) -> None:
        """`width` in inches of DPI pixels: wider figures are made narrower."""
        super().__init__([])
        self.add_class("rds-figure")
        self._width = width
        self.figure: Any = None
        self._waiting: Any = None
        self._shown: list[widgets.Widget] = []  # closed when something else is: a kernel keeps every open widget

    def show(self, figure: Any, session: Session, caption: str = "") -> None:
        """Show a matplotlib figure that belongs to no pyplot; `caption` is read out in its place.

        Its texts are in the language of the session's page.
        """
        self.clear()
        translate_picture(figure, session.language)
        figure.set_dpi(DPI)
        if figure.get_figwidth() > self._width:
            figure.set_figwidth(self._width)
        self.figure = figure
        words = [widgets.HTML(f"<p>{caption}</p>")] if caption else []
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
        self._put(widgets.HTML('<p role="status">drawing …</p>'))
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
                self._put(widgets.HTML(f'<p role="alert">✖ no plot: {escape(str(task.error))}</p>'))
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
        self.children = []
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
        self.children = [box]


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
