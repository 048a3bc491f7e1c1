"""Line charts as SVG, without a plotting library: a batch draws thousands of them.

A chart stands by itself, as an image: nothing in it can act on the page that shows it, and the same text serves pages
and gradebooks. Curves keep the lowest and the highest sample of every pixel, so that no peak is lost.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import ceil, floor, isfinite, log10

import numpy as np

WIDTH = 860  # px
_LEFT, _RIGHT, _TOP, _BOTTOM, _LEGEND = 66, 12, 6, 20, 20  # px around each panel
_HEIGHT = 150  # px of a panel of curves over time
_SQUARE = 420  # px of a panel of a path
_COLUMNS = 360  # of which a curve keeps lowest and highest
_MOST_POINTS = 1500  # of a path
_FAR = 4.0  # times the range of what is expected: a curve that goes further is cut
_MOST = 1e12  # of any number that is drawn: beyond it doubles have no small differences
VOLTAGES = {"command": "command voltage", "voltage": "voltage"}
"""What is drawn of a controller, by its column: the command if there is one, which can be beyond the limit."""
_GRID, _TEXT = "#E2E2E2", "#3A3A3A"


@dataclass(frozen=True)
class Curve:
    """A line of x and y; `expected` says that the panel must show all of it."""

    label: str
    x: np.ndarray
    y: np.ndarray
    colour: str
    width: float = 1.3  # px
    dashes: str = ""  # px on, px off
    expected: bool = False


@dataclass(frozen=True)
class Panel:
    """Curves with one pair of axes; `levels` are lines across (y, label). A path has the same scale on both axes.

    Curves are cut beyond `most` to either side of zero; without it, far from those that are expected.
    """

    curves: Sequence[Curve]
    y: str
    x: str = "time [s]"
    levels: Sequence[tuple[float, str]] = ()
    is_path: bool = False
    most: float | None = None


@dataclass(frozen=True)
class Chart:
    """A picture of panels below each other, as SVG; `is_cut` says that a curve goes beyond it."""

    svg: str
    is_cut: bool = False

    @property
    def url(self) -> str:
        """As the source of an image."""
        return f"data:image/svg+xml;base64,{b64encode(self.svg.encode()).decode('ascii')}"


def chart(panels: Sequence[Panel]) -> Chart:
    """The panels below each other, with the legend of all of them above."""
    parts, top, is_cut = [_legend(panels)], _LEGEND, False
    for panel in panels:
        height = _SQUARE if panel.is_path else _HEIGHT
        drawn, cut = _panel(panel, top, height)
        parts.append(drawn)
        is_cut |= cut
        top += height + _TOP + _BOTTOM + 16
    return Chart(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top}" width="{WIDTH}" height="{top}" '
        f'font-family="system-ui,sans-serif" font-size="11" fill="{_TEXT}">'
        f'<rect width="100%" height="100%" fill="#ffffff"/>{"".join(parts)}</svg>',
        is_cut,
    )


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Round numbers from `low` to `high`, 1, 2 or 5 times a power of ten apart."""
    if not high > low:
        return [low]
    rough = (high - low) / most
    power = 10.0 ** floor(log10(rough))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))
    return [k * step for k in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]


def _legend(panels: Sequence[Panel]) -> str:
    curves = {curve.label: curve for panel in panels for curve in panel.curves if curve.label}
    parts, x = [], float(_LEFT)
    for label, curve in curves.items():
        parts.append(
            f'<line x1="{x:g}" x2="{x + 22:g}" y1="10" y2="10" stroke="{curve.colour}" '
            f'stroke-width="{max(curve.width, 2):g}"{_dashes(curve, 1)}/>'
            f'<text x="{x + 27:g}" y="14">{escape(label)}</text>'
        )
        x += 50 + 6.2 * len(label)
    return "".join(parts)


def _panel(panel: Panel, top: int, height: int) -> tuple[str, bool]:
    width = WIDTH - _LEFT - _RIGHT
    (x0, x1), (y0, y1), is_cut = _ranges(panel)
    if panel.is_path:
        (x0, x1), (y0, y1) = _same_scale((x0, x1), (y0, y1), width / height)
    sx, sy = width / (x1 - x0), height / (y1 - y0)
    top += _TOP
    parts = [f'<text x="0" y="0" transform="translate(12 {top + height / 2:g}) rotate(-90)" '
             f'text-anchor="middle">{escape(panel.y)}</text>']  # fmt: skip
    for value in ticks(y0, y1, 5 if not panel.is_path else 8):
        at = top + (y1 - value) * sy
        parts.append(
            f'<path d="M{_LEFT} {at:.1f}h{width}" stroke="{_GRID}"/>'
            f'<text x="{_LEFT - 5}" y="{at + 4:.1f}" text-anchor="end">{_tick(value)}</text>'
        )
    for value in ticks(x0, x1, 10):
        at = _LEFT + (value - x0) * sx
        parts.append(
            f'<path d="M{at:.1f} {top}v{height}" stroke="{_GRID}"/>'
            f'<text x="{at:.1f}" y="{top + height + 13}" text-anchor="middle">{_tick(value)}</text>'
        )
    parts.append(
        f'<text x="{_LEFT + width / 2:g}" y="{top + height + 27}" text-anchor="middle">{escape(panel.x)}</text>'
        # a picture within: curves end at its edge
        f'<svg x="{_LEFT}" y="{top}" width="{width}" height="{height}" viewBox="0 0 {10 * width} {10 * height}">'
    )
    for curve in panel.curves:
        points = _points(curve, panel.is_path, x0, 10 * sx, y1, 10 * sy)
        if points:
            parts.append(
                f'<path d="{points}" fill="none" stroke="{curve.colour}" stroke-width="{10 * curve.width:g}" '
                f'stroke-linejoin="round"{_dashes(curve, 10)}/>'
            )
    for level, label in panel.levels:
        at = 10 * (y1 - level) * sy
        if 0 <= at <= 10 * height:
            parts.append(
                f'<path d="M0 {at:.0f}h{10 * width}" stroke="{_TEXT}" stroke-width="8" stroke-dasharray="20 40"/>'
            )
            # beyond the line where there is room, with a rim of white: curves pass behind it
            is_above = at > 150 and (level >= 0.0 or at > 10 * height - 150)
            parts.append(
                f'<text x="{10 * width - 20}" y="{at - 30 if is_above else at + 110:.0f}" text-anchor="end" '
                'font-size="100" stroke="#ffffff" stroke-width="40" stroke-linejoin="round" paint-order="stroke">'
                f"{escape(label)}</text>"
            )
    return "".join(parts) + "</svg>", is_cut


