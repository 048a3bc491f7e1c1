"""A criterion's bands as a bar: where no points, some and all points are, and where the value lies."""

from __future__ import annotations

from html import escape

from rds.grading.criteria.bands import Bands
from rds.grading.grade import with_unit

_WIDTH, _BAR, _HEIGHT = 340, 12, 40  # px
_TOP = 12  # px, of the bar: the mark stands above it
_BEYOND = 0.45  # of the width between the bounds: how much is shown outside them
_APART = 80  # px that two labels need
_LETTER = 6.2  # px

STYLE = """
.bands { width: 340px; max-width: 100%; height: auto; font: 11px system-ui, sans-serif; }
.bands text { fill: var(--dim); } .bands .value { stroke: var(--ink); fill: var(--ink); }
.bands .full { fill: #009E73; } .bands .partial { fill: #E69F00; } .bands .none { fill: #D55E00; }
.bands rect { opacity: .75; }
"""


def band_bar(bands: Bands, value: float | None, unit: str) -> str:
    """The bar as SVG for a page with `STYLE`; without a value it has no mark. Text says what the colours say."""
    low, high = min(bands.full, bands.none), max(bands.full, bands.none)
    first, last = _range(low, high)
    scale = _WIDTH / (last - first)
    left, right = (low - first) * scale, (high - first) * scale
    names = ("full", "partial", "none") if bands.more_is_worse else ("none", "partial", "full")
    zones = ((0.0, left), (left, right), (right, float(_WIDTH)))
    parts = [
        f'<rect class="{name}" x="{begin:.1f}" y="{_TOP}" width="{end - begin:.1f}" height="{_BAR}"/>'
        for name, (begin, end) in zip(names, zones, strict=True)
    ]
    if right - left < _APART:
        left, right = min(left, (left + right - _APART) / 2), max(right, (left + right + _APART) / 2)
    for bound, at in ((low, left), (high, right)):
        said = f"{'full' if bound == bands.full else 'none'} {_number(bound, unit)}"
        half = _LETTER * len(said) / 2
        at = min(max(at, half), _WIDTH - half)
        parts.append(f'<text x="{at:.1f}" y="{_HEIGHT - 4}" text-anchor="middle">{said}</text>')
    if value is not None:
        parts.append(_mark(value, first, last, scale))
    said = "no value" if value is None else f"value {_number(value, unit)}"
    return (
        f'<svg class="bands" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{said}, full points at '
        f'{_number(bands.full, unit)}, none at {_number(bands.none, unit)}">{"".join(parts)}</svg>'
    )


def _range(low: float, high: float) -> tuple[float, float]:
    beyond = _BEYOND * (high - low)
    first = low - beyond
    if low >= 0.0 > first and low > 0.0:  # what is measured from zero is shown from zero
        first = 0.0
    return first, high + beyond


def _mark(value: float, first: float, last: float, scale: float) -> str:
    """A needle at the value; an arrow at the end of the bar beyond which it lies."""
    if first <= value <= last:
        at = min(max((value - first) * scale, 5.0), _WIDTH - 5.0)
        return (
            f'<path class="value" d="M{at:.1f} {_TOP + _BAR + 2}V{_TOP - 2}l-4 -7h8z" '
            'stroke-width="2" stroke-linejoin="round"/>'
        )
    middle = _TOP + _BAR / 2
    at, step = (2.0, 9) if value < first else (_WIDTH - 2.0, -9)
    return f'<path class="value" d="M{at:g} {middle:g}l{step} -6v12z" stroke-width="1"/>'


def _number(value: float, unit: str) -> str:
    return escape(with_unit(value, unit))
