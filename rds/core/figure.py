"""What all plots share: a figure that needs no display and no pyplot, axis labels, line styles beside the colours."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any

from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from rds.core.colours import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DPI = 128
WIDTH = 10.0  # inches: 1280 pixels

__all__ = [
    "BLACK",
    "BLUE",
    "CYCLE",
    "GREEN",
    "GREY",
    "ORANGE",
    "PURPLE",
    "SKY",
    "VERMILLION",
    "Picture",
    "common_legend",
    "dress",
    "legend",
    "quantity",
]

CYCLE = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)

RESPONSES: dict[str, dict[str, Any]] = {
    "reference": {"color": GREY, "linewidth": 3.0, "alpha": 0.55},
    "measured": {"color": BLUE, "linewidth": 1.3},
    "modelled": {"color": VERMILLION, "linewidth": 1.3, "linestyle": (0, (5, 2))},
    "simulated": {"color": GREEN, "linewidth": 1.3, "linestyle": (0, (1, 1.5))},
}


class Picture(Figure):
    """A figure that shows itself in a notebook without pyplot's global state.

    What hangs on its width, such as the columns of a legend, is laid out anew when it is made wider or narrower.
    """

    def __init__(self, height: float, width: float = WIDTH):
        self._layouts: list[Callable[[float], None]] = []
        super().__init__(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")

    def lay_out(self, by_width: Callable[[float], None]) -> None:
        """Call `by_width(inches)` now, and again with each other width."""
        self._layouts.append(by_width)
        by_width(self.get_figwidth())

    def set_size_inches(self, w: Any, h: Any = None, forward: bool = True) -> None:
        """As ever; then what hangs on the width."""
        super().set_size_inches(w, h, forward=forward)
        for by_width in self._layouts:
            by_width(self.get_figwidth())

    def draw(self, renderer: Any) -> None:
        """Names are the user's: a $ in them is a $, and not the beginning of a formula, which may be a wrong one."""
        for text in self.findobj(Text):
            if "$" in text.get_text() and "\\mathdefault" not in text.get_text():  # which numbers at ticks hold
                text.set_parse_math(False)
        with _ticks_kept(self.axes):
            super().draw(renderer)

    def png(self) -> bytes:
        """The picture as PNG, 128 pixels per inch."""
        stream, canvas = BytesIO(), self.canvas
        if type(canvas) is not FigureCanvasBase or self.dpi != DPI:  # it is on a screen, which savefig puts aside
            self.savefig(stream, format="png", metadata={"Software": None})
            return stream.getvalue()
        try:  # savefig would draw all of it twice, the first time for the layout, which a drawing begins with anyway
            FigureCanvasAgg(self).print_png(stream, metadata={"Software": None})
        finally:
            self.set_canvas(canvas)
        return stream.getvalue()

    def _repr_png_(self) -> bytes:
        return self.png()


@contextmanager
def _ticks_kept(every: Sequence[Any]) -> Iterator[None]:
    """Matplotlib places the ticks of an axis, and measures their labels, some ten times in one drawing: for the title,
    the label and the layout, each twice. Here once for each place and view of its axes: a picture takes 0.7 times as
    long.
    """
    kept = [axis for axes in every if axes.name == "rectilinear" for axis in (axes.xaxis, axes.yaxis)]
    kept = [axis for axis in kept if hasattr(axis, "_update_ticks") and hasattr(axis, "_get_ticklabel_bboxes")]
    for axis in kept:
        axis._update_ticks, axis._get_ticklabel_bboxes = _kept_of(axis)
    try:
        yield
    finally:
        for axis in kept:  # of a drawing within this one, as a widget's for its background, it is taken off already
            for name in ("_update_ticks", "_get_ticklabel_bboxes"):
                vars(axis).pop(name, None)


def _kept_of(axis: Any) -> tuple[Callable[[], Any], Callable[[Any, Any], Any]]:
    place_ticks, measure = axis._update_ticks, axis._get_ticklabel_bboxes
    at: Any = None
    ticks: Any = None
    measured: Any = None
    sizes: Any = None

    def placed() -> Any:
        nonlocal at, ticks, measured
        now = (*axis.axes.bbox.bounds, *axis.get_view_interval())
        if ticks is None or now != at:
            at, ticks, measured = now, place_ticks(), None
        return ticks

    def boxes(of: Any, renderer: Any) -> Any:
        nonlocal measured, sizes
        if of is not ticks:
            return measure(of, renderer)
        if measured is not renderer:
            measured, sizes = renderer, measure(of, renderer)
        return sizes

    return placed, boxes


def dress(axes: Axes, y: str, x: str | None = "time [s]") -> None:
    """Labels with units, a quiet grid, no box."""
    axes.set_ylabel(y)
    if x is not None:
        axes.set_xlabel(x)
    axes.grid(True, color="#E2E2E2", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.01)


def legend(axes: Axes, columns: int = 4) -> None:
    """The legend above the axes, where it covers no line; at most `columns` entries side by side, as there is room."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    place = axes.get_subplotspec()
    across = place.get_gridspec().ncols if place is not None else 1

    def lay_out(width: float) -> None:
        most = min(columns, beside(labels, width / across))
        drawn = axes.legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=most,
            frameon=False,
            fontsize="small",
            handlelength=1.6,
            handletextpad=0.5,
            columnspacing=0.9,
            labelspacing=0.2,  # as close as the lines of the blank title, which keeps the height free
            borderaxespad=0.2,
        )
        # a legend wider than its axes would make the layout shrink them; a blank title keeps just the height free
        drawn.set_in_layout(False)
        axes.set_title("\n".join([" "] * -(-len(handles) // most)), fontsize="small", pad=9)

    _by_width(axes.figure, lay_out)


def common_legend(picture: Picture, handles: Sequence[Any], texts: Sequence[str], loc: Any) -> None:
    """One legend for all axes, at `loc` outside them: as many entries side by side as there is room for."""

    def lay_out(width: float) -> None:
        for earlier in list(picture.legends):
            earlier.remove()
        columns = beside(texts, width)
        picture.legend(handles, texts, loc=loc, ncols=columns, frameon=False, fontsize="small")

    picture.lay_out(lay_out)


def beside(texts: Sequence[str], width: float) -> int:
    """How many entries of a legend have room beside each other in `width` inches."""
    return max(1, min(len(texts), int(width / (0.45 + 0.075 * max(map(len, texts), default=0)))))


def _by_width(figure: Any, lay_out: Callable[[float], None]) -> None:
    if isinstance(figure, Picture):
        figure.lay_out(lay_out)
    else:  # of somebody's own
        lay_out(figure.get_figwidth())


def quantity(axis: str, unit: str) -> str:
    """The label of an axis's response: what it measures, with the unit."""
    what = {"rev/min": "speed", "°": "angle", "deg": "angle"}.get(unit, "position")
    return f"{axis} {what} [{unit}]" if unit else f"{axis} {what}"