def _ranges(panel: Panel) -> tuple[tuple[float, float], tuple[float, float], bool]:
    """Of x and of y; and whether a curve leaves them."""
    expected = [curve for curve in panel.curves if curve.expected] or list(panel.curves)
    x, y, is_cut = _extent([c.x for c in expected]), _extent([c.y for c in expected]), False
    ranges = []
    for (low, high), values in ((x, [c.x for c in panel.curves]), (y, [c.y for c in panel.curves])):
        lowest, highest = _extent(values)
        if panel.most is None:
            room = _FAR * max(high - low, abs(low), abs(high), 1e-9)  # what hardly changes has a size too
            low, high = low - room, high + room
        else:
            low, high = -panel.most, panel.most
        if values[0] is not panel.curves[0].x or panel.is_path:
            is_cut |= lowest < low or highest > high
        ranges.append(_with_margin(max(lowest, low), min(highest, high)))
    if not panel.is_path:  # time has no margin
        low, high = _extent([c.x for c in panel.curves])
        ranges[0] = (low, high if high > low else low + 1.0)
    return ranges[0], ranges[1], is_cut


def _extent(values: Sequence[np.ndarray]) -> tuple[float, float]:
    finite = [each[np.isfinite(each)] for each in values]
    finite = [each for each in finite if len(each)]
    if not finite:
        return 0.0, 1.0
    low, high = min(float(each.min()) for each in finite), max(float(each.max()) for each in finite)
    return min(max(low, -_MOST), _MOST), min(max(high, -_MOST), _MOST)


def _with_margin(low: float, high: float) -> tuple[float, float]:
    room = 0.06 * (high - low) or 0.5 * max(abs(high), 1e-6)
    return low - room, high + room


def _same_scale(
    x: tuple[float, float], y: tuple[float, float], shape: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """The ranges widened to `shape`, width over height."""
    width, height = x[1] - x[0], y[1] - y[0]
    more_x, more_y = max(0.0, shape * height - width) / 2, max(0.0, width / shape - height) / 2
    return (x[0] - more_x, x[1] + more_x), (y[0] - more_y, y[1] + more_y)


def _points(curve: Curve, is_path: bool, x0: float, sx: float, y1: float, sy: float) -> str:
    """The curve's line in whole tenths of a pixel, each point counted from the last; gaps where it is no number."""
    x, y = _thinned_path(curve) if is_path else _thinned(curve)
    with np.errstate(invalid="ignore", over="ignore"):
        px, py = np.clip((x - x0) * sx, -1e5, 1e5), np.clip((y1 - y) * sy, -1e5, 1e5)
    good = np.isfinite(px) & np.isfinite(py)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    pieces = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        points = np.rint(np.column_stack([px[begin:end], py[begin:end]])).astype(int)
        steps = np.diff(points, axis=0).ravel().tolist()
        pieces.append(f"M{points[0, 0]} {points[0, 1]}l{' '.join(map(str, steps)) if steps else '0 0'}")
    return "".join(pieces)


def _thinned(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    n = len(curve.y)
    if n <= 2 * _COLUMNS:
        return np.asarray(curve.x, float), np.asarray(curve.y, float)
    starts = np.linspace(0, n, _COLUMNS + 1).astype(int)[:-1]
    y = np.where(np.isfinite(curve.y), curve.y, np.nan)
    if np.isnan(y).any():  # rare, and reduceat knows no gaps
        y = np.nan_to_num(y, nan=float(np.nan_to_num(y).max()))
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    with np.errstate(over="ignore"):
        first_is_low = y[starts] - low <= high - y[starts]
    pairs = np.column_stack([np.where(first_is_low, low, high), np.where(first_is_low, high, low)])
    x = np.asarray(curve.x, float)
    middle = starts + np.diff(np.append(starts, n)) // 2
    times = np.column_stack([x[starts], x[np.minimum(middle, n - 1)]])
    return np.append(times.ravel(), x[-1]), np.append(pairs.ravel(), y[-1])


def _thinned_path(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    step = ceil(len(curve.x) / _MOST_POINTS) or 1
    return np.asarray(curve.x[::step], float), np.asarray(curve.y[::step], float)


def _dashes(curve: Curve, scale: int) -> str:
    if not curve.dashes:
        return ""
    return f' stroke-dasharray="{" ".join(f"{scale * float(part):g}" for part in curve.dashes.split())}"'


def _tick(value: float) -> str:
    return f"{value:.6g}".replace("-", "−") if isfinite(value) and abs(value) > 1e-15 else "0"
